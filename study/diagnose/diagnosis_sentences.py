"""The diagnosis in plain sentences, composed from its numbers and from nothing else."""

from collections.abc import Sequence

from study.compare.prediction import Prediction
from study.compare.varying_coefficients import varying_in_words
from study.diagnose import verdict
from study.diagnose.constancy import wavers
from study.diagnose.credibility import by_luck, explained_rms
from study.diagnose.held_out import evidence, held_out_of
from study.diagnose.ranked import FittedEffect, Ranked
from study.diagnose.verdict import NOTHING, PARTLY_KNOWN, Diagnosis
from study.equations.model import ModelTerm
from study.equations.place import place_in_words
from study.figures.labels import term_names
from study.support.numbers import by_chance, digits_between, enumerated, in_one_notation, percent
from study.support.thresholds import ALPHA, TOLERANCE, UNSTEADY

DEPENDENCE = 0.1  # held-out share from which the unexplained force is said to depend on something
NAMED = 3  # effects that cannot be told apart, before the others are counted
NAMED_WITHIN = 0.05  # families this close to the best one are named with it


def diagnosis_sentences(diagnosis: Diagnosis, amounts: bool = True) -> list[str]:
    """What to tell the engineer; without the ``amounts`` of what is missing where a table beside the words has them."""
    if diagnosis.verdict == NOTHING:
        return [_nothing(diagnosis)]
    match diagnosis.verdict:
        case verdict.MISSING:
            said = _missing(diagnosis, amounts)
        case verdict.SEVERAL | verdict.PARTLY_KNOWN:
            said = _several(diagnosis, diagnosis.sets[0], amounts)
        case _:
            said = [_misses_much(diagnosis)] if diagnosis.misses_much else _unknown(diagnosis)
    if diagnosis.ended:
        said.append(f"The search was ended {diagnosis.ended}: what is said is the best so far.")
    if diagnosis.answer is not None:
        said += [varying_in_words(one) for one in diagnosis.varying]
    if diagnosis.comparison.prediction.diverged:
        said.insert(0, "The free run of the model grows without bound: its error counts as 100 %.")
    return said


def _nothing(diagnosis: Diagnosis) -> str:
    where = " at any place" if diagnosis.comparison.model.named else ""
    prediction = diagnosis.comparison.prediction
    sizes = (
        f"the error of {_response(diagnosis)} is {percent(prediction.error)}, where noise alone would leave "
        f"{percent(prediction.floor)}"
    )
    seen = next((r for r in diagnosis.candidates if _matters_little(r, prediction)), None)
    if seen is not None:
        effect = effect_in_words(seen.entry)
        return (
            f"Nothing is missing that matters at this level: {sizes}. {effect[0].upper()}{effect[1:]} explains "
            f"{percent(seen.gain.explained, '.1f')} of its mean square, which chance does not, but less than "
            f"{percent(TOLERANCE)} of the response counts as nothing: excite harder and ask again."
        )
    return (
        f"Nothing is missing that this record could show: {sizes}, and what is left looks like noise: it depends "
        f"neither on the motion{where}, nor on its past, nor on time. None of {all_asked(diagnosis)} explains any of "
        "it."
    )


def _matters_little(row: Ranked, prediction: Prediction) -> bool:
    """Whether an effect explains a part of the error by no chance, but one that is practically nothing."""
    seen = row.gain.explained > DEPENDENCE and not (row.unphysical or by_luck(row.effect.interval, row.p_value))
    return seen and explained_rms(prediction, row.prediction) <= TOLERANCE


def _misses_much(diagnosis: Diagnosis) -> str:
    prediction = diagnosis.comparison.prediction
    return (
        f"The model does not describe this record, and no known effect is what it lacks: the error of "
        f"{_response(diagnosis)} is {percent(prediction.error)}, where noise alone would leave "
        f"{percent(prediction.floor)}. None of {all_asked(diagnosis)} explains it. Other modes may show, or a force "
        "that was not measured: --near and --up-to choose one mode, 'linear: modal' in the model file takes several."
    )


def all_asked(diagnosis: Diagnosis) -> str:
    """How many candidates were asked for: ``126 effects and places``."""
    return f"{diagnosis.asked} {'effects and places' if diagnosis.comparison.model.named else 'candidates'}"


def _response(diagnosis: Diagnosis) -> str:
    several = "the forces" if diagnosis.comparison.model.prescribed else "the motions"
    return several if len(diagnosis.comparison.prepared.outputs) > 1 else "the response"


def _before_and_after(diagnosis: Diagnosis, first: Ranked) -> str:
    """Errors without and with an effect: those of both parts, each predicted by the other, where it shows in the one.

    That is so of a weak damping of a decay, which the loud stretches show.
    """
    comparison = diagnosis.comparison
    errors = percent(comparison.prediction.error), percent(first.response_error)
    seen = first.response_error < comparison.prediction.error and errors[0] != errors[1]
    if comparison.record.stretches and not seen:
        both = (
            evidence(comparison.prediction, held_out_of(comparison)),
            evidence(first.prediction, first.held_out),
        )
        return f"{percent(both[0].error)} to {percent(both[1].error)}, of all stretches as the others predict them"
    return f"{errors[0]} to {errors[1]}"


def _missing(diagnosis: Diagnosis, amounts: bool) -> list[str]:
    first = diagnosis.candidates[0]
    words, where = term_names(first.term.name), first.entry.place
    placed = f" {place_in_words(where)}" if where.label else ""
    said = [
        f"{words[0].upper()}{words[1:]} is missing{placed} ({first.term.meaning})."
        if first.term.variation is None
        else f"The model lacks {first.term.meaning}{placed}.",
        f"With it the held-out error of {_response(diagnosis)} falls from {_before_and_after(diagnosis, first)}; the "
        f"noise floor is {percent(first.prediction.floor)}.",
    ]
    if amounts:
        said.append(f"{_its_coefficient(first.entry)} {_amount(first.effect)}.")
    rows = {row.name: row for row in diagnosis.candidates}
    if diagnosis.left > 0.0:
        said.append(f"{percent(diagnosis.left)} of the response is still unexplained beside it, and is not noise.")
    if first.unphysical:
        said.append(f"{doubted('it', first)}.")
    if first.tied_with:
        said.append(f"This record cannot tell it from {_few([rows[name].entry for name in first.tied_with])}.")
    return said


def _its_coefficient(entry: ModelTerm) -> str:
    return "Its coefficient is" if entry.term.variation is None else "The largest change is"


def _several(diagnosis: Diagnosis, answer: Ranked, amounts: bool) -> list[str]:
    effects = enumerated([_with_alike(e.entry, diagnosis) for e in answer.effects])
    one = len(answer.effects) == 1
    are, them, their = ("is", "it", "Its coefficient is") if one else ("are", "them", "Their coefficients are")
    nameless = f", and something beside {them} that has no name" if diagnosis.verdict == PARTLY_KNOWN else ""
    said = [
        f"{effects[0].upper()}{effects[1:]} {are} missing{nameless}.",
        f"With {them} the held-out error of {_response(diagnosis)} falls from {_before_and_after(diagnosis, answer)}; "
        f"the noise floor is {percent(answer.prediction.floor)}.",
    ]
    if amounts:
        said.append(f"{their} {enumerated([_amount(e) for e in answer.effects])}.")
    if diagnosis.left > 0.0:
        said.append(f"{percent(diagnosis.left)} of the response is left beside {them}{_depending(diagnosis)}.")
    if answer.unphysical:
        said.append(f"{doubted('it' if one else 'one of them', answer)}.")
    if len(diagnosis.sets) > 1:
        count = len(diagnosis.sets)
        often = [f"{term_names(name)} in {'all' if n == count else n}" for name, n in diagnosis.included.items()]
        said.append(f"This record cannot tell {count} such sets apart, with {enumerated(often)}.")
    return said


def doubted(who: str, row: Ranked) -> str:
    """Why values as fitted are doubted: they do not act, are seldom met, or are those of nothing physical."""
    if row.unphysical == row.idle:
        return f"As fitted, {row.idle}"
    return f"As fitted {who} is {'unusual' if row.seldom else 'not physical'}: {row.unphysical}"


def _with_alike(entry: ModelTerm, diagnosis: Diagnosis) -> str:
    """An effect in words, and those that may stand in its place."""
    others = diagnosis.alike[entry.name]
    words = effect_in_words(entry)
    return f"{words} (or {' or '.join(term_names(name) for name in others)})" if others else words


def _depending(diagnosis: Diagnosis) -> str:
    """On what that depends which has no name; empty where nothing stands out."""
    found = [f for f in diagnosis.families if f.gain.explained > DEPENDENCE]
    if not found:
        return ", which depends on the motion, its past or time"
    place = f" {place_in_words(found[0].place)}" if found[0].place.label else ""
    return f", which depends on {found[0].family}{place}"


def _unknown(diagnosis: Diagnosis) -> list[str]:
    prediction = diagnosis.comparison.prediction
    error = percent(prediction.error)
    said = [f"Something is missing that no candidate explains: the error of {_response(diagnosis)} is {error}."]
    best = diagnosis.candidates[0] if diagnosis.candidates else None
    if best is not None and best.gain.explained > 0.0 and best.p_value < ALPHA:
        said.append(
            f"The nearest, {effect_in_words(best.entry)}, leaves {percent(best.response_error)}; "
            f"{_doubt(best, diagnosis)}, so its shape is not right."
        )
    families = [f for f in diagnosis.families if f.gain.explained > DEPENDENCE]
    if families:
        best_place = families[0].place
        shares = [(f.family, f.gain.explained) for f in families if f.place == best_place]
        named = [name for name, share in shares if share > shares[0][1] - NAMED_WITHIN]
        where = f" {place_in_words(best_place)}" if best_place.label else ""
        said.append(
            f"The missing force depends on {' or '.join(named)}{where}: general functions of it explain "
            f"{percent(shares[0][1])} of what is unexplained, held out."
        )
    else:
        said.append("Neither displacement, velocity, the past nor time explains a tenth of it.")
    return said


def _doubt(row: Ranked, diagnosis: Diagnosis) -> str:
    if row.effect.steadiness is not None and wavers(row.effect.steadiness, len(diagnosis.candidates)):
        change, chance = percent(row.effect.steadiness.spread()), by_chance(row.effect.steadiness.p_value())
        return f"its coefficient changes with the amplitude by {change} ({chance})"
    if row.effect.flatness is not None and row.effect.flatness.spread() > UNSTEADY:
        return f"its coefficient changes with the frequency by {percent(row.effect.flatness.spread())}"
    return f"what remains still depends on the motion, its past or time ({percent(diagnosis.left)} of the response)"


def _amount(effect: FittedEffect) -> str:
    """Coefficient and shape parameters with their 95 % intervals, or half of them."""
    low, high = effect.interval
    digits = digits_between(effect.coefficient, high - low)
    coefficient, low_end, high_end = in_one_notation((effect.coefficient, low, high), digits)
    said = f"{coefficient} {effect.unit} (95 % interval {low_end} to {high_end})"
    parts = [
        f"{name} = {value:.4g} +- {1.96 * effect.parameter_errors[name]:.2g} {effect.parameter_units[name]}"
        for name, value in effect.parameters.items()
    ]
    return f"{said}, with {', '.join(parts)}" if parts else said


def _few(entries: Sequence[ModelTerm]) -> str:
    """A few effects in words, and how many more there are."""
    shown = [effect_in_words(entry) for entry in (entries if len(entries) <= NAMED + 1 else entries[:NAMED])]
    return enumerated([*shown, *([f"{len(entries) - len(shown)} more"] if len(entries) > len(shown) else [])])


def effect_in_words(entry: ModelTerm) -> str:
    """``cubic stiffness``, or ``cubic stiffness between floor2 and floor3``."""
    words = term_names(entry.term.name)
    return f"{words} {place_in_words(entry.place)}" if entry.place.label else words
