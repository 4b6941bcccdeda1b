"""The library of terms: every physical effect the project knows, written once, in the form that ``term`` defines.

The force of a term is ``sum over its components of coefficient * factor * (d/dt)^order shape``. One
entry serves three times: forward (``simulate`` adds the force), reverse (components with the same
shape form one MI/SO input whose frequency response function is
``A(f) = sum of coefficient * factor * (j 2 pi f)^order``, the report's Figure 14), and in words. It also defines where
its shape parameters are searched, how a trial draws it and when it is physical: no other module depends on its name.

To add an effect, add one entry to ``LIBRARY`` and one row to the parametrised tests.
"""

from collections.abc import Collection, Container, Iterable, Mapping
from difflib import get_close_matches

import numpy as np

from study.equations import formulas, kernels
from study.equations.graph import Graph, Program
from study.equations.own_parameters import name_and_parameters, parameters_of
from study.equations.term import QUANTITIES as QUANTITIES
from study.equations.term import Component, PhysicalBound, Search, ShapeParameter, Term
from study.support.errors import StudyError, expect


def _single(
    name: str, symbol: str, shape: str, *,
    formula: str | None = None, order: int = 0, factor: float = 1.0, meaning: str, cause: str,
    parameters: tuple[ShapeParameter, ...] = (), state: str | None = None, conditions: tuple[PhysicalBound, ...] = (),
    reported: tuple[str, ...] = (), either_sign: bool = False, placeless: bool = False, angle: bool = False,
) -> Term:  # fmt: skip
    """An effect with one coefficient."""
    component = Component(symbol, shape, order, factor)
    return Term(
        name, (component,), formula or shape, meaning, cause, parameters, state, conditions, reported,
        either_sign=either_sign, placeless=placeless, angle=angle,
    )  # fmt: skip


def _even(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(np.linspace(low, high, count).tolist())


def _drains(symbol: str, what: str = "damping") -> tuple[PhysicalBound, ...]:
    """Damping that grows with velocity; Van der Pol's, which depends on displacement, may well feed energy in."""
    return (PhysicalBound(symbol, f"{what} takes energy out, so it is zero or more", reached=True),)


def _spring(symbol: str, owner: str) -> PhysicalBound:
    return PhysicalBound(symbol, f"the stiffness of a {owner} is positive")


AROUND = (-0.35, 0.0, 0.35)  # a line and a third of a line to either side: a fit converges from there

_TERMS = (
    _single(
        "inertia", "m", "u", formula="d2u/dt2", order=2,
        meaning="mass times acceleration", cause="the moving mass, added mass of the fluid included",
        conditions=(PhysicalBound("m", "a mass is positive", enforced=True),), placeless=True,
    ),
    _single(
        "linear_damping", "c", "u", formula="v", order=1,
        meaning="force in proportion to velocity", cause="viscous dampers, material damping, wave radiation",
        conditions=_drains("c"), placeless=True,
    ),
    _single(
        "linear_stiffness", "k", "u",
        meaning="restoring force in proportion to displacement", cause="any elastic support, hydrostatic stiffness",
        placeless=True,
    ),
    _single(
        "quadratic_stiffness", "k2", "u**2", formula="u^2",
        meaning="stiffness that differs between the two directions, growing with displacement",
        cause="static offset of a hardening spring, curved shells, gravity on an asymmetric structure",
        either_sign=True, placeless=True,
    ),
    _single(
        "signed_quadratic_stiffness", "k2s", "u*abs(u)", formula="u|u|",
        meaning="stiffness that grows with the size of the displacement, the same in both directions",
        cause="fenders and rubber mounts, Hertz-like contact", either_sign=True,
    ),
    _single(
        "cubic_stiffness", "k3", "u**3", formula="u^3",
        meaning="spring that hardens, or softens where negative", cause="stretching of a clamped beam, mooring lines",
        either_sign=True,
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
        conditions=_drains("c2"), placeless=True,
    ),
    _single(
        "cubic_damping", "cv3", "v**3", formula="v^3",
        meaning="damping that grows with the cube of velocity", cause="shock absorbers, squeeze films",
        conditions=_drains("cv3"), placeless=True,
    ),
    _single(
        "coulomb_friction", "fc", "sgn(v)", formula="sgn v",
        meaning="dry friction of constant size against the motion", cause="bearings, guides, bolted joints",
        conditions=_drains("fc", "friction"), placeless=True,
    ),
    _single(
        "dead_band", "kg", "max(min(u, u_g), -u_g)", formula="u within +-u_g, u_g sgn u beyond",
        meaning="spring force that stops growing at u_g; with coefficient -k the stiffness k is absent within the gap",
        cause="clearance in joints, a slack mooring",
        parameters=(
            ShapeParameter(
                "u_g", "length", "half width of the dead band",
                Search("quantiles of |u|", _even(0.08, 0.97, 14), blunt=True), (0.3, 1.2),
            ),
        ),
        reported=("k_dead_band",), either_sign=True,
    ),
    _single(
        "bilinear_stiffness", "kb", "max(u, 0)",
        meaning="extra stiffness on one side of zero", cause="a breathing crack, a spring that pushes but cannot pull",
        either_sign=True,
    ),
    _single(
        "one_sided_contact", "kc", "max(u - gap, 0)",
        meaning="stop that is touched beyond a gap", cause="fenders, snubbers, end stops",
        parameters=(
            ShapeParameter(
                "gap", "length", "displacement at which contact begins",
                Search("quantiles of u", _even(0.1, 0.985, 16), blunt=True), (0.3, 1.2), signed=True,
            ),
        ),
        conditions=(_spring("kc", "stop"),),
    ),
    Term(
        "periodic_stiffness",
        (Component("km_cos", "u*cos(2*pi*f_m*t)"), Component("km_sin", "u*sin(2*pi*f_m*t)")),
        "u cos(2 pi f_m t + phase)",
        "stiffness that varies with time at its own frequency, whatever the motion",
        "fishtailing at a single-point mooring, rotating asymmetric shafts, gear meshing",
        (
            ShapeParameter(
                "f_m", "frequency", "frequency of the stiffness", Search("lines of the modulation", AROUND), (0.15, 0.9)
            ),
        ),
        reported=("k_m", "phase"),
    ),
    _single(
        "relaxation", "kr", "z", formula="z, with dz/dt = v - z/tau", state="v - z/tau",
        meaning="spring and damper in series: stiff when fast, slack when slow (Maxwell element)",
        cause="viscoelastic mounts, fluid-filled bushings, soil",
        parameters=(
            ShapeParameter(
                "tau", "time", "relaxation time",
                Search("times of the motion", tuple(np.geomspace(0.05, 20.0, 12).tolist()), blunt=True), (0.3, 3.0),
            ),
        ),
        conditions=(_spring("kr", "Maxwell element"),), placeless=True,
    ),
    _single(
        "hysteresis", "kz", "z", formula="z, with dz/dt = v - beta |v| z - gamma v |z|",
        state="v - beta*abs(v)*z - gamma*v*abs(z)",
        meaning="force that depends on the path by which a displacement was reached (Bouc-Wen)",
        cause="bolted and riveted joints, wire-rope isolators, yielding metal",
        parameters=(
            ShapeParameter(
                "beta", "1/length", "rate at which the loop closes",
                Search("per amplitude", (0.15, 0.4, 1.0, 2.5, 6.0)), (0.5, 2.0), signed=True,
            ),
            ShapeParameter(
                "gamma", "1/length", "roundness of the loop",
                Search("shares of the one before", (-0.9, -0.3, 0.3, 0.9)), (-0.5, 0.5), signed=True,
            ),
        ),
        conditions=(
            _spring("kz", "Bouc-Wen element"),
            PhysicalBound("beta", "a Bouc-Wen element takes energy out, so beta is zero or more", reached=True),
            PhysicalBound(
                "beta", "the loops of joints and wire ropes seldom have |gamma| above beta", over="gamma", reached=True,
                seldom=True,
            ),
        ),
        placeless=True,
    ),
    _single(
        "constant_force", "f0", "1",
        meaning="steady force beside the measured one", cause="offset of a sensor, gravity, steady wind or current",
        either_sign=True, placeless=True,
    ),
    Term(
        "harmonic_force",
        (Component("fh_cos", "cos(2*pi*f*t)"), Component("fh_sin", "sin(2*pi*f*t)")),
        "cos(2 pi f t + phase)",
        "sinusoidal force that was not measured", "rotating imbalance, mains hum, a neighbouring machine",
        (
            ShapeParameter(
                "f", "frequency", "frequency of the force", Search("lines of the residual", AROUND), (0.3, 2.5)
            ),
        ),
        placeless=True,
    ),
    # Of measured rigs. Friction that differs by direction is Coulomb friction beside a constant force; what no other
    # term has of two directions is damping.
    _single(
        "stribeck_friction", "fs", "sgn(v)*exp(-(v/v_s)**2)", formula="exp(-(v/v_s)^2) sgn v",
        meaning="dry friction that falls as the velocity grows: its peak at rest over what stays, the Coulomb friction",
        cause="lubricated guides and bearings, rack and pinion, seals",
        parameters=(
            ShapeParameter(
                "v_s", "velocity", "Stribeck velocity, at which friction has nearly fallen",
                Search("shares of the velocity", tuple(np.geomspace(0.03, 1.5, 7).tolist())), (0.15, 0.6),
            ),
        ),
        conditions=_drains("fs", "friction that falls as the velocity grows"), placeless=True,
    ),
    _single(
        "load_dependent_friction", "fu", "abs(u)*sgn(v)", formula="|u| sgn v",
        meaning="dry friction that grows with the load of the spring beside it",
        cause="leaf springs, wedges, structural damping at any frequency (Reid's model)",
        conditions=_drains("fu", "friction"),
    ),
    _single(
        "directional_damping", "cd", "abs(v)", formula="|v|",
        meaning="damping that differs between the two directions: c + cd one way, c - cd the other",
        cause="dampers of vehicles, check valves, lifting against gravity", either_sign=True, placeless=True,
    ),
    _single(
        "directional_quadratic_damping", "cd2", "v**2", formula="v^2",
        meaning="drag with the square of velocity that differs between the two directions",
        cause="orifices and vanes of unlike edges, friction that differs by direction and grows with velocity",
        either_sign=True, placeless=True,
    ),
    _single(
        "pendulum_stiffness", "kp", "sin(u)", formula="sin u",
        meaning="moment of a weight about a pivot, the displacement being an angle; negative where it stands above",
        cause="pendulums, cranes, gravity on a disk or an arm out of balance", either_sign=True, angle=True,
    ),
    Term(
        "cogging",
        (Component("fp_cos", "cos(2*pi*u/pitch)"), Component("fp_sin", "sin(2*pi*u/pitch)")),
        "cos(2 pi u/pitch + phase)",
        "force that is periodic in position",
        "magnets of a linear motor or a torque motor, teeth of a gear, balls of a screw",
        (
            ShapeParameter(
                "pitch", "length", "distance after which the force repeats itself",
                Search("pitches of the residual", AROUND), (0.3, 1.2),
            ),
        ),
        placeless=True,
        repeats=True,
    ),
)  # fmt: skip

LIBRARY: dict[str, Term] = {term.name: term for term in _TERMS}
# What makes a linear model, each with the order of its derivative.
LINEAR = {t.name: t.components[0].order for t in _TERMS if [c.shape for c in t.components] == ["u"]}


def get(name: str) -> Term:
    """The library's term of this name."""
    if name not in LIBRARY:
        near = get_close_matches(name, LIBRARY, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else "; `study terms` lists those that are known"
        raise StudyError(f"there is no term {name!r}{hint}")
    return LIBRARY[name]


def effects_but(known: Container[str], extra: Iterable[Term] = ()) -> list[Term]:
    """The library's effects and these more, without those of known names; inertia is none that could be missing."""
    return [t for t in (*LIBRARY.values(), *extra) if t.name not in known and t.name != "inertia"]


def is_own(term: Term) -> bool:
    """Whether it is one that the user brings, and no effect of the library or change of one."""
    return term.name not in LIBRARY and term.variation is None


def find_terms(word: str) -> tuple[Term, ...]:
    """The library's terms that a word finds: in the name, or where no name has it, in formula, meaning or cause."""
    sought = word.strip().lower().replace(" ", "_")
    named = tuple(t for t in LIBRARY.values() if sought in t.name)
    plain = sought.replace("_", " ")
    found = named or tuple(t for t in LIBRARY.values() if plain in f"{t.formula} {t.meaning} {t.cause}".lower())
    if not found:
        get(word)  # which names the nearest
    return found


def custom(heading: str, force: str) -> Term:
    """A user's own term: ``force`` is a formula of u, v, t and the names of extra measured channels.

    Its parameters, which are fitted, are named behind its name: ``friction(vs)`` with ``tanh(v/vs)``. u, v, t and
    pi are displacement, velocity, time and the number, even where a channel is called so. The term has no state: z is a
    channel like any other.
    """
    name, listed = name_and_parameters(heading)
    if name in LIBRARY:
        raise StudyError(f"the name {name!r} belongs to the library; give your own term another name")
    if not name.isidentifier() or not name.isascii():
        raise StudyError(f"{name!r} is not a name for a term; use letters, digits and underscores")
    graph = Graph()
    known = {n: graph.input(n) for n in formulas.names(force)}
    formulas.add_formula(graph, force, known)  # raises unless it is a formula
    for parameter in (p for p in listed if p in known and p not in formulas.VARIABLES):
        scales = f"{parameter!r} only scales the formula {force!r}, which the coefficient of {name} does already"
        expect(not _only_scales(graph, force, known, parameter), f"{scales}; expected the formula without it")
    parameters = parameters_of(listed, force) if listed else ()
    return _single(
        name, f"q_{name}", force, meaning=f"the user's own force {force}", cause="as the user knows",
        parameters=parameters,
    )  # fmt: skip


def _only_scales(graph: Graph, force: str, known: Mapping[str, int], parameter: str) -> bool:
    """Whether a parameter is a factor before the rest of a formula, or a divisor of it."""
    program = graph.program([formulas.add_formula(graph, force, known)])
    motions = [{"u": 0.7, "v": 0.4, "t": 0.2}, {"u": -1.3, "v": 0.6, "t": 1.1}, {"u": 0.2, "v": -1.1, "t": 2.3}]
    forces = [[_value(program, {**motion, parameter: value}) for value in (0.31, 0.62)] for motion in motions]
    ratios = [two / one for one, two in forces if one != 0.0]
    return len(ratios) > 1 and max(ratios) - min(ratios) < 1e-9 * max(map(abs, ratios))


def same_elsewhere(one: str, other: str, beside: Collection[str]) -> bool:
    """Whether two terms are one beside others, the displacement being counted from another place.

    With ``u = w + a`` a cubic spring gives ``k3 u^3 = k3 w^3 + 3 k3 a w^2 + ...``: a quadratic stiffness beside one is
    a constant force, and only a measured displacement could tell.
    """
    return "cubic_stiffness" in beside and {one, other} == {"quadratic_stiffness", "constant_force"}


def external(term: Term) -> bool:
    """Whether it is a force from outside: none of its formulas names the motion."""
    texts = [c.shape for c in term.components] + ([term.state] if term.state else [])
    return not any({"u", "v"} & set(formulas.names(text)) for text in texts)


def one_sided(term: Term) -> bool:
    """Whether its force at the opposite motion is neither the same nor the opposite: it matters which end is second."""
    values = {p.name: 0.3 for p in term.parameters}
    motions = np.array([[0.7, 0.4], [1.3, -0.6], [0.2, 1.1]])
    for component in term.components:
        graph = Graph()
        nodes = {n: graph.input(n) for n in ("u", "v", "t", "z", *values, *term.channels)}
        program = graph.program([formulas.add_formula(graph, component.shape, nodes)])
        forces = [
            _value(program, {**values, "u": s * u, "v": s * v, "z": s * u}) for u, v in motions for s in (1.0, -1.0)
        ]
        if any(abs(abs(a) - abs(b)) > 1e-9 for a, b in zip(forces[::2], forces[1::2], strict=True)):
            return True
    return False


def is_linear(term: Term) -> bool:
    """Whether its forces at two motions add up to that at their sum, at any time: no mode is needed beside it."""
    parameters = {p.name: 0.3 + 0.1 * i for i, p in enumerate(term.parameters)}
    for text in [c.shape for c in term.components] + ([term.state] if term.state else []):
        if not {"u", "v", "z", *parameters}.issuperset(formulas.names(text)):
            return False
        graph = Graph()
        program = graph.program([formulas.add_formula(graph, text, {n: graph.input(n) for n in formulas.names(text)})])
        other = (-1.9, 1.1, 0.5)
        for one in ((0.7, -0.4, 0.2), (1.3, 0.6, -0.9), (-0.2, -1.7, 0.4)):
            motions = one, other, tuple(a + b for a, b in zip(one, other, strict=True))
            parts = [_value(program, {**parameters, **dict(zip("uvz", own, strict=True))}) for own in motions]
            if abs(parts[0] + parts[1] - parts[2]) > 1e-9:
                return False
    return True


def _value(program: Program, values: dict[str, float]) -> float:
    known = program.with_inputs({name: values.get(name, 0.3) for name in program.inputs})
    return float(kernels.evaluate(known, {}, 1)[0, 0])
