"""What kind of test a record is, and which parts of it are fitted and judged: the one place where that is decided.

Decays between blows, decays from several heights, parts of a long record that are fitted and judged in turn, pieces of
the motion of a mass without a spring, several records of one structure: all are stretches, strung together to one
prepared record whose first part is fitted and whose second is judged.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.records.completion import CompletedRecord, complete
from study.records.driven_by_motion import with_prescribed_motion
from study.records.plan import (
    SHORTEST_PART,
    Plan,
    Span,
    compared_sensors,
    driven_apart,
    falls_silent,
    make_plan,
    shared,
)
from study.records.prepared import FORCE, Prepared, prepare_record
from study.records.record import MOTIONS, Record, Sensor, Stretch
from study.records.sampling_rate import completed_without_spare
from study.records.states import period
from study.support.errors import StudyError, at, expect
from study.support.numbers import percent
from study.support.thresholds import TOLERANCE

BLOCK_PERIODS = 5.0  # of the motion, at least: its noise is then hardly that of its neighbours; of a short decay fewer
BLOCKS_OF_STRETCH = 24  # at most
HORIZON = 4.0  # periods of its motion over which a mass without a spring is judged ...
PIECES = 4  # ... and in how many each part is cut at least; of a decay, that it lacks no amplitudes of the other
STOPPED = 0.2  # of its size within 1.5 periods: a motion that no damping brought to rest, where as many before ...
OUTRIGHT = 3.0  # ... had taken so many times less


@dataclass(frozen=True)
class Layout:
    """What the user says of the parts of a record."""

    use: tuple[tuple[float, float | None], ...] = ()  # stretches to use, in seconds of the record's time; empty: all
    fit: Span | None = None  # samples to fit ...
    judge: Span | None = None  # ... and to judge
    alternate: bool = False  # whether every other block is judged
    response: str | None = None  # the measured motion that free runs are compared with
    cutoff: float | None = None  # hertz above which a measured acceleration is integrated
    near: float | None = None  # hertz near which the mode lies that is meant, where the record shows several
    highest: float | None = None  # hertz above which nothing is used
    as_sampled: bool = False  # whether all samples are used, though the motion asks for fewer
    horizon: float | None = None  # seconds over which the motion of a mass that nothing brings back is judged

    @property
    def explicit(self) -> bool:
        return self.fit is not None or self.judge is not None

    def settled(self, samples: int) -> "Layout":
        """Where one part alone is named, the other is the longer of what that leaves before and behind it."""

        def other(named: Span | None) -> Span | None:
            return named and max(((named[1], samples), (0, named[0])), key=lambda part: part[1] - part[0])

        return replace(self, fit=self.fit or other(self.judge), judge=self.judge or other(self.fit))


@dataclass(frozen=True)
class KindOfTest:
    """What a model makes of a record."""

    prescribed: bool = False  # it has no inertia: the motion is prescribed, and the force is predicted
    drifts: bool = False  # nothing brings its mass back: the motion is judged over a horizon
    unbroken: bool = False  # it wants long stretches: the first half of each is fitted, the second judged
    anew: float = (
        0.0  # periods after which a free motion begins anew; 0 where it runs on through the other part's blocks
    )
    varies: bool = False  # a coefficient changes along it: each part has to see all of what it changes with


def laid_out(records: Sequence[Record], layout: Layout, kind: KindOfTest | None = None) -> Prepared:
    """Records made ready: motions completed, and the parts to fit and to judge settled.

    A single stretch under a force is fitted in its first half and judged in its second. Every other block is judged of
    several stretches, of a free decay, whose second half is quiet, of a prescribed motion, which is often a program of
    amplitudes and frequencies, of a sweep or dwells, whose halves have other frequencies, where a coefficient of the
    model varies, and where the user says so.

    Parameters
    ----------
    records : sequence of Record
        Of one structure, judged together.
    layout : Layout
        What the user says.
    kind : KindOfTest, optional
        What the model makes of them.
    """
    kind, notes, every = kind or KindOfTest(), list[str](), 1
    _refuse_contradictions(records, layout, kind)
    layout = layout.settled(len(records[0]))
    if kind.prescribed:
        readied = [with_prescribed_motion(record) for record in records]
        records, notes = [r for r, _ in readied], [note for _, said in readied for note in said]
    wanted = FORCE if kind.prescribed else layout.response
    sensors = compared_sensors(records[0], wanted)
    forced = any(np.any(r[f][a:b]) for r in records for a, b in _samples(r, layout) for f in r.forces)
    free = not (kind.prescribed or forced)
    anew = kind.anew if free else 0.0
    several = len(records) > 1 or len(layout.use) > 1
    by_itself = (free or kind.prescribed or kind.varies) and not (layout.explicit or kind.unbroken)
    turns = (several and not kind.unbroken) or layout.alternate or by_itself
    if not (turns or several or layout.use or kind.drifts):
        with at(records[0].name):
            plan = make_plan(records[0], layout.fit, layout.judge, wanted)
        silent = falls_silent(records[0], sensors, plan.fit, plan.judge)
        turns = not (layout.explicit or kind.unbroken) and (silent or driven_apart(records[0], plan.fit, plan.judge))
        if not (turns or anew):
            prepared = prepare_record(records[0], plan, layout.cutoff)
            return replace(prepared, sensors=sensors, notes=(*notes, *prepared.notes))
        notes += [_why(records[0], plan, silent=silent)] if turns else []
    completed = [complete(record, layout.cutoff) for record in records]
    if (turns or several) and not (layout.use or layout.as_sampled or free or kind.prescribed or kind.drifts):
        completed, every = completed_without_spare(completed, sum(len(record) for record in records) // 2)
    if layout.explicit:
        plan = make_plan(records[0], layout.fit, layout.judge, wanted)
        fit, judge = [sure(completed[0], *plan.fit)], [sure(completed[0], *plan.judge)]
    else:
        stretches = [sure(c, *span) for c in completed for span in _samples(c.record, layout)]
        if free and not layout.use:
            unbroken = [_unbroken(stretch, sensors) for stretch in stretches]
            stretches, notes = [s for s, _ in unbroken], [*notes, *(said for _, said in unbroken if said)]
        stretches = [_until_rest(s, sensors) for s in stretches] if turns and anew else stretches
        halves = [
            (replace(s, last=(s.first + s.last) // 2), replace(s, first=(s.first + s.last) // 2)) for s in stretches
        ]
        fit, judge = [first for first, _ in halves], [second for _, second in halves]
        if turns:
            fit, judge = alternating(stretches, sensors, anew, fades=free and not anew)
            notes.append(_said(fit, judge, len(stretches), anew=bool(anew)))
        elif len(stretches) > 1:
            notes.append(f"of each of {len(stretches)} stretches the first half is fitted and the second judged")
    if kind.drifts:
        (fit, first), (judge, second) = (within_the_horizon(part, sensors, layout.horizon) for part in (fit, judge))
        notes.append(
            f"nothing in the model brings the mass back, so its motion drifts: it is fitted in {len(fit)} and judged "
            f"in {len(judge)} pieces of {0.5 * (first + second):.3g} s, each from its own state"
        )
    prepared = strung_together(fit, judge, sensors, completed, notes)
    return replace(prepared, low=layout.cutoff or 0.0, every=every)


def _refuse_contradictions(records: Sequence[Record], layout: Layout, kind: KindOfTest) -> None:
    """What the user says of the parts has to go together, and with the model."""
    if kind.prescribed:
        wanted = layout.response
        with at(records[0].name):
            expect(wanted in (None, FORCE), f"the model has no inertia, so the force is predicted, not the {wanted}")
    expect(
        not (layout.explicit and (layout.use or layout.alternate)),
        "--use and --fit or --judge A:B exclude each other; expected '--judge every-other-block' beside --use",
    )
    expect(
        not (layout.explicit and len(records) > 1),
        f"{', '.join(record.name for record in records)}: --fit and --judge A:B name samples of one record; expected "
        "'--judge every-other-block' of several, or --use",
    )
    expect(
        layout.horizon is None or kind.drifts,
        "--horizon is for a mass that nothing in the model brings back; expected no horizon of a motion about a rest",
    )
    expect(
        not (kind.unbroken and layout.alternate),
        "the linear part of the model is a sum of modes, which are found in long stretches; expected --fit A:B and "
        "--judge A:B, or several records, whose first halves are fitted, instead of blocks",
    )
    for record in records if kind.prescribed else ():
        expect(
            not record.unforced,
            f"{record.name}: no force was measured, which a model without inertia predicts; expected a column of the "
            "force, or a model with inertia",
        )


def _why(record: Record, plan: Plan, *, silent: bool) -> str:
    if silent:
        because = "one half of the record is nearly at rest, so that what is judged there would be noise"
    else:
        share = percent(shared(record, plan.fit, plan.judge), ".0f")
        because = (
            f"the halves of the record share {share} of the force's power at the same frequencies, as those of a sweep "
            "or of dwells do"
        )
    return f"{because}: every other block is judged in place of a half (--fit and --judge A:B choose parts)"


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


def sure(completed: CompletedRecord, first: int, last: int) -> Stretch:
    """A stretch of a completed record without the samples at its ends that derivatives leave uncertain."""
    edge = completed.edge
    low, high = max(first, edge), min(last, len(completed.record) - edge)
    expect(
        high - low >= SHORTEST_PART,
        f"{completed.record.name}: samples {first} to {last} leave {max(high - low, 0)} that are sure; expected "
        f"{SHORTEST_PART} or more",
    )
    return Stretch(completed.record, low, high)


def _until_rest(stretch: Stretch, sensors: Sequence[Sensor]) -> Stretch:
    """A stretch up to where the motion has died away to practically nothing: rest tells nothing of a structure."""
    values = stretch.source.columns(sensors, (stretch.first, stretch.last))
    away = np.abs(values - np.mean(values[-SHORTEST_PART // 2 :], axis=0))
    loud = np.flatnonzero(np.any(away > TOLERANCE * np.max(away, axis=0), axis=1))
    last = int(loud[-1]) + 1 if len(loud) else 0
    return replace(stretch, last=stretch.first + min(max(last, 2 * SHORTEST_PART), len(stretch)))


def _unbroken(stretch: Stretch, sensors: Sequence[Sensor]) -> tuple[Stretch, str]:
    """A stretch of a free decay up to where the motion breaks off, touched or stopped, and a sentence if it does.

    Nothing that damps a motion takes most of it within a period or two and had taken little in those before: dry
    friction takes the same in every period, all else less and less.
    """
    values = stretch.source.columns(sensors, (stretch.first, stretch.last))
    values = (values - np.mean(values, axis=0)) / np.std(values, axis=0)
    step = max(int(0.5 * period_of(stretch, sensors)), 1)
    starts = range(0, len(values) - 2 * step + 1, step)
    sizes = np.array([np.max(np.std(values[a : a + 2 * step], axis=0)) for a in starts])
    for i in range(3, len(sizes) - 3):  # what breaks off does so within one of these, which overlap by half
        stops = np.max(sizes[i + 3 :]) < STOPPED * sizes[i]
        if stops and sizes[i] - sizes[i + 3] > OUTRIGHT * max(sizes[i - 3] - sizes[i], 0.0):
            alive = np.max(np.abs(values - np.mean(values[-step:], axis=0)), axis=1) > 0.5 * sizes[i]
            last = stretch.first + int(np.flatnonzero(alive)[-1]) + 1
            at_time = stretch.source.start + last * stretch.source.dt
            return replace(stretch, last=last), (
                f"{stretch.source.name}: the motion breaks off at {at_time:.4g} s, sooner than damping could end it; "
                "what follows is left out (--use S:T chooses otherwise)"
            )
    return stretch, ""


def alternating(
    stretches: Sequence[Stretch], sensors: Sequence[Sensor], anew: float = 0.0, *, fades: bool = False
) -> tuple[list[Stretch], list[Stretch]]:
    """Every other block of the stretches to be fitted, and those between them to be judged.

    Of a motion that ``fades`` there are enough of them for either part to have all amplitudes.

    Each part has one motion in every stretch, that runs on through the blocks of the other; or it begins ``anew`` in
    each block, of so many periods. Where a stretch before began with a block that is fitted, the next begins with one
    that is judged, so that neither has all the loud ones.
    """
    fit, judge = list[Stretch](), list[Stretch]()
    least = max(2, -(-2 * PIECES // len(stretches))) if fades else 2
    for number, stretch in enumerate(stretches):
        count = max(int(len(stretch) / ((anew or BLOCK_PERIODS) * period_of(stretch, sensors))), least)
        count = max(min(count, len(stretch) // SHORTEST_PART, BLOCKS_OF_STRETCH), 2)
        for place, block in enumerate(cut(stretch, count)):
            block = replace(block, continues=place > 1 and not anew)  # the motion runs on through the blocks between
            (fit if (number + place) % 2 == 0 else judge).append(block)
    return fit, judge


def _said(fit: Sequence[Stretch], judge: Sequence[Stretch], stretches: int, *, anew: bool) -> str:
    length = float(np.mean([len(s) for s in (*fit, *judge)])) * fit[0].source.dt
    of = f" of {stretches} stretches" if stretches > 1 else ""
    goes_on = "the free run of either part runs on through the other's"
    begins = "the free run starts again in each, from a fitted state"
    return (
        f"every other block{of} is judged: {len(fit)} fitted and {len(judge)} judged, of {length:.3g} s each on "
        f"average, and {begins if anew else goes_on}"
    )


def period_of(stretch: Stretch, sensors: Sequence[Sensor]) -> float:
    """Samples in a period of the slowest motion; of the displacement where that is prescribed."""
    seen = [Sensor(s.coordinate, MOTIONS[0]) if s.motion == FORCE else s for s in sensors]
    return max(period(stretch.source[s][stretch.first : stretch.last]) for s in seen)


def cut(stretch: Stretch, count: int) -> list[Stretch]:
    """A stretch in so many parts of about equal length."""
    bounds = np.linspace(stretch.first, stretch.last, count + 1).round().astype(int).tolist()
    return [replace(stretch, first=a, last=b) for a, b in itertools.pairwise(bounds)]


def within_the_horizon(
    stretches: Sequence[Stretch], sensors: Sequence[Sensor], seconds: float | None = None
) -> tuple[list[Stretch], float]:
    """Stretches in pieces of so many seconds, or some periods of the motion, and their mean length in seconds."""
    pieces = list[Stretch]()
    for stretch in stretches:
        if seconds is None:
            wanted = max(len(stretch) / (HORIZON * period_of(stretch, sensors)), -(-PIECES // len(stretches)))
        else:
            wanted = len(stretch) * stretch.source.dt / seconds
        count = min(max(round(wanted), 1), max(len(stretch) // SHORTEST_PART, 1))
        pieces += cut(stretch, count)
    return pieces, float(np.mean([len(p) for p in pieces])) * stretches[0].source.dt


def strung_together(
    fit: Sequence[Stretch], judge: Sequence[Stretch], sensors: Sequence[Sensor], completed: Sequence[CompletedRecord],
    notes: Sequence[str] = (),
) -> Prepared:  # fmt: skip
    """One prepared record of the stretches to fit and those to judge; ``completed`` are the records they come from."""
    first = completed[0].record
    for other in (c.record for c in completed[1:]):
        off = abs(other.dt / first.dt - 1.0)
        one, two = f"{1.0 / first.dt:.8g} Hz", f"{1.0 / other.dt:.8g} Hz"
        rates = f"the record {first.name} is sampled at {one} and {other.name} at {two}"
        again = "expected the same rate for records that are judged together: resample one of them"
        # an inertia is off by twice as much as the clock: practically nothing
        expect(off <= 0.5 * TOLERANCE, f"{rates}, {percent(off)} apart; {again}")
        if off > 1e-6:
            notes = [
                *notes,
                f"{rates}, {1e6 * off:.2g} ppm apart as two clocks are: both are taken as {1.0 / first.dt:.8g} Hz "
                "(--fs says otherwise)",
            ]
        for channel in (*first.forces, *map(str, first.sensors)):
            one, two = first.units.get(channel, ""), other.units.get(channel, "")
            differ = f"{channel} is in {one} in {first.name} and in {two} in {other.name}"
            expect(one == two, f"{differ}; expected the same unit in records that are judged together")
    stretches = (*fit, *judge)
    common = [c for c in first.channels if all(c in s.source for s in stretches)]
    channels = {c: np.concatenate([s.source[c][s.first : s.last] for s in stretches]) for c in common}
    split, total = sum(map(len, fit)), sum(map(len, stretches))
    for part, samples in (("fit", split), ("judge", total - split)):
        expect(
            samples >= SHORTEST_PART,
            f"{first.name}: {samples} samples are left to {part}; expected {SHORTEST_PART} or more",
        )
    record = Record(
        first.dt, channels, first.units, first.name, first.start, stretches=stretches, coordinates=first.coordinates,
        forces=first.forces, computed=first.computed.union(*(c.record.computed for c in completed)),
    )  # fmt: skip
    band = max(c.band[0] for c in completed), min(c.band[1] for c in completed)
    said = tuple(dict.fromkeys((*(n for c in completed for n in c.notes), *notes)))
    plan = Plan(sensors[0].motion, (0, split), (split, total))
    return Prepared(record, plan, band, 0, said, sensors=tuple(sensors))


def in_turns(prepared: Prepared) -> Prepared:
    """A single stretch whose every other block is fitted and judged, in place of one part after the other.

    Raises
    ------
    StudyError
        If it is too short for that.
    """
    record, (fit, judge) = prepared.record, (prepared.plan.fit, prepared.plan.judge)
    completed = CompletedRecord(record, prepared.band, prepared.edge, prepared.notes)
    sensors = prepared.outputs.sensors
    parts = alternating([sure(completed, min(fit[0], judge[0]), max(fit[1], judge[1]))], sensors)
    strung = strung_together(*parts, sensors, [completed], [_said(*parts, 1, anew=False)])
    lost = prepared.lost
    if lost is not None:
        lost = np.concatenate([lost[s.first : s.last] for s in strung.record.stretches])
    return replace(strung, low=prepared.low, lost=lost, every=prepared.every)


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


def runs_on(prepared: Prepared) -> bool:
    """Whether a motion runs on between stretches of the record."""
    return any(s.continues for s in prepared.record.stretches)


def apart(prepared: Prepared) -> Iterator[Prepared]:
    """The same record with motions that begin anew, from a state of its own each: for a model that loses the motion.

    First in every stretch, then every few periods.
    """
    stretches = [replace(s, continues=False) for s in prepared.record.stretches]
    whole = _begun_anew(prepared, stretches)
    yield whole
    joined = Stretch(prepared.record, 0, len(prepared.record))
    samples = BLOCK_PERIODS * period_of(joined, prepared.sensors)
    pieces = [p for s in stretches for p in cut(s, max(round(len(s) / max(samples, SHORTEST_PART)), 1))]
    if len(pieces) > len(stretches):
        yield replace(_begun_anew(prepared, pieces), running_on=whole)


def _begun_anew(prepared: Prepared, pieces: Sequence[Stretch]) -> Prepared:
    said = (
        "the free run of this model loses the motion on its way, so it is restarted every "
        f"{len(prepared.record) / len(pieces) * prepared.dt:.3g} s, from a fitted state"
    )
    record = replace(prepared.record, stretches=tuple(pieces))
    return replace(prepared, record=record, notes=(*prepared.notes, said), running_on=prepared)
