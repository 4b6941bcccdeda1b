"""A trial: an experiment, a hidden effect (or none, or two), a sensor and its fault, all drawn from one seed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from study.equations.free_run import predict_response
from study.equations.model import Model, ModelTerm, free
from study.equations.simulate import Integrator, simulate
from study.equations.term import ShapeParameter, Term
from study.equations.terms import LIBRARY, get
from study.records.excitation import displacement_noise, force
from study.records.record import MOTIONS, Record
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError
from study.trials.experiment import LINEAR, REPORT_LIKE, Experiment, Ranges
from study.trials.strength import SHARE, grown_to_share, share_of

HIDDEN = tuple(name for name in LIBRARY if name not in LINEAR)
NOISES = (0.0, 0.01, 0.05, 0.10)
KNOWN = ("none", "none", "cubic_stiffness", "van_der_pol_damping")  # of which one is drawn
KNOWN_SHARE = 0.15
STEPS = 32  # per sample of the record, and more where there are few samples a period
PUSH, FORGOTTEN = 20, 1e-3  # samples at the start, at most half a period; share of the motion in the second half
ATTEMPTS = 300  # systems drawn until one carries the effects at the wanted strength and stays finite
ANY, NO_FAULT = "any", "none"  # what may be said of the fault beside its name


@dataclass(frozen=True)
class Trial:
    """A record, what its owner believes, and the truth."""

    record: Record  # force and one measured motion
    believed: Model  # the model without the hidden effects, nothing known of its coefficients
    truth: Model  # the model that made the record
    hidden: tuple[str, ...]  # names of the hidden effects
    noise: float  # mean square of the noise over that of the response
    shares: tuple[float, ...]  # of the restoring force in each hidden effect, beyond any linear model
    experiment: Experiment | None  # the linear system, its excitation and how it was sampled; None for other tests
    fault: Mapping[str, Any] = field(default_factory=dict[str, Any])  # of the measurement: its name, channel and value

    @property
    def response(self) -> str:
        """The measured motion."""
        return next(c for c in self.record.channels if c in MOTIONS)

    @property
    def completed(self) -> Model:
        """What its owner believes after adding all that was hidden, nothing known of the coefficients."""
        return _nothing_known(self.truth, self.believed.name)


@dataclass(frozen=True)
class _Wanted:
    """What a trial is to be."""

    seed: int
    hidden: tuple[str, ...]
    noise: float
    response: str
    ranges: Ranges


def make_trial(
    seed: int,
    hidden: Sequence[str] | None = None,
    noise: float | None = None,
    response: str | None = None,
    fault: str = NO_FAULT,
    ranges: Ranges = REPORT_LIKE,
) -> Trial:
    """A trial of this seed; what is given is not drawn.

    No effect is hidden with an empty sequence; ``noise`` is a mean square over that of the response, ``response`` is
    ``displacement``, ``velocity`` or ``acceleration``. ``fault`` is one of ``study.faults.imposed.FAULTS``, ``any`` for
    one that is drawn in half of the trials, or ``none``. It comes last and has a stream of its own: the trial without
    it is the same record before the fault.

    Raises
    ------
    StudyError
        If an effect cannot be hidden, the response is no motion, or there is no such fault.
    DivergenceError
        If no system was found that stays finite with these effects.
    """
    rng = np.random.default_rng([2026, seed])
    if hidden is None:
        count = int(rng.choice([0, 1, 1, 1, 1, 2]))
        hidden = tuple(str(n) for n in rng.choice(HIDDEN, count, replace=False))
    _check(hidden, response)
    drawn_noise = float(rng.choice(NOISES))
    drawn_response = str(rng.choice(ranges.responses))
    noise = drawn_noise if noise is None else noise
    wanted = _Wanted(seed, tuple(hidden), noise, response or drawn_response, ranges)
    for _ in range(ATTEMPTS):
        trial = _attempt(rng, wanted)
        if trial is not None:
            return _with_fault(trial, fault, seed)
    raise DivergenceError(f"no system of trial {seed} stays finite with {', '.join(hidden)}", 0.0)


def _with_fault(trial: Trial, fault: str, seed: int) -> Trial:
    if fault == NO_FAULT:
        return trial
    from study.faults.imposed import FAULTS, impose  # most trials have none

    rng = np.random.default_rng([2026, seed, 1])
    if fault == ANY:
        fault = str(rng.choice([*FAULTS, *[NO_FAULT] * len(FAULTS)]))
        return _with_fault(trial, fault, seed)
    if fault not in FAULTS:
        raise StudyError(f"fault is {fault!r}; expected {ANY}, {NO_FAULT} or one of {', '.join(FAULTS)}")
    record, what = impose(trial.record, trial.response, fault, rng)
    return replace(trial, record=record, fault=what)


def _check(hidden: Sequence[str], response: str | None) -> None:
    for name in hidden:
        if get(name).name not in HIDDEN:
            raise StudyError(f"{name!r} cannot be hidden, a linear model has it; take {', '.join(HIDDEN)}")
    if len(set(hidden)) < len(hidden):
        raise StudyError(f"the effects to hide are {', '.join(hidden)}; each may be named once")
    if response is not None and response not in MOTIONS:
        raise StudyError(f"response is {response!r}; it must be one of {', '.join(MOTIONS)}")


def _attempt(rng: np.random.Generator, wanted: _Wanted) -> Trial | None:
    experiment = wanted.ranges.experiment(rng)
    drive = force(experiment.excitation, experiment.samples, experiment.dt, wanted.seed)
    try:
        quiet = _simulated(experiment.system, drive, experiment, 4)
        base, known = _with_own_nonlinearity(rng, wanted.hidden, drive, experiment, quiet)
        if _unseen(base, wanted.hidden, wanted.response):
            return None
        truth = _with_effects(rng, base, wanted.hidden, known, drive, experiment)
        if truth is None:
            return None
        record = _simulated(truth, drive, experiment, 8)
        if not _of_this_size(record, quiet) or not _forgets(truth, drive, experiment):
            return None
        if _drowned(truth, drive, wanted.ranges.drowned):
            return None
    except DivergenceError:
        return None
    shares = tuple(share_of(truth, name, record) for name in wanted.hidden)
    if any(not SHARE[0] <= share <= SHARE[1] for share in shares):
        return None
    values = _measured(truth, record, experiment, wanted)
    if values is None:
        return None
    if wanted.noise > 0.0:
        values = values + displacement_noise(values, wanted.noise, wanted.seed)
    name = f"trial_{wanted.seed}"
    measured = Record(experiment.dt, {"force": drive, wanted.response: values}, record.units, name)
    return Trial(measured, _nothing_known(base, name), truth, wanted.hidden, wanted.noise, shares, experiment)


def _nothing_known(model: Model, name: str) -> Model:
    return replace(model, name=name).with_values(dict.fromkeys(model.values, None))


def _simulated(model: Model, drive: Floats, experiment: Experiment, steps: int) -> Record:
    return simulate(model, drive, experiment.dt, Integrator("rk4", experiment.steps(steps)))


def _of_this_size(record: Record, quiet: Record) -> bool:
    """Whether the motion is about as large as that of the linear system, by which shape parameters are drawn."""
    return bool(0.1 < np.std(record["displacement"]) / np.std(quiet["displacement"]) < 10.0)


def _unseen(base: Model, hidden: tuple[str, ...], response: str) -> bool:
    """A steady force moves a system to another place, which only a displacement shows if no force depends on the place.

    Linear stiffness does not count: it is the same everywhere.
    """
    effects = [get(name) for name in hidden]
    if response == "displacement" or not any(term.steady for term in effects):
        return False
    return all(term.placeless for term in (*effects, *(entry.term for entry in base.terms)))


def _drowned(truth: Model, drive: Floats, most: float) -> bool:
    """Whether a hidden harmonic force is more than so many times as large (rms) as the measured one.

    On a resonance it would have to be many times larger to be the wanted share of the restoring force, and what the
    measured force does then lies below the noise.
    """
    values = truth.values
    amplitude = math.hypot(values.get("fh_cos") or 0.0, values.get("fh_sin") or 0.0)
    return amplitude > most * math.sqrt(2.0) * float(np.std(drive))


def _measured(truth: Model, record: Record, experiment: Experiment, wanted: _Wanted) -> Floats | None:
    """The motion without visible error of integration; None where so many steps do not give it."""
    steps = experiment.steps(STEPS)
    coarse, fine = (
        predict_response(truth, record, response=wanted.response, steps_per_sample=n) for n in (steps // 2, steps)
    )
    return fine if float(np.std(fine - coarse)) < wanted.ranges.accurate * float(np.std(fine)) else None


def _forgets(model: Model, drive: Floats, experiment: Experiment) -> bool:
    """Whether the motion forgets a small push at its start: that of a chaotic system does not, and no free run follows.

    A spring that pushes away from the centre would make such a system, with two places to rest.
    """
    half = len(drive) // 2
    pushed = drive.copy()
    pushed[: min(PUSH, int(np.ceil(experiment.samples_a_period / 2.0)))] += 0.1 * float(np.std(drive))
    one, other = (_simulated(model, f, experiment, 2)["displacement"][half:] for f in (drive, pushed))
    return float(np.std(one - other)) < FORGOTTEN * float(np.std(one))


def _grown(
    model: Model, entry: ModelTerm, drive: Floats, experiment: Experiment, target: float
) -> tuple[Model, float] | None:
    return grown_to_share(model, entry, drive, experiment.dt, target, experiment.steps(2), secant=experiment.secant)


def _with_own_nonlinearity(
    rng: np.random.Generator, hidden: tuple[str, ...], drive: Floats, experiment: Experiment, quiet: Record
) -> tuple[Model, Record]:
    """Half of the systems have a known nonlinearity of the report's kind from the start."""
    known, base = str(rng.choice(KNOWN)), experiment.system
    if known == "none" or known in hidden:
        return base, quiet
    known_system = _grown(base, free(get(known)), drive, experiment, KNOWN_SHARE)
    if known_system is None:
        return base, quiet
    return known_system[0], _simulated(known_system[0], drive, experiment, 4)


def _with_effects(
    rng: np.random.Generator,
    model: Model,
    hidden: tuple[str, ...],
    quiet: Record,
    drive: Floats,
    experiment: Experiment,
) -> Model | None:
    """The model and the hidden effects, as strong as is drawn; None where that cannot be.

    What comes later changes the motion, and so the share of what came before: that is sized again at the end.
    """
    wanted = {name: (float(rng.uniform(*SHARE)), _drawn(rng, get(name), quiet)) for name in hidden}
    for name in (*hidden, *hidden[:-1]):
        target, entry = wanted[name]
        stronger = _grown(model.without_term(name), entry, drive, experiment, target)
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
        values.append(share * values[-1] if parameter.relative else in_own_unit(share, parameter, scale, omega))
    entry = free(term)
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    sign = -1.0 if term.either_sign and angle > np.pi else 1.0
    shape = (np.cos(angle), np.sin(angle)) if len(term.components) == 2 else (sign,)
    return replace(entry, coefficients=tuple(float(s) for s in shape), parameters=tuple(values))


def in_own_unit(value: float, parameter: ShapeParameter, scale: float, omega: float) -> float:
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
