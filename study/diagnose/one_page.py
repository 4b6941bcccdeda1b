"""What a diagnosis comes to on one page, for somebody who was not there: the equation, the errors, what is missing.

The content is gathered here once; ``one_page_files`` puts it on an A4 sheet as HTML and as PDF.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from study import __version__
from study.compare.comparison import Comparison
from study.compare.fitted_coefficients import value_and_interval
from study.diagnose.adding import added_candidate
from study.diagnose.diagnosis_files import all_names, choices_in_words, diagnosis_in_words
from study.diagnose.diagnosis_sentences import all_asked, effect_in_words
from study.diagnose.verdict import Diagnosis
from study.equations.model import Model
from study.faults.fault import Fault
from study.figures.labels import term_names
from study.records.record import Record
from study.support.numbers import enumerated, percent

HEADLINES = {
    "missing_effect": "{effects} is missing from the equation",
    "missing_effects": "{effects} are missing from the equation",
    "partly_known": "{effects} missing from the equation, and something else that has no name",
    "unknown_effect": "Something is missing from the equation that no candidate explains",
    "nothing_missing": "Nothing is missing from the equation that this record could show",
}


@dataclass(frozen=True, eq=False)
class OnePage:
    """What stands on the page."""

    headline: str
    record: str  # which records, how long, how fast
    equation: str  # as given, with ``^2`` for powers ...
    completed: str  # ... and with what is missing; empty where nothing is named
    errors: tuple[tuple[str, str, str], ...]  # what, as given, with what is missing
    says: tuple[str, ...]  # the diagnosis in words, and how sure it is
    coefficients: tuple[tuple[str, ...], ...]  # key, term, value, 95 % interval, unit
    notes: tuple[str, ...]  # how the record was read and corrected
    version: str
    before: Comparison
    after: Comparison | None  # with what is missing


def one_page(diagnosis: Diagnosis, faults: Sequence[Fault] = ()) -> OnePage:
    """The page of a diagnosis of one or several records; what is missing is added and fitted for it."""
    before = diagnosis.comparison
    after = None if diagnosis.answer is None else added_candidate(before, diagnosis.answer)
    entries = () if diagnosis.answer is None else diagnosis.answer.entries
    effects, one = enumerated([effect_in_words(entry) for entry in entries]), len(entries) == 1
    if diagnosis.verdict == "partly_known":
        effects += " is" if one else " are"
    headline = HEADLINES[diagnosis.verdict].format(effects=effects)
    if diagnosis.misses_much:
        headline = (
            f"No known effect is missing, but the model misses {percent(before.prediction.error)} of the response"
        )
    shown = after or before
    rows = [
        (c.key, term_names(c.term), *value_and_interval(c), c.unit)
        for c in shown.coefficients
    ]  # fmt: skip
    # The table's are of a finished fit; where it may have no room for them the words keep those of the search.
    amounts = before.model.named or any(entry.term.variation for entry in entries)
    return OnePage(
        headline[0].upper() + headline[1:],
        described(before.record),
        equation_in_symbols(before.model, before.prepared.free),
        "" if after is None else equation_in_symbols(after.model, after.prepared.free),
        _errors(before, after),
        (diagnosis_in_words(diagnosis, amounts), _how_sure(diagnosis)),
        tuple(rows),
        (*(fault.says for fault in faults), *(n for n in before.notes if n not in choices_in_words(before.notes))),
        f"study {__version__}",
        before,
        after,
    )


def described(record: Record) -> str:
    """Names of the records, samples, rate and length."""
    samples = f"{len(record):,} samples at {1.0 / record.dt:.5g} Hz, {len(record) * record.dt:.4g} s"
    return f"{all_names(record)}: {samples} used"


def equation_in_symbols(model: Model, free: bool = False) -> str:
    """``m d2u/dt2 + c v + k u = F(t)``; or ``= 0`` of a ``free`` decay.

    Of a structure its terms with their places, which have no room for formulas.
    """
    if model.named:
        return ", ".join(term_names(entry.name) for entry in model.terms)
    terms = [
        f"{' , '.join(t.symbols)} {_in_brackets(t.term.formula.replace('d2u/dt2', 'd^2u/dt^2'))}" for t in model.terms
    ]
    return f"{' + '.join(terms)} = {'0' if free else 'F(t)'}"


def _in_brackets(formula: str) -> str:
    return f"({formula})" if re.search(r" [+-] ", formula) else formula


def _how_sure(diagnosis: Diagnosis) -> str:
    """What chance does, and what was asked for."""
    asked = f"{all_asked(diagnosis)} were tried."
    if diagnosis.answer is None:
        return asked
    chance = max(diagnosis.answer.p_value, 1e-12)
    return f"The probability that chance alone gains as much is {chance:.1g} or less; {asked}"


def _errors(before: Comparison, after: Comparison | None) -> tuple[tuple[str, str, str], ...]:
    def row(what: str, values: Sequence[str]) -> tuple[str, str, str]:
        return what, values[0], values[1] if after is not None else "-"

    both = [before, *([after] if after is not None else [])]
    unit = before.record.unit(before.worst.sensor)
    rows = [
        row("error of the response, held out", [percent(c.prediction.error) for c in both]),
        row("the same, rms", [f"{c.worst.size * c.worst.error:.3g} {unit}" for c in both]),
        row("noise floor", [percent(c.prediction.floor) for c in both]),
    ]
    if all(c.forces for c in both) and not before.prepared.free:
        rows.append(row("power of the force unexplained, with leakage", [percent(c.force_error) for c in both]))
    return tuple(rows)
