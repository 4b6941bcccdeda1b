"""Motions of a decay that a model loses on their way begin anew; a better model may follow them for longer."""

from study.compare.comparison import Comparison, compare
from study.compare.prediction import Prediction
from study.identify.time_domain.stretch_states import is_smooth
from study.records.prepared import Prepared
from study.support.errors import StudyError

LOST = 0.3  # of the rms response: a free run through several blocks that misses so much has lost the motion


def has_lost_its_way(prediction: Prediction) -> bool:
    """Whether a free run has lost the motion: it misses much, and what it leaves looks like a motion, not as noise."""
    return prediction.error > LOST and is_smooth(prediction.residual, len(prediction.views))


def running_on(comparison: Comparison) -> Comparison:
    """The comparison along motions that run on for as long as its model follows them.

    That is how the model is compared by itself: what its predecessor lost is no reason to begin anew.
    """
    for longer in _longer(comparison.prepared):
        try:
            whole = compare(comparison.model, longer)
        except StudyError:
            continue
        if not has_lost_its_way(whole.prediction):
            return whole
    return comparison


def _longer(prepared: Prepared) -> list[Prepared]:
    """The same record with motions that run on for longer, the longest first."""
    longer = prepared.running_on
    return [] if longer is None else [*_longer(longer), longer]
