"""A force that is read late or early of a prescribed motion: what a diagnosis of a component may take for an effect.

A delay turns some stiffness into damping and some damping into inertia, much as a relaxation does. So where an effect
is missing it is asked whether the force alone, moved in time, would do as much.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from study.compare.prediction import predict
from study.diagnose.held_out import HeldOut, held_out
from study.diagnose.verdict import NOTHING, Diagnosis
from study.faults.accounting import NOT_ASKED
from study.faults.fault import DELAY, Fault
from study.faults.imposed import shifted
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, linearise
from study.identify.time_domain.weighted_fit import noise_left
from study.records.prepared import FORCE, Prepared
from study.support import statistics
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares
from study.support.thresholds import ALPHA, K


def late_force(diagnosis: Diagnosis) -> Fault | None:
    """The delay of the force that explains as much of a component's record as the first candidate; None without any.

    It is mentioned beside that effect and nothing is corrected. It is asked for where faults of the measurement are.
    """
    comparison, rows = diagnosis.comparison, diagnosis.candidates
    asked = comparison.prepared.response == FORCE and NOT_ASKED in comparison.prepared.notes
    if not asked or diagnosis.verdict == NOTHING or not rows:
        return None
    try:
        delay, error, fit, prepared = _moved(comparison.fit, comparison.prepared)
        prediction = predict(fit, prepared)
    except StudyError:
        return None
    gain = statistics.gain(comparison.prediction.residual, prediction.residual)
    held = held_out(fit, prediction, linearise(fit, prepared), prepared)
    if gain.p_value * (len(rows) + 1) >= ALPHA or _behind(held, fit, rows[0].held_out, rows[0].fit):
        return None
    return Fault(DELAY, FORCE, delay, error, "samples", gain.explained, rivals=(rows[0].name,))


def _moved(fit: FreeRunFit, prepared: Prepared) -> tuple[float, float, FreeRunFit, Prepared]:
    """Samples by which the force comes late, the standard error, and the fit to the force without that delay."""
    earlier, late, error, now = _mover(prepared), 0.0, 0.0, prepared
    for _ in range(4):  # steps of Gauss and Newton towards the delay
        jacobian = linearise(fit, now)
        force = now.fitted - fit.residual
        columns = np.column_stack([jacobian, -now.outputs.stacked(_rates(now.outputs.apart(force), now))])
        steps = least_squares(columns, fit.residual)
        covariance = statistics.clustered_covariance(columns, fit.residual - columns @ steps)
        late, error = late + float(steps[-1]), float(np.sqrt(covariance[-1, -1]))
        now = earlier(late)
        fit = fit_part(fit.model, now, fit.held, steps=fit.steps_per_sample)
    return late, error, fit, now


def _rates(values: Floats, prepared: Prepared) -> Floats:
    """Change of channels of the fitting part with the sample, within each stretch, shape (n, channels)."""
    last = prepared.plan.fit[1]
    bounds = [b for b in prepared.record.joints if 0 < b < last]
    return np.concatenate([np.gradient(piece, axis=0) for piece in np.split(values, bounds)])


def _mover(prepared: Prepared) -> Callable[[float], Prepared]:
    """What gives the record with all of its forces moved to earlier times by some samples, each source as a whole."""
    stretches = prepared.record.stretches
    sources = {id(s.source): s.source for s in stretches}

    def moved(late: float) -> Prepared:
        moved_forces: dict[str, Floats] = {}
        for name in prepared.record.forces:
            whole = {key: shifted(source[name], -late) for key, source in sources.items()}
            moved_forces[name] = np.concatenate([whole[id(s.source)][s.first : s.last] for s in stretches])
        return replace(prepared, record=prepared.record.with_channels(moved_forces))

    return moved


def _behind(one: HeldOut, fit: FreeRunFit, other: HeldOut, other_fit: FreeRunFit) -> bool:
    """Whether one explanation leaves more than another, whitened with what the better of both leaves."""
    better = min((fit, other_fit), key=lambda f: f.rms)
    noise = noise_left(better.residual, len(better.outputs))
    first, second = (np.concatenate(held.white(better.outputs, noise)) for held in (one, other))
    count = min(len(first), len(second))
    return statistics.worse(first[:count], second[:count]) >= K
