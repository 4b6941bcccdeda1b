"""Faults of the measurement and missing effects are asked for in the light of each other; no record is fitted here."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from study.diagnose import confirmed_faults
from study.diagnose.confirmed_faults import diagnose_accounted
from study.diagnose.verdict import SEVERAL, UNKNOWN
from study.faults.fault import Fault, same
from study.support import work
from study.support.errors import StudyError
from study.support.thresholds import TOLERANCE


def delay(value: float, error: float = 0.01, **options: Any) -> Fault:
    return Fault("delay", "displacement", value, error, **options)


OFFSET = Fault("offset", "displacement", 1e-3, 1e-5)
NOISE = Fault("force_noise", "force", 1.0, 0.1)


def test_faults_are_the_same_by_their_errors():
    assert same([], [])
    assert same([delay(1.0)], [delay(1.02)])
    assert not same([delay(1.0)], [delay(1.06)])
    assert same([delay(1.0)], [delay(1.06, error=0.03)])  # either error counts
    assert same([delay(1.0), OFFSET], [OFFSET, delay(1.0)])


def test_other_faults_are_not_the_same():
    assert not same([delay(1.0)], [])
    assert not same([], [delay(1.0)])
    assert not same([delay(1.0)], [delay(1.0), OFFSET])
    assert not same([delay(1.0)], [Fault("delay", "velocity", 1.0, 0.01)])


def test_what_is_only_named_makes_no_difference():
    assert same([NOISE], [])
    assert same([delay(1.0), NOISE], [delay(1.0)])
    assert same([delay(1.0, rivals=("relaxation",))], [])


class Model:
    """A model of a single mass that knows the names of its terms."""

    coordinates = ("",)

    def __init__(self, *names: str):
        self.names = names

    def with_term(self, entry: str) -> "Model":
        return Model(*self.names, entry)


class Samples:
    """A record that no test asks for more of than how it is read, and how long it is."""

    def __init__(self, between: str = "band-limited"):
        self.between = between

    def __len__(self) -> int:
        return 4096


INERTIA, SAMPLES = Model("inertia"), Samples()


@dataclass(frozen=True)
class Compared:
    """A comparison of that model with that record, and what is said of it."""

    notes: tuple[str, ...]
    model: Model = INERTIA
    record: Samples = SAMPLES
    prediction: Any = field(default_factory=lambda: SimpleNamespace(error=1.0))


class Corrected:
    """A record that is corrected for faults, and the faults that it shows beside a fuller model."""

    def __init__(self, faults: Sequence[Fault], beside: Sequence[Fault] | StudyError):
        self.faults, self.beside = tuple(faults), beside
        self.comparison = Compared(tuple(f"corrected for {fault.fault}" for fault in faults))
        self.asked: list[tuple[str, ...]] = []
        self.otherwise: list[tuple[Fault, ...]] = []  # for what it was corrected in its place
        self.put_off, self.work_left = False, np.inf
        self.unread: Corrected | None = None  # the record before its force was read as held

    def read_as_given(self) -> "Corrected":
        return self.unread or self

    def faults_beside(self, _fit: Any, model: Model) -> tuple[Fault, ...]:
        self.asked.append(model.names)
        if isinstance(self.beside, StudyError):
            raise self.beside
        return tuple(self.beside)

    def corrected_for(self, faults: Sequence[Fault]) -> "Corrected":
        self.otherwise.append(tuple(faults))
        return Corrected(faults, ())


@dataclass(frozen=True)
class Found:
    """A diagnosis."""

    answer: Any
    left: float
    verdict: str
    changes: bool
    comparison: Compared
    ended: str = ""


def diagnosed(
    monkeypatch: pytest.MonkeyPatch, record: Any, *found: tuple[tuple[str, ...], float, float]
) -> tuple[Any, int]:
    """What comes out, and how many diagnoses were made; ``found`` are the effects of each, what is left, the error.

    Where there are none, the error is that of the model.
    """
    made: list[tuple[str, ...]] = []

    def diagnosis(comparison: Any, **_: Any) -> Any:
        names, left, error = found[len(made)]
        made.append(names)
        answer = SimpleNamespace(entries=names, fit=None, response_error=error) if names else None
        changes = any("_over_" in name for name in names)
        verdict = SEVERAL if names else UNKNOWN
        if not names and error:
            comparison = replace(comparison, prediction=SimpleNamespace(error=error))
        return Found(answer, left, verdict, changes, comparison)

    monkeypatch.setattr(confirmed_faults, "diagnose_as_read", diagnosis)
    monkeypatch.setattr(confirmed_faults, "confirmed", lambda faults, _: tuple(faults))
    monkeypatch.setattr(confirmed_faults, "held_coefficients", lambda _: ())
    return diagnose_accounted(record), len(made)


SET, ONE = ("cubic_stiffness", "coulomb_friction"), ("cubic_stiffness",)


def test_a_record_is_corrected_anew_where_it_shows_other_faults_beside_the_set(monkeypatch: pytest.MonkeyPatch):
    late = delay(1.0)
    record = Corrected([OFFSET], beside=[late])
    found, made = diagnosed(monkeypatch, record, (SET, 0.01, 0.05), (SET, 0.0, 0.02))
    assert made == 2
    assert record.asked == [("inertia", *SET)]
    assert found.accounted.faults == found.faults == (late,)
    assert found.diagnosis.answer.response_error == 0.02


def test_where_all_work_is_done_the_first_diagnosis_stands_and_says_so(monkeypatch: pytest.MonkeyPatch):
    record = Corrected([OFFSET], beside=[delay(1.0)])
    record.work_left = 0.0
    found, made = diagnosed(monkeypatch, record, (SET, 0.01, 0.05))
    assert made == 1
    assert record.asked == []
    assert found.diagnosis.ended == work.ENDED


@pytest.mark.parametrize("again", [(SET, 0.0, 0.06), ((), 0.0, 0.0)])
def test_the_better_of_both_diagnoses_stands(monkeypatch: pytest.MonkeyPatch, again: Any):
    record = Corrected([OFFSET], beside=[delay(1.0)])
    found, made = diagnosed(monkeypatch, record, (SET, 0.01, 0.05), again)
    assert made == 2
    assert found.accounted is record
    assert found.diagnosis.answer.response_error == 0.05


@pytest.mark.parametrize(
    ("names", "left", "faults"),
    [
        ((), 0.1, []),  # nothing beside which to ask
        (ONE, TOLERANCE, [OFFSET]),  # one effect leaves nothing
        (SET, TOLERANCE, []),  # a set leaves nothing, and nothing was corrected that it may have imitated
    ],
)
def test_faults_are_not_asked_for_again_where_there_is_no_reason_to(
    monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...], left: float, faults: list[Fault]
):
    record = Corrected(faults, beside=[delay(1.0)])
    found, made = diagnosed(monkeypatch, record, (names, left, 0.05))
    assert made == 1
    assert not record.asked
    assert found.accounted is record


SPIKES = Fault("spikes", "displacement", 3.0, lost=np.zeros(9, dtype=bool))
KNOWN = delay(0.5, held=True)


def test_what_was_corrected_may_be_the_motion_that_is_missing(monkeypatch: pytest.MonkeyPatch):
    """Where nothing is found, the record is diagnosed without what the model alone told of its faults."""
    record = Corrected([OFFSET, SPIKES, KNOWN], beside=[SPIKES, KNOWN])
    found, made = diagnosed(monkeypatch, record, ((), 0.1, 0.0), (SET, 0.0, 0.05))
    assert made == 2
    assert record.otherwise[0] == (SPIKES, KNOWN)
    assert found.diagnosis.answer.response_error == 0.05
    assert found.accounted.faults == (SPIKES, KNOWN)


def test_a_force_that_the_model_alone_told_to_be_held_may_be_none(monkeypatch: pytest.MonkeyPatch):
    """A multisine under which friction is missing was read as held, for good, and no effect left noise beside it."""
    record = Corrected([], beside=[])
    record.unread, record.comparison = Corrected([], beside=[]), Compared((), record=Samples("held"))
    found, made = diagnosed(monkeypatch, record, ((), 0.1, 0.0), (SET, 0.0, 0.05))
    assert made == 2
    assert record.unread.otherwise == [()]
    assert not record.otherwise
    assert found.diagnosis.answer.response_error == 0.05


@pytest.mark.parametrize("leaves", [0.05, 0.04])
def test_an_effect_that_leaves_no_less_than_the_correction_does_not_undo_it(
    monkeypatch: pytest.MonkeyPatch, leaves: float
):
    """Of the Silverbox an offset that was corrected came back as a constant force, and the error rose in between."""
    record = Corrected([OFFSET], beside=[])
    found, made = diagnosed(monkeypatch, record, ((), 0.1, leaves), (SET, 0.0, 0.05))
    assert made == 2
    assert found.accounted is record
    assert found.diagnosis.answer is None


def test_where_nothing_is_found_either_way_the_corrected_record_stands(monkeypatch: pytest.MonkeyPatch):
    record = Corrected([OFFSET], beside=[])
    found, made = diagnosed(monkeypatch, record, ((), 0.1, 0.0), ((), 0.1, 0.0))
    assert made == 2
    assert found.accounted is record


@pytest.mark.parametrize("faults", [[SPIKES], [KNOWN], [NOISE]])
def test_what_shows_without_a_model_stays_corrected(monkeypatch: pytest.MonkeyPatch, faults: list[Fault]):
    record = Corrected(faults, beside=[])
    assert diagnosed(monkeypatch, record, ((), 0.1, 0.0))[1] == 1


@pytest.mark.parametrize(("names", "left"), [(ONE, 2.0 * TOLERANCE), (SET, 0.0)])
def test_the_same_faults_beside_it_change_nothing(monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...], left: float):
    record = Corrected([delay(1.0)], beside=[delay(1.01)])
    found, made = diagnosed(monkeypatch, record, (names, left, 0.05))
    assert len(record.asked) == made == 1
    assert found.accounted is record


def test_noise_on_a_force_that_shows_beside_the_effects_alone_is_said(monkeypatch: pytest.MonkeyPatch):
    """Nothing undoes it: no other diagnosis is made for it, and what was known of it is not said twice."""
    record = Corrected([], beside=[NOISE])
    found, made = diagnosed(monkeypatch, record, (ONE, 2.0 * TOLERANCE, 0.05))
    assert made == 1
    assert found.faults == (NOISE,)
    assert diagnosed(monkeypatch, Corrected([NOISE], beside=[NOISE]), (ONE, 0.01, 0.05))[0].faults == (NOISE,)


def test_where_the_fuller_model_cannot_be_asked_the_first_diagnosis_stands(monkeypatch: pytest.MonkeyPatch):
    record = Corrected([OFFSET], beside=StudyError("no finite motion"))
    found, made = diagnosed(monkeypatch, record, (SET, 0.01, 0.05))
    assert made == 1
    assert found.accounted is record


class PutOff(Corrected):
    """A record along which a coefficient seems to change: faults that look like that are yet to be looked for."""

    def __init__(self, hidden: Sequence[Fault], beside: Sequence[Fault] | None = None):
        super().__init__((), ())
        self.comparison = Compared(("faults are put off",))
        self.put_off, self.hidden, self.shown = True, hidden, hidden if beside is None else beside

    def with_all_faults(self) -> Corrected:
        return Corrected(self.hidden, self.shown)


def test_faults_that_look_like_a_change_are_looked_for_where_none_is_named(monkeypatch: pytest.MonkeyPatch):
    late = delay(1.0)
    found, made = diagnosed(monkeypatch, PutOff([late]), (ONE, 0.01, 0.05), (ONE, 0.0, 0.02))
    assert made == 2
    assert found.accounted.faults == (late,)


def test_a_change_that_is_named_needs_no_fault_in_its_stead(monkeypatch: pytest.MonkeyPatch):
    found, made = diagnosed(monkeypatch, PutOff([delay(1.0)]), (("linear_stiffness_over_time",), 0.0, 0.02))
    assert made == 1
    assert found.accounted.faults == ()


def test_a_record_that_is_corrected_as_before_is_not_diagnosed_again(monkeypatch: pytest.MonkeyPatch):
    """Beside what is missing the fault is none: what was found without it is known, what was said of it is not true."""
    record = PutOff([delay(1.0)], beside=[])
    found, made = diagnosed(monkeypatch, record, (SET, 0.01, 0.02), (SET, 0.01, 0.05))
    assert made == 2
    assert found.accounted.faults == found.faults == ()
    assert found.diagnosis.answer.response_error == 0.02
    assert found.diagnosis.comparison.notes == ()


def test_with_another_fault_it_is(monkeypatch: pytest.MonkeyPatch):
    record = PutOff([delay(1.0)], beside=[delay(1.1)])
    found, made = diagnosed(monkeypatch, record, (SET, 0.01, 0.02), (SET, 0.01, 0.05), (SET, 0.01, 0.01))
    assert made == 3
    assert [fault.value for fault in found.accounted.faults] == [1.1]


def found_in_stead(
    monkeypatch: pytest.MonkeyPatch, record: Corrected, named: tuple[str, ...], above_noise: float
) -> tuple[bool | None, Any, int]:
    """Whether a fault stands for the change that the record asks for, what comes out, and how many diagnoses were made.

    ``named`` is what is found before a change is asked for; beside that of other corrections so much is left.
    """
    told: list[bool] = []
    made: list[Any] = []

    def answer_of(names: tuple[str, ...], error: float, above: float) -> Any:
        prediction = SimpleNamespace(above_noise=above)
        return SimpleNamespace(entries=names, fit=names, response_error=error, prediction=prediction)

    def diagnosis(comparison: Any, *, otherwise: Any, **_: Any) -> Any:
        made.append(comparison)
        if len(made) > 1:
            return Found(answer_of(SET, 0.02 + above_noise, above_noise), 0.0, SEVERAL, False, comparison)
        answer = answer_of(named, 0.05, 0.04) if named else None
        before = Found(answer, 0.04, SEVERAL if named else UNKNOWN, False, comparison)
        told.append(otherwise(before))
        changed = answer_of((*named, "linear_stiffness_over_time"), 0.03, 0.0)
        return before if told[-1] else Found(changed, 0.0, SEVERAL, True, comparison)

    monkeypatch.setattr(confirmed_faults, "diagnose_as_read", diagnosis)
    monkeypatch.setattr(confirmed_faults, "confirmed", lambda faults, _: tuple(faults))
    monkeypatch.setattr(confirmed_faults, "held_coefficients", lambda _: ())
    found = diagnose_accounted(record)  # type: ignore[arg-type]
    return told[0], found, len(made)


@pytest.mark.parametrize("named", [(), ONE])
def test_a_fault_that_explains_all_is_asked_for_before_a_change(monkeypatch: pytest.MonkeyPatch, named: Any):
    """The diagnosis of the record as it is corrected then is made once."""
    shown = (delay(1.0),) if named else ()
    instead, found, made = found_in_stead(monkeypatch, Corrected([OFFSET], beside=shown), named, 0.0)
    assert instead
    assert made == 2
    assert found.diagnosis.answer.response_error == 0.02
    assert found.accounted.faults == shown


def test_a_change_is_asked_for_where_no_fault_explains_all(monkeypatch: pytest.MonkeyPatch):
    record = Corrected([OFFSET], beside=[delay(1.0)])
    instead, found, _ = found_in_stead(monkeypatch, record, ONE, 0.02)
    assert not instead
    assert found.diagnosis.changes


@pytest.mark.parametrize(
    ("faults", "beside", "named"),
    [
        ([OFFSET], [OFFSET], ONE),  # the same faults show beside what is named
        ([KNOWN], [], ()),  # nothing is named, and what was corrected is known
        ([OFFSET], StudyError("no finite motion"), ONE),
    ],
)
def test_a_change_is_asked_for_at_once_where_no_other_fault_shows(
    monkeypatch: pytest.MonkeyPatch, faults: list[Fault], beside: Any, named: Any
):
    instead, found, made = found_in_stead(monkeypatch, Corrected(faults, beside), named, 0.0)
    assert not instead
    assert made == 1
    assert found.diagnosis.changes


def test_no_diagnosis_is_begun_where_all_work_is_done(monkeypatch: pytest.MonkeyPatch):
    """Beside what is missing other faults show, but looking for these has taken what work was left."""

    class AtItsEnd(Corrected):
        def faults_beside(self, _fit: Any, model: Model) -> tuple[Fault, ...]:
            work.add(10)
            return super().faults_beside(_fit, model)

    record = AtItsEnd([OFFSET], beside=[delay(1.0)])
    record.work_left = 10
    found, made = diagnosed(monkeypatch, record, (SET, 0.01, 0.05))
    assert made == 1
    assert found.accounted is record
    assert found.diagnosis.ended == work.ENDED
