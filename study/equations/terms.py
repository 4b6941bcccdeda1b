"""The library of terms: every physical effect the project knows, written once.

The force of a term is ``sum over its components of coefficient * factor * (d/dt)^order shape``. One
entry serves three times: forward (``simulate`` adds the force), reverse (components with the same
shape form one MI/SO input whose frequency response function is
``A(f) = sum of coefficient * factor * (j 2 pi f)^order``, the report's Figure 14), and in words.

To add an effect, add one entry to ``LIBRARY`` and one row to the parametrised tests.
"""

from dataclasses import dataclass, field
from functools import cached_property

from study.equations import dimensions, formulas
from study.equations.graph import Graph
from study.support.errors import StudyError


@dataclass(frozen=True)
class Component:
    """One coefficient's shape.

    Attributes
    ----------
    symbol : str
        Name of the coefficient, such as ``k3``.
    shape : str
        Formula of the unit-coefficient shape g(u, v, t) or of the term's state z.
    order : int
        How often it is differentiated with respect to time: 0, 1 or (inertia alone) 2.
    factor : float
        A fixed number before it: Van der Pol's damping is c3/3 d/dt u^3.
    """

    symbol: str
    shape: str
    order: int = 0
    factor: float = 1.0


@dataclass(frozen=True)
class Parameter:
    """A shape parameter: what it is, in which unit (``length``, ``frequency``, ``time``, ``1/length``), which sign.

    ``signed`` ones may be zero or negative, all others are above zero.
    """

    name: str
    quantity: str
    meaning: str
    signed: bool = False


@dataclass(frozen=True)
class Term:
    """A physical effect.

    Attributes
    ----------
    name : str
        As models and tables name it.
    components : tuple of Component
        One for each coefficient (a periodic stiffness of any phase has two).
    formula : str
        For people: the force with a unit coefficient.
    meaning, cause : str
        The physics in a sentence, and where it commonly comes from.
    parameters : tuple of Parameter
        Shape parameters, given or estimated.
    state : str or None
        dz/dt for a term with a memory z of its own.
    """

    name: str
    components: tuple[Component, ...]
    formula: str
    meaning: str
    cause: str
    parameters: tuple[Parameter, ...] = field(default=())
    state: str | None = None

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the coefficients."""
        return tuple(c.symbol for c in self.components)

    @cached_property  # a diagnosis prepares hundreds of runs
    def channels(self) -> tuple[str, ...]:
        """Measured channels that its formulas name, in alphabetical order.

        A channel is whatever is not u, v, t or pi, a parameter, or z where the term has a state of its own: what a
        record happens to call so is never meant.
        """
        own = {*formulas.VARIABLES, *(p.name for p in self.parameters), *(("z",) if self.state else ())}
        texts = (*(c.shape for c in self.components), *((self.state,) if self.state else ()))
        return tuple(sorted({name for text in texts for name in formulas.names(text)} - own))

    def unit(self, symbol: str, force: str, length: str) -> str:
        """Unit of one coefficient for a record with these units of force and length."""
        component = next(c for c in self.components if c.symbol == symbol)
        known = {p.name: QUANTITIES[p.quantity] for p in self.parameters}
        known |= {"z": STATE_DIMENSIONS} if self.state else {}
        powers = dimensions.dimensions(component.shape, known)
        if powers is not None:
            powers = (powers[0], powers[1] - component.order)
        return dimensions.compose(force, length, powers)


QUANTITIES = {
    "length": dimensions.VARIABLES["u"],
    "time": dimensions.VARIABLES["t"],
    "frequency": (dimensions.NONE[0], dimensions.NONE[1] - 1),
    "1/length": (dimensions.NONE[0] - 1, dimensions.NONE[1]),
}
STATE_DIMENSIONS = dimensions.VARIABLES["u"]  # the states of the library are internal displacements


def _single(
    name: str, symbol: str, shape: str, *,
    formula: str | None = None, order: int = 0, factor: float = 1.0, meaning: str, cause: str,
    parameters: tuple[Parameter, ...] = (), state: str | None = None,
) -> Term:  # fmt: skip
    """An effect with one coefficient."""
    component = Component(symbol, shape, order, factor)
    return Term(name, (component,), formula or shape, meaning, cause, parameters, state)


_TERMS = (
    _single(
        "inertia", "m", "u", formula="d2u/dt2", order=2,
        meaning="mass times acceleration", cause="the moving mass, added mass of the fluid included",
    ),
    _single(
        "linear_damping", "c", "u", formula="v", order=1,
        meaning="force in proportion to velocity", cause="viscous dampers, material damping, wave radiation",
    ),
    _single(
        "linear_stiffness", "k", "u",
        meaning="restoring force in proportion to displacement", cause="any elastic support, hydrostatic stiffness",
    ),
    _single(
        "quadratic_stiffness", "k2", "u**2", formula="u^2",
        meaning="stiffness that differs between the two directions, growing with displacement",
        cause="static offset of a hardening spring, curved shells, gravity on an asymmetric structure",
    ),
    _single(
        "signed_quadratic_stiffness", "k2s", "u*abs(u)", formula="u|u|",
        meaning="stiffness that grows with the size of the displacement, the same in both directions",
        cause="fenders and rubber mounts, Hertz-like contact",
    ),
    _single(
        "cubic_stiffness", "k3", "u**3", formula="u^3",
        meaning="hardening (or, if negative, softening) spring", cause="stretching of a clamped beam, mooring lines",
    ),
    _single(
        "quintic_stiffness", "k5", "u**5", formula="u^5",
        meaning="spring that hardens steeply at large displacement",
        cause="mooring lines near taut, end stops of rubber",
    ),
    _single(
        "van_der_pol_damping", "c3", "u**3", formula="u^2 v", order=1, factor=1.0 / 3.0,
        meaning="damping that grows with the square of displacement",
        cause="flow-induced vibration, dampers that grip away from the centre",
    ),
    _single(
        "displacement_damping", "cu", "u*abs(u)", formula="|u| v", order=1, factor=0.5,
        meaning="damping that grows with the size of displacement", cause="wedging supports, progressive dampers",
    ),
    _single(
        "quadratic_damping", "c2", "v*abs(v)", formula="v|v|",
        meaning="drag with the square of velocity", cause="flow separation (Morison drag), orifices, sloshing",
    ),
    _single(
        "cubic_damping", "cv3", "v**3", formula="v^3",
        meaning="damping that grows with the cube of velocity", cause="shock absorbers, squeeze films",
    ),
    _single(
        "coulomb_friction", "fc", "sgn(v)", formula="sgn v",
        meaning="dry friction of constant size against the motion", cause="bearings, guides, bolted joints",
    ),
    _single(
        "dead_band", "kg", "max(min(u, u_g), -u_g)", formula="u within +-u_g, u_g sgn u beyond",
        meaning="spring force that stops growing at u_g; with coefficient -k the stiffness k is absent within the gap",
        cause="clearance in joints, a slack mooring",
        parameters=(Parameter("u_g", "length", "half width of the dead band"),),
    ),
    _single(
        "bilinear_stiffness", "kb", "max(u, 0)",
        meaning="extra stiffness on one side of zero", cause="a breathing crack, a spring that pushes but cannot pull",
    ),
    _single(
        "one_sided_contact", "kc", "max(u - gap, 0)",
        meaning="stop that is touched beyond a gap", cause="fenders, snubbers, end stops",
        parameters=(Parameter("gap", "length", "displacement at which contact begins", signed=True),),
    ),
    Term(
        "periodic_stiffness",
        (Component("km_cos", "u*cos(2*pi*f_m*t)"), Component("km_sin", "u*sin(2*pi*f_m*t)")),
        "u cos(2 pi f_m t + phase)",
        "stiffness that varies with time at its own frequency, whatever the motion",
        "fishtailing at a single-point mooring, rotating asymmetric shafts, gear meshing",
        (Parameter("f_m", "frequency", "frequency of the stiffness"),),
    ),
    _single(
        "relaxation", "kr", "z", formula="z, with dz/dt = v - z/tau", state="v - z/tau",
        meaning="spring and damper in series: stiff when fast, slack when slow (Maxwell element)",
        cause="viscoelastic mounts, fluid-filled bushings, soil",
        parameters=(Parameter("tau", "time", "relaxation time"),),
    ),
    _single(
        "hysteresis", "kz", "z", formula="z, with dz/dt = v - beta |v| z - gamma v |z|",
        state="v - beta*abs(v)*z - gamma*v*abs(z)",
        meaning="force that depends on the path by which a displacement was reached (Bouc-Wen)",
        cause="bolted and riveted joints, wire-rope isolators, yielding metal",
        parameters=(
            Parameter("beta", "1/length", "rate at which the loop closes", signed=True),
            Parameter("gamma", "1/length", "roundness of the loop", signed=True),
        ),
    ),
    _single(
        "constant_force", "f0", "1",
        meaning="steady force beside the measured one", cause="offset of a sensor, gravity, steady wind or current",
    ),
    Term(
        "harmonic_force",
        (Component("fh_cos", "cos(2*pi*f*t)"), Component("fh_sin", "sin(2*pi*f*t)")),
        "cos(2 pi f t + phase)",
        "sinusoidal force that was not measured", "rotating imbalance, mains hum, a neighbouring machine",
        (Parameter("f", "frequency", "frequency of the force"),),
    ),
)  # fmt: skip

LIBRARY: dict[str, Term] = {term.name: term for term in _TERMS}


def get(name: str) -> Term:
    """The library's term of this name.

    Raises
    ------
    StudyError
        If there is none, naming the nearest.
    """
    if name not in LIBRARY:
        from difflib import get_close_matches

        near = get_close_matches(name, LIBRARY, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else f"; known are {', '.join(LIBRARY)}"
        raise StudyError(f"there is no term {name!r}{hint}")
    return LIBRARY[name]


def custom(name: str, force: str) -> Term:
    """A user's own term: ``force`` is a formula of u, v, t and the names of extra measured channels.

    u, v, t and pi are displacement, velocity, time and the number, even where a channel is called so. The term has no
    state: z is a channel like any other.

    Raises
    ------
    StudyError
        If the name is taken by the library or is no plain name, or the formula is refused.
    """
    if name in LIBRARY:
        raise StudyError(f"the name {name!r} belongs to the library; give your own term another name")
    if not name.isidentifier() or not name.isascii():
        raise StudyError(f"{name!r} is not a name for a term; use letters, digits and underscores")
    graph = Graph()
    formulas.build(graph, force, {n: graph.input(n) for n in formulas.names(force)})  # refuses all but a formula
    return _single(name, f"q_{name}", force, meaning=f"the user's own force {force}", cause="as the user knows")
