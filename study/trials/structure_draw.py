"""Trials of structures: a chain or tree of masses, one shaker, and an effect hidden at one of its places."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.equations.model import Model, ModelTerm, free
from study.equations.place import GROUND, Place
from study.equations.term import Term
from study.equations.terms import LIBRARY, get
from study.identify.frequency_domain.inputs import input_history
from study.records.excitation import Excitation, force
from study.records.record import MOTIONS, Record, Sensor
from study.structure.missing_forces import placed_inputs, relative_record
from study.structure.modes import modes_of
from study.structure.placed_candidates import external
from study.structure.places import connections
from study.structure.structure_simulation import simulate_structure
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError, expect
from study.support.least_squares import least_squares

LINEAR = ("inertia", "linear_damping", "linear_stiffness")
HIDDEN = tuple(name for name in LIBRARY if name not in LINEAR)
NOISES = (0.0, 0.01, 0.05)
SHARE = (0.10, 0.40)  # of the rms force that the structure itself exerts at the place
SAMPLES = 8192
FASTEST = (8.0, 14.0)  # samples in a period of the fastest mode
SLOWEST = 120.0  # periods of the slowest mode in a record, at least
ROUNDS, CLOSE, ATTEMPTS = 10, 0.1, 200
CHAOTIC = 1e-3  # share of the motion that a small push at the start may still move in the second half


@dataclass(frozen=True)
class StructureTrial:
    """A record, what its owner believes, and the truth."""

    record: Record
    believed: Model
    truth: Model
    hidden: ModelTerm | None  # None where nothing is missing
    noise: float  # mean square of the noise over that of each motion
    response: str  # which motion is measured
    share: float  # of the force at its place that the effect carries beyond any linear one

    @property
    def completed(self) -> Model:
        """What its owner believes after adding what was hidden, nothing known of the coefficients."""
        model = replace(self.truth, name=self.believed.name)
        return model.with_values(dict.fromkeys(model.values, None))


def make_structure_trial(
    seed: int, hidden: str | None = None, noise: float | None = None, response: str | None = None,
    coordinates: int | None = None,
) -> StructureTrial:  # fmt: skip
    """A trial of this seed; what is given is not drawn.

    ``hidden`` is an effect, or ``none``; ``response`` a motion, measured at every coordinate; ``coordinates`` 2 to 5.

    Raises
    ------
    StudyError
        If there is no such effect or motion.
    DivergenceError
        If no structure was found that carries the effect.
    """
    rng = np.random.default_rng([2027, seed])
    drawn = (str(rng.choice(HIDDEN)), float(rng.choice(NOISES)), str(rng.choice(["displacement", "acceleration"])))
    name = hidden or drawn[0]
    expect(
        name in (*HIDDEN, "none"),
        f"{name!r} cannot be hidden in a structure; expected none or one of {', '.join(HIDDEN)}",
    )
    expect(response is None or response in MOTIONS, f"response is {response!r}; expected one of {', '.join(MOTIONS)}")
    noise, response = drawn[1] if noise is None else noise, response or drawn[2]
    for _ in range(ATTEMPTS):
        try:
            trial = _attempt(rng, seed, name, noise, response, coordinates)
        except (DivergenceError, np.linalg.LinAlgError):
            continue
        if trial is not None:
            return trial
    raise DivergenceError(f"no structure of trial {seed} carries {name}", 0.0)


def _attempt(
    rng: np.random.Generator, seed: int, name: str, noise: float, response: str, coordinates: int | None
) -> StructureTrial | None:
    base = random_structure(rng, coordinates or int(rng.integers(2, 6)))
    frequency = modes_of(base).frequency
    dt = 1.0 / (frequency[-1] * float(rng.uniform(*FASTEST)))
    if frequency[0] * SAMPLES * dt < SLOWEST:
        return None
    level = float(10.0 ** rng.uniform(-1.0, 4.0))
    drive = {
        "shaker": force(Excitation(level=level, reading="filtered", cutoff=1.3 * frequency[-1]), SAMPLES, dt, seed)
    }
    truth, entry, share = base, None, 0.0
    if name != "none":
        grown = _hidden(rng, base, get(name), drive, dt)
        if grown is None:
            return None
        truth, entry, share = grown
        if not _forgets(truth, drive, dt):
            return None
    wanted = tuple(Sensor(c, response) for c in base.coordinates)
    quiet = simulate_structure(truth, drive, dt, sensors=wanted, steps_per_sample=16)
    noisy = {s: x + np.sqrt(noise) * float(np.std(x)) * rng.standard_normal(len(x)) for s, x in quiet.motions.items()}
    label = f"structure_{seed}"
    believed = replace(base, name=label).with_values(dict.fromkeys(base.values, None))
    record = replace(quiet.with_motions(noisy), name=label)
    return StructureTrial(record, believed, truth, entry, noise, response, share)


def random_structure(rng: np.random.Generator, count: int) -> Model:
    """A chain or tree of so many masses, the first on the ground, each other tied to an earlier one, some to both."""
    names = [f"mass{i + 1}" for i in range(count)]
    scale, rate = float(10.0 ** rng.uniform(-1.0, 2.0)), 2.0 * np.pi * float(10.0 ** rng.uniform(-0.5, 1.5))
    chain = bool(rng.integers(2))
    terms: list[ModelTerm] = []
    for i, name in enumerate(names):
        mass = scale * float(np.exp(rng.uniform(-0.5, 0.5)))
        parents = [GROUND] if i == 0 else [names[i - 1] if chain else str(rng.choice(names[:i]))]
        if i > 0 and not chain and rng.integers(3) == 0:
            parents.append(GROUND)
        terms.append(ModelTerm(get("inertia"), (mass,), (), Place("at", (name,))))
        for parent in parents:
            stiffness = scale * rate**2 * float(np.exp(rng.uniform(-0.5, 0.5)))
            damping = 2.0 * float(rng.uniform(0.01, 0.04)) * float(np.sqrt(stiffness * scale))
            place = Place("between", (parent, name))
            terms.append(ModelTerm(get("linear_stiffness"), (stiffness,), (), place))
            terms.append(ModelTerm(get("linear_damping"), (damping,), (), place))
    return Model("structure", tuple(terms), tuple(names), (("shaker", str(rng.choice(names))),))


def _hidden(
    rng: np.random.Generator, base: Model, term: Term, drive: dict[str, Floats], dt: float
) -> tuple[Model, ModelTerm, float] | None:
    """The structure with an effect at one of its places that carries the share drawn; None where that cannot be."""
    places: Sequence[Place] = [Place("at", (c,)) for c in base.coordinates] if external(term) else connections(base)
    place = places[int(rng.integers(len(places)))]
    if not external(term) and rng.integers(2):
        place = Place("between", place.ends[::-1])
    target = float(rng.uniform(*SHARE))
    record = simulate_structure(base, drive, dt, steps_per_sample=4)
    along = relative_record(place, base, _motion(record, base), dt)
    unit = _drawn(rng, term, place, along["displacement"], along["velocity"])
    amount = 0.0
    for _ in range(ROUNDS):
        alone, own = _strength(unit, base, record, dt)
        share = amount * alone / own
        if amount > 0.0 and abs(share / target - 1.0) < CLOSE:
            entry = replace(unit, coefficients=tuple(amount * (c or 0.0) for c in unit.coefficients))
            return base.with_term(entry), entry, share
        if alone == 0.0 or own == 0.0:
            return None
        wanted = target * own / alone
        amount = wanted if amount == 0.0 else float(np.sqrt(amount * wanted))
        grown = replace(unit, coefficients=tuple(amount * (c or 0.0) for c in unit.coefficients))
        record = simulate_structure(base.with_term(grown), drive, dt, steps_per_sample=4)
    return None


def _motion(record: Record, model: Model) -> Floats:
    return np.stack([[record[Sensor(c, m)] for c in model.coordinates] for m in MOTIONS]).transpose(0, 2, 1)


def _strength(unit: ModelTerm, base: Model, record: Record, dt: float) -> tuple[float, float]:
    """Rms of a unit effect beyond any linear force at its place, and of the structure's own force there."""
    motion = _motion(record, base)
    along = relative_record(unit.place, base, motion, dt)
    total = np.zeros(len(record))
    for item in placed_inputs(unit):
        values = along["displacement"] if item.shape == "u" else input_history(item, along)
        for part in item.parts:
            coefficient = next(
                c or 0.0 for c, s in zip(unit.coefficients, unit.term.symbols, strict=True) if s == part.symbol
            )
            total = total + coefficient * part.factor * (values if part.order == 0 else np.gradient(values, dt))
    e = np.array(unit.place.direction(base.coordinates))
    linear = np.column_stack([*(x @ e for x in motion)])
    rest = total - linear @ least_squares(linear, total)
    values = base.numbers()
    orders = {"linear_stiffness": 0, "linear_damping": 1}
    springs = [
        values[t.symbols[0]] * (motion[orders[t.term.name]] @ np.array(t.place.direction(base.coordinates)))
        for t in base.terms
        if t.place.path == unit.place.path and t.term.name in orders
    ]
    masses = [values[f"m[{c}]"] for c in base.coordinates]
    inertia = max(float(np.std(motion[2][:, i])) * masses[i] for i in np.flatnonzero(e))
    return float(np.sqrt(np.mean(rest**2))), float(np.std(np.sum(springs, axis=0))) if springs else inertia


def _drawn(rng: np.random.Generator, term: Term, place: Place, u: Floats, v: Floats) -> ModelTerm:
    """Shape parameters in the range where the effect shows, in the units of the motion at its place."""
    scale, rate = float(np.std(u)), float(np.std(v)) / float(np.std(u))
    units = {"length": scale, "1/length": 1.0 / scale, "time": 1.0 / rate, "frequency": rate / (2.0 * np.pi)}
    values: list[float] = []
    for parameter in term.parameters:
        share = float(rng.uniform(*parameter.drawn))
        values.append(share * values[-1] if parameter.relative else share * units[parameter.quantity])
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    sign = -1.0 if term.either_sign and angle > np.pi else 1.0
    shape = (float(np.cos(angle)), float(np.sin(angle))) if len(term.components) == 2 else (sign,)
    return replace(free(term, place), coefficients=shape, parameters=tuple(values))


def _forgets(model: Model, drive: dict[str, Floats], dt: float) -> bool:
    """Whether the motion forgets a small push at its start, as that of a chaotic structure does not."""
    pushed = {name: values + 0.1 * np.std(values) * (np.arange(len(values)) < 10) for name, values in drive.items()}
    wanted = tuple(Sensor(c, "displacement") for c in model.coordinates)
    try:
        one, other = (
            np.stack([*simulate_structure(model, f, dt, sensors=wanted, steps_per_sample=2).motions.values()])
            for f in (drive, pushed)
        )
    except StudyError:
        return False
    half = one.shape[1] // 2
    return float(np.std((one - other)[:, half:])) < CHAOTIC * float(np.std(one[:, half:]))
