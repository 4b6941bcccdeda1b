"""A trial: a system, an excitation, a hidden effect (or none, or two) and a sensor, all drawn from one seed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.equations.free_run import predict
from study.equations.model import Model, ModelTerm, free
from study.equations.simulate import Integrator, simulate
from study.equations.term import Parameter, Term
from study.equations.terms import LIBRARY, get
from study.records.excitation import Excitation, displacement_noise, force
from study.records.record import MOTIONS, Record
from study.support.errors import DivergenceError, StudyError
from study.trials.strength import SHARE, grown, share_of

Floats = NDArray[np.float64]
LINEAR = ("inertia", "linear_damping", "linear_stiffness")  # what a linear model has: it cannot be hidden behind one
HIDDEN = tuple(name for name in LIBRARY if name not in LINEAR)
NOISES = (0.0, 0.01, 0.05, 0.10)
KNOWN = ("none", "none", "cubic_stiffness", "van_der_pol_damping")  # of which one is drawn
KNOWN_SHARE = 0.15
SAMPLES = 8192
STEPS, ACCURATE = 32, 1e-3  # steps per sample of the record, and by how much halving them may change it
PUSH, FORGOTTEN = 20, 1e-3  # samples at the start; share of the motion in the second half
ATTEMPTS = 300  # systems drawn until one carries the effects at the wanted strength and stays finite


@dataclass(frozen=True)
class Trial:
    """A record, what its owner believes, and the truth."""

    record: Record  # force and one measured motion
    believed: Model  # the model without the hidden effects, nothing known of its coefficients
    truth: Model  # the model that made the record
    hidden: tuple[str, ...]  # names of the hidden effects
    noise: float  # mean square of the noise over that of the response
    shares: tuple[float, ...]  # of the restoring force in each hidden effect, beyond any linear model


def make_trial(
    seed: int, hidden: Sequence[str] | None = None, noise: float | None = None, response: str | None = None
) -> Trial:
    """A trial of this seed; what is given is not drawn.

    No effect is hidden with an empty sequence; ``noise`` is a mean square over that of the response, ``response`` is
    ``displacement``, ``velocity`` or ``acceleration``.

    Raises
    ------
    StudyError
        If an effect cannot be hidden, or the response is no motion.
    DivergenceError
        If no system was found that stays finite with these effects.
    """
    rng = np.random.default_rng([2026, seed])
    if hidden is None:
        count = int(rng.choice([0, 1, 1, 1, 1, 2]))
        hidden = tuple(str(n) for n in rng.choice(HIDDEN, count, replace=False))
    _check(hidden, response)
    drawn_noise = float(rng.choice(NOISES))
    drawn_response = str(rng.choice(["displacement", "acceleration"]))
    noise = drawn_noise if noise is None else noise
    response = response or drawn_response
    for _ in range(ATTEMPTS):
        trial = _attempt(rng, seed, tuple(hidden), noise, response)
        if trial is not None:
            return trial
    raise DivergenceError(f"no system of trial {seed} stays finite with {', '.join(hidden)}", 0.0)


def _check(hidden: Sequence[str], response: str | None) -> None:
    for name in hidden:
        if get(name).name not in HIDDEN:
            raise StudyError(f"{name!r} cannot be hidden, a linear model has it; take {', '.join(HIDDEN)}")
    if len(set(hidden)) < len(hidden):
        raise StudyError(f"the effects to hide are {', '.join(hidden)}; each may be named once")
    if response is not None and response not in MOTIONS:
        raise StudyError(f"response is {response!r}; it must be one of {', '.join(MOTIONS)}")


def _attempt(rng: np.random.Generator, seed: int, hidden: tuple[str, ...], noise: float, response: str) -> Trial | None:
    base, dt = _system(rng)
    excitation = Excitation(level=float(10.0 ** rng.uniform(-1.0, 5.0)), reading="filtered", cutoff=0.25 / dt)
    drive = force(excitation, SAMPLES, dt, seed)
    try:
        quiet = simulate(base, drive, dt, Integrator("rk4", 4))
        scale = float(np.std(quiet["displacement"]))
        base, quiet = _with_own_nonlinearity(rng, base, hidden, drive, dt, quiet)
        if _unseen(base, hidden, response):
            return None
        truth = _with_effects(rng, base, hidden, quiet, drive, dt)
        if truth is None:
            return None
        record = simulate(truth, drive, dt, Integrator("rk4", 8))
        forgets = _forgets(truth, drive, dt)
    except DivergenceError:
        return None
    shares = tuple(share_of(truth, name, record) for name in hidden)
    if not forgets or not 0.1 * scale < np.std(record["displacement"]) < 10.0 * scale:
        return None
    if any(not SHARE[0] <= share <= SHARE[1] for share in shares):
        return None
    values = _measured(truth, record, response)
    if values is None:
        return None
    if noise > 0.0:
        values = values + displacement_noise(values, noise, seed)
    measured = Record(dt, {"force": drive, response: values}, record.units, f"trial_{seed}")
    believed = replace(base, name=f"trial_{seed}").with_values(dict.fromkeys(base.values, None))
    return Trial(measured, believed, truth, hidden, noise, shares)


def _unseen(base: Model, hidden: tuple[str, ...], response: str) -> bool:
    """A steady force moves a system to another place, which only a displacement shows if no force depends on the place.

    Linear stiffness does not count: it is the same everywhere.
    """
    effects = [get(name) for name in hidden]
    if response == "displacement" or not any(term.steady for term in effects):
        return False
    return all(term.placeless for term in (*effects, *(entry.term for entry in base.terms)))


def _measured(truth: Model, record: Record, response: str) -> Floats | None:
    """The motion without visible error of integration; None where so many steps do not give it."""
    coarse, fine = (predict(truth, record, response=response, steps_per_sample=n) for n in (STEPS // 2, STEPS))
    return fine if float(np.std(fine - coarse)) < ACCURATE * float(np.std(fine)) else None


def _forgets(model: Model, drive: Floats, dt: float) -> bool:
    """Whether the motion forgets a small push at its start: that of a chaotic system does not, and no free run follows.

    A spring that pushes away from the centre would make such a system, with two places to rest.
    """
    pushed = drive.copy()
    pushed[:PUSH] += 0.1 * float(np.std(drive))
    one, other = (simulate(model, f, dt, Integrator("rk4", 2))["displacement"][SAMPLES // 2 :] for f in (drive, pushed))
    return float(np.std(one - other)) < FORGOTTEN * float(np.std(one))


def _system(rng: np.random.Generator) -> tuple[Model, float]:
    """A linear oscillator of any size, sampled as the report's is, give or take a factor of two."""
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
    known = str(rng.choice(KNOWN))
    if known == "none" or known in hidden:
        return base, quiet
    known_system = grown(base, free(get(known)), drive, dt, KNOWN_SHARE)
    if known_system is None:
        return base, quiet
    return known_system[0], simulate(known_system[0], drive, dt, Integrator("rk4", 4))


def _with_effects(
    rng: np.random.Generator, model: Model, hidden: tuple[str, ...], quiet: Record, drive: Floats, dt: float
) -> Model | None:
    """The model and the hidden effects, as strong as is drawn; None where that cannot be.

    What comes later changes the motion, and so the share of what came before: that is sized again at the end.
    """
    wanted = {name: (float(rng.uniform(*SHARE)), _drawn(rng, get(name), quiet)) for name in hidden}
    for name in (*hidden, *hidden[:-1]):
        target, entry = wanted[name]
        stronger = grown(model.without_term(name), entry, drive, dt, target)
        if stronger is None:
            return None
        model = stronger[0]
    return model


def _drawn(rng: np.random.Generator, term: Term, quiet: Record) -> ModelTerm:
    """Shape parameters in the range where the effect shows, in the units of the system."""
    scale = float(np.std(quiet["displacement"]))
    omega = float(np.std(quiet["velocity"])) / scale
    values: list[float] = []
    for parameter in term.parameters:
        share = float(rng.uniform(*parameter.drawn))
        values.append(share * values[-1] if parameter.relative else _scaled(share, parameter, scale, omega))
    entry = free(term)
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    sign = -1.0 if term.either_sign and angle > np.pi else 1.0
    shape = (np.cos(angle), np.sin(angle)) if len(term.components) == 2 else (sign,)
    return replace(entry, coefficients=tuple(float(s) for s in shape), parameters=tuple(values))


def _scaled(value: float, parameter: Parameter, scale: float, omega: float) -> float:
    """A value in the unit of its quantity, from one in units of rms displacement and angular rate (rad/s)."""
    match parameter.quantity:
        case "length":
            return value * scale
        case "1/length":
            return value / scale
        case "time":
            return value / omega
        case _:
            return value * omega / (2.0 * np.pi)
