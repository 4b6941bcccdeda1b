"""A diagnosis in words, and as the files that a command writes."""

from study.compare.comparison import Comparison
from study.compare.comparison_report import as_json, where
from study.diagnose import diagnosis_pages, diagnosis_report
from study.diagnose.diagnosis_sentences import sentences
from study.diagnose.separating_test import advice
from study.diagnose.verdict import MISSING, Diagnosis
from study.records.plan import Plan
from study.records.record import Record


def in_words(found: Diagnosis, record: Record, how: Plan) -> str:
    """A diagnosis in sentences, with the test that would part a tie."""
    said = sentences(found, record.units.get("force", "N"), record.units.get("displacement", "m"))
    if found.verdict == MISSING:
        said.append(advice(found.candidates, record, how))
    return " ".join(s for s in said if s)


def files(found: Diagnosis, compared: Comparison, said: str) -> dict[str, bytes]:
    """``diagnosis.json`` and the pictures by file name.

    Parameters
    ----------
    found : Diagnosis
        What is missing.
    compared : Comparison
        The same model held against the same record.
    said : str
        The diagnosis in words.
    """
    content = diagnosis_report.fields(found)
    content["error"]["force"] = compared.force.total
    content |= {"record": compared.record.name, "where": where(compared), "says": said}
    return {"diagnosis.json": as_json(content)} | diagnosis_pages.files(found, compared.record.name)
