"""Trials like real rigs: several effects at once, under every kind of test, beside a remainder that no term has.

A single mass, or two or three of them, lacks none to four effects. What is known of a rig is how far its response is
explained, so each effect is sized by the error that is left without it when everything else is fitted again; so is the
remainder, a smooth force of displacement and velocity that the library lacks, or has but is not asked for.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from study.equations.free_run import prepare
from study.equations.linear_part import connections, modes_of
from study.equations.model import Model, ModelTerm, free
from study.equations.place import Place
from study.equations.simulate import Integrator, simulate
from study.equations.term import Term
from study.equations.terms import LIBRARY, custom, external, get
from study.identify.frequency_domain.inputs import relative_record
from study.records.excitation import Excitation, displacement_noise, force
from study.records.record import ALONE, MOTIONS, Record, Sensor
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import length_or_one
from study.trials import effects
from study.trials.effects import HIDDEN, LATER, Asked, Rig, Shares, Sizing, evenly_in_log
from study.trials.kinds import TESTS, TIMED, Bench, decay, response_to
from study.trials.structures import SHAKER, random_structure


@dataclass(frozen=True)
class RigRanges:
    """What trials like real rigs are drawn from."""

    counts: tuple[float, ...] = (0.12, 0.2, 0.33, 0.25, 0.1)  # chances of no, one, ... four effects
    flexible: float = 0.25  # chance that one of them has a memory, a clock or a shape of its own
    error: tuple[float, float] = (0.05, 0.20)  # that an effect leaves when it is left out, over the rms response
    kept: tuple[float, float] = (0.04, 0.25)  # ... in the end, when the others have been sized as well
    unknown: float = 1.0 / 3.0  # chance of a remainder
    remainder: tuple[float, float] = (0.01, 0.03)  # error that it leaves
    samples: int = 6000  # of a record under a force
    rates: tuple[float, float] = (14.0, 40.0)  # of these in a period
    dampings: tuple[float, float] = (0.004, 0.05)  # share of the critical damping


RANGES = RigRanges()
RIG_NOISES = tuple(rms**2 for rms in (0.003, 0.005, 0.01, 0.02, 0.03))  # mean squares
REMAINDER = "remainder"
# Effects that differ little along any one motion: at most one of each is drawn.
ALIKE = (
    ("signed_quadratic_stiffness", "cubic_stiffness", "quintic_stiffness", "pendulum_stiffness"),
    ("quadratic_damping", "cubic_damping"),
    ("van_der_pol_damping", "displacement_damping"),
    ("coulomb_friction", "load_dependent_friction", "hysteresis"),
    ("directional_damping", "directional_quadratic_damping"),
    ("quadratic_stiffness", "bilinear_stiffness", "constant_force"),
    ("dead_band", "one_sided_contact"),
)
REMAINDERS = (  # of a remainder; a and b are one over a typical displacement and velocity
    "tanh({a}*u)*tanh({b}*v)**2", "sin({a}*u + {b}*v)", "tanh({b}*v)*cos({a}*u)", "stribeck_friction", "cogging",
)  # fmt: skip


@dataclass(frozen=True)
class Setup:
    """A system, and the test that it is put to."""

    base: Model
    along: Callable[[Place], Record]  # motion of the base at a place
    respond: Callable[[Model], Record]  # what is measured of a model, without noise
    sensors: tuple[Sensor, ...]  # what noise is added to
    initial: tuple[float, ...]  # displacements and velocities at the first sample
    held: tuple[str, ...] = ()  # keys that no test of this kind tells: the mass of what moves freely
    # A force, and the motion of a model under another; none where a test makes sure itself that its motion is calm.
    pushed: tuple[Floats, Callable[[Model, Floats], Floats]] | None = None


def rig_of_real_kind(rng: np.random.Generator, asked: Asked, make: Callable[..., Setup]) -> Rig:
    """A rig of a kind of test, its remainder in it if it has one."""
    setup = make(rng, asked)

    def effect(term: Term) -> tuple[ModelTerm, float]:
        entry = _placed(rng, term, setup.base)
        unit, _ = effects.drawn_effect(rng, entry, setup.along(entry.place))
        return unit, float(rng.uniform(*RANGES.error))

    def strength(unit: ModelTerm, model: Model) -> tuple[float, float]:
        """Rms that a unit of an effect adds to the response beside all else, and that of the response.

        Where so much of the effect stops the motion or lets it escape, that is far more than any is to add.
        """
        amount = next((t.coefficients for t in model.terms if t.name == unit.name), None)
        grown = model if amount else model.with_term(replace(unit, coefficients=(0.0,) * len(unit.coefficients)))
        try:
            return added_response(setup, grown, setup.respond(grown), unit), 1.0
        except StudyError:
            if not amount:
                raise
            return 10.0 / float(np.linalg.norm([c or 0.0 for c in amount])), 1.0

    def recorded(truth: Model, _: Shares) -> tuple[Record, Shares]:
        record = setup.respond(truth)
        if setup.pushed is not None:
            drive, moved = setup.pushed
            calm = effects.forgets(lambda force: moved(truth, force), drive, slight=True)
            expect(calm, "the motion is chaotic")
        units = [next(t for t in truth.terms if t.term.name == name) for name in asked.hidden]
        shares = tuple(added_response(setup, truth, record, unit) for unit in units)
        low, high = RANGES.kept
        expect(all(low <= share <= high for share in shares), "an effect has changed what another leaves")
        # A mass that nothing brings back may end in another trough of a cogging force, however true its model is.
        measured = record.columns(setup.sensors)
        shown = (measured - np.mean(measured, axis=0)) / np.std(measured, axis=0)
        apart = linearised(setup, truth, record)[2] - shown.ravel()
        expect(float(np.std(apart)) < 0.3 * np.sqrt(asked.noise), "the true model does not follow what was measured")
        noisy = {
            str(s): record[str(s)] + displacement_noise(record[str(s)], asked.noise, asked.seed + i)
            for i, s in enumerate(setup.sensors)
        }
        record = record.with_channels(noisy)
        if any(get(name).angle for name in asked.hidden):
            record = replace(record, units={**record.units, "displacement": "rad", "force": "N m"})
        return record, shares

    rig = Rig(setup.base, effect, lambda model: model, strength, recorded, Sizing(7, close=0.1, secant=True), {})
    if not asked.hidden or rng.random() >= RANGES.unknown:
        return rig
    unit, size = _remainder(rng, setup, asked.hidden), float(rng.uniform(*RANGES.remainder))
    base, _ = effects.grown(setup.base, unit, size, rig)
    about = {"remainder": unit.term.formula if unit.term.name == REMAINDER else unit.term.name, "remainder_error": size}
    return replace(rig, base=base, unknown=(unit.name,), about=about)


def added_response(setup: Setup, model: Model, record: Record, unit: ModelTerm) -> float:
    """Rms over that of the response of what an effect adds beside all that everything else could change.

    ``model`` has the effect, ``record`` is its response without noise; ``unit`` gives the amounts of its coefficients.
    """
    columns, keys, response = linearised(setup, model, record)
    own = [keys.index(key) for key in unit.symbols]
    shape = [i for i, key in enumerate(keys) if key.startswith(f"{unit.name}.")]
    others = np.delete(columns, [*own, *shape], axis=1)
    added = columns[:, own] @ np.array([c or 0.0 for c in unit.coefficients])
    return float(np.linalg.norm(unexplained_by(added, others)) / np.linalg.norm(response))


def linearised(setup: Setup, model: Model, record: Record) -> tuple[Floats, tuple[str, ...], Floats]:
    """Derivatives of the response by all keys, then by the initial motion; the keys; the response, shape (n s,).

    In shares of the sensors' sizes.
    """
    keys, states = tuple(key for key in model.values if key not in setup.held), len(setup.initial)
    run = prepare(model, record, keys, sensors=setup.sensors, steps_per_sample=8)
    initial, values = (*setup.initial, *[0.0] * len(model.states)), model.numbers()
    response, jacobian = run.respond({key: values[key] for key in keys}, initial, states)
    size = np.std(response, axis=0)
    lively = np.all(size > 0.0) and float(np.max(np.abs(jacobian) / size[:, None])) < 1e100
    expect(bool(lively), "the motion stands still, or multiplies every disturbance")
    shown = (response - np.mean(response, axis=0)) / size
    return (jacobian / size[:, None]).reshape(-1, jacobian.shape[2]), keys, shown.ravel()


def unexplained_by(columns: Floats, others: Floats) -> Floats:
    """Columns, shape (n, ...), less what others, shape (n, m), could make of them."""
    scaled = others / length_or_one(others)
    left, size, _ = np.linalg.svd(scaled, full_matrices=False)
    basis = left[:, size > 1e-10 * np.max(size, initial=0.0)]
    return columns - basis @ (basis.T @ columns)


def _placed(rng: np.random.Generator, term: Term, base: Model) -> ModelTerm:
    places = [Place("at", (c,)) for c in base.coordinates] if external(term) else connections(base)
    return free(term, places[int(rng.integers(len(places)))])


def _remainder(rng: np.random.Generator, setup: Setup, hidden: Sequence[str]) -> ModelTerm:
    """A force that no candidate is, of unit size, drawn at a place."""
    shape = str(rng.choice([s for s in REMAINDERS if s not in hidden]))
    if shape in LIBRARY:
        entry = _placed(rng, get(shape), setup.base)
        return effects.drawn_effect(rng, entry, setup.along(entry.place))[0]
    place = connections(setup.base)[int(rng.integers(len(connections(setup.base))))]
    motion = setup.along(place)
    a, b = (
        float(f"{1.0 / (float(rng.uniform(0.5, 1.5)) * float(np.std(motion[x]))):.4g}")
        for x in ("displacement", "velocity")
    )
    return replace(free(custom(REMAINDER, shape.format(a=f"{a:.4g}", b=f"{b:.4g}")), place), coefficients=(1.0,))


def _benched(rng: np.random.Generator, asked: Asked, make: Callable[..., Bench]) -> Setup:
    """A test of a single mass, or of a component; where an angle is asked for, the decay of a pendulum."""
    swings = any(get(name).angle for name in asked.hidden)
    bench = make(rng, (0.0, 0.7)) if swings else make(rng)
    initial = (float(bench.quiet["displacement"][0]), float(bench.quiet["velocity"][0]))
    moving = any(e.term.name == "inertia" for e in bench.base.terms)
    return Setup(
        bench.base, lambda _: bench.quiet, bench.respond, (Sensor(ALONE, bench.measured),), initial if moving else (),
        () if np.any(bench.quiet["force"]) else ("m",),
    )  # fmt: skip


def _driven(rng: np.random.Generator, asked: Asked, kind: str) -> Setup:
    """A force of a kind on a mass and spring."""
    frequency, mass = evenly_in_log(rng, 0.3, 30.0), float(np.exp(rng.uniform(-2.0, 4.0)))
    base = effects.linear_oscillator(mass, frequency, evenly_in_log(rng, *RANGES.dampings))
    dt = 1.0 / (frequency * float(rng.uniform(*RANGES.rates)))
    drive = _force(rng, kind, (0.3 * frequency, 2.5 * frequency), dt, asked.seed)
    quiet = response_to(base, drive, dt)

    def respond(model: Model, drive: Floats = drive) -> Record:
        return response_to(model, drive, dt, motions=[asked.response])

    def moved(model: Model, drive: Floats) -> Floats:
        return respond(model, drive)[asked.response]

    sensors = (Sensor(ALONE, asked.response),)
    return Setup(base, lambda _: quiet, respond, sensors, (0.0, 0.0), pushed=(drive, moved))


def _structure(rng: np.random.Generator, asked: Asked) -> Setup:
    """Two or three masses between springs, under a shaker on one of them."""
    base = random_structure(rng, int(rng.integers(2, 4)))
    frequency = modes_of(base).frequency
    dt = 1.0 / (frequency[-1] * float(rng.uniform(8.0, 14.0)))
    expect(frequency[0] * RANGES.samples * dt >= 60.0, "the slowest mode is too slow")
    kind = str(rng.choice(["noise", "multisine", "sweep"]))
    drive = _force(rng, kind, (0.4 * frequency[0], 1.3 * frequency[-1]), dt, asked.seed)
    sensors = tuple(Sensor(c, asked.response) for c in base.coordinates)
    every = tuple(Sensor(c, m) for m in MOTIONS for c in base.coordinates)

    def simulated(model: Model, drive: Floats, seen: Sequence[Sensor]) -> Record:
        return simulate(model, {SHAKER: drive}, dt, Integrator("rk4", 8), sensors=seen)

    def moved(model: Model, drive: Floats) -> Floats:
        return simulated(model, drive, sensors).columns(sensors)

    quiet = simulated(base, drive, every)
    motion = np.stack([quiet.motion(c) for c in base.coordinates], axis=2)
    return Setup(
        base, lambda place: relative_record(place, base, motion, dt), lambda model: simulated(model, drive, sensors),
        sensors, (0.0,) * (2 * len(base.coordinates)), pushed=(drive, moved),
    )  # fmt: skip


def _force(rng: np.random.Generator, kind: str, band: tuple[float, float], dt: float, seed: int) -> Floats:
    """A force of a kind in a band of frequencies in hertz, shape (n,)."""
    (low, high), samples = band, RANGES.samples
    level, repeated = float(10.0 ** rng.uniform(-2.0, 6.0)), int(rng.choice([1, 2, 4]))
    match kind:
        case "noise":
            excitation = Excitation(level=level, reading="filtered", cutoff=high)
        case "multisine":
            excitation = Excitation(
                "random_phase_multisine", level, start_frequency=low, stop_frequency=high, periods=repeated
            )
        case "sweep":
            excitation = Excitation("swept_sine", level, start_frequency=low, stop_frequency=high, periods=2)
        case _:  # steps in any order, so that what is fitted and what is judged are driven alike
            steps = np.repeat(rng.permutation(np.linspace(low, high, 12)), samples // 12)
            return np.sqrt(2.0 * level) * np.sin(2.0 * np.pi * np.cumsum(steps) * dt)
    return force(excitation, samples, dt, seed)


def _drawn(simple: Sequence[str], flexible: Sequence[str], rng: np.random.Generator) -> Iterable[str]:
    """None to four effects, one of them flexible at most, and no two of those that differ little.

    A steady force comes beside what knows the place alone: else it is an offset of the sensor, but for a mass without a
    spring, whose tests know no other.
    """
    count = int(rng.choice(len(RANGES.counts), p=RANGES.counts))
    chosen = [str(rng.choice(flexible))] if flexible and rng.random() < RANGES.flexible else []
    free_to_move = all(get(name).placeless for name in simple)
    for name in map(str, rng.permutation(simple)):
        tied = any({name, other} <= set(alike) for other in chosen for alike in ALIKE)
        placed = free_to_move or any(not get(other).placeless for other in chosen[:count])
        if not tied and (placed or not get(name).steady):
            chosen.append(name)
    return chosen[:count]


def _without(names: Sequence[str], *others: str) -> tuple[str, ...]:
    return tuple(name for name in names if name not in others)


_EVERY = (*HIDDEN, *LATER)
_FLEXIBLE = tuple(n for n in _EVERY if get(n).parameters)
_SIMPLE = tuple(n for n in _EVERY if n not in _FLEXIBLE and not get(n).angle)
_LASTING = _without(_FLEXIBLE, *TIMED, "relaxation")  # no clock is in step with a test
_MOVING = (  # of a mass that nothing brings back
    "coulomb_friction", "constant_force", "quadratic_damping", "cubic_damping", "directional_damping",
    "directional_quadratic_damping",
)  # fmt: skip
_SWINGING = _without(_SIMPLE, "load_dependent_friction")  # at one frequency that is linear damping
_PRESCRIBED = tuple(n for n in _SIMPLE if not get(n).steady)  # a steady force is an offset of the load cell


@dataclass(frozen=True)
class RigKind:
    """A kind of test, and what may be hidden in it."""

    make: Callable[[np.random.Generator, Asked], Setup]
    simple: tuple[str, ...] = _SIMPLE
    flexible: tuple[str, ...] = _FLEXIBLE
    motions: tuple[str, ...] = ("displacement",)

    @property
    def possible(self) -> tuple[str, ...]:
        return (*self.simple, *self.flexible)

    def drawn(self, rng: np.random.Generator) -> Iterable[str]:
        """Names of effects to hide."""
        return _drawn(self.simple, self.flexible, rng)

    def rig(self, rng: np.random.Generator, asked: Asked) -> Rig:
        """The next one that is drawn."""
        return rig_of_real_kind(rng, asked, self.make)


_MOSTLY = ("displacement", "displacement", "acceleration")  # one of which is measured
RIG_KINDS: Mapping[str, RigKind] = MappingProxyType(
    {
        **{f"rig_{kind}": RigKind(partial(_driven, kind=kind), motions=_MOSTLY)
           for kind in ("noise", "multisine", "sweep", "stepped")},
        "rig_blows": RigKind(partial(_benched, make=TESTS["blows"]), flexible=_LASTING),
        "rig_decay": RigKind(
            partial(_benched, make=partial(decay, periods=(12.0, 40.0))), (*_SWINGING, "pendulum_stiffness"), _LASTING
        ),
        "rig_axis": RigKind(partial(_benched, make=TESTS["axis"]), _MOVING, ("stribeck_friction", "cogging")),
        "rig_component": RigKind(partial(_benched, make=TESTS["component"]), _PRESCRIBED, _LASTING),
        "rig_structure": RigKind(_structure, motions=_MOSTLY),
    }
)  # fmt: skip
