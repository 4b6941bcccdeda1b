"""The state of a session: the models tried so far and what was found of each. Nothing here knows of a browser.

Every function gives a new session; what was found of a model stays with its rung, so that undoing computes nothing.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from study.compare.comparison import Comparison, compare
from study.compare.comparison_report import rung as history_step
from study.compare.missing_force import MissingForce, missing_force
from study.diagnose import candidates
from study.diagnose.candidates import Candidate
from study.diagnose.diagnosis_files import in_words
from study.diagnose.ranking import Ranked, rank
from study.diagnose.verdict import Diagnosis, diagnose, search_base, search_part
from study.equations import formulas
from study.equations.model import Model
from study.equations.terms import LIBRARY, Term, custom
from study.identify.time_domain.fit_model import continued, settled
from study.records.prepared import Prepared
from study.support.errors import StudyError, expect

Step = dict[str, Any]
Progress = Callable[[str], None]
SHOWN = 8  # candidates


@dataclass(frozen=True)
class Rung:
    """A model and what was found of it."""

    model: Model  # values that it gives are held
    label: str  # what was done to arrive at it
    added: str | None  # the term that is new in it
    comparison: Comparison
    diagnosis: Diagnosis | None = None  # None as long as nobody has asked
    said: str = ""  # the diagnosis in words
    would: Mapping[str, MissingForce] = field(default_factory=dict[str, MissingForce])  # with a candidate, by its name

    @property
    def shown(self) -> tuple[Ranked, ...]:
        """The candidates that a page lists: the best, and all of the user's own."""
        rows = self.diagnosis.candidates if self.diagnosis is not None else ()
        return (*rows[:SHOWN], *(r for r in rows[SHOWN:] if r.name not in LIBRARY))

    @property
    def values(self) -> dict[str, float]:
        """Every value as fitted or held."""
        return self.comparison.fit.model.numbers()


@dataclass(frozen=True)
class Session:
    """A record, and the models tried on it."""

    prepared: Prepared
    rungs: tuple[Rung, ...]  # from the model as given to the present one
    own: tuple[Term, ...] = ()  # the user's own candidates
    earlier: tuple[Step, ...] = ()  # of the history that was kept beside the model file

    @property
    def now(self) -> Rung:
        """The present model."""
        return self.rungs[-1]

    @property
    def steps(self) -> list[Step]:
        """The history, the steps before this session included."""
        own = [history_step(r.comparison, r.added) for r in self.rungs]
        last = self.earlier[-1] if self.earlier else None
        known = last is not None and last["terms"] == own[0]["terms"] and last["record"] == own[0]["record"]
        return [*self.earlier, *own[1 if known else 0 :]]


def begin(
    model: Model, prepared: Prepared, *, earlier: Sequence[Step] = (), progress: Progress | None = None
) -> Session:
    """A session with the model as given."""
    return begin_with(compare(model, prepared, progress=progress), earlier=earlier)


def begin_with(comparison: Comparison, *, earlier: Sequence[Step] = ()) -> Session:
    """A session with the model as it was compared, on the record as it was corrected for that."""
    first = Rung(comparison.model, "as given", None, comparison)
    return Session(comparison.prepared, (first,), earlier=tuple(earlier))


def climbed(session: Session, comparison: Comparison, label: str, added: str | None) -> Session:
    """The session with a model more."""
    return replace(session, rungs=(*session.rungs, Rung(comparison.model, label, added, comparison)))


def candidate(session: Session, name: str) -> Ranked:
    """The candidate of this name in the present diagnosis, which must have one."""
    diagnosis = session.now.diagnosis
    for row in diagnosis.candidates if diagnosis is not None else ():
        if row.name == name:
            return row
    raise StudyError(f"{name!r} is no candidate of the present model; expected one of the list")


def with_added(session: Session, name: str) -> Session:
    """The session with a candidate added to the model, as its diagnosis fitted it."""
    row, prepared = candidate(session, name), session.prepared
    fit = settled(continued(row.fit, prepared), prepared)
    comparison = compare(session.now.model.with_term(row.term), prepared, fit=fit)
    return climbed(session, comparison, f"+ {name}", name)


def undone(session: Session) -> Session:
    """The session before its last change; the model as given stays."""
    return replace(session, rungs=session.rungs[:-1]) if len(session.rungs) > 1 else session


def with_held(session: Session, key: str, hold: bool) -> Session:
    """The session with a value held where it stands, or freed; it must not be so already."""
    values = session.now.model.values
    expect(key in values, f"{key!r} is no value of this model; it has {', '.join(values)}")
    expect((values[key] is None) == hold, f"{key} is {'held' if hold else 'free'} already")
    alone = key == "m" and len(session.now.model.terms) == 1
    expect(hold or not alone, "m alone cannot be freed; a model of inertia alone has nothing to be fitted to")
    now = session.now.values
    model = session.now.model.with_values({**values, key: now[key] if hold else None})
    comparison = compare(model, session.prepared, start=now)
    return climbed(session, comparison, f"{key} {'held' if hold else 'free'}", None)


def examined(session: Session, progress: Callable[[int], None] | None = None) -> tuple[Rung, Diagnosis]:
    """The present rung with what is missing, in words too, and what each candidate would leave; and the diagnosis."""
    diagnosis = diagnose(session.now.comparison, extra=session.own, progress=progress)
    return _foreseen(replace(session.now, diagnosis=diagnosis, said=in_words(diagnosis))), diagnosis


def lacking_with(row: Ranked) -> MissingForce:
    """The force that the model with a candidate lacks."""
    return missing_force(row.fit.model, (), row.prediction)


def _foreseen(rung: Rung) -> Rung:
    """The rung with what each candidate that is shown would leave; one that cannot run leaves what there is."""
    would = dict(rung.would)
    for row in rung.shown:
        if row.name not in would:
            try:
                would[row.name] = lacking_with(row)
            except StudyError:
                would[row.name] = rung.comparison.missing_force
    return replace(rung, would=would)


def with_rung(session: Session, rung: Rung) -> Session:
    """The session with a diagnosed rung in place of those of its model; unchanged if that was undone meanwhile."""
    rungs = (
        replace(r, diagnosis=rung.diagnosis, said=rung.said, would=rung.would) if r.model == rung.model else r
        for r in session.rungs
    )
    return replace(session, rungs=tuple(rungs))


def own_term(session: Session, text: str) -> Term:
    """A user's formula of the whitelisted kind, or ``NAME=FORMULA`` with a name that is not taken, as a term."""
    name, sign, formula = text.partition("=")
    taken = {t.name for t in (*session.own, *session.now.model.terms)}
    if not sign:
        name = next(f"own_{i}" for i in range(1, len(taken) + 2) if f"own_{i}" not in taken)
        formula = text
    term = custom(name.strip(), formula.strip())
    known = ("u", "v", "t", *session.prepared.record.extra)
    for used in formulas.names(formula.strip()):
        uses = f"the expression {formula.strip()!r} uses the name {used!r}"
        expect(used in known, f"{uses}; it may use {', '.join(known)}")
    expect(term.name not in taken, f"the name {term.name!r} is taken; expected another")
    return term


def _attempted(term: Term, session: Session) -> Candidate | None:
    """The present model with a term, fitted as the candidates of its diagnosis were; None if it cannot run."""
    prepared = session.prepared
    attempt = candidates.attempt(term, search_base(session.now.comparison), search_part(prepared))
    return None if attempt is None else candidates.all_settled([attempt], prepared)[0]


def tried(session: Session, text: str) -> Session:
    """The session with a formula of the user's among the candidates, fitted and ranked with them.

    The verdict is left as it was; :func:`examined` weighs it again.

    Raises
    ------
    StudyError
        If the formula is refused, or has no finite response on this record.
    """
    term, now = own_term(session, text), session.now
    if now.diagnosis is None:
        raise StudyError("the present model is still being diagnosed; a formula can be tried when that is done")
    known = [Candidate(r.term, r.fit, r.prediction) for r in now.diagnosis.candidates]
    silent = f"the expression {term.components[0].shape!r} has no finite response on this record"
    try:
        with np.errstate(all="ignore"):  # a formula may overflow: then it has no finite response
            attempt = _attempted(term, session)
            if attempt is None:
                raise StudyError(silent)
            rows = rank([*known, attempt], now.comparison.prediction.residual, session.prepared)
    except np.linalg.LinAlgError:
        raise StudyError(silent) from None
    ranked = replace(now.diagnosis, candidates=tuple(rows))
    return replace(with_rung(session, _foreseen(replace(now, diagnosis=ranked))), own=(*session.own, term))
