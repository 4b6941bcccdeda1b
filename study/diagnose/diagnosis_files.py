"""A diagnosis in words, and as the files that a command writes."""

from study.compare.comparison_report import as_json, where
from study.diagnose import diagnosis_pages, diagnosis_report
from study.diagnose.diagnosis_sentences import sentences
from study.diagnose.separating_test import advice
from study.diagnose.verdict import MISSING, Diagnosis


def in_words(diagnosis: Diagnosis) -> str:
    """A diagnosis in sentences, with the test that would tell tied candidates apart."""
    said = sentences(diagnosis)
    if diagnosis.verdict == MISSING:
        said.append(advice(diagnosis.candidates, diagnosis.comparison.prepared))
    return " ".join(s for s in said if s)


def files(diagnosis: Diagnosis, words: str) -> dict[str, bytes]:
    """``diagnosis.json`` and the pictures by file name; ``words`` is the diagnosis in words."""
    comparison = diagnosis.comparison
    content = diagnosis_report.fields(diagnosis)
    content |= {"record": comparison.record.name, "where": where(comparison), "says": words}
    return {"diagnosis.json": as_json(content)} | diagnosis_pages.files(diagnosis, comparison.record.name)
