"""Faults of the measurement in the light of a diagnosis."""

from collections.abc import Sequence

from study.diagnose.late_force import late_force
from study.diagnose.verdict import MISSING, Diagnosis
from study.faults.accounting import still_seen
from study.faults.fault import Fault


def confirmed(faults: Sequence[Fault], diagnosis: Diagnosis) -> tuple[Fault, ...]:
    """The faults that the record shows beside the effect that is missing as well, if one is.

    With a delay of a component's force, where that does what the first candidate does.
    """
    late = late_force(diagnosis)
    if late is not None:
        return (*faults, late)
    if diagnosis.verdict != MISSING:
        return tuple(faults)
    return still_seen(faults, diagnosis.candidates[0].fit, diagnosis.comparison.prepared)
