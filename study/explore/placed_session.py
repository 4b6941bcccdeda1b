"""The state of a session with a structure: as ``session`` has it for one coordinate, with places."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from study.compare.comparison import Comparison, compare
from study.compare.comparison_report import history_step
from study.diagnose.adding import added
from study.diagnose.diagnosis_files import diagnosis_in_words, unneeded_in_words
from study.diagnose.dropping import compared_without, term_at
from study.diagnose.needless import Needless, needless
from study.diagnose.verdict import Diagnosis, diagnose
from study.equations.model import Model, free
from study.equations.terms import Term
from study.explore.any_session import chosen, held, holding
from study.explore.session import Step, joined, own_term
from study.records.prepared import Prepared


@dataclass(frozen=True, eq=False)
class PlacedStage:
    """A structure and what was found of it."""

    model: Model  # values that it gives are held
    label: str  # what was done to arrive at it
    added: str | None  # effect and place that are new in it
    comparison: Comparison
    diagnosis: Diagnosis | None = None  # None as long as nobody has asked
    said: str = ""  # the diagnosis in words
    dropped: str | None = None  # effect and place that were taken out of the model before
    unneeded: tuple[Needless, ...] = ()  # terms that it does not need

    @property
    def values(self) -> dict[str, float]:
        """Every value as fitted or held."""
        return self.comparison.fit.model.numbers()


@dataclass(frozen=True, eq=False)
class PlacedSession:
    """A record of a structure, and the models tried on it."""

    prepared: Prepared
    stages: tuple[PlacedStage, ...]  # from the model as given to the present one
    own: tuple[Term, ...] = ()  # the user's own candidates, each at all places
    earlier: tuple[Step, ...] = ()  # of the history that was kept beside the model file

    @property
    def now(self) -> PlacedStage:
        """The present model."""
        return self.stages[-1]

    @property
    def steps(self) -> list[Step]:
        """The history, the steps before this session included."""
        return joined(self.earlier, [history_step(s.comparison, s.added, s.dropped) for s in self.stages])


def begin_placed(comparison: Comparison, earlier: Sequence[Step] = ()) -> PlacedSession:
    """A session with a structure as it was compared."""
    first = PlacedStage(comparison.model, "as given", None, comparison)
    return PlacedSession(comparison.prepared, (first,), earlier=tuple(earlier))


def with_placed(session: PlacedSession, name: str) -> PlacedSession:
    """The session with a candidate added where its diagnosis found it."""
    row = chosen(session.now.diagnosis.candidates if session.now.diagnosis is not None else (), name)
    comparison = added(session.now.comparison, free(row.term, row.entry.place))
    stage = PlacedStage(comparison.model, f"+ {name}", name, comparison)
    return replace(session, stages=(*session.stages, stage))


def without_placed(session: PlacedSession, name: str) -> PlacedSession:
    """The session with a term, by effect and place, taken out of the structure and the rest fitted again.

    Raises
    ------
    StudyError
        If it is not in the model or cannot be left out.
    """
    comparison = compared_without(session.now.comparison, term_at(session.now.model, name, None))
    stage = PlacedStage(comparison.model, f"- {name}", None, comparison, dropped=name)
    return replace(session, stages=(*session.stages, stage))


def with_held(session: PlacedSession, key: str, hold: bool) -> PlacedSession:
    """The session with a value held where it stands, or freed; it must not be so already."""
    comparison = compare(holding(session, key, hold), session.prepared)
    stage = PlacedStage(comparison.model, held(key, hold), None, comparison)
    return replace(session, stages=(*session.stages, stage))


def tried(session: PlacedSession, text: str) -> PlacedSession:
    """The session with a formula of the user's among the effects; the diagnosis that follows tries it at all places.

    Raises
    ------
    StudyError
        If the formula is refused, or its name is taken.
    """
    taken = {t.name for t in session.own} | {t.term.name for t in session.now.model.terms}
    term = own_term(text, taken, session.prepared.record.extra)
    return replace(session, own=(*session.own, term))


def examined(session: PlacedSession, progress: Callable[[int], None] | None = None) -> PlacedStage:
    """The present stage with what is missing and where, and what is not needed, in words too."""
    now = session.now

    def report(done: int, _: int) -> None:
        if progress is not None:
            progress(done)

    diagnosis = diagnose(now.comparison, extra=session.own, progress=report)
    unneeded = needless(now.comparison)
    said = f"{diagnosis_in_words(diagnosis)} {unneeded_in_words(unneeded, diagnosis)}".strip()
    return replace(now, diagnosis=diagnosis, said=said, unneeded=unneeded)


def with_stage(session: PlacedSession, stage: PlacedStage) -> PlacedSession:
    """The session with a diagnosed stage in place of those of its model; unchanged if that was undone meanwhile."""
    stages = (
        replace(s, diagnosis=stage.diagnosis, said=stage.said, unneeded=stage.unneeded) if s.model == stage.model else s
        for s in session.stages
    )
    return replace(session, stages=tuple(stages))
