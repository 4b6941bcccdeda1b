"""Which parts of a record are fitted and judged."""

from dataclasses import dataclass

import numpy as np

from study.records.moving import halves, moving
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
    """Fit the first half and judge the second by default; compare with the first motion that was measured.

    Of a record that rests in one of the halves, those of the stretch that moves (:func:`study.records.moving.halves`).

    Raises
    ------
    StudyError
        If a part leaves the record, is too short, overlaps the other or does not move.
    """
    response = measured or next((c for c in MOTIONS if c in record), None)
    if response is None:
        raise StudyError(f"record {record.name!r} has no displacement, velocity or acceleration")
    given = fit is not None or judge is not None
    half = len(record) // 2
    usual = ((0, half), (half, len(record))) if given or len(record) < 2 * FEWEST else halves(record, response)
    fit, judge = fit or usual[0], judge or usual[1]
    for name, (first, last) in (("fit", fit), ("judge", judge)):
        if not 0 <= first < last <= len(record) or last - first < FEWEST:
            raise StudyError(f"the part to {name}, {first}:{last}, must hold {FEWEST} samples or more of {len(record)}")
        if not np.ptp(record[response][first:last]) > 0.0:
            raise StudyError(_still(record, response, f"the part to {name}, {first}:{last}"))
    if fit[0] < judge[1] and judge[0] < fit[1]:
        raise StudyError(f"the parts to fit {fit[0]}:{fit[1]} and to judge {judge[0]}:{judge[1]} overlap")
    if not np.ptp(record["force"][slice(*fit)]) > 0.0:
        raise StudyError(_still(record, "force", f"the part to fit, {fit[0]}:{fit[1]}"))
    return Plan(response, fit, judge)


def _still(record: Record, channel: str, part: str) -> str:
    first, last = moving(record[channel])
    return (
        f"the {channel} of {record.name!r} does not move in {part}; it moves in samples {first}:{last}, expected parts "
        "there, by --fit A:B and --judge A:B"
    )
