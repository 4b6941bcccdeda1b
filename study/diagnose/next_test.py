"""Which test next: the one that decides between models that a record cannot tell apart.

All designs within the limits are compared by what each separates by sensitivities (``separation``). The best is then
rehearsed: rivals are simulated in it with noise, each time with coefficients that this record allows, and all are
fitted to this record and the test together, and compared, as a diagnosis of both does it. The promise is that of the
rehearsals.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice

import numpy as np
from scipy.special import ndtr

from study.compare.prediction import predict
from study.diagnose.designs import LET_GO, Design, Limits, PresentTest
from study.diagnose.held_out import held_out
from study.diagnose.ranked import Ranked
from study.diagnose.separation import Rivals, allowed, own_limits, respond, rivals_of, shorter_designs
from study.diagnose.verdict import Diagnosis
from study.equations.model import free
from study.identify.time_domain.fit_model import with_term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, linearise
from study.identify.time_domain.settling import better_fit
from study.identify.time_domain.shape_search import baseline
from study.identify.time_domain.weighted_fit import noise_left
from study.records.interpolation import between_samples
from study.records.outputs import Noise
from study.records.prepared import Prepared
from study.records.record import MOTIONS, OF_THE_GROUND, Record, Sensor
from study.records.record_layout import Layout
from study.support import statistics
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.thresholds import K
from study.way_in.compare_records import made_ready

Doing = Callable[[str, int], None]  # called with what is done next, and how many steps are still to come
DECIDES = 0.95  # probability with which a test is to decide
WORTH = 0.3  # ... by sensitivities, from which on a test is worth a rehearsal


@dataclass(frozen=True, eq=False)
class Choice:
    """A test, what it separates, and how sure that is."""

    design: Design
    sensor: Sensor | None  # one that the test needs beside those of the record
    pairs: Floats  # probability that each pair of rivals is told apart, the one of the row being true, shape (r, r)
    alone: Floats  # probability that each rival stands alone at the end, if it is true, shape (r,)
    rehearsed: int = 0  # times that it was simulated; none: by sensitivities alone

    @property
    def promise(self) -> float:
        """Probability that the true rival stands alone at the end; any may be the true one."""
        return float(np.mean(self.alone))

    @property
    def merit(self) -> tuple[float, float]:
        """By which tests are compared: of those that promise alike the one that tells more pairs."""
        return round(self.promise, 2), float(np.mean(self.pairs))


@dataclass(frozen=True, eq=False)
class NextTest:
    """Which test decides between rivals."""

    rivals: Rivals
    limits: Limits
    choice: Choice
    again: Choice | None  # the same test as this record's; None where even that breaks the limits
    asked: int  # how many tests were compared


def tied_rows(diagnosis: Diagnosis, most: int = 6) -> tuple[Ranked, ...]:
    """The answer of a diagnosis and those that the record cannot tell from it, the first of them.

    Raises
    ------
    StudyError
        If there is no tie.
    """
    name = diagnosis.comparison.record.name
    expect(
        diagnosis.answer is not None and len(diagnosis.sets) > 1,
        f"{name}: the verdict is {diagnosis.verdict.replace('_', ' ')}, and nothing is tied with another; expected a "
        "record whose diagnosis ends in a tie, or --precision KEY=PERCENT",
    )
    return diagnosis.sets[:most]


def next_test(
    rivals: Rivals,
    limits: Limits,
    *,
    sensors: Sequence[str] = (),
    rehearsals: int = 3,
    progress: Doing | None = None,
) -> NextTest:
    """The cheapest test within limits that decides between rivals with ``DECIDES``, or the one that does so best.

    Cheap is what needs no further sensor, then no other rig, then what is short, then what is quiet. Up to three tests
    are rehearsed, so many times with each rival true: the cheapest first, then one that is dearer, then the surest. A
    repetition of the record's own test is rehearsed once.

    ``sensors`` names those that may be added, as ``right displacement``; any if left out.

    Raises
    ------
    StudyError
        If the limits allow no test, or there is no such sensor.
    """
    fits, present, extra = rivals.fits, rivals.present, further_sensors(rivals, sensors)
    if progress:
        progress("asking how loud tests may be", len(present.kinds))
    found = _screened(rivals, [(design, None) for design in allowed(fits, present, limits)], progress)
    again = next((c for c in found if c.design.kind == present.kinds[0][0] and c.design.level == 1.0), None)
    asked = len(found)
    found.sort(key=lambda choice: choice.merit, reverse=True)
    good = [choice for choice in found if choice.promise >= DECIDES]
    if good:
        tried = [(d, None) for one in good for d in shorter_designs(fits, present, limits, one.design)]
        asked += len(tried)
        shorter = [choice for choice in _screened(rivals, tried, progress) if choice.promise >= DECIDES]
        listed = sorted([*good, *shorter], key=lambda choice: choice.design.effort)
        heard = list(dict.fromkeys([listed[0], listed[len(listed) // 2], found[0]]))
    else:
        # what these sensors do not see at all says nothing of which test others would see: the same signal is asked too
        like_this = (choice for choice in found if choice.design.kind == present.kinds[0][0])
        asked_with = list(dict.fromkeys([*found[:4], *islice(like_this, 2)]))
        further = [(one.design, sensor) for one in asked_with for sensor in extra]
        asked += len(further)
        every = sorted([*found, *_screened(rivals, further, progress)], key=lambda c: c.merit, reverse=True)
        heard = list(islice(_different(every), 3))
    best = heard[0] if rehearsals or not good else found[0]  # without a rehearsal the surest
    if rehearsals and best.promise >= WORTH:
        tested = dict[Choice, Choice]()
        for choice in heard:
            tested[choice] = rehearsed(rivals, choice, rehearsals, progress)
            if tested[choice].promise >= DECIDES:
                break
        best = max(tested.values(), key=lambda choice: choice.merit)
        if again and again.promise >= WORTH:
            again = tested.get(again) or rehearsed(rivals, again, 1, progress)
    return NextTest(rivals, limits, best, again, asked)


def _screened(rivals: Rivals, tests: Sequence[tuple[Design, Sensor | None]], progress: Doing | None) -> list[Choice]:
    """What tests separate by the rivals' sensitivities, but those in which one of them does not stay finite."""
    found = list[Choice]()
    for number, (design, sensor) in enumerate(tests):
        if progress:
            progress("comparing tests", len(tests) - number)
        try:
            distances = rivals.distances(design, sensor)
        except StudyError:
            continue
        pairs = rivals.decided(distances, alone=sensor is not None)
        found.append(Choice(design, sensor, pairs, np.min(pairs, axis=1)))
    return found


def _different(found: Sequence[Choice]) -> Iterator[Choice]:
    """The first of each kind of test, band and sensor."""
    seen = set[tuple[str, str, Sensor | None]]()
    for choice in found:
        what = choice.design.kind, choice.design.place, choice.sensor
        if what not in seen:
            seen.add(what)
            yield choice


def further_sensors(rivals: Rivals, names: Sequence[str] = ()) -> tuple[Sensor, ...]:
    """Motions of any coordinate that the record does not show, or those of them that have these names.

    Raises
    ------
    StudyError
        If there is no such sensor, or the record has it.
    """
    known = rivals.prepared.outputs.sensors
    every = (Sensor(c, m) for c in rivals.fits[0].model.coordinates for m in MOTIONS)
    found = {str(sensor): sensor for sensor in every if sensor not in known and not rivals.present.prescribed}
    for name in names:
        there = "one of " + ", ".join(repr(own) for own in found) if found else "none for this record"
        expect(name in found, f"{name!r} is no sensor beside those of the record; expected {there}")
    return tuple(found[name] for name in names or found)


def rehearsed(rivals: Rivals, choice: Choice, times: int, progress: Doing | None = None) -> Choice:
    """A test with what it decides when it is simulated, with noise, and judged together with this record.

    By how many standard errors a rival leaves more than the true one is normal, with a variance of one or what the
    rehearsals show about their means. Where the test cannot be judged so, the choice is as it was.
    """
    rng, count = np.random.default_rng(1), len(rivals.rows)
    means, spreads = np.full((count, count), np.inf), list[float]()
    closest = np.zeros(count)
    for true in range(count):
        behind = list[Floats]()
        for time in range(times):
            if progress:
                progress(f"rehearsing ({choice.design.kind})", times * (count - true) - time)
            try:
                record = simulated(rivals, choice, true, rng)
                behind.append(np.delete(compared_in(rivals, record, true, alone=choice.sensor is not None), true))
            except StudyError:
                continue
        if len(behind) < times:
            return choice
        means[true, np.arange(count) != true] = np.mean(behind, axis=0)
        nearest: Floats = np.min(behind, axis=1)
        closest[true] = float(np.mean(nearest))
        spreads.append(float(np.var(nearest, ddof=1)) if times > 1 else 1.0)
    spread = np.sqrt(max(1.0, float(np.mean(spreads))) * (1.0 + 1.0 / times))
    pairs, alone = (np.asarray(ndtr((x - K) / spread), dtype=np.float64) for x in (means, closest))
    return replace(choice, pairs=pairs, alone=alone, rehearsed=count * times)


def simulated(rivals: Rivals, choice: Choice, true: int, rng: np.random.Generator) -> Record:
    """The record of a test if one rival is true, with coefficients that this record allows and noise like its own."""
    row, design = rivals.rows[true], choice.design
    outputs, noise = rivals.seen(choice.sensor)
    values, vectors = np.linalg.eigh(rivals.covariances[true])
    drawn = np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(values))
    moved = row.fit.values + vectors @ drawn
    try:
        shown = respond(replace(row.fit, values=moved), design, outputs.sensors)[0]
    except StudyError:
        shown = respond(row.fit, design, outputs.sensors)[0]
    added = outputs.apart(_coloured(rivals.size * rng.standard_normal(shown.size), noise, len(outputs)))
    return record_of_test(design, dict(zip(map(str, outputs.sensors), (shown + added).T, strict=True)))


def _coloured(white: Floats, noise: Noise, sensors: int) -> Floats:
    """Noise that is white once it is filtered with each sensor's coefficients, stacked, shape (n s,)."""
    if not noise:
        return white
    values = white.reshape(-1, sensors)
    gains = [np.fft.rfft(own, len(values)) for own in noise]
    parts = [np.fft.irfft(np.fft.rfft(x) / gain, len(values)) for x, gain in zip(values.T, gains, strict=True)]
    return np.stack(parts, axis=1).ravel()


def record_of_test(design: Design, measured: dict[str, Floats]) -> Record:
    """The record of a test in which this was measured."""
    record, forces = design.record, design.record.forces
    driven = {name: values for name, values in record.channels.items() if name not in measured}
    if "force" in measured:  # of a component
        return replace(record, channels={**measured, **driven}, name="next test")
    kept = {name: values for name, values in driven.items() if name in forces or name in record.extra}
    return replace(record, channels={**kept, **measured}, name="next test")


def compared_in(rivals: Rivals, record: Record, true: int, *, alone: bool) -> Floats:
    """By how many standard errors each rival leaves more than the true one of a record and this one, shape (r,).

    Each is fitted from its values. What has a shape of its own and would lose so is fitted anew from all that may
    become of it: some effects have others as a limit, as a contact whose gap is zero is a bilinear spring.
    """
    joint = judged_together(rivals, record, alone=alone)
    fits = [fit_part(f.model, joint, f.held, steps=f.steps_per_sample, max_iterations=30) for f in rivals.fits]
    noise = noise_left(fits[true].residual, len(joint.outputs))
    white = [_white(fit, joint, noise) for fit in fits]
    behind = np.array([_behind(own, white[true]) for own in white])
    for place, row in enumerate(rivals.rows):
        if place != true and row.flexible and behind[place] > K - 1.0:
            other = _sought(row, joint)
            if other is not None and other.rms < fits[place].rms:
                behind[place] = min(behind[place], _behind(_white(other, joint, noise), white[true]))
    return behind


def _white(fit: FreeRunFit, joint: Prepared, noise: Noise) -> Floats:
    """What a fit leaves of samples that it was not fitted to, white, shape (n s,)."""
    return np.concatenate(held_out(fit, predict(fit, joint), linearise(fit, joint), joint).white(joint.outputs, noise))


def _behind(one: Floats, other: Floats) -> float:
    count = min(len(one), len(other))
    return statistics.worse(one[:count], other[:count])


def _sought(row: Ranked, joint: Prepared) -> FreeRunFit | None:
    """A rival whose effects with a shape of their own are searched for anew; None where that has no finite response."""
    model, best = row.fit.model, None
    for entry in (e for e in row.entries if e.term.parameters):
        without = model.without_term(entry.name)
        kept = [key for key in row.fit.held if key in without.values]
        try:
            beside = fit_part(without, joint, kept, steps=row.fit.steps_per_sample, max_iterations=15)
            best = better_fit(best, with_term(baseline(beside, joint), free(entry.term, entry.place)))
        except StudyError:
            continue
    return best


def judged_together(rivals: Rivals, record: Record, *, alone: bool) -> Prepared:
    """A record of a test made ready, with those of this record unless it is judged alone."""
    own = rivals.prepared.record
    sources = list({id(s.source): s.source for s in own.stretches}.values()) or [own]
    records = [record] if alone else [*sources, record]
    return made_ready(records, rivals.rows[0].fit.model, Layout(response=None if alone else rivals.prepared.response))[
        1
    ]


def driving(present: PresentTest, design: Design, every: int) -> dict[str, Floats]:
    """What drives a test, shape (n,) each, at so many samples to one of the fit; nothing where it is let go.

    Of a single mass on a moving base that is the base's acceleration.
    """
    if design.kind == LET_GO:
        return {}
    names = (OF_THE_GROUND,) if present.based else present.drivers
    return {
        name: between_samples(own, every) for name, own in zip(names, present.signals(design.record).T, strict=True)
    }


@lru_cache(maxsize=4)
def suggested(diagnosis: Diagnosis) -> NextTest | None:
    """The test after a tie within twice what the record reached, by sensitivities alone; None without a tie.

    None, too, where a record cannot be made louder, as one that is of no motion at all.
    """
    if diagnosis.answer is None or len(diagnosis.sets) < 2:
        return None
    try:
        rivals = rivals_of(tied_rows(diagnosis), diagnosis.comparison.prepared)
        return next_test(rivals, own_limits(rivals.fits, rivals.present, 2.0), rehearsals=0)
    except (StudyError, np.linalg.LinAlgError):
        return None
