"""Several stretches as one record: each goes on without a break and begins from a state of its own.

Decays between blows, decays from several heights, parts of a long record that are fitted and judged in turn, pieces of
the motion of a mass without a spring, several records of one structure: all are stretches, strung together to one
prepared record whose first part is fitted and whose second is judged. A free run begins anew at each of them.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from study.records.completion import CompletedRecord
from study.records.plan import FEWEST, Plan
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record, Stretch
from study.records.states import period
from study.support.errors import StudyError, expect

PERIODS = 5.0  # of the motion in a block, at least: its noise is then hardly that of its neighbours (docs/tool.md)
BLOCKS = 24  # of a stretch, at most
HORIZON = 4.0  # periods of its motion over which a mass without a spring is judged ...
PIECES = 4  # ... and in how many pieces each part is cut at least


def strung_together(
    fit: Sequence[Stretch], judge: Sequence[Stretch], response: str, completed: Sequence[CompletedRecord],
    notes: Sequence[str] = (),
) -> Prepared:  # fmt: skip
    """One prepared record of the stretches to fit and those to judge; ``completed`` are the records they come from.

    Raises
    ------
    StudyError
        If the records differ in sampling, channels' units or what was measured, or a part is too short.
    """
    first = completed[0].record
    for other in completed[1:]:
        _refuse_different(first, other.record)
    stretches = (*fit, *judge)
    shared = [c for c in first.channels if all(c in s.source for s in stretches)]
    channels = {c: np.concatenate([s.source[c][s.first : s.last] for s in stretches]) for c in shared}
    split, total = sum(map(len, fit)), sum(map(len, stretches))
    for part, samples in (("fit", split), ("judge", total - split)):
        expect(samples >= FEWEST, f"{first.name}: {samples} samples are left to {part}; expected {FEWEST} or more")
    record = Record(first.dt, channels, first.units, first.name, first.start, None, tuple(stretches))
    band = max(c.band[0] for c in completed), min(c.band[1] for c in completed)
    said = tuple(dict.fromkeys((*(n for c in completed for n in c.notes), *notes)))
    return Prepared(record, Plan(response, (0, split), (split, total)), band, 0, said)


def _refuse_different(first: Record, other: Record) -> None:
    if abs(other.dt / first.dt - 1.0) > 1e-6:
        raise StudyError(
            f"{first.name} is sampled at {1.0 / first.dt:g} Hz and {other.name} at {1.0 / other.dt:g} Hz; expected the "
            "same for records that are judged together"
        )
    for channel in ("force", *MOTIONS):
        one, two = first.units.get(channel, ""), other.units.get(channel, "")
        expect(
            one == two,
            f"{channel} is in {one} in {first.name} and in {two} in {other.name}; expected the same unit in records "
            "that are judged together",
        )


def records_judged(prepared: Prepared) -> tuple[Prepared, ...]:
    """A prepared record of several records, each time with the samples of one of them to judge; none of one record.

    What is fitted stays the same. Each is called as the record whose samples are judged.
    """
    record, (begin, end) = prepared.record, prepared.plan.judge
    bounds = (0, *record.joints, len(record))
    judged = [(s.source, a, b) for s, (a, b) in zip(record.stretches, itertools.pairwise(bounds), strict=False)
              if begin <= a and b <= end]  # fmt: skip
    runs = [list(stretches) for _, stretches in itertools.groupby(judged, key=lambda stretch: id(stretch[0]))]
    if len(runs) < 2:
        return ()
    return tuple(
        replace(
            prepared, record=replace(record, name=run[0][0].name),
            plan=replace(prepared.plan, judge=(run[0][1], run[-1][2])),
        )
        for run in runs
    )  # fmt: skip


def sure(completed: CompletedRecord, first: int, last: int) -> Stretch:
    """A stretch of a completed record without the samples at its ends that derivatives leave uncertain."""
    edge = completed.edge
    low, high = max(first, edge), min(last, len(completed.record) - edge)
    expect(
        high - low >= FEWEST,
        f"{completed.record.name}: samples {first} to {last} leave {max(high - low, 0)} that are sure; expected "
        f"{FEWEST} or more",
    )
    return Stretch(completed.record, low, high)


def alternating(stretches: Sequence[Stretch], response: str) -> tuple[list[Stretch], list[Stretch]]:
    """Every other block of the stretches to be fitted, and those between them to be judged.

    Each part has one motion in every stretch, that runs on through the blocks of the other.
    Where a stretch before began with a block that is fitted, the next begins with one that is judged, so that neither
    has all the loud ones.
    """
    fit, judge = list[Stretch](), list[Stretch]()
    for number, stretch in enumerate(stretches):
        for place, block in enumerate(_blocks(stretch, response)):
            block = replace(block, continues=place > 1)  # the motion runs on through the blocks between
            (fit if (number + place) % 2 == 0 else judge).append(block)
    return fit, judge


def runs_on(prepared: Prepared) -> bool:
    """Whether a motion runs on between stretches of the record."""
    return any(s.continues for s in prepared.record.stretches)


def apart(prepared: Prepared) -> Iterator[Prepared]:
    """The same record with motions that begin anew, from a state of its own each: for a model that loses the motion.

    First in every stretch, then every few periods.
    """
    whole = _begun_anew(prepared, [replace(s, continues=False) for s in prepared.record.stretches])
    yield whole
    response = MOTIONS[0] if prepared.response == FORCE else prepared.response
    samples = PERIODS * period(prepared.record[response])
    pieces: list[Stretch] = []
    for stretch in prepared.record.stretches:
        pieces += cut(replace(stretch, continues=False), max(round(len(stretch) / max(samples, FEWEST)), 1))
    if len(pieces) > len(prepared.record.stretches):
        yield replace(_begun_anew(prepared, pieces), running_on=whole)


def _begun_anew(prepared: Prepared, pieces: Sequence[Stretch]) -> Prepared:
    said = (
        f"the free run of this model loses the motion on its way, so it begins anew every "
        f"{len(prepared.record) / len(pieces) * prepared.dt:.3g} s, from a state of its own"
    )
    record = replace(prepared.record, stretches=tuple(pieces))
    return replace(prepared, record=record, notes=(*prepared.notes, said), running_on=prepared)


def _blocks(stretch: Stretch, response: str) -> list[Stretch]:
    most = int(len(stretch) / max(PERIODS * period_of(stretch, response), FEWEST))
    return cut(stretch, int(np.clip(most, 2, BLOCKS)))


def period_of(stretch: Stretch, response: str) -> float:
    """Samples in a period of the motion."""
    return period(stretch.source[response][stretch.first : stretch.last])


def cut(stretch: Stretch, count: int) -> list[Stretch]:
    """A stretch in so many parts of about equal length."""
    bounds = np.linspace(stretch.first, stretch.last, count + 1).round().astype(int).tolist()
    return [replace(stretch, first=a, last=b) for a, b in itertools.pairwise(bounds)]


def within_the_horizon(stretches: Sequence[Stretch], response: str) -> tuple[list[Stretch], float]:
    """Stretches in pieces of some periods of the motion, and their mean length in seconds."""
    pieces = list[Stretch]()
    for stretch in stretches:
        wanted = len(stretch) / (HORIZON * period_of(stretch, response))
        count = min(max(round(wanted), -(-PIECES // len(stretches))), max(len(stretch) // FEWEST, 1))
        pieces += cut(stretch, count)
    return pieces, float(np.mean([len(p) for p in pieces])) * stretches[0].source.dt
