"""What kind of test a record is, and which parts of it are fitted and judged: the one place where that is decided."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.records.completion import CompletedRecord, complete
from study.records.oversampling import completed_without_spare
from study.records.plan import Plan, make_plan
from study.records.prepared import FORCE, Prepared, prepare_record
from study.records.prescribed import with_prescribed_motion
from study.records.record import MOTIONS, Record, Stretch
from study.records.shared_frequencies import differ, shared
from study.records.stretches import alternating, strung_together, sure, within_the_horizon
from study.support.errors import StudyError, at, expect
from study.support.numbers import percent

Span = tuple[int, int]


@dataclass(frozen=True)
class Layout:
    """What the user says of the parts of a record.

    Attributes
    ----------
    use : tuple of (float, float or None)
        Stretches to use, in seconds of the record's own time; all of it if empty.
    fit, judge : pair of int, optional
        Samples to fit and to judge.
    alternate : bool
        Whether every other block is judged.
    response : str, optional
        The measured motion that free runs are held against.
    cutoff : float, optional
        Frequency in hertz above which a measured acceleration is integrated.
    as_sampled : bool
        Whether all samples are used, though the motion asks for fewer.
    """

    use: tuple[tuple[float, float | None], ...] = ()
    fit: Span | None = None
    judge: Span | None = None
    alternate: bool = False
    response: str | None = None
    cutoff: float | None = None
    as_sampled: bool = False


def laid_out(records: Sequence[Record], layout: Layout, *, prescribed: bool = False, drifts: bool = False) -> Prepared:
    """Records made ready: motions completed, and the parts to fit and to judge settled.

    A single stretch under a force is fitted in its first half and judged in its second. Every other block is judged of
    several stretches, of a free decay, whose second half is quiet, of a prescribed motion, which is often a program of
    amplitudes and frequencies, of a sweep or dwells, whose halves have other frequencies, and where the user says so.

    Parameters
    ----------
    records : sequence of Record
        Of one structure, judged together.
    layout : Layout
        What the user says.
    prescribed : bool
        Whether the motion is prescribed and the force is what a model predicts: it has no inertia.
    drifts : bool
        Whether nothing in the model brings the mass back: its motion is judged over a horizon.

    Raises
    ------
    StudyError
        If ranges overlap or leave the record, the response asked for was not measured, or it cannot be completed.
    """
    response = _response(records[0], layout.response, prescribed)
    explicit = layout.fit is not None or layout.judge is not None
    contradiction = (
        "--use and --fit or --judge A:B exclude each other; expected '--judge every-other-block' beside --use"
    )
    expect(not (explicit and (layout.use or layout.alternate)), contradiction)
    readied = [with_prescribed_motion(r) if prescribed else (r, ()) for r in records]
    records = [r for r, _ in readied]
    free = not prescribed and all(_unforced(r, layout) for r in records)
    several = len(records) > 1 or len(layout.use) > 1
    turns = several or layout.alternate or ((free or prescribed) and not explicit)
    notes, every = [n for _, said in readied for n in said], 1
    if not (turns or layout.use or drifts):
        plan = _plan(records[0], layout, response)
        if explicit or not differ(records[0], plan.fit, plan.judge):
            return _plain(records[0], plan, layout, notes)
        turns = True
        notes.append(_why(records[0], plan))
    completed = [complete(record, layout.cutoff) for record in records]
    if turns and not (layout.use or layout.as_sampled or free or prescribed or drifts):
        shortest = sum(len(record) for record in records) // 2
        completed, every = completed_without_spare(completed, _measured(records), shortest)
    if explicit:
        plan = make_plan(records[0], layout.fit, layout.judge, response)
        fit, judge = [sure(completed[0], *plan.fit)], [sure(completed[0], *plan.judge)]
    else:
        stretches = _stretches(completed, layout)
        if turns:
            fit, judge = alternating(stretches, _seen(response))
            notes.append(_said(fit, judge, len(stretches)))
        else:
            fit, judge = _halves(stretches[0])
    if drifts:
        fit, judge, horizon = _over_a_horizon(fit, judge, _seen(response))
        notes.append(
            f"nothing in the model brings the mass back, so its motion drifts: it is fitted and judged over a horizon "
            f"of {horizon:.3g} s, from {len(fit)} and {len(judge)} states of its own"
        )
    prepared = strung_together(fit, judge, response, completed, notes)
    return replace(prepared, low=layout.cutoff or 0.0, measured=_measured(records), every=every)


def _measured(records: Sequence[Record]) -> tuple[str, ...]:
    return tuple(m for m in MOTIONS if all(m in record for record in records))


def _plan(record: Record, layout: Layout, response: str) -> Plan:
    """Of a single stretch: halves, or the samples that are named."""
    with at(record.name):
        return make_plan(record, layout.fit, layout.judge, response)


def _why(record: Record, plan: Plan) -> str:
    share = percent(shared(record, plan.fit, plan.judge), ".0f")
    return (
        f"the halves of the record share {share} of the force's power at the same frequencies, as those of a sweep or "
        "of dwells do, so that every other block is judged in place of a half (--fit and --judge A:B choose parts)"
    )


def _plain(record: Record, plan: Plan, layout: Layout, notes: list[str]) -> Prepared:
    """A single stretch in two parts."""
    prepared = prepare_record(record, plan, layout.cutoff)
    return replace(prepared, notes=(*notes, *prepared.notes)) if notes else prepared


def _response(record: Record, wanted: str | None, prescribed: bool) -> str:
    with at(record.name):
        measured = [m for m in MOTIONS if m in record]
        if prescribed:
            expect(wanted in (None, FORCE), f"the model has no inertia, so the force is predicted, not the {wanted}")
            return FORCE
        usable = wanted is None or wanted in measured
        expect(usable, f"no {wanted} was measured; expected --response {', '.join(measured)}")
        return wanted or measured[0]


def _seen(response: str) -> str:
    """What shows the period of a motion."""
    return "displacement" if response == FORCE else response


def _unforced(record: Record, layout: Layout) -> bool:
    """Whether no force acts along the stretches that are used."""
    return all(not np.any(record[FORCE][a:b]) for a, b in _samples(record, layout))


def _samples(record: Record, layout: Layout) -> list[Span]:
    """The stretches to use, in samples."""
    spans: list[Span] = []
    for begin, end in layout.use:
        first = round((begin - record.start) / record.dt)
        last = len(record) if end is None else round((end - record.start) / record.dt)
        if not 0 <= first < last <= len(record):
            times = record.start, record.start + record.dt * (len(record) - 1)
            asked = f"--use {begin:g}:{'' if end is None else f'{end:g}'}"
            raise StudyError(
                f"{record.name}: {asked} leaves the record; its times run from {times[0]:g} to {times[1]:g} s"
            )
        spans.append((first, last))
    ordered = sorted(spans)
    for (_, end), (begin, _) in itertools.pairwise(ordered):
        expect(end <= begin, f"{record.name}: two of the stretches to use overlap; expected each sample once")
    return ordered or [(0, len(record))]


def _stretches(completed: Sequence[CompletedRecord], layout: Layout) -> list[Stretch]:
    return [sure(c, *span) for c in completed for span in _samples(c.record, layout)]


def _halves(stretch: Stretch) -> tuple[list[Stretch], list[Stretch]]:
    middle = (stretch.first + stretch.last) // 2
    return [replace(stretch, last=middle)], [replace(stretch, first=middle)]


def _over_a_horizon(
    fit: list[Stretch], judge: list[Stretch], response: str
) -> tuple[list[Stretch], list[Stretch], float]:  # fmt: skip
    (fit, first), (judge, second) = (within_the_horizon(part, response) for part in (fit, judge))
    return fit, judge, 0.5 * (first + second)


def _said(fit: Sequence[Stretch], judge: Sequence[Stretch], stretches: int) -> str:
    length = float(np.mean([len(s) for s in (*fit, *judge)])) * fit[0].source.dt
    of = f" of {stretches} stretches" if stretches > 1 else ""
    return (
        f"every other block{of} is judged: {len(fit)} are fitted and {len(judge)} judged, of {length:.3g} s each on "
        "average, and the free run of either part runs on through the other's"
    )
