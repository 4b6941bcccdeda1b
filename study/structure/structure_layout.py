"""Which parts of a record of a structure are fitted and judged: halves, or stretches that begin anew in turn.

A free decay is known by its state alone. One free run of many periods turns the smallest wrong stiffness into a motion
out of step, and says nothing of the force any more; so its motion begins anew every few periods, from a state of its
own, and every other stretch is judged.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.equations.model import Model
from study.records.plan import FEWEST
from study.records.record import Record, Stretch
from study.records.states import period
from study.records.stretches import BLOCKS, cut
from study.structure.prepared_structure import PreparedStructure, prepare_structure
from study.support.errors import expect
from study.support.thresholds import TOLERANCE

PERIODS = 1.5  # of the motion in a block: over more a wrong stiffness takes it out of step (docs/structures.md)
Span = tuple[int, int]
Use = tuple[tuple[float, float | None], ...]


@dataclass(frozen=True)
class Parts:
    """What a user says of the parts of a record of a structure.

    Attributes
    ----------
    fit, judge : pair of int, optional
        Samples to fit and to judge.
    use : tuple of (float, float or None)
        Stretches to use, in seconds of the record's own time; all of it if empty.
    alternate : bool
        Whether every other block is judged, as it is of a free decay and of several stretches.
    cutoff : float, optional
        Frequency in hertz above which accelerations are integrated.
    """

    fit: Span | None = None
    judge: Span | None = None
    use: Use = ()
    alternate: bool = False
    cutoff: float | None = None


def lay_out(record: Record, model: Model, parts: Parts) -> PreparedStructure:
    """A record of a structure made ready, in stretches that begin anew where it is a free decay or the user says so.

    Raises
    ------
    StudyError
        As :func:`study.structure.prepared_structure.prepare_structure`, or if what is asked for contradicts itself or
        the record is too short.
    """
    explicit = parts.fit is not None or parts.judge is not None
    asked = bool(parts.use) or parts.alternate
    contradiction = (
        "--use and --fit or --judge A:B exclude each other; expected '--judge every-other-block' beside --use"
    )
    expect(not (explicit and asked), contradiction)
    if model.measured:
        sentence = f"{model.name!r} has 'linear: measured': the frequency response functions want one long stretch"
        expect(not asked, f"{sentence}; expected --fit A:B and --judge A:B instead of stretches")
    free = not model.forces and not model.measured
    if not (asked or free):
        return prepare_structure(record, model, parts.fit, parts.judge, parts.cutoff)
    plain = prepare_structure(record, model, parts.fit, parts.judge, parts.cutoff)
    source = plain.record
    if explicit:
        fit, judge = ([_sure(source, span, plain.edge)] for span in (plain.fit, plain.judge))
        return _strung(plain, fit, judge, ())
    used = [_sure(source, span, plain.edge) for span in _samples(record, parts.use)]
    if len(used) == 1 and not free and not parts.alternate:
        halves = cut(used[0], 2)
        return _strung(plain, halves[:1], halves[1:], ())
    fit, judge = _in_turn(used, plain)
    seconds = float(np.mean([len(s) for s in (*fit, *judge)])) * record.dt
    said = (
        f"every other block is judged: {len(fit)} are fitted and {len(judge)} judged, of {seconds:.3g} s each on "
        "average, and the motion begins anew in each, from a state of its own"
    )
    return _strung(plain, fit, judge, (said,))


def _samples(record: Record, use: Use) -> list[Span]:
    """The stretches to use, in samples, in the order of time."""
    if not use:
        return [(0, len(record))]
    spans: list[Span] = []
    for begin, end in sorted(use, key=lambda s: s[0]):
        last = len(record) if end is None else round((end - record.start) / record.dt)
        first = round((begin - record.start) / record.dt)
        inside = 0 <= first < last <= len(record)
        until = record.start + len(record) * record.dt
        named = f"{begin:g}:{'' if end is None else f'{end:g}'}"
        expected = f"expected times from {record.start:g} s to {until:g} s"
        expect(inside, f"{record.name}: the stretch {named} s does not lie in it; {expected}")
        expect(not spans or spans[-1][1] <= first, f"{record.name}: the stretches to use overlap at {begin:g} s")
        spans.append((first, last))
    return spans


def _sure(source: Record, span: Span, edge: int) -> Stretch:
    """A stretch without the samples at the ends of the record that derivatives leave uncertain."""
    first, last = max(span[0], edge), min(span[1], len(source) - edge)
    expect(
        last - first >= FEWEST,
        f"{source.name}: samples {span[0]} to {span[1]} leave {max(last - first, 0)} that are sure; expected {FEWEST} "
        "or more",
    )
    return Stretch(source, first, last)


def _in_turn(used: Sequence[Stretch], plain: PreparedStructure) -> tuple[list[Stretch], list[Stretch]]:
    """Blocks of the stretches to fit, and those between them to judge; each begins anew."""
    fit, judge = list[Stretch](), list[Stretch]()
    for number, whole in enumerate(used):
        stretch = _moving(whole, plain)
        samples = max(period(plain.measured[stretch.first : stretch.last, i]) for i in range(len(plain.sensors)))
        count = int(np.clip(int(len(stretch) / max(PERIODS * samples, FEWEST)), 2, BLOCKS))
        for place, block in enumerate(cut(stretch, count)):
            (fit if (number + place) % 2 == 0 else judge).append(block)
    return fit, judge


def _moving(stretch: Stretch, plain: PreparedStructure) -> Stretch:
    """A stretch up to where the motion has died away to practically nothing: rest tells nothing of a structure."""
    values = plain.measured[stretch.first : stretch.last]
    away = np.abs(values - np.mean(values[-FEWEST // 2 :], axis=0))
    loud = np.flatnonzero(np.any(away > TOLERANCE * np.max(away, axis=0), axis=1))
    last = int(loud[-1]) + 1 if len(loud) else 0
    return replace(stretch, last=stretch.first + min(max(last, 2 * FEWEST), len(stretch)))


def _strung(
    plain: PreparedStructure, fit: Sequence[Stretch], judge: Sequence[Stretch], notes: tuple[str, ...]
) -> PreparedStructure:
    """The prepared record of the stretches to fit, then of those to judge."""
    record, stretches = plain.record, (*fit, *judge)
    rows = np.concatenate([np.arange(s.first, s.last) for s in stretches])
    split = sum(map(len, fit))
    channels = {name: values[rows] for name, values in record.channels.items()}
    strung = replace(record, channels=channels, stretches=stretches)
    return replace(plain, record=strung, fit=(0, split), judge=(split, len(rows)), notes=(*plain.notes, *notes))
