"""Which parts of a record are fitted and judged."""

from dataclasses import dataclass

from study.records.record import MOTIONS, Record
from study.support.errors import StudyError

FEWEST = 64  # samples in a part


@dataclass(frozen=True)
class Plan:
    """Which parts of a record are fitted and judged.

    Attributes
    ----------
    response : str
        The measured motion that free runs are compared with.
    fit, judge : pair of int
        First sample and the one after the last of each part; they do not overlap.
    """

    response: str
    fit: tuple[int, int]
    judge: tuple[int, int]


def make_plan(
    record: Record,
    fit: tuple[int, int] | None = None,
    judge: tuple[int, int] | None = None,
    measured: str | None = None,
) -> Plan:
    """Fit the first half and judge the second by default; compare with the first motion that was measured."""
    half = len(record) // 2
    fit, judge = fit or (0, half), judge or (half, len(record))
    for name, (first, last) in (("fit", fit), ("judge", judge)):
        if not 0 <= first < last <= len(record) or last - first < FEWEST:
            raise StudyError(f"the part to {name}, {first}:{last}, must hold {FEWEST} samples or more of {len(record)}")
    if fit[0] < judge[1] and judge[0] < fit[1]:
        raise StudyError(f"the parts to fit {fit[0]}:{fit[1]} and to judge {judge[0]}:{judge[1]} overlap")
    response = measured or next((c for c in MOTIONS if c in record), None)
    if response is None:
        raise StudyError(f"record {record.name!r} has no displacement, velocity or acceleration")
    return Plan(response, fit, judge)
