"""A diagnosis in words, and as the files that a command writes."""

from collections.abc import Mapping, Sequence
from typing import Any

from study.compare.comparison_report import as_json, mode_rows, where
from study.compare.varying_coefficients import varying_fields
from study.diagnose import diagnosis_report
from study.diagnose.diagnosis_sentences import diagnosis_sentences
from study.diagnose.force_between import reading_in_words
from study.diagnose.held_values import CONTRADICTED
from study.diagnose.needless import Needless, needless_fields, needless_in_words
from study.diagnose.next_test import suggested
from study.diagnose.next_test_report import advice_in_words, next_test_fields
from study.diagnose.varying_candidates import LAID_ANEW
from study.diagnose.verdict import NOTHING, Diagnosis
from study.equations.linear_part import modes_table
from study.faults import fault
from study.faults.fault import Fault
from study.records.record import Record
from study.support.extras import undrawn
from study.support.numbers import enumerated


def diagnosis_in_words(diagnosis: Diagnosis, amounts: bool = True) -> str:
    """A diagnosis in sentences, with the test that would tell tied candidates apart; ``amounts`` as for these."""
    said = diagnosis_sentences(diagnosis, amounts)
    if diagnosis.answer is not None:
        said.append(advice_in_words(suggested(diagnosis)))
    said += [f"{note[0].upper()}{note[1:]}." for note in choices_in_words(diagnosis.comparison.notes)]
    said.append(reading_in_words(diagnosis.comparison))
    return " ".join(s for s in said if s)


def all_names(record: Record) -> str:
    """The name of a record, or those of all that it is strung together of."""
    names = list(dict.fromkeys(stretch.source.name for stretch in record.stretches)) or [record.name]
    return enumerated(names if len(names) <= 3 else [*names[:2], f"{len(names) - 2} more"])


def choices_in_words(notes: Sequence[str]) -> list[str]:
    """What was chosen for the user, who may choose else, and what spoils the answer: said beside the verdict."""
    said = [note for note in notes if CONTRADICTED in note or LAID_ANEW in note]
    return said + [note for note in notes if "(--" in note or "too coarsely" in note]


def unneeded_in_words(found: Sequence[Needless], diagnosis: Diagnosis) -> str:
    """Which terms the diagnosed model does not need, at a place or without one, in sentences; empty if it needs all."""
    return needless_in_words(found, complete=diagnosis.verdict == NOTHING)


def diagnosis_files(
    diagnosis: Diagnosis, words: str, unneeded: Sequence[Needless] = (), faults: Sequence[Fault] = (),
    unfitted: Mapping[str, str] | None = None, by_record: Sequence[Mapping[str, Any]] = (),
) -> dict[str, bytes]:  # fmt: skip
    """``diagnosis.json`` and the pictures, if they can be drawn, by file name; ``words`` is the diagnosis in words.

    ``unneeded`` are the terms of the model that it does not need, ``faults`` those of the measurement that the record
    was corrected for, or may have, ``unfitted`` by name why candidates of the user's could not be fitted,
    ``by_record`` the coefficients that may differ between records.
    """
    comparison, prediction = diagnosis.comparison, diagnosis.comparison.prediction
    content = diagnosis_report.diagnosis_fields(diagnosis)
    content["error"] = {"response": prediction.error, "force": comparison.force_error}
    content["noise_floor"] = {"response": prediction.floor}
    if comparison.model.named:
        for of, found in (("error", prediction.errors), ("noise_floor", prediction.floors)):
            shown = zip(prediction.prepared.outputs.sensors, found.tolist(), strict=True)
            content[of]["sensors"] = {str(sensor): value for sensor, value in shown}
        if comparison.forces:
            content["error"] |= {"coordinates": {force.coordinate: force.total for force in comparison.forces}}
        after = diagnosis.modes_after
        content["modes"] = {"before": mode_rows(comparison.modes), "after": after and mode_rows(after)}
    if diagnosis.varying:
        content["varying"] = [varying_fields(one) for one in diagnosis.varying]
    content |= {"record": comparison.record.name, "where": where(comparison), "says": words}
    following = suggested(diagnosis)
    content["next_test"] = following and next_test_fields(following)
    content["not_needed"] = needless_fields(unneeded)
    content["not_fitted"] = dict(unfitted or {})
    content |= {"notes": list(comparison.notes), "every_sample": comparison.prepared.every}
    content |= {"measurement": [fault.fault_fields(f) for f in faults]}
    if by_record:
        content["coefficients_by_record"] = list(by_record)
    found = {"diagnosis.json": as_json(content)}
    if undrawn():
        return found
    from study.diagnose.diagnosis_pictures import picture_files

    return found | picture_files(diagnosis, all_names(comparison.record))


def modes_before_and_after(diagnosis: Diagnosis) -> str:
    """The modes of a structure as fitted, and with what is missing."""
    comparison, after = diagnosis.comparison, diagnosis.modes_after
    before = modes_table(comparison.modes, comparison.model.coordinates)
    if after is None:
        return f"modes\n{before}"
    with_it = modes_table(after, comparison.model.coordinates)
    return f"modes of the model as fitted\n{before}\n\nmodes with what is missing\n{with_it}"
