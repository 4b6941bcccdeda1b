"""Trials of other kinds of tests than a force on a mass and spring.

Free decays, blows of a hammer, a moving base, a component whose motion is prescribed, an axis in closed loop. Along the
motion without them, effects carry, beyond what a linear model can take over, 10 to 40 % of the spring's force or, where
they damp, 25 to 100 % of the viscous force; the motion forgets how it began, and the coefficient is as many of the
standard errors that noise leaves it as a test of all candidates needs (:func:`study.trials.effects.stands_out`).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from study.equations.free_run import predict_response
from study.equations.model import Model, ModelTerm, free
from study.equations.term import Term
from study.equations.terms import LINEAR, get
from study.records.excitation import displacement_noise
from study.records.record import MOTIONS, SI_UNITS, Record
from study.support.arrays import Floats
from study.support.errors import expect
from study.trials import effects
from study.trials.effects import HIDDEN, SHARE, Asked, Rig, Shares, Sizing, evenly_in_log, linear_model

TIMED = ("periodic_stiffness", "harmonic_force")  # what knows of time: no program of a test is in step with it
TEST_STEPS = 8  # of the integration, a sample
# The motion that each linear term acts on.
SHAPES: Mapping[str, str] = MappingProxyType(dict(zip(LINEAR, reversed(MOTIONS), strict=True)))


@dataclass(frozen=True)
class Bench:
    """A system, and the test that it is put to."""

    base: Model
    quiet: Record  # all of its motion in the test
    respond: Callable[[Model], Record]  # what is measured of a model, without noise
    measured: str = "displacement"  # the channel that noise is added to


def rig_of_a_test(rng: np.random.Generator, asked: Asked, make: Callable[[np.random.Generator], Bench]) -> Rig:
    """A system in a test. Its effects are sized along the motion without them, what they make of it left aside."""
    bench = make(rng)
    base, quiet = bench.base, bench.quiet
    v, u, values = quiet["velocity"], quiet["displacement"], base.numbers()
    viscous, spring = values.get("c", 0.0) * float(np.std(v)), values.get("k", 0.0) * float(np.std(u))

    def damps(force: Floats) -> bool:
        return abs(float(force @ v)) > 0.5 * float(np.linalg.norm(force) * np.linalg.norm(v)) and viscous > 0.0

    def effect(term: Term) -> tuple[ModelTerm, float]:
        """Shape, share and sign, in the order in which the published ones were drawn; more of what damps."""
        entry = replace(free(term), coefficients=(1.0,), parameters=effects.drawn_shape(rng, term, quiet))
        # a hidden damper carries a larger share, of the viscous force
        share = float(rng.uniform(*SHARE)) * (2.5 if damps(_force(entry, quiet)) else 1.0)
        opposite = term.either_sign and rng.random() < 0.5 and not term.steady
        return replace(entry, coefficients=(-1.0 if opposite else 1.0,)), share

    def strength(unit: ModelTerm, record: Record) -> tuple[float, float]:
        force = _force(unit, record)
        alone = effects.beyond_linear(force, [record[SHAPES[t.name]] for t in base.terms])
        return alone, viscous if damps(force) else spring or viscous

    def recorded(truth: Model, shares: Shares) -> tuple[Record, Shares]:
        record = bench.respond(truth)
        clean = record[bench.measured]
        size = math.sqrt(asked.noise) * float(np.std(clean))
        seen = all(effects.stands_out(record, truth, name, size) for name in asked.hidden)
        expect(seen, "no test could find the effect")
        added = displacement_noise(clean - np.mean(clean), asked.noise, asked.seed)
        return record.with_channels({bench.measured: clean + added}), shares

    return Rig(base, effect, lambda _: quiet, strength, recorded, Sizing(0), {})


def _oscillator(rng: np.random.Generator, damping: tuple[float, float]) -> tuple[Model, float, float]:
    """Inertia, damping and stiffness, with the natural frequency in Hz and the sampling interval."""
    frequency, mass = evenly_in_log(rng, 0.3, 30.0), float(np.exp(rng.uniform(-2.0, 4.0)))
    model = effects.linear_oscillator(mass, frequency, evenly_in_log(rng, *damping))
    return model, frequency, 1.0 / (frequency * float(rng.uniform(16.0, 40.0)))


def _per_unit_mass(model: Model) -> Model:
    """The model with a mass of one, as a test without a measured force shows it."""
    values = model.numbers()
    return model.with_values({key: value / values["m"] for key, value in values.items()})


def response_to(
    model: Model, force: Floats, dt: float, initial: Sequence[float] = (0.0, 0.0), motions: Sequence[str] = MOTIONS
) -> Record:
    """The motion of a model under a force, friction's switches met exactly."""
    record = Record(dt, {"force": force}, dict(SI_UNITS))
    return record.with_channels(
        {
            name: predict_response(model, record, response=name, steps_per_sample=TEST_STEPS, initial=initial)
            for name in motions
        }
    )


def _force(entry: ModelTerm, record: Record) -> Floats:
    """The force of an effect with a unit coefficient along a motion, shape (n,)."""
    alone = Model("alone", (replace(entry, coefficients=(1.0,)),))
    return predict_response(alone, record, response="force", steps_per_sample=4, initial=(0.0,) * len(alone.states))


def decay(
    rng: np.random.Generator, reach: tuple[float, float] = (-6.0, -2.0), periods: tuple[float, float] = (40.0, 80.0)
) -> Bench:
    """A structure let go, from a place that nothing else knows, its logarithm drawn within ``reach``; no force."""
    model, frequency, dt = _oscillator(rng, (0.003, 0.03))
    model = _per_unit_mass(model)
    samples = int(rng.uniform(*periods) / (frequency * dt))
    height = float(np.exp(rng.uniform(*reach)))
    start, force = (height, float(rng.uniform(-0.3, 0.3)) * height * 2.0 * np.pi * frequency), np.zeros(samples)

    def respond(truth: Model) -> Record:
        record = response_to(truth, force, dt, start, ["displacement"])
        u = record["displacement"]
        # A decay whose second half stands still tells of nothing but friction.
        expect(float(np.std(u[len(u) // 2 :])) > 0.02 * float(np.std(u)), "the motion has stopped")
        return record

    return Bench(model, response_to(model, force, dt, start), respond)


def _blows(rng: np.random.Generator) -> Bench:
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
    return Bench(model, response_to(model, force, dt), lambda truth: _calm(truth, force, dt))


def _base(rng: np.random.Generator) -> Bench:
    """A shake table with noise below three times the natural frequency; the response is relative to it."""
    model, frequency, dt = _oscillator(rng, (0.01, 0.08))
    model = _per_unit_mass(model)
    base = _band(rng, 4096, 3.0 * frequency * dt)

    def respond(truth: Model) -> Record:
        relative = _calm(truth, -base, dt)["displacement"]
        shown = {"base_acceleration": base, "force": np.zeros(len(base)), "displacement": relative}
        return Record(dt, shown, {**SI_UNITS, "base_acceleration": "m/s^2"})

    return Bench(model, response_to(model, -base, dt), respond)


def _calm(truth: Model, force: Floats, dt: float) -> Record:
    """Force and displacement of a system that does not magnify every disturbance."""

    def respond(force: Floats) -> Record:
        return response_to(truth, force, dt, motions=["displacement"])

    expect(effects.forgets(lambda f: respond(f)["displacement"], force, slight=True), "the motion is chaotic")
    return respond(force)


def _component(rng: np.random.Generator) -> Bench:
    """A damper or mount in a rig that prescribes its motion: noise in a band; the force is measured."""
    frequency, samples = evenly_in_log(rng, 0.5, 20.0), 3000
    dt = 1.0 / (frequency * float(rng.uniform(30.0, 60.0)))
    stroke = float(np.exp(rng.uniform(-6.0, -2.0)))
    u = stroke * _band(rng, samples, 1.5 * frequency * dt)
    v = np.asarray(np.fft.irfft(np.fft.rfft(u) * 2j * np.pi * np.fft.rfftfreq(samples, dt), samples))
    a = np.asarray(np.fft.irfft(np.fft.rfft(v) * 2j * np.pi * np.fft.rfftfreq(samples, dt), samples))
    k, omega = float(np.exp(rng.uniform(4.0, 10.0))), 2.0 * np.pi * frequency
    model = linear_model({"k": k, "c": float(rng.uniform(0.2, 2.0)) * k / omega})
    motion = {"force": np.zeros(samples), "displacement": u, "velocity": v, "acceleration": a}
    record = Record(dt, motion, dict(SI_UNITS))

    def respond(truth: Model) -> Record:
        initial = (0.0,) * len(truth.states)
        force = predict_response(truth, record, response="force", steps_per_sample=TEST_STEPS, initial=initial)
        return record.with_channels({"force": force})

    return Bench(model, record, respond, "force")


def _axis(rng: np.random.Generator) -> Bench:
    """A mass without a spring under position control, that moves to and fro with rests between."""
    mass, samples, dt = float(np.exp(rng.uniform(0.0, 5.0))), 4000, 0.005
    omega = 2.0 * np.pi * float(rng.uniform(1.5, 3.0))  # of the control
    model = linear_model({"m": mass, "c": float(rng.uniform(0.5, 3.0)) * mass})
    wanted = _moves(rng, samples, dt)
    stiff, damped = mass * omega**2, 1.4 * mass * omega
    drive = stiff * wanted + damped * np.gradient(wanted, dt)

    def closed(model: Model) -> Model:
        """The model with the control's stiffness and damping."""
        held = model.with_values({**model.numbers(), "c": (model.values["c"] or 0.0) + damped})
        return held.with_term(free(get("linear_stiffness")).with_values({"k": stiff}))

    def respond(truth: Model) -> Record:
        record = response_to(closed(truth), drive, dt)
        force = drive - stiff * record["displacement"] - damped * record["velocity"]
        return Record(dt, {"force": force, "displacement": record["displacement"]}, dict(SI_UNITS))

    return Bench(model, response_to(closed(model), drive, dt), respond)


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


TESTS: Mapping[str, Callable[[np.random.Generator], Bench]] = MappingProxyType(
    {"free_decay": decay, "blows": _blows, "base": _base, "component": _component, "axis": _axis}
)
_ONE = tuple(n for n in HIDDEN if n not in TIMED and len(get(n).components) == 1)
POSSIBLE: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        # A decay swings at one frequency, at which a relaxation is damping and stiffness.
        "free_decay": tuple(sorted({*_ONE} - {"relaxation"}, key=_ONE.index)),
        "blows": _ONE, "base": _ONE, "component": _ONE,
        "axis": ("coulomb_friction", "constant_force", "quadratic_damping", "cubic_damping"),
    }
)  # fmt: skip
