"""Faults of the measurement in the light of a diagnosis."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from study.compare.comparison import Comparison
from study.diagnose.candidates import Progress
from study.diagnose.force_between import diagnose_as_read
from study.diagnose.held_values import contradicted, held_coefficients, saying_so
from study.diagnose.late_force import late_force
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import UNKNOWN, Diagnosis, Otherwise
from study.equations.terms import Term
from study.faults.accounting import Accounted, still_seen
from study.faults.fault import SPIKES, Fault, same
from study.support import statistics, work
from study.support.errors import StudyError
from study.support.thresholds import TOLERANCE, K


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A diagnosis of a record as it is corrected in the light of what is missing."""

    diagnosis: Diagnosis
    accounted: Accounted  # the comparison that it is of, and what the record is corrected for
    faults: tuple[Fault, ...]  # those that the record shows beside what is missing as well


def diagnose_accounted(
    accounted: Accounted, *, extra: Sequence[Term] = (), without: Sequence[str] = (), progress: Progress | None = None
) -> Diagnosed:
    """The diagnosis of a comparison, faults and effects asked for in the light of each other.

    What a model lacks hides faults and imitates others. So where a set of effects is found, or something is left beside
    what is found, the record as it was given is asked for faults beside the model with it; where these are others, the
    record that is corrected for them is diagnosed, and the better of both diagnoses stands. Where nothing is found in
    a corrected record, what was corrected may have been the motion that is missing: then the record is diagnosed
    without what the model alone told of its faults, and that stands where it leaves less. The first diagnosis stands
    where all is done that may be. Arguments as for :func:`study.diagnose.verdict.diagnose`.
    """

    def diagnosed(comparison: Comparison, otherwise: Otherwise | None) -> Diagnosis:
        return diagnose_as_read(comparison, extra=extra, without=without, progress=progress, otherwise=otherwise)

    with work.limited_to(accounted.work_left):
        return _with_faults(_Diagnoses(accounted, diagnosed))


class _Diagnoses:
    """Diagnoses of a record that is corrected for one set of faults or another; none is made twice."""

    def __init__(self, accounted: Accounted, diagnosed: Callable[[Comparison, Otherwise | None], Diagnosis]) -> None:
        self.accounted, self._diagnosed = accounted, diagnosed
        self._made: list[Diagnosed] = []
        self._beside: list[tuple[Ranked, tuple[Fault, ...]]] = []

    def of(self, one: Accounted) -> Diagnosed:
        """The diagnosis of a comparison, with those of its faults that show beside what is missing as well."""
        done = next((d for d in self._made if _of_the_same(d.accounted, one)), None)
        otherwise = self._is_a_fault if one is self.accounted else None
        diagnosis = self._diagnosed(one.comparison, otherwise) if done is None else _saying(done, one)
        self._made.append(_with_confirmed(diagnosis, one))
        return self._made[-1]

    def faults_beside(self, answer: Ranked) -> tuple[Fault, ...]:
        """The faults that the record as it was given shows beside the model with what is missing."""
        asked = next((faults for row, faults in self._beside if row.fit is answer.fit), None)
        if asked is None:
            model = self.accounted.comparison.model
            for entry in answer.entries:
                model = model.with_term(entry)
            asked = self.accounted.faults_beside(answer.fit, model)
            self._beside.append((answer, asked))
        return asked

    def _is_a_fault(self, named: Diagnosis) -> bool:
        """Whether the record, corrected for other faults, leaves no more than noise beside what is missing.

        What is left beside what is named so far may be a fault that imitates a change of a coefficient, and is the
        sooner asked for. Where nothing is named, what was corrected may have been the motion that is missing.
        """
        own = self.accounted.faults
        if self.accounted.put_off or (named.answer is None and all(map(_plain, own))):
            return False
        try:
            shown = [f for f in own if _plain(f)] if named.answer is None else self.faults_beside(named.answer)
            if same(shown, own):
                return False
            one = self.accounted.corrected_for(shown)
            diagnosis = self._diagnosed(one.comparison, lambda _: True)
        except StudyError:
            return False
        if diagnosis.answer is None or diagnosis.answer.prediction.above_noise > TOLERANCE:
            return False
        self._made.append(_with_confirmed(diagnosis, one))
        return True


def _with_faults(diagnoses: _Diagnoses) -> Diagnosed:
    """The diagnosis that stands of those of the record as it is corrected for one set of faults or another."""
    first = diagnoses.of(diagnoses.accounted)
    if work.is_done():
        return _cut_short(first)
    if diagnoses.accounted.put_off and not first.diagnosis.changes:  # no change it was that looks like a fault
        diagnoses.accounted = diagnoses.accounted.with_all_faults()
        if diagnoses.accounted.faults != first.accounted.faults:
            first = diagnoses.of(diagnoses.accounted)
    freed = _with_values_let_go(first, diagnoses.of)
    if freed is not None:
        first, diagnoses.accounted = freed, freed.accounted
    told = diagnoses.accounted
    removable = told.unread is not None or any(f.corrected and not _plain(f) for f in told.faults)
    if removable and not work.is_done() and first.diagnosis.verdict == UNKNOWN:
        first = _without_what_was_corrected(first, diagnoses)
    answer = first.diagnosis.answer
    if answer is None or not _asks_again(first, answer, diagnoses.accounted):
        return _cut_short(first) if answer is None and work.is_done() else first
    return _cut_short(first) if work.is_done() else _corrected_anew(first, answer, diagnoses)


def _without_what_was_corrected(first: Diagnosed, diagnoses: _Diagnoses) -> Diagnosed:
    """The diagnosis of the record without what the model alone told of its faults, where something is missing there."""
    accounted = diagnoses.accounted.read_as_given()
    other = diagnoses.of(accounted.corrected_for([f for f in accounted.faults if _plain(f)]))
    instead, corrected = other.diagnosis.answer, first.diagnosis.comparison.prediction
    # what leaves no less than the correction by itself is the fault by another name
    return other if instead is not None and instead.response_error < corrected.error else first


def _asks_again(first: Diagnosed, answer: Ranked, accounted: Accounted) -> bool:
    """Whether the record may show other faults beside what is missing."""
    faults = first.accounted.faults
    beside = len(faults) > 0 or first.accounted is not accounted
    several = len(accounted.comparison.model.coordinates) > 1
    noisy = several and answer.prediction.above_noise > TOLERANCE  # a force, as nothing else is left
    spiky = any(f.fault == SPIKES for f in faults)  # near the Nyquist frequency what is missing stands out as they do
    return first.diagnosis.left > TOLERANCE or noisy or spiky or (beside and len(answer.entries) > 1)


def _corrected_anew(first: Diagnosed, answer: Ranked, diagnoses: _Diagnoses) -> Diagnosed:
    """The better of a diagnosis and that of the record corrected for faults that show beside what is missing."""
    try:
        shown = diagnoses.faults_beside(answer)
        if same(shown, first.accounted.faults):
            known = {(fault.fault, fault.channel) for fault in first.faults}
            said = tuple(f for f in shown if not f.corrected and (f.fault, f.channel) not in known)
            return replace(first, faults=(*first.faults, *said))
        if work.is_done():
            return _cut_short(first)
        again = diagnoses.of(diagnoses.accounted.corrected_for(shown))
    except StudyError:
        return first
    better = again.diagnosis.answer is not None and again.diagnosis.answer.response_error < answer.response_error
    return again if better else first


def _cut_short(found: Diagnosed) -> Diagnosed:
    """What was found, said to be the best so far."""
    diagnosis = found.diagnosis
    return replace(found, diagnosis=replace(diagnosis, ended=diagnosis.ended or work.ENDED))


def _with_confirmed(diagnosis: Diagnosis, one: Accounted) -> Diagnosed:
    """A diagnosis of a comparison, with those of its faults that the record shows beside what is missing as well."""
    faults = one.faults
    if diagnosis.comparison.model is not one.comparison.model:  # seen beside values that are let go
        faults = still_seen(faults, diagnosis.comparison.fit, diagnosis.comparison.prepared)
    return Diagnosed(diagnosis, one, confirmed(faults, diagnosis))


def _of_the_same(one: Accounted, other: Accounted) -> bool:
    """Whether two comparisons are of one model with a record corrected and read in the same way."""

    def of(accounted: Accounted) -> tuple[object, ...]:
        corrected = {(f.fault, f.channel, f.value) for f in accounted.faults if f.corrected}
        record = accounted.comparison.record
        return accounted.comparison.model, corrected, record.between, len(record)

    return of(one) == of(other)


def _saying(done: Diagnosed, one: Accounted) -> Diagnosis:
    """A diagnosis that was made, with what is said of the record now."""
    own = done.diagnosis.comparison
    added = [note for note in own.notes if note not in done.accounted.comparison.notes]
    return replace(done.diagnosis, comparison=replace(own, notes=(*one.comparison.notes, *added)))


def _with_values_let_go(first: Diagnosed, found: Callable[[Accounted], Diagnosed]) -> Diagnosed | None:
    """The diagnosis with values let go that the record contradicts once its faults are looked for beside them as well.

    A value that is wrong looks like a fault, and the record that is corrected for that contradicts it no longer. None
    where no fault rests on what the model holds, nothing is contradicted, or more is left so.
    """
    comparison = first.accounted.comparison
    keys = held_coefficients(comparison)
    if not keys or all(map(_plain, first.accounted.faults)):
        return None
    try:
        told = found(first.accounted.beside(comparison.model.with_values(dict.fromkeys(keys))))
        wrong = contradicted(keys, told.diagnosis, comparison)
        if 0 < len(wrong) < len(keys):
            told = found(first.accounted.beside(comparison.model.with_values(dict.fromkeys(wrong))))
    except StudyError:
        return None
    one, other = ((d.diagnosis.answer or d.diagnosis.comparison).prediction.residual for d in (told, first))
    if not wrong or statistics.worse(one, other) >= K:
        return None
    return replace(told, diagnosis=saying_so(told.diagnosis, wrong, comparison))


def _plain(fault: Fault) -> bool:
    """Whether a fault shows in the record itself, or is known, whatever model is held beside it."""
    return fault.held or fault.lost is not None


def confirmed(faults: Sequence[Fault], diagnosis: Diagnosis) -> tuple[Fault, ...]:
    """The faults that the record shows beside the effects that are missing as well, if any are.

    With a delay of a component's force, where that does what the first candidate does.
    """
    late = late_force(diagnosis)
    if late is not None:
        return (*faults, late)
    if diagnosis.answer is None:
        return tuple(faults)
    return still_seen(faults, diagnosis.answer.fit, diagnosis.comparison.prepared)
