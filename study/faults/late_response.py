"""A delay that loses the fit: found along the motion, before any free run, and then fitted with the model."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from study.equations.model import Model
from study.faults.adjustable import fault_columns, unit
from study.faults.correction import corrected
from study.faults.fault import DELAY, Fault
from study.faults.leftover import amounts_on_both, leftover
from study.faults.physics import on_all
from study.faults.refinement import Refined, refined
from study.faults.stage import searched_part
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.motion_start import delay_along_the_motion
from study.identify.time_domain.stretch_states import is_poor
from study.records.prepared import Prepared
from study.support.errors import StudyError
from study.support.thresholds import TOLERANCE


def late_response(
    model: Model, prepared: Prepared, fit: FreeRunFit, faults: Sequence[Fault],
    needed: Callable[[Prepared], Prepared],
) -> Refined | None:  # fmt: skip
    """A delay with which a model that had lost the motion follows it; None where it follows no better.

    ``fit`` is the model fitted without a delay to the record that is corrected for ``faults``, ``needed`` gives the
    samples that a fit asks for.
    """
    plain = corrected(prepared, faults)
    if not is_poor(fit, needed(plain).fitted):
        return None
    try:
        late = delay_along_the_motion(fit.model, plain)
        if not abs(late) > 0.0:
            return None
        begin = Fault(DELAY, prepared.response, late, unit=unit(DELAY, ""))
        begun = fit_model(model, needed(corrected(prepared, (*faults, begin))))
        follows = fit.restarts or begun.rms < fit.rms  # segments follow anything, with states of their own
        return _refined(begin, prepared, begun, faults) if follows and not begun.restarts else None
    except StudyError:
        return None


def _refined(begin: Fault, prepared: Prepared, begun: FreeRunFit, faults: Sequence[Fault]) -> Refined | None:
    """The delay with its value and error, as for any fault of one number."""
    look = searched_part(prepared)
    fit = on_all(begun, corrected(look, (*faults, begin)))
    left = leftover(fit, corrected(look, (*faults, begin)))
    if left is None:
        return None
    covariance = amounts_on_both(left, fault_columns(DELAY, left, begin.value))[1]
    error = math.hypot(math.sqrt(max(float(covariance[0, 0]), 0.0)), TOLERANCE * begin.value)
    right = Refined(replace(begin, error=error), left)  # where the search begins may be the very value
    return refined(DELAY, look, faults, left, begin.value) or right
