"""Trials of other kinds of tests than a force on a mass and spring, all drawn from one seed.

Free decays, blows of a hammer, a moving base, a component whose motion is prescribed, an axis in closed loop: each is a
system with an effect hidden behind what its owner believes, or with none. Effects are drawn so that the record shows
them, as in :mod:`study.trials.draw`: along the motion without them they carry, beyond what a linear model can take
over, 10 to 40 % of the spring's force or, where they damp, 25 to 100 % of the viscous force; the motion forgets how it
began, and the coefficient is as many of the standard errors that noise leaves it as a test of all candidates needs
(:mod:`study.trials.visible`).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.equations.free_run import predict_response
from study.equations.model import Model, ModelTerm, free
from study.equations.term import ShapeParameter
from study.equations.terms import LIBRARY, get
from study.records.excitation import displacement_noise
from study.records.record import SI_UNITS, Record
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares
from study.trials.draw import NOISES, Trial
from study.trials.draw import in_own_unit as in_units
from study.trials.strength import SHARE
from study.trials.visible import forgets, stands_out

LINEAR = ("linear_damping", "linear_stiffness")
TIMED = ("periodic_stiffness", "harmonic_force")  # what knows of time: no program of a test is in step with it
DAMPED = 2.5  # times as large a share, of the viscous force, is what a hidden damper carries
STEPS = 8  # of the integration, a sample
ATTEMPTS = 300


@dataclass(frozen=True)
class DrawnTest:
    """A system and how it is tested."""

    believed: Model  # without the hidden effect
    truth: Model
    record: Record  # what was measured, without noise
    measured: str  # the channel that noise is added to


Maker = Callable[[np.random.Generator, tuple[str, ...]], DrawnTest]


def make_test(test: str, seed: int, hidden: Sequence[str] | None = None, noise: float | None = None) -> Trial:
    """A trial of a kind of test and seed; arguments as of :func:`study.trials.draw.make_trial`.

    Raises
    ------
    StudyError
        If there is no such kind of test, or such an effect cannot be hidden in it.
    """
    expect(test in TESTS, f"test is {test!r}; expected one of {', '.join(TESTS)}")
    rng = np.random.default_rng([2026, seed, *test.encode()])
    possible = HIDDEN[test]
    if hidden is None:
        hidden = tuple(str(n) for n in rng.choice(possible, int(rng.random() < 0.75), replace=False))
    for name in hidden:
        expect(name in possible, f"{name!r} cannot be hidden in {test}; take {', '.join(possible)}")
    level = float(rng.choice(NOISES[:3])) if noise is None else noise
    for _ in range(ATTEMPTS):
        try:
            drawn = TESTS[test](rng, tuple(hidden))
        except StudyError:
            continue
        clean = drawn.record[drawn.measured]
        added = displacement_noise(clean - np.mean(clean), level, seed)
        size = math.sqrt(level) * float(np.std(clean))
        if not all(stands_out(drawn.record, drawn.truth, name, size) for name in hidden):
            continue
        record = replace(drawn.record.with_channels({drawn.measured: clean + added}), name=f"{test}_{seed}")
        believed = drawn.believed.with_values(dict.fromkeys(drawn.believed.values))
        return Trial(record, believed, drawn.truth, tuple(hidden), level, tuple(0.0 for _ in hidden), None)
    raise StudyError(f"no system of {test} {seed} stays finite with {', '.join(hidden)}")


def _evenly(rng: np.random.Generator, low: float, high: float) -> float:
    """A number drawn evenly on a logarithmic scale."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _oscillator(rng: np.random.Generator, damping: tuple[float, float]) -> tuple[Model, float, float]:
    """Inertia, damping and stiffness, with the natural frequency in Hz and the sampling interval."""
    frequency, mass = _evenly(rng, 0.3, 30.0), float(np.exp(rng.uniform(-2.0, 4.0)))
    zeta = _evenly(rng, *damping)
    omega = 2.0 * np.pi * frequency
    values = {"m": mass, "c": 2.0 * zeta * omega * mass, "k": mass * omega**2}
    model = Model("believed", tuple(free(get(n)).with_values(values) for n in ("inertia", *LINEAR)))
    return model, frequency, 1.0 / (frequency * float(rng.uniform(16.0, 40.0)))


def _per_unit_mass(model: Model) -> Model:
    """The model with a mass of one, as a test without a measured force shows it."""
    values = model.numbers()
    return model.with_values({key: value / values["m"] for key, value in values.items()})


def _run(model: Model, force: Floats, dt: float, initial: Sequence[float] = (0.0, 0.0)) -> Record:
    """The motion of a model under a force, friction's switches met exactly."""
    record = Record(dt, {"force": force}, dict(SI_UNITS))
    motion = {
        name: predict_response(model, record, response=name, steps_per_sample=STEPS, initial=initial)
        for name in ("displacement", "velocity", "acceleration")
    }
    return record.with_channels(motion)


def _with_hidden(rng: np.random.Generator, model: Model, names: Sequence[str], quiet: Record) -> Model:
    """The model and the effects, sized along the motion without them: dampers by the viscous force."""
    values = model.numbers()
    for name in names:
        entry = _shaped(rng, name, quiet)
        unit = _force(entry, quiet)
        v, u = quiet["velocity"], quiet["displacement"]
        drains = abs(float(unit @ v)) > 0.5 * float(np.linalg.norm(unit) * np.linalg.norm(v))
        viscous = values.get("c", 0.0) * float(np.std(v))
        damper = drains and viscous > 0.0
        beside = viscous if damper else values.get("k", 0.0) * float(np.std(u)) or viscous
        share = float(rng.uniform(*SHARE)) * (DAMPED if damper else 1.0)
        amount = share * beside / max(_beyond(unit, quiet, model), 1e-300)
        sign = -1.0 if entry.term.either_sign and rng.random() < 0.5 and not entry.term.steady else 1.0
        model = model.with_term(replace(entry, coefficients=(sign * amount,)))
    return model


def _beyond(values: Floats, record: Record, model: Model) -> float:
    """Root mean square of a force less what the terms of a linear model can take over along a motion."""
    shapes = {"inertia": "acceleration", "linear_damping": "velocity", "linear_stiffness": "displacement"}
    motion = np.column_stack([record[shapes[t.name]] for t in model.terms if t.name in shapes])
    return float(np.sqrt(np.mean((values - motion @ least_squares(motion, values)) ** 2)))


def _shaped(rng: np.random.Generator, name: str, quiet: Record) -> ModelTerm:
    """An effect with shape parameters drawn in the units of the motion."""
    scale = float(np.std(quiet["displacement"]))
    omega = float(np.std(quiet["velocity"])) / scale
    values: list[float] = []
    parameter: ShapeParameter
    for parameter in get(name).parameters:
        share = float(rng.uniform(*parameter.drawn))
        values.append(share * values[-1] if parameter.relative else in_units(share, parameter, scale, omega))
    return replace(free(get(name)), parameters=tuple(values))


def _force(entry: ModelTerm, record: Record) -> Floats:
    """The force of an effect with a unit coefficient along a motion, shape (n,)."""
    alone = Model("alone", (replace(entry, coefficients=(1.0,)),))
    return predict_response(alone, record, response="force", steps_per_sample=4, initial=(0.0,) * len(alone.states))


def _decay(rng: np.random.Generator, hidden: tuple[str, ...]) -> DrawnTest:
    """A structure let go, from a place that nothing else knows; no force."""
    model, frequency, dt = _oscillator(rng, (0.003, 0.03))
    model = _per_unit_mass(model)
    samples = int(rng.uniform(40.0, 80.0) / (frequency * dt))
    height = float(np.exp(rng.uniform(-6.0, -2.0)))
    start, force = (height, float(rng.uniform(-0.3, 0.3)) * height * 2.0 * np.pi * frequency), np.zeros(samples)
    truth = _with_hidden(rng, model, hidden, _run(model, force, dt, start))
    record = _run(truth, force, dt, start)
    _refuse_lost(record)
    return DrawnTest(model, truth, _only(record, "displacement"), "displacement")


def _blows(rng: np.random.Generator, hidden: tuple[str, ...]) -> DrawnTest:
    """Blows of a hammer with decays between them."""
    model, frequency, dt = _oscillator(rng, (0.01, 0.05))
    samples = 4096
    time, force = dt * np.arange(samples), np.zeros(samples)
    width = float(rng.uniform(0.1, 0.3)) / frequency
    begin = 5.0 / frequency
    while begin < time[-1]:
        inside = (time >= begin) & (time < begin + width)
        force[inside] += float(rng.uniform(0.5, 1.5)) * np.sin(np.pi * (time[inside] - begin) / width)
        begin += float(rng.uniform(8.0, 20.0)) / frequency
    truth = _with_hidden(rng, model, hidden, _run(model, force, dt))
    _refuse_restless(truth, force, dt)
    record = _run(truth, force, dt)
    return DrawnTest(model, truth, _only(record, "displacement"), "displacement")


def _base(rng: np.random.Generator, hidden: tuple[str, ...]) -> DrawnTest:
    """A shake table with noise below three times the natural frequency; the response is relative to it."""
    model, frequency, dt = _oscillator(rng, (0.01, 0.08))
    model = _per_unit_mass(model)
    base = _band(rng, 4096, 3.0 * frequency * dt)
    truth = _with_hidden(rng, model, hidden, _run(model, -base, dt))
    _refuse_restless(truth, -base, dt)
    record = _run(truth, -base, dt)
    shown = {"base_acceleration": base, "force": np.zeros(len(base)), "displacement": record["displacement"]}
    return DrawnTest(model, truth, Record(dt, shown, {**SI_UNITS, "base_acceleration": "m/s^2"}), "displacement")


def _component(rng: np.random.Generator, hidden: tuple[str, ...]) -> DrawnTest:
    """A damper or mount in a rig that prescribes its motion: noise in a band; the force is measured."""
    frequency, samples = _evenly(rng, 0.5, 20.0), 3000
    dt = 1.0 / (frequency * float(rng.uniform(30.0, 60.0)))
    stroke = float(np.exp(rng.uniform(-6.0, -2.0)))
    u = stroke * _band(rng, samples, 1.5 * frequency * dt)
    v = np.asarray(np.fft.irfft(np.fft.rfft(u) * 2j * np.pi * np.fft.rfftfreq(samples, dt), samples))
    a = np.asarray(np.fft.irfft(np.fft.rfft(v) * 2j * np.pi * np.fft.rfftfreq(samples, dt), samples))
    k, omega = float(np.exp(rng.uniform(4.0, 10.0))), 2.0 * np.pi * frequency
    values = {"k": k, "c": float(rng.uniform(0.2, 2.0)) * k / omega}
    model = Model("believed", tuple(free(get(n)).with_values(values) for n in LINEAR))
    motion = {"force": np.zeros(samples), "displacement": u, "velocity": v, "acceleration": a}
    record = Record(dt, motion, dict(SI_UNITS))
    truth = _with_hidden(rng, model, hidden, record)
    force = predict_response(
        truth, record, response="force", steps_per_sample=STEPS, initial=(0.0,) * len(truth.states)
    )
    return DrawnTest(model, truth, record.with_channels({"force": force}), "force")


def _axis(rng: np.random.Generator, hidden: tuple[str, ...]) -> DrawnTest:
    """A mass without a spring under position control, that moves to and fro with rests between."""
    mass, samples, dt = float(np.exp(rng.uniform(0.0, 5.0))), 4000, 0.005
    omega = 2.0 * np.pi * float(rng.uniform(1.5, 3.0))  # of the control
    values = {"m": mass, "c": float(rng.uniform(0.5, 3.0)) * mass}
    model = Model("believed", tuple(free(get(n)).with_values(values) for n in ("inertia", "linear_damping")))
    wanted = _moves(rng, samples, dt)
    stiff, damped = mass * omega**2, 1.4 * mass * omega
    drive = stiff * wanted + damped * np.gradient(wanted, dt)
    control = Model("control", tuple(free(get(n)).with_values({"k": stiff, "c": damped}) for n in LINEAR))
    closed = _closed(model, control)
    truth = _with_hidden(rng, model, hidden, _run(closed, drive, dt))
    record = _run(_closed(truth, control), drive, dt)
    force = drive - stiff * record["displacement"] - damped * record["velocity"]
    return DrawnTest(model, truth, _only(record.with_channels({"force": force}), "displacement"), "displacement")


def _closed(model: Model, control: Model) -> Model:
    """The model with the control's stiffness and damping."""
    added = {**model.numbers(), "c": (model.values["c"] or 0.0) + (control.values["c"] or 0.0)}
    stiffness = next(t for t in control.terms if t.name == "linear_stiffness")
    return model.with_values(added).with_term(stiffness)


def _moves(rng: np.random.Generator, samples: int, dt: float) -> Floats:
    """Position over time: smooth moves of random length with rests between them, back and forth."""
    time, wanted, begin, side = dt * np.arange(samples), np.zeros(samples), 0.5, 1.0
    while begin < time[-1]:
        lasting = float(rng.uniform(0.5, 1.2))
        x = np.clip((time - begin) / lasting, 0.0, 1.0)
        wanted += side * float(rng.uniform(0.05, 0.3)) * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        begin += lasting + float(rng.uniform(0.2, 0.6))
        side = -side
    return wanted


def _band(rng: np.random.Generator, samples: int, highest: float) -> Floats:
    """Noise of unit variance below a frequency in cycles a sample, shape (n,); it closes on itself."""
    lines = np.fft.rfft(rng.standard_normal(samples))
    lines *= np.exp(-((np.fft.rfftfreq(samples) / highest) ** 8))
    lines[0] = 0.0
    values = np.fft.irfft(lines, samples)
    return np.asarray(values / np.std(values), dtype=np.float64)


def _only(record: Record, motion: str) -> Record:
    return Record(record.dt, {"force": record["force"], motion: record[motion]}, dict(SI_UNITS))


def _refuse_lost(record: Record) -> None:
    """A decay whose second half stands still tells of nothing but friction."""
    u = record["displacement"]
    expect(float(np.std(u[len(u) // 2 :])) > 0.02 * float(np.std(u)), "the motion has stopped")


def _refuse_restless(truth: Model, force: Floats, dt: float) -> None:
    """A system that magnifies every disturbance is drawn again."""
    expect(forgets(truth, force, dt, STEPS), "the motion is chaotic")


TESTS: dict[str, Maker] = {
    "free_decay": _decay, "blows": _blows, "base": _base, "component": _component, "axis": _axis,
}  # fmt: skip
_ONE = tuple(n for n, t in LIBRARY.items() if n not in ("inertia", *LINEAR, *TIMED) and len(t.components) == 1)
HIDDEN: dict[str, tuple[str, ...]] = {
    # A decay swings at one frequency, at which a relaxation is damping and stiffness.
    "free_decay": tuple(sorted({*_ONE} - {"relaxation"}, key=_ONE.index)), "blows": _ONE, "base": _ONE,
    "component": _ONE,
    "axis": ("coulomb_friction", "constant_force", "quadratic_damping", "cubic_damping"),
}  # fmt: skip
