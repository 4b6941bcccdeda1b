"""The state of a session: the models tried so far and what was found of each. Nothing here knows of a browser.

Terms and candidates go by their full name: the effect, and the place where that has a name. Every function gives a new
session; what was found of a model stays with its stage, so that undoing computes nothing.
"""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from study.compare import each_record
from study.compare.comparison import Comparison, across_records, compare, on_each_record
from study.compare.comparison_report import history_step
from study.compare.each_record import Separate
from study.compare.fitted_coefficients import Level
from study.compare.force_map import ForceCurve, cells_of, curve, surface
from study.compare.missing_force import unbalanced
from study.diagnose import candidates, dropping
from study.diagnose.adding import added_candidate
from study.diagnose.candidates import FittedCandidate, Progress
from study.diagnose.confirmed_faults import Diagnosed, diagnose_accounted
from study.diagnose.diagnosis_files import diagnosis_in_words, unneeded_in_words
from study.diagnose.needless import Needless, needless
from study.diagnose.next_test import suggested
from study.diagnose.next_test_report import likely
from study.diagnose.ranked import Ranked
from study.diagnose.ranking import rank
from study.diagnose.verdict import Diagnosis, search_base
from study.equations.model import Model, free
from study.equations.terms import Term, custom, is_own
from study.faults.accounting import Accounted
from study.figures.styles import in_style
from study.records.prepared import Prepared
from study.records.record import Record
from study.records.record_layout import records_judged
from study.records.sampling_rate import without_spare_samples
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.extras import undrawn

Step = dict[str, Any]
ON_THE_PAGE = 12  # candidates


@dataclass(frozen=True)
class Several:
    """What a session needs of its records one by one; empty of one record."""

    apart: tuple[Prepared, ...] = ()  # each made ready by itself
    records: tuple[Record, ...] = ()  # as they were read
    separate: tuple[Separate, ...] = ()  # the coefficients that may differ within the one fit, if any were asked for


@dataclass(frozen=True)
class ByRecord:
    """The coefficients of each record."""

    names: tuple[str, ...] = ()  # of the records, in the order of the levels' entries
    levels: tuple[Level, ...] = ()
    errors: tuple[float, ...] = ()  # of each record's own fit, in the order of the records; none in one fit
    why_not: str = ""  # the sentence on a record to which the model alone cannot be fitted


NO_OTHERS = Several()


@dataclass(frozen=True, eq=False)
class StillMissing:
    """The force that would still be missing at a place with a candidate in the model: what is shown of it."""

    against_displacement: ForceCurve
    against_velocity: ForceCurve
    plane: Floats  # mean force in the cells of the map that is shown, shape (cells, cells)


@dataclass(frozen=True)
class Stage:
    """A model and what was found of it."""

    model: Model  # values that it gives are held
    label: str  # what was done to arrive at it
    added: str | None  # the term that is new in it, by effect and place
    accounted: Accounted  # the comparison, and the faults that its record is corrected for
    diagnosis: Diagnosis | None = None  # None as long as nobody has asked
    said: str = ""  # the diagnosis in words
    # what each candidate would leave, by its name, on each record at each place, by its label
    would: Mapping[str, tuple[Mapping[str, StillMissing], ...]] = field(
        default_factory=dict[str, tuple[Mapping[str, "StillMissing"], ...]]
    )
    dropped: str | None = None  # the term that was taken out of the model before
    unneeded: tuple[Needless, ...] | None = None  # terms that it does not need; None as long as nobody has asked
    on_each: tuple[Comparison, ...] = ()  # of several records: the same fit judged on each of them
    by_record: ByRecord | None = None  # coefficients of each record's own; None as long as nobody has asked
    given: Model | None = None  # as it was asked about, where values that it held are let go
    next_test: bytes = b""  # PNG of what tied effects would answer to the test that decides, if one is likely to

    @property
    def comparison(self) -> Comparison:
        """The model beside the record as it is corrected."""
        return self.accounted.comparison

    @property
    def shown(self) -> tuple[Ranked, ...]:
        """What a page lists: sets of effects, the best single ones, and all of the user's own."""
        rows = self.diagnosis.candidates if self.diagnosis is not None else ()
        sets = [r for r in self.diagnosis.sets if len(r.entries) > 1] if self.diagnosis is not None else []
        return (*sets[:ON_THE_PAGE], *rows[:ON_THE_PAGE], *(r for r in rows[ON_THE_PAGE:] if is_own(r.term)))

    @property
    def values(self) -> dict[str, float]:
        """Every value as fitted or held."""
        return self.comparison.fit.model.numbers()


@dataclass(frozen=True)
class Session:
    """A record, and the models tried on it."""

    stages: tuple[Stage, ...]  # from the model as given to the present one
    own: tuple[Term, ...] = ()  # the user's own candidates
    earlier: tuple[Step, ...] = ()  # of the history that was kept beside the model file
    several: Several = NO_OTHERS

    @property
    def now(self) -> Stage:
        """The present model."""
        return self.stages[-1]

    @property
    def steps(self) -> list[Step]:
        """The history, the steps before this session included."""
        return joined(self.earlier, [history_step(r.comparison, r.added, r.dropped) for r in self.stages])


def joined(earlier: Sequence[Step], own: Sequence[Step]) -> list[Step]:
    """The steps of a session after those that were kept: the model that both begin or end with stands once."""
    last = earlier[-1] if earlier else None
    known = last is not None and last["terms"] == own[0]["terms"] and last["record"] == own[0]["record"]
    return [*earlier, *own[1 if known else 0 :]]


def begin(model: Model, prepared: Prepared, *, earlier: Sequence[Step] = ()) -> Session:
    """A session with the model as given, on the samples that the record's motion asks for."""
    return begin_with(Accounted.as_compared(compare(model, without_spare_samples(prepared))), earlier=earlier)


def begin_with(
    accounted: Accounted, *, earlier: Sequence[Step] = (), several: Several = NO_OTHERS, known: ByRecord | None = None
) -> Session:
    """A session with the model as it was compared, on the record, or records, as corrected for that.

    ``known`` are the coefficients of each of several records.
    """
    accounted = replace(accounted, comparison=_named_after_all(accounted.comparison))
    first = replace(stage_of(accounted, "as given", None), by_record=known)
    return Session((first,), earlier=tuple(earlier), several=several)


def _named_after_all(comparison: Comparison) -> Comparison:
    """A comparison with several records called as all of them are."""
    prepared = comparison.prepared
    parts = records_judged(prepared)
    if not parts:
        return comparison
    together = replace(prepared.record, name=", ".join(part.record.name for part in parts))
    return replace(comparison, prepared=replace(prepared, record=together))


def stage_of(accounted: Accounted, label: str, added: str | None, dropped: str | None = None) -> Stage:
    """A model as it was compared, which nobody has diagnosed."""
    each: tuple[Comparison, ...] = ()
    with suppress(StudyError):  # one may be too short to be judged by itself: then all are shown as one
        each = on_each_record(accounted.comparison)
    return Stage(accounted.comparison.model, label, added, accounted, dropped=dropped, on_each=each)


def climbed(
    session: Session, comparison: Comparison, label: str, added: str | None, dropped: str | None = None
) -> Session:
    """The session with a model more."""
    stage = stage_of(replace(session.now.accounted, comparison=comparison), label, added, dropped)
    return replace(session, stages=(*session.stages, stage))


def undone(session: Session) -> Session:
    """The session before its last change; the model as given stays."""
    return replace(session, stages=session.stages[:-1]) if len(session.stages) > 1 else session


def candidate(session: Session, name: str) -> Ranked:
    """The effect or set of this name in the present diagnosis, which must have one."""
    diagnosis = session.now.diagnosis
    for row in (*diagnosis.candidates, *diagnosis.sets) if diagnosis is not None else ():
        if row.name == name:
            return row
    raise StudyError(f"{name!r} is no candidate of the present model; expected one of the list")


def with_added(session: Session, name: str) -> Session:
    """The session with a candidate added to the model, as its diagnosis fitted it."""
    comparison = added_candidate(session.now.comparison, candidate(session, name))
    return climbed(session, comparison, f"+ {name}", name)


def dropped(session: Session, name: str) -> Session:
    """The session with a term taken out of the model and the rest fitted again.

    Raises
    ------
    StudyError
        If it is not in the model or cannot be left out.
    """
    now = session.now
    comparison = dropping.compared_without(now.comparison, dropping.term_at(now.model, name))
    return climbed(session, comparison, f"- {name}", None, dropped=name)


def on_record(stage: Stage, number: int) -> Stage:
    """A stage of several records as one of them shows it; that of one record as it is."""
    if not stage.on_each:
        return stage
    accounted, diagnosis = replace(stage.accounted, comparison=stage.on_each[number]), stage.diagnosis
    if diagnosis is not None:
        candidates, sets = (
            tuple(replace(row, prediction=row.prediction.along(accounted.comparison.prepared)) for row in rows)
            for rows in (diagnosis.candidates, diagnosis.sets)
        )
        diagnosis = replace(diagnosis, candidates=candidates, sets=sets)
    would = {name: (lacking[number],) for name, lacking in stage.would.items()}
    return replace(stage, accounted=accounted, diagnosis=diagnosis, would=would)


def by_itself(session: Session) -> Session:
    """The session with the coefficients of each record known; as it is of one record, or where they are."""
    now = session.now
    if not now.on_each or now.by_record is not None:
        return session
    now = replace(now, by_record=by_record(session.several, now.comparison))
    return replace(session, stages=(*session.stages[:-1], now))


def weighed(session: Session) -> Session:
    """The session with the present model's terms asked whether they are needed."""
    if session.now.unneeded is not None:
        return session
    now = replace(session.now, unneeded=needless(session.now.comparison))
    return replace(session, stages=(*session.stages[:-1], now))


def with_held(session: Session, key: str, hold: bool) -> Session:
    """The session with a value held where it stands, or freed; it must not be so already."""
    model, known, done = session.now.model, session.now.values, "held" if hold else "free"
    expect(key in model.values, f"{key!r} is no value of this model; it has {', '.join(model.values)}")
    expect((model.values[key] is None) == hold, f"{key} is {done} already")
    alone = key == "m" and len(model.terms) == 1
    expect(hold or not alone, "m alone cannot be freed; a model of inertia alone has nothing to be fitted to")
    changed = model.with_values({**model.values, key: known[key] if hold else None})
    return climbed(session, compare(changed, session.now.comparison.prepared, start=known), f"{key} {done}", None)


def examined(session: Session, progress: Progress | None = None) -> tuple[Stage, Diagnosis]:
    """The present stage with what is missing and what is not needed, in words too, and what each candidate would leave.

    And the diagnosis. Where the record shows other faults beside what is missing, the stage is that of the record as it
    is corrected for these.
    """
    now = session.now
    found = diagnose_accounted(now.accounted, extra=session.own, progress=progress)
    if found.accounted.comparison is not now.comparison:
        corrected = stage_of(found.accounted, now.label, now.added, now.dropped)
        session = replace(session, stages=(*session.stages[:-1], replace(corrected, by_record=now.by_record)))
    return with_diagnosis(weighed(session).now, found), found.diagnosis


def with_diagnosis(stage: Stage, found: Diagnosed) -> Stage:
    """A stage whose terms were weighed with its diagnosis, in words too, and what each candidate would leave."""
    comparison = found.diagnosis.comparison
    anew = comparison.prepared.plan != stage.comparison.prepared.plan  # laid out, as changes ask for
    if anew or comparison.model != stage.comparison.model:  # with values let go that the record contradicts
        laid = stage_of(replace(stage.accounted, comparison=comparison), stage.label, stage.added, stage.dropped)
        stage = replace(laid, unneeded=stage.unneeded, given=stage.model)
    words = (
        diagnosis_in_words(found.diagnosis),
        *(fault.says for fault in found.faults),
        unneeded_in_words(stage.unneeded or (), found.diagnosis),
    )
    return _foreseen(replace(stage, diagnosis=found.diagnosis, said=" ".join(said for said in words if said)))


def with_next_test(stage: Stage) -> Stage:
    """A diagnosed stage with the picture of the next test, as ``study plan`` draws it, where its words name one."""
    found = None if stage.diagnosis is None or undrawn() else suggested(stage.diagnosis)
    if found is None or not likely(found):
        return stage
    from study.diagnose.next_test_pictures import next_test_figure
    from study.figures.page import rendered

    with in_style():
        return replace(stage, next_test=rendered(next_test_figure(found), "png"))


def _foreseen(stage: Stage) -> Stage:
    """The stage with what each candidate that is shown would leave; one that cannot run leaves what there is."""
    rows = [row for row in stage.shown if row.name not in stage.would]
    on_each = [_still_missing(rows, comparison) for comparison in stage.on_each or (stage.comparison,)]
    would = {row.name: each for row, each in zip(rows, zip(*on_each, strict=True), strict=True)}
    return replace(stage, would={**stage.would, **would})


def _still_missing(rows: Sequence[Ranked], comparison: Comparison) -> list[dict[str, StillMissing]]:
    """The force that each of these candidates leaves on a record, at every place where one that is missing shows."""
    places = comparison.missing.shown
    cells = [cells_of(*comparison.missing.at(place).known[:2]) for place in places]
    found: list[dict[str, StillMissing]] = []
    for row in rows:
        try:
            left = unbalanced(row.fit.model, (), row.prediction.along(comparison.prepared))
        except StudyError:
            left = comparison.missing
        known = [left.at(place).known for place in places]
        found.append({
            place.label: StillMissing(curve(u, force), curve(v, force), surface(u, v, force, count).mean)
            for place, (u, v, force), count in zip(places, known, cells, strict=True)
        })  # fmt: skip
    return found


def with_stage(session: Session, stage: Stage) -> Session:
    """The session with a diagnosed stage in place of those of its model; unchanged if that was undone meanwhile."""
    asked = stage.given or stage.model
    stages = (
        replace(stage, label=r.label, added=r.added, dropped=r.dropped) if r.model == asked else r
        for r in session.stages
    )
    return replace(session, stages=tuple(stages))


def own_term(text: str, taken: Collection[str], channels: Collection[str]) -> Term:
    """A user's formula of the whitelisted kind, or ``NAME=FORMULA`` with a name that is not taken, as a term.

    ``channels`` are the measured ones that it may name.
    """
    name, sign, formula = text.partition("=")
    if not sign:
        name = next(f"own_{i}" for i in range(1, len(taken) + 2) if f"own_{i}" not in taken)
        formula = text
    term = custom(name.strip(), formula.strip())
    known = ", ".join(("u", "v", "t", *channels))
    for used in term.channels:
        uses = f"the expression {formula.strip()!r} uses the name {used!r}"
        like = f"parameters to be fitted that are named before it, as in '{term.name}({used})={formula.strip()}'"
        expect(used in channels, f"{uses}; it may use {known}, and {like}")
    expect(term.name not in taken, f"the name {term.name!r} is taken; expected another")
    return term


def tried(session: Session, text: str) -> Session:
    """The session with a formula of the user's among the candidates, fitted and ranked with them.

    The verdict is left as it was; :func:`examined` weighs it again, and tries the formula at all places of a structure.

    Raises
    ------
    StudyError
        If the formula is refused, or has no finite response on this record.
    """
    now = session.now
    taken = {t.name for t in session.own} | {t.term.name for t in now.model.terms}
    term = own_term(text, taken, session.now.comparison.record.extra)
    if now.model.named:
        return replace(session, own=(*session.own, term))
    if now.diagnosis is None:
        raise StudyError("the present model is still being diagnosed; a formula can be tried when that is done")
    known = [FittedCandidate(r.entries, r.fit, r.prediction) for r in now.diagnosis.candidates]
    silent = f"the expression {term.components[0].shape!r} has no finite response on this record; expected one that "
    silent += "holds the motion or takes energy out of it, such as 'u*abs(u)' or 'v**3'"
    try:
        with np.errstate(all="ignore"):  # a formula may overflow: then it has no finite response
            attempt = candidates.attempt(free(term), search_base(now.comparison))
            if attempt is None:
                raise StudyError(silent)
            rows = rank([*known, *candidates.all_settled([attempt], now.comparison.prepared)], now.comparison)
    except np.linalg.LinAlgError:
        raise StudyError(silent) from None
    ranked = replace(now.diagnosis, candidates=tuple(rows))
    return replace(with_stage(session, _foreseen(replace(now, diagnosis=ranked))), own=(*session.own, term))


def of_own(comparisons: Sequence[Comparison]) -> ByRecord:
    """Comparisons of a model with each record, held against each other as ``study compare`` does."""
    levels = across_records(comparisons)
    names = tuple(c.record.name for c in sorted(comparisons, key=lambda c: c.level))
    return ByRecord(names, levels, tuple(c.prediction.error for c in comparisons))


def by_record(several: Several, together: Comparison) -> ByRecord:
    """The same of the model that was fitted to all records together: fitted to each, from where that fit ended.

    Where some of its coefficients were to differ between records, these are what the one fit has found.
    """
    if several.separate:
        names = tuple(record.name for record in several.records)
        levels = each_record.levels_by_record(together, several.separate, several.records)
        return ByRecord(names, levels)
    start = together.fit.model.numbers()
    try:
        return of_own([compare(together.model, prepared, start=start) for prepared in several.apart])
    except StudyError as error:
        return ByRecord(why_not=str(error))


def worst(each: Sequence[Comparison]) -> int:
    """The place of the record of which the model misses most; 0 of one record, which has no comparison of its own."""
    missed = [comparison.prediction.above_noise for comparison in each]
    return missed.index(max(missed)) if missed else 0
