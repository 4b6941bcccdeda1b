"""What a structure's unexplained force depends on, and at which place: general shapes of the motion, its past, time.

As for a single coordinate (``diagnose.dependence``): amounts from the first part of the record, what they explain from
the second. A force of each shape at each place passes through the linear approximation of the structure.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import next_fast_len

from study.compare.prediction import Prediction
from study.diagnose.dependence import DEGREE, TAUS, hysteretic, relaxed
from study.equations.linear_part import connections, transfer
from study.equations.place import Place
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import JudgingRun
from study.records.record import MOTIONS, Sensor
from study.records.spectra import stretch_transforms
from study.structure.placed_lines import placed_modulation_lines, placed_residual_lines
from study.support import statistics
from study.support.arrays import Complexes, Floats
from study.support.errors import DivergenceError
from study.support.least_squares import least_squares
from study.support.statistics import Gain
from study.support.thresholds import ALPHA

LONGEST = 8192  # samples of either part that are looked at


@dataclass(frozen=True)
class FamilyGain:
    """What one family of shapes at one place explains, held out."""

    place: Place
    family: str  # ``displacement``, ``velocity``, ``displacement and velocity``, ``past`` or ``time``
    gain: Gain


def explained_by_place(found: Sequence[FamilyGain]) -> dict[frozenset[str], float]:
    """The largest share that any family explains at each place, of those that do so not by chance."""
    shares: dict[frozenset[str], float] = {}
    for item in found:
        if item.gain.p_value * len(found) < ALPHA and item.gain.explained > 0.0:
            shares[item.place.path] = max(shares.get(item.place.path, 0.0), item.gain.explained)
    return shares


def family_gains(fit: FreeRunFit, prediction: Prediction) -> list[FamilyGain]:
    """What each family of shapes at each place explains of what a fitted structure leaves; none if it diverges."""
    if prediction.run is None:
        return []
    model, prepared = fit.model, prediction.prepared
    run = _from_the_fit(prediction.run)
    begin = max(run.first, prepared.plan.judge[0] - LONGEST)
    end = min(prepared.plan.judge[1], prepared.plan.judge[0] + LONGEST)
    split = prepared.plan.judge[0] - begin if begin < prepared.plan.judge[0] else (end - begin) // 2
    ahead = replace(run, prepared=replace(prepared, plan=replace(prepared.plan, judge=(begin, end))))
    try:
        free = ahead.motions([Sensor(c, m) for m in MOTIONS[:2] for c in model.coordinates])
        own, predicted = ahead.derivatives(fit), ahead.motions()
    except DivergenceError:
        return []
    residual = prepared.outputs.stacked(prepared.measured[begin:end] - predicted)
    own_runs = stretch_transforms(prepared.record.runs((begin, end)))
    transforms = replace(own_runs, size=next_fast_len(own_runs.size, real=True))
    paths = transfer(model, prepared.sensors, prepared.dt, transforms.size)
    weights = np.array(prepared.outputs.weights)
    paths = paths * weights[:, None]
    cut, n = split * len(prepared.sensors), len(model.coordinates)
    early = residual[:cut].reshape(split, -1)
    short = transfer(model, prepared.sensors, prepared.dt, split) * weights[:, None]
    steady = placed_residual_lines(early)
    found: list[FamilyGain] = []
    for place in connections(model):
        e = np.array(place.direction(model.coordinates))
        u = free[:, :n] @ e
        families = [*_families(u, free[:, n:] @ e), ("time", _times(u, short @ e, early, steady))]
        for family, shapes in families:
            columns = transforms.passed(paths @ e, [transforms.lines(x) for x in shapes])
            before, after = _held_out(own, columns.reshape(len(residual), -1), residual, cut)
            gain = statistics.gain(before, after, evenly=bool(prepared.record.stretches))
            found.append(FamilyGain(place, family, gain))
    return found


def _from_the_fit(run: JudgingRun) -> JudgingRun:
    """The same with the fitted stretches before the judged ones, which are as loud; of a decay, halves are not."""
    fit, prepared = run.fit, run.prepared
    if not prepared.record.stretches or fit.span != (prepared.plan.fit[0], prepared.plan.judge[0]):
        return run
    states = np.concatenate([np.atleast_2d(fit.initial), np.atleast_2d(run.initial)])
    return replace(run, first=fit.first, initial=states)


def _families(u: Floats, v: Floats) -> Iterator[tuple[str, list[Floats]]]:
    x, y = u / max(float(np.std(u)), 1e-300), v / max(float(np.std(v)), 1e-300)
    yield "displacement", _functions(x)
    yield "velocity", _functions(y)
    yield (
        "displacement and velocity",
        [x * y, x**2 * y, x * y**2, x**3 * y, x * y**3, x**2 * y**2, abs(x) * y, abs(y) * x],
    )
    steps = np.diff(x, prepend=x[0])
    rate = float(np.std(steps) / np.std(y))
    past = [relaxed(steps, float(np.exp(-rate / tau))) for tau in TAUS]
    yield "past", past + [hysteretic(steps, beta) for beta in (0.5, 1.5, 4.0)]


def _times(u: Floats, path: Complexes, early: Floats, steady: Floats) -> list[Floats]:
    """What varies with time at the place: its stiffness, or a force, at the lines that stand out of the first part."""
    turn = 2.0 * np.pi * np.arange(len(u)) / len(early)
    x = u / max(float(np.std(u)), 1e-300)
    shapes: list[Floats] = []
    for line in placed_modulation_lines(u[: len(early)], path, early)[:3]:
        shapes += [x * np.cos(line * turn), x * np.sin(line * turn)]
    for line in steady[:3]:
        shapes += [np.cos(line * turn), np.sin(line * turn)]
    return shapes


def _functions(x: Floats) -> list[Floats]:
    powers = [x**n for n in range(2, DEGREE + 1)]
    return [*powers, np.abs(x), x * np.abs(x), np.sign(x), np.clip(x, -0.5, 0.5), np.clip(x, -1.0, 1.0)]


def _held_out(own: Floats, columns: Floats, residual: Floats, cut: int) -> tuple[Floats, Floats]:
    """The residual of the second part before and after, less what the model's own coefficients could do there."""
    amounts = least_squares(np.hstack([own, columns])[:cut], residual[:cut], 1e-6)[own.shape[1] :]
    late = np.column_stack([residual[cut:], columns[cut:] @ amounts])
    length = np.linalg.norm(own[cut:], axis=0)
    basis = np.linalg.qr(own[cut:] / np.where(length > 0.0, length, 1.0))[0]
    late = late - basis @ (basis.T @ late)
    return late[:, 0], late[:, 0] - late[:, 1]
