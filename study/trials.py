"""Records with a hidden effect: the proof, and the practice ground, of ``diagnose``.

A trial draws a system, an excitation, an effect (or none, or two) and its strength, which sensor there
is and its noise, simulates, and keeps the answer apart from the record and the model that a user would
believe in. Everything follows from the seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.errors import DivergenceError
from study.excitation import Excitation, displacement_noise, force
from study.free_run import predict
from study.inputs import Input, history, reverse_inputs
from study.linear import least_squares
from study.model import Model, ModelTerm, free
from study.record import Record
from study.simulate import Integrator, simulate
from study.terms import LIBRARY, Term, get

Floats = NDArray[np.float64]
LINEAR = ("inertia", "linear_damping", "linear_stiffness")
HIDDEN = tuple(name for name in LIBRARY if name not in LINEAR)
NOISES = (0.0, 0.01, 0.05, 0.10)
SHARE = (0.10, 0.40)  # of the restoring force, what no linear model can take over
SAMPLES = 8192
ATTEMPTS = 300  # systems drawn until one carries the effects at the wanted strength and stays finite


@dataclass(frozen=True)
class Trial:
    """A record, what its owner believes, and the truth.

    Attributes
    ----------
    record : Record
        Force and one measured motion.
    believed : Model
        The model without the hidden effects, nothing known of its coefficients.
    truth : Model
        The model that made the record.
    hidden : tuple of str
        Names of the hidden effects.
    noise : float
        Mean square of the noise over that of the response.
    shares : tuple of float
        Share of the restoring force that each hidden effect carries and no linear model can take over.
    """

    record: Record
    believed: Model
    truth: Model
    hidden: tuple[str, ...]
    noise: float
    shares: tuple[float, ...]


def make_trial(
    seed: int, hidden: Sequence[str] | None = None, noise: float | None = None, response: str | None = None
) -> Trial:
    """A trial of this seed; what is given is not drawn.

    Parameters
    ----------
    seed : int
        Everything else follows from it.
    hidden : sequence of str, optional
        Effects to hide; none with an empty sequence.
    noise : float, optional
        Mean square of the noise over that of the response.
    response : str, optional
        ``displacement`` or ``acceleration``.
    """
    rng = np.random.default_rng([2026, seed])
    if hidden is None:
        count = int(rng.choice([0, 1, 1, 1, 1, 2]))
        hidden = tuple(str(n) for n in rng.choice(HIDDEN, count, replace=False))
    drawn_noise = float(rng.choice(NOISES))
    drawn_response = str(rng.choice(["displacement", "acceleration"]))
    noise = drawn_noise if noise is None else noise
    response = response or drawn_response
    for _ in range(ATTEMPTS):
        found = _attempt(rng, seed, tuple(hidden), noise, response)
        if found is not None:
            return found
    raise DivergenceError(f"no system of trial {seed} stays finite with {', '.join(hidden)}", 0.0)


def _attempt(rng: np.random.Generator, seed: int, hidden: tuple[str, ...], noise: float, response: str) -> Trial | None:
    base, dt = _system(rng, hidden)
    excitation = Excitation(level=float(10.0 ** rng.uniform(-1.0, 5.0)), reading="filtered", cutoff=0.25 / dt)
    drive = force(excitation, SAMPLES, dt, seed)
    try:
        quiet = simulate(base, drive, dt, Integrator("rk4", 4))
        scale = float(np.std(quiet["displacement"]))
        base, quiet = _with_own_nonlinearity(rng, base, hidden, drive, dt, quiet)
        truth, shares = base, list[float]()
        for name in hidden:
            target = float(rng.uniform(*SHARE))
            entry = _drawn(rng, get(name), quiet, scale)
            grown = _grow(truth, entry, drive, dt, target)
            if grown is None:
                return None
            truth, share = grown
            shares.append(share)
        record = simulate(truth, drive, dt, Integrator("rk4", 8))
    except DivergenceError:
        return None
    if not 0.1 * scale < np.std(record["displacement"]) < 10.0 * scale:
        return None
    if any(not 0.8 * SHARE[0] < share_of(truth, name, record) < 1.2 * SHARE[1] for name in hidden):
        return None
    values = predict(truth, record, response=response, steps_per_sample=8)  # exact at stick and slip too
    if noise > 0.0:
        values = values + displacement_noise(values, noise, seed)
    measured = Record(dt, {"force": drive, response: values}, record.units, f"trial_{seed}")
    believed = replace(base, name="believed").with_values(dict.fromkeys(base.values, None))
    return Trial(measured, believed, truth, hidden, noise, tuple(shares))


def _system(rng: np.random.Generator, hidden: tuple[str, ...]) -> tuple[Model, float]:
    """A linear oscillator of any size, sampled as the report's is, give or take a factor of two."""
    del hidden
    mass = float(10.0 ** rng.uniform(-2.0, 3.0))
    f_n = float(10.0 ** rng.uniform(-0.5, 2.0))
    zeta = float(rng.uniform(0.02, 0.10))
    omega = 2.0 * np.pi * f_n
    values = (mass, 2.0 * zeta * omega * mass, omega**2 * mass)
    entries = tuple(ModelTerm(get(n), (v,), ()) for n, v in zip(LINEAR, values, strict=True))
    return Model("truth", entries), float(rng.uniform(0.04, 0.08)) / f_n


def _with_own_nonlinearity(
    rng: np.random.Generator, base: Model, hidden: tuple[str, ...], drive: Floats, dt: float, quiet: Record
) -> tuple[Model, Record]:
    """Half of the systems have a known nonlinearity of the report's kind from the start."""
    known = str(rng.choice(["none", "none", "cubic_stiffness", "van_der_pol_damping"]))
    if known == "none" or known in hidden:
        return base, quiet
    grown = _grow(base, free(get(known)), drive, dt, 0.15)
    if grown is None:
        return base, quiet
    return grown[0], simulate(grown[0], drive, dt, Integrator("rk4", 4))


def _drawn(rng: np.random.Generator, term: Term, quiet: Record, scale: float) -> ModelTerm:
    """Shape parameters in the range where the effect shows, in the units of the system."""
    omega = float(np.std(quiet["velocity"]) / np.std(quiet["displacement"]))
    match term.name:
        case "dead_band" | "one_sided_contact":
            values = (float(rng.uniform(0.3, 1.2)) * scale,)
        case "periodic_stiffness":
            values = (float(rng.uniform(0.15, 0.9)) * omega / (2.0 * np.pi),)
        case "harmonic_force":
            values = (float(rng.uniform(0.3, 2.5)) * omega / (2.0 * np.pi),)
        case "relaxation":
            values = (float(rng.uniform(0.3, 3.0)) / omega,)
        case "hysteresis":
            beta = float(rng.uniform(0.5, 2.0)) / scale
            values = (beta, float(rng.uniform(-0.5, 0.5)) * beta)
        case _:
            values = ()
    entry = free(term)
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    shape = (np.cos(angle), np.sin(angle)) if len(term.components) == 2 else (1.0,)
    return replace(entry, coefficients=tuple(float(s) for s in shape), parameters=values)


def _grow(model: Model, entry: ModelTerm, drive: Floats, dt: float, target: float) -> tuple[Model, float] | None:
    """The amount of an effect at which it carries the target share, by iteration on the simulated motion."""
    unit = tuple(c if c is not None else 1.0 for c in entry.coefficients)
    amount, share = 0.0, 0.0
    record = simulate(model, drive, dt, Integrator("rk4", 2))
    for _ in range(12):
        alone = _unshared(replace(entry, coefficients=unit), record)
        restoring = drive - (model.values["m"] or 0.0) * record["acceleration"]
        share = amount * alone / float(np.std(restoring))
        if amount > 0.0 and abs(share / target - 1.0) < 0.05:
            return model.with_term(replace(entry, coefficients=tuple(amount * c for c in unit))), share
        if alone == 0.0:
            return None
        wanted = target * float(np.std(restoring)) / alone
        amount = wanted if amount == 0.0 else float(np.sqrt(amount * wanted))
        grown = model.with_term(replace(entry, coefficients=tuple(amount * c for c in unit)))
        try:
            record = simulate(grown, drive, dt, Integrator("rk4", 2))
        except DivergenceError:
            return None
    return None


def share_of(model: Model, name: str, record: Record) -> float:
    """Share of the rms restoring force that a term carries and no linear model can take over."""
    entry = next(t for t in model.terms if t.name == name)
    restoring = record["force"] - (model.values["m"] or 0.0) * record["acceleration"]
    return _unshared(entry, record) / float(np.std(restoring))


def _unshared(entry: ModelTerm, record: Record) -> float:
    """Root mean square of a term's force less its best fit by displacement, velocity and acceleration."""
    own = _force(entry, record)
    motion = np.column_stack([record[c] for c in ("displacement", "velocity", "acceleration")])
    rest = own - motion @ least_squares(motion, own)
    return float(np.sqrt(np.mean(rest**2)))


def _force(entry: ModelTerm, record: Record) -> Floats:
    """The force of one term along a record: what a system of this term and unit mass leaves of no force."""
    total = np.zeros(len(record))
    model = Model("alone", (entry,))
    for item in reverse_inputs(model):
        values = history(item, record)
        for part in item.parts:
            rate = values if part.order == 0 else _rate(item, record)
            total = total + (model.values[part.symbol] or 0.0) * part.factor * rate
    return total


def _rate(item: Input, record: Record) -> Floats:
    """Time derivative of a shape of displacement alone, by the chain rule on a fine difference."""
    u = record["displacement"]
    step = 1e-6 * float(np.std(u))
    ahead = history(item, record.with_channels({"displacement": u + step}))
    behind = history(item, record.with_channels({"displacement": u - step}))
    return (ahead - behind) / (2.0 * step) * record["velocity"]
