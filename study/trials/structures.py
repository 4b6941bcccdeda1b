"""Trials of structures: a chain or tree of masses, one shaker, and effects hidden at its places."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from study.equations.linear_part import connections, modes_of
from study.equations.model import Model, ModelTerm, free
from study.equations.place import GROUND, Place
from study.equations.simulate import Integrator, simulate
from study.equations.term import Term
from study.equations.terms import external, get
from study.identify.frequency_domain.inputs import relative_record
from study.records.excitation import Excitation, force
from study.records.record import MOTIONS, Record, Sensor
from study.support.arrays import Floats
from study.support.errors import expect
from study.trials.effects import Asked, Rig, Shares, Sizing, beyond_linear, drawn_effect, force_along, forgets

SHAKER = "shaker"  # the force
STRUCTURE_SAMPLES = 8192
FASTEST_MODE = (8.0, 14.0)  # samples in a period of the fastest mode
SLOWEST_MODE = 120.0  # periods of the slowest mode in a record, at least


def structure_rig(rng: np.random.Generator, asked: Asked) -> Rig:
    """Masses between springs and dampers, sampled as the fastest mode asks, under a force that drives all modes."""
    base = random_structure(rng, asked.coordinates or int(rng.integers(2, 6)))
    frequency = modes_of(base).frequency
    dt = 1.0 / (frequency[-1] * float(rng.uniform(*FASTEST_MODE)))
    expect(frequency[0] * STRUCTURE_SAMPLES * dt >= SLOWEST_MODE, "the slowest mode is too slow")
    level = float(10.0 ** rng.uniform(-1.0, 4.0))
    excitation = Excitation(level=level, reading="filtered", cutoff=1.3 * frequency[-1])
    drive = force(excitation, STRUCTURE_SAMPLES, dt, asked.seed)

    def simulated(model: Model, steps: int, motions: Sequence[str], drive: Floats = drive) -> Record:
        sensors = tuple(Sensor(c, m) for m in motions for c in model.coordinates)
        return simulate(model, {SHAKER: drive}, dt, Integrator("rk4", steps), sensors=sensors)

    def motion(model: Model) -> Floats:
        """Displacement, velocity and acceleration, shape (3, samples, coordinates)."""
        record = simulated(model, 4, MOTIONS)
        return np.stack([record.motion(c) for c in model.coordinates], axis=2)

    def effect(term: Term) -> tuple[ModelTerm, float]:
        outside = external(term)
        places = [Place("at", (c,)) for c in base.coordinates] if outside else connections(base)
        place = places[int(rng.integers(len(places)))]
        if not outside and rng.integers(2):
            place = Place("between", place.ends[::-1])
        return drawn_effect(rng, free(term, place), relative_record(place, base, motion(base), dt), in_units=True)

    def recorded(truth: Model, shares: Shares) -> tuple[Record, Shares]:
        if asked.hidden:

            def moved(force: Floats) -> Floats:
                record = simulated(truth, 2, ["displacement"], force)
                return record.columns(record.sensors)

            expect(forgets(moved, drive, 10), "the motion does not forget how it began")
        quiet = simulated(truth, 16, [asked.response])
        level = np.sqrt(asked.noise)
        noisy = {str(s): x + level * float(np.std(x)) * rng.standard_normal(len(x)) for s, x in quiet.motions.items()}
        return quiet.with_channels(noisy), shares

    return Rig(
        base, effect, motion, partial(_strength, base, dt), recorded, Sizing(10, close=0.1),
        {"coordinates": len(base.coordinates)},
    )  # fmt: skip


def _strength(base: Model, dt: float, unit: ModelTerm, motion: Floats) -> tuple[float, float]:
    """Beside the structure's own force at the place, or where it has none, the larger force of inertia there."""
    place = unit.place
    e = np.array(place.direction(base.coordinates))
    along = relative_record(place, base, motion, dt)
    alone = beyond_linear(force_along(unit, along, differenced=True), [x @ e for x in motion])
    values, orders = base.numbers(), {"linear_stiffness": 0, "linear_damping": 1}
    springs = [
        values[t.symbols[0]] * (motion[orders[t.term.name]] @ np.array(t.place.direction(base.coordinates)))
        for t in base.terms
        if t.term.name in orders and t.place.path == place.path
    ]
    if springs:
        return alone, float(np.std(np.sum(springs, axis=0)))
    masses = [values[f"m[{c}]"] for c in base.coordinates]
    return alone, max(float(np.std(motion[2][:, i])) * masses[i] for i in np.flatnonzero(e))


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
    return Model("structure", tuple(terms), tuple(names), ((SHAKER, str(rng.choice(names))),))
