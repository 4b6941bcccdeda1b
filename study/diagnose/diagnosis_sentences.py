"""The diagnosis in plain sentences, composed from its numbers and from nothing else."""

import math
from collections.abc import Sequence

from study.diagnose.constancy import wavers
from study.diagnose.held_out import held_out_of, residual_held_out
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import MISSING, NOTHING, Diagnosis
from study.figures.labels import term_names
from study.support.numbers import by_chance, percent
from study.support.thresholds import ALPHA, UNSTEADY

DEPENDENCE = 0.1  # held-out share from which the unexplained force is said to depend on something
NAMED = 3  # effects that cannot be told apart, before the others are counted
CLOSE = 0.05  # families this close to the best one are named with it


def diagnosis_sentences(diagnosis: Diagnosis) -> list[str]:
    """What to tell the engineer."""
    if diagnosis.verdict == NOTHING:
        return [_nothing(diagnosis)]
    said = _missing(diagnosis) if diagnosis.verdict == MISSING else _unknown(diagnosis)
    if diagnosis.comparison.prediction.diverged:
        said.insert(0, "The free run of the model does not stay finite: its error counts as 100 %.")
    return said


def _nothing(diagnosis: Diagnosis) -> str:
    prediction = diagnosis.comparison.prediction
    return (
        f"Nothing is missing that this record could show: the error of the response is {percent(prediction.error)}, "
        "and what is left depends no more than chance has it on the motion, its past or time, as noise does; "
        f"none of {len(diagnosis.candidates)} candidates explains any of it."
    )


def _before_and_after(diagnosis: Diagnosis, first: Ranked) -> str:
    """Errors without and with an effect: those of both parts, each predicted by the other, where it shows in the one.

    That is so of a weak damping of a decay, which the loud stretches show.
    """
    comparison = diagnosis.comparison
    errors = percent(comparison.prediction.error), percent(first.response_error)
    seen = first.response_error < comparison.prediction.error and errors[0] != errors[1]
    if comparison.record.stretches and not seen:
        both = (
            residual_held_out(comparison.prediction, held_out_of(comparison)),
            residual_held_out(first.prediction, first.held_out),
        )
        return f"{percent(both[0].error)} to {percent(both[1].error)}, of all stretches as the others predict them"
    return f"{errors[0]} to {errors[1]}"


def _missing(diagnosis: Diagnosis) -> list[str]:
    first, units = diagnosis.candidates[0], diagnosis.comparison.record.units
    force, length = units.get("force", "N"), units.get("displacement", "m")
    said = [
        f"{_words(first.name)} is missing ({first.term.meaning}).",
        f"With it the held-out error of the response falls from {_before_and_after(diagnosis, first)}; the noise floor "
        f"is {percent(first.prediction.floor)}.",
        f"Its coefficient is {_amount(first, force, length)}{_shape(first, length)}.",
    ]
    if diagnosis.pair:
        second = next(name for name in diagnosis.pair if name != first.name)
        said.append(f"It does not explain all: of all candidates, {term_names(second)} beside it explains most.")
    elif diagnosis.left > 0.0:
        said.append(f"Structure of {percent(diagnosis.left)} of the response is left beside it.")
    if first.unphysical:
        said.append(f"As fitted it is no physical effect: {first.unphysical}.")
    if first.tied_with:
        said.append(f"This record cannot tell it from {_named(first.tied_with)}.")
    return said


def _unknown(diagnosis: Diagnosis) -> list[str]:
    prediction = diagnosis.comparison.prediction
    error = percent(prediction.error)
    said = [f"Something is missing that no candidate explains: the error of the response is {error}."]
    best = diagnosis.candidates[0] if diagnosis.candidates else None
    if best is not None and best.gain.explained > 0.0 and best.p_value < ALPHA:
        said.append(
            f"The nearest, {term_names(best.name)}, leaves {percent(best.response_error)}; "
            f"{_doubt(best, diagnosis)}, so its shape is not right."
        )
    families = sorted(diagnosis.families.items(), key=lambda item: -item[1])
    if families and families[0][1] > DEPENDENCE:
        named = [name for name, share in families if share > families[0][1] - CLOSE]
        said.append(
            f"The missing force depends on {' or '.join(named)}: general functions of it explain "
            f"{percent(families[0][1])} of what is unexplained, held out."
        )
    else:
        said.append("Neither displacement, velocity, the past nor time as such explains a tenth of it.")
    return said


def _doubt(row: Ranked, diagnosis: Diagnosis) -> str:
    if row.steadiness is not None and wavers(row.steadiness, len(diagnosis.candidates)):
        change, chance = percent(row.steadiness.spread()), by_chance(row.steadiness.p_value())
        return f"its coefficient changes with the amplitude by {change} ({chance})"
    if row.flatness is not None and row.flatness.spread() > UNSTEADY:
        return f"its coefficient changes with the frequency by {percent(row.flatness.spread())}"
    return f"what remains still depends on the motion, its past or time ({percent(diagnosis.left)} of the response)"


def _amount(row: Ranked, force: str, length: str) -> str:
    low, high = row.interval
    digits = _digits(row.coefficient, high - low)
    unit = row.term.unit(row.term.symbols[0], force, length)
    return f"{row.coefficient:.{digits}g} {unit} (95 % interval {low:.{digits}g} to {high:.{digits}g})"


def _digits(value: float, width: float) -> int:
    """Significant digits that tell the ends of an interval apart, four at least."""
    if value == 0.0 or not 0.0 < width < math.inf:
        return 4
    return min(max(4, math.ceil(math.log10(abs(value) / width)) + 2), 12)


def _shape(row: Ranked, length: str) -> str:
    units = {"length": length, "time": "s", "frequency": "Hz", "1/length": f"1/{length}"}
    known = {p.name: units[p.quantity] for p in row.term.parameters} | {"phase": "rad"}
    parts = [
        f"{name} = {value:.4g} +- {row.parameter_errors[name]:.2g} {known[name]}"
        for name, value in row.parameters.items()
    ]
    return f", with {', '.join(parts)}" if parts else ""


def _named(names: Sequence[str]) -> str:
    """A few names in words, and how many more there are."""
    shown = [term_names(name) for name in (names if len(names) <= NAMED + 1 else names[:NAMED])]
    more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
    return ", ".join(shown) + more


def _words(name: str) -> str:
    words = term_names(name)
    return words[0].upper() + words[1:]
