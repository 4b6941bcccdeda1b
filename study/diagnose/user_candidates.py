"""Candidates that the user brings: formulas on the command line, each of which is tried or refused with a reason."""

from collections.abc import Mapping, Sequence

from study.diagnose.verdict import Diagnosis, search_base
from study.equations.linear_part import connections
from study.equations.model import Model, free, named_channels
from study.equations.redundancy import repeated_force
from study.equations.terms import LIBRARY, Term, custom
from study.identify.frequency_domain.inputs import input_history, reverse_inputs
from study.identify.time_domain.fit_model import with_term
from study.records.record import Record
from study.support.errors import StudyError, at, expect


def own_candidates(given: Sequence[str], model: Model) -> list[Term]:
    """``NAME=FORMULA`` as terms.

    Raises
    ------
    StudyError
        If one is not of this form, its formula is refused, its name is taken, or the model has its force already.
    """
    terms: list[Term] = []
    for text in given:
        name, sign, formula = text.partition("=")
        expect(sign, f"{text!r} is no candidate; expected NAME=FORMULA such as 'bracket=u*abs(u)'")
        with at(f"candidate {text}"):
            term = custom(name.strip(), formula.strip())
        expect(term.name not in model, f"candidate {text}: the model has a term {term.name!r}; expected another name")
        taken = any(term.name == other.name for other in terms)
        expect(not taken, f"candidate {text}: two candidates are called {term.name!r}; expected a name for each")
        fault = repeated_force(model.with_term(term))
        expect(fault is None, f"candidate {text}: {fault}")
        terms.append(term)
    return terms


def check_on(record: Record, terms: Sequence[Term]) -> None:
    """Refuse a formula that names what the record lacks, or has no finite value somewhere along it.

    The record holds all three motions; of a structure that has relative motions at each place, channels are asked for.
    """
    for term in terms:
        if any(sensor.coordinate for sensor in record.sensors):
            lacking = [name for name in term.channels if name not in record]
            has = f"the record has {', '.join(record.extra) or 'none beside forces and motions'}"
            expect(not lacking, f"candidate {term.name}: no channel is called {', '.join(lacking)}; {has}")
            continue
        formula = term.components[0].shape
        try:
            if term.parameters:  # of which nothing is known yet: what it needs of the record is asked for alone
                named_channels(Model("own", (free(term),)), record.extra)
                continue
            for item in reverse_inputs(Model("own", (free(LIBRARY["inertia"]), free(term)))):
                if term.name in item.terms:
                    input_history(item, record)
        except StudyError as error:
            raise StudyError(f"candidate {term.heading}={formula}: {error}") from None


def unfitted(diagnosis: Diagnosis, terms: Sequence[Term]) -> dict[str, str]:
    """By name why a candidate of the user's is not in a diagnosis; empty where all are."""
    ranked, found = {row.term.name for row in diagnosis.candidates}, dict[str, str]()
    for term in (t for t in terms if t.name not in ranked):
        base = search_base(diagnosis.comparison)
        try:
            with_term(base, free(term, connections(base.fit.model)[0]))
            found[term.name] = "its free run does not stay finite on the part that is judged"
        except StudyError as error:
            found[term.name] = str(error)
    return found


def unfitted_in_words(untried: Mapping[str, str]) -> list[str]:
    """The same, a sentence each."""
    return [f"{effect} could not be fitted: {why}." for effect, why in untried.items()]
