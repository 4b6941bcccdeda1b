"""The words of a page as fragments of HTML, by the name of their place; whatever a user typed is escaped."""

import math
from base64 import b64encode
from collections.abc import Sequence
from html import escape

import numpy as np

from study.compare.comparison import Comparison
from study.compare.comparison_sentences import comparison_in_words
from study.compare.fitted_coefficients import Coefficient
from study.compare.varying_coefficients import VaryingCoefficient, varying_in_words
from study.diagnose.diagnosis_report import explained_share
from study.diagnose.diagnosis_sentences import doubted
from study.diagnose.needless import Needless
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import MISSING, NOTHING, PARTLY_KNOWN, SEVERAL, Diagnosis
from study.equations.coefficient_units import coefficient_unit
from study.equations.linear_part import connections
from study.equations.model import ModelTerm
from study.equations.place import place_in_words
from study.equations.terms import is_own
from study.explore.page_units import Scale, in_percent, in_sentence, in_text, mass, motion, number, with_error
from study.explore.session import Stage
from study.figures.labels import power_of_ten, term_names
from study.support.arrays import Floats
from study.support.statistics import Gain
from study.support.thresholds import ALPHA

VERDICT_HEADINGS = {
    MISSING: "An effect is missing", SEVERAL: "Several effects are missing", NOTHING: "Nothing is missing",
    PARTLY_KNOWN: "Effects are missing, and something that has no name",
}  # fmt: skip
UNKNOWN_HEADING = "Something is missing that no candidate explains"
WAITING = "Candidates are being tried …"
DIAGNOSIS_NOT_ASKED = (
    "Not asked for here: <code>study diagnose</code> or <code>study explore</code> tells which effect is missing."
)
ABOUT_ERROR = "The model runs free under the measured force, on the part of the record that it was not fitted to."
MANY_CHARACTERS = 8  # of a large number
ABOUT_FLOOR = "From the quietest bands of what is left, or from what differs between periods."
ABOUT_FORCE = "The model in reverse: what its terms, computed from the measured motion, leave of the measured force."
SCALE = "".join(f"<span style='left:{x}%'>{x}</span>" for x in (0, 50, 100))
HEAD = (
    f"<li class='scale'><span class='head'>share of the difference explained / %</span><i class='axis'>{SCALE}</i></li>"
)
ONLY_NOISE = "What is left looks like noise: no missing force stands out over displacement and velocity."


def words(stage: Stage, step: int, live: bool) -> dict[str, str]:
    """Every fragment of a model that does not hang on what the panels are turned to, by its place."""
    comparison, diagnosed = stage.comparison, live or stage.diagnosis is not None  # a live page diagnoses by itself
    return {
        "figures": _figures(comparison),
        "says": escape(in_sentence(comparison_in_words(comparison, diagnosed))),
        "verdict": _verdict(stage, live),
        "candidates": _candidates(stage, live),
        "next-test": _next_test(stage),
        "equation": equation(stage),
        "equation-values": equation(stage, values=True),
        "only-noise": ONLY_NOISE if comparison.growths is None else "",
        "coefficients": _coefficients(stage, live),
        "notes": escape(in_sentence("; ".join(comparison.notes))),
        "step": escape(f"{step} {in_words(stage.label)}"),
    }


def in_words(label: str) -> str:
    """The name of a term as people write it."""
    return term_names(label)


def equation(stage: Stage, values: bool = False) -> str:
    """The equation of motion with its symbols, or with the values of its coefficients in the units of the record.

    None of a structure, which has several.
    """
    if stage.model.named:
        return ""
    known = stage.values
    parts: list[str] = []
    for entry in stage.model.terms:
        own, force = entry.term.written
        symbols = ", ".join(
            f"<b>{number(known[s], 4)}</b>" if values and s in known else f"<i>{escape(s)}</i>" for s in own
        )
        shape = escape(in_text(force).replace("d2u/dt2", "d²u/dt²"))
        parts.append(f"{symbols} {shape}" if shape.isalpha() or "d²" in shape else f"{symbols} [{shape}]")
    return " + ".join(parts) + " = F(t)"


def _figures(comparison: Comparison) -> str:
    """The large numbers; of several sensors the worst is told, of one what its error is in its own unit."""
    prediction, worst = comparison.prediction, comparison.worst
    about = f"worst {in_percent(worst.error)} at {worst.sensor.coordinate}"
    if len(comparison.views) == 1:
        size = worst.error * worst.size
        shown = motion(comparison.record.unit(worst.sensor), size)
        about = f"rms {number(size / shown.factor, 3)} {in_text(shown.unit)}; fit {in_percent(1.0 - worst.error)}"
    unexplained = "of its power unexplained"
    if len(comparison.forces) > 1:
        most = max(comparison.forces, key=lambda force: force.total)
        unexplained += f"; worst {in_percent(most.total)} at {most.coordinate}"
    cells = (
        ("error", "Error of the response", in_percent(prediction.error), about, ABOUT_ERROR),
        ("floor", "Noise floor", in_percent(prediction.floor), "what no model could explain", ABOUT_FLOOR),
        ("force", "Error of the force", in_percent(comparison.force_error), unexplained, ABOUT_FORCE),
    )
    told = cells if comparison.forces else cells[:-1]  # modes have no equation
    return "".join(_figure(*cell) for cell in told)


def _figure(key: str, title: str, value: str, about: str, meaning: str) -> str:
    """One of the large numbers, small enough for its place where it has many digits."""
    size = " class='long'" if len(value) > MANY_CHARACTERS else ""
    return (
        f'<div class="figure" id="figure-{key}" title="{escape(meaning)}"><span>{title}</span><b{size}>{value}</b>'
        f"<small>{escape(about)}</small></div>"
    )


def _verdict(stage: Stage, live: bool) -> str:
    if stage.diagnosis is None:
        return f"<p class='waiting'>{WAITING if live else DIAGNOSIS_NOT_ASKED}</p>"
    head = VERDICT_HEADINGS.get(stage.diagnosis.verdict, UNKNOWN_HEADING)
    return f"<h3 class='{stage.diagnosis.verdict}'>{head}</h3><p>{escape(in_sentence(stage.said))}</p>"


def _next_test(stage: Stage) -> str:
    """The picture of what tied effects would answer to the test that decides; empty where there is none."""
    if not stage.next_test:
        return ""
    what = "What drives the test, what each of the tied effects would answer, and how the evidence grows"
    return f"<img alt='{what}' src='data:image/png;base64,{b64encode(stage.next_test).decode()}'>"


def _candidates(stage: Stage, live: bool) -> str:
    """The list of candidates: sets of effects that no one can tell apart, single effects, and what is not offered."""
    diagnosis = stage.diagnosis
    if diagnosis is None:
        return ""
    offered = {i: row for i, row in enumerate(stage.shown) if offers(diagnosis, row)}
    shown = {row.name for row in offered.values()}
    left = [in_words(row.name) for row in diagnosis.candidates if row.name not in shown]
    more = len(left)
    others = f"{more} more explain no more than chance would" if offered else f"none of {more} explains any of it"
    if stage.model.named:  # too many to name
        more = diagnosis.asked - sum(len(row.entries) == 1 for row in offered.values())
        others, left = f"{more} more effects and places explain less, or no more than chance would", []
    rows: list[str] = [HEAD] if offered else []
    sets = tuple(row for row in diagnosis.sets if len(row.entries) > 1)
    apart = "sets of effects, which this record cannot tell apart" if len(sets) > 1 else "set of effects"
    for kind, those in ((apart, sets), ("single effects", diagnosis.candidates)):
        own = [_row(i, row, _rank(row, those), stage, live) for i, row in offered.items() if row in those]
        rows += [f"<li class='kind'>{kind}</li>" if sets and own else "", *own]
    rest = f"<li class='more'>{others}{escape(': ' + ', '.join(left)) if left else ''}</li>" if more > 0 else ""
    return f"<ol>{''.join(rows)}{rest}</ol>"


def gives(row: Ranked) -> bool:
    """Whether a candidate explains more than chance would: one that does not is not offered."""
    return row.gain.explained > 0.0 and row.p_value < ALPHA


def offers(diagnosis: Diagnosis, row: Ranked) -> bool:
    """Whether a candidate is offered: the user's own, and one of what is missing that explains more than chance."""
    return is_own(row.term) or (diagnosis.verdict != NOTHING and gives(row))


def _row(number: int, row: Ranked, rank: str, stage: Stage, live: bool) -> str:
    """One row: an effect or a set of them, what it explains, and the words that are shown when it is pointed at."""
    add = f"<button data-act='add' data-name='{escape(row.name)}'>Add</button>" if live else ""
    explained = explained_share(row.gain, with_error=False)
    names = [_name(entry) for entry in row.entries]
    shown = "".join(f"<b>{name}</b>{f' <i>{place}</i>' if place else ''}" for name, place in names)
    spoken = ", ".join(" ".join(name).strip() for name in names)
    place = row.effect.entry.place
    # the sketch may have the ends of the place the other way round
    sketched = next((known.label for known in connections(stage.model) if known.path == place.path), place.label)
    at = f" data-at='{escape(sketched)}'" if place.label else ""
    return (
        f"<li class='candidate{' set' if len(names) > 1 else ''}' data-candidate='{number}' "
        f"data-row='{escape(row.name)}'{at} "
        f"data-label='{escape(_label(row))}' data-of='{' '.join(_name(row.effect.entry)).strip()}' tabindex='0' "
        f"aria-label='{spoken}, explains {explained}'><span class='rank'>{rank}</span>"
        f"<span class='name' title='{spoken}; a click pins it beside another'>{shown}</span>{_ties(row)}{bar(row.gain)}"
        f"<span class='explained'>{explained}</span>{add}<small hidden>{_detail(row)}</small></li>"
    )


def _name(entry: ModelTerm) -> tuple[str, str]:
    """An effect and its place in words."""
    return escape(in_words(entry.term.name)), escape(entry.place.label)


def _detail(row: Ranked) -> str:
    """What is known of a candidate: formula and coefficient of each effect, what they explain, meaning and cause."""
    effects: list[str] = []
    for effect in row.effects:
        (words, at), term = _name(effect.entry), effect.entry.term
        unit = coefficient_unit(effect.entry, term.symbols[0], row.prediction.prepared.record)
        size = f"{' ± '.join(with_error(effect.coefficient, 1.96 * effect.error))} {in_text(unit)}"
        where = f" {escape(place_in_words(effect.entry.place))}" if at else ""
        formula = escape(in_text(term.formula))
        effects.append(f"<b>{words}</b>{where} <i>{formula}</i>, coefficient <em>{escape(size)}</em>")
    share = in_sentence(explained_share(row.gain))
    explains = "explains" if len(effects) == 1 else "together they explain"
    said = f"{'; '.join(effects)}; {explains} {share if share != 'worse' else 'none of it'}, error with "
    said += f"{'it' if len(effects) == 1 else 'them'} {in_percent(row.response_error)}."
    if len(effects) == 1:
        said += f" {escape(row.term.meaning[0].upper() + row.term.meaning[1:])}."
        said += f" Found in {escape(row.term.cause)}." if not is_own(row.term) else ""
    elif 0.0 < row.distance < math.inf:
        said += f" That leaves more than the first by {number(row.distance, 2)} standard errors."
    who = "it" if len(effects) == 1 else "one of them"
    return said + (f" {escape(doubted(who, row))}." if row.unphysical else "")


def _label(row: Ranked) -> str:
    """Label of the axis on which the candidate's coefficient is drawn; of a set, that which is known least."""
    symbols = ", ".join(row.effect.entry.term.symbols)
    symbol = f"|{symbols}|" if "," in symbols else symbols
    return f"{symbol} / {in_text(power_of_ten(abs(row.effect.coefficient))[1] + row.effect.unit)}"


def _rank(row: Ranked, rows: Sequence[Ranked]) -> str:
    """Its place among those of its kind; a tie with the first is no place of its own."""
    place = rows.index(row)
    return "=" if place and row.name in rows[0].tied_with else str(place + 1)


def _ties(row: Ranked) -> str:
    if not row.tied_with:
        return "<span></span>"
    everyone = ", ".join(in_words(n) for n in row.tied_with)
    return f"<span class='tie' title='cannot be told from {escape(everyone)}'>tie {len(row.tied_with) + 1}</span>"


def bar(gain: Gain) -> str:
    """Explained share with its standard error; what reaches beyond the axis is cut."""
    share, error = 100.0 * gain.explained, 100.0 * gain.error
    low, high = (min(max(x, 0.0), 100.0) for x in (share - error, share + error))
    grid = "".join(f"<line class='grid' x1='{x}' x2='{x}' y1='0' y2='16'/>" for x in (0, 25, 50, 75, 100))
    ends = f"M{low:.2f} 8H{high:.2f}M{low:.2f} 5V11M{high:.2f} 5V11"
    whisker = f"<path class='whisker' d='{ends}' vector-effect='non-scaling-stroke'/>"
    return (
        f"<svg class='bar' viewBox='0 0 100 16' preserveAspectRatio='none'>{grid}"
        f"<rect x='0' y='3' width='{min(max(share, 0.0), 100.0):.2f}' height='10'/>{whisker}</svg>"
    )


def _coefficients(stage: Stage, live: bool) -> str:
    """A row each; that of a term's first coefficient says whether the term is not needed."""
    head = "<tr><th></th><th>term</th><th>value</th><th>95 % interval</th><th>unit</th><th></th></tr>"
    unneeded = {n.entry.keys[0]: n for n in stage.unneeded or ()}
    rows = [_coefficient(c, live, unneeded.get(c.key)) for c in stage.comparison.coefficients]
    modal = "" if stage.model.named else _modal(stage.comparison)  # the modes of a structure are a table of their own
    drawn = "".join(varying_drawing(one) for one in stage.comparison.varying)
    return f"<table>{head}{''.join(rows)}{modal}</table>{drawn}"


def _modal(comparison: Comparison) -> str:
    """Natural frequency and damping ratio of the linear part, if it has them."""
    rows = ""
    named = (("f<sub>n</sub>", "natural frequency"), ("ζ", "damping ratio"))
    for (symbol, what), found in zip(named, comparison.natural, strict=True):
        if found is not None:
            value, error, unit = found
            size, half = with_error(value, 1.96 * error)
            half = "held" if math.isnan(error) else f"± {half}"
            rows += (
                f"<tr class='derived'><td><i>{symbol}</i></td><td>{what}</td><td class='number'>{size}</td>"
                f"<td>{half}</td><td>{unit or '1'}</td><td></td></tr>"
            )
    return rows


def _unneeded(term: Needless | None, live: bool) -> str:
    """That a term is not needed, with the button that takes it out."""
    if term is None:
        return ""
    drop = f" <button data-act='drop' data-name='{escape(term.name)}'>Drop</button>" if live else ""
    return f"<span class='unneeded' title='{escape(term.sentence())}'>not needed{drop}</span>"


def in_table(value: float, error: float | None, factor: float = 1.0) -> tuple[str, str]:
    """A value and half its interval as a table has them; of a value that is held, that."""
    if error is None:
        return number(value, 5), "held"
    size, half = with_error(value, 1.96 * error / factor)
    return size, f"± {half}"


def _coefficient(coefficient: Coefficient, live: bool, unneeded: Needless | None) -> str:
    shown = mass(coefficient.unit) if coefficient.term == "inertia" else Scale(1.0, coefficient.unit)
    size, half = in_table(coefficient.value / shown.factor, coefficient.error, shown.factor)
    act, label = ("free", "Free") if coefficient.held else ("hold", "Hold")
    button = f"<button data-act='{act}' data-name='{escape(coefficient.key)}'>{label}</button>" if live else ""
    symbol, at = coefficient.key.partition("[")[0].rpartition(".")[2], coefficient.place.label
    where = f" <i>{escape(at)}</i>" if at else ""
    return (
        f"<tr data-key='{escape(coefficient.key)}'><td><i>{escape(symbol)}</i></td>"
        f"<td>{escape(in_words(coefficient.term))}{where}{_unneeded(unneeded, live)}</td>"
        f"<td class='number'>{size}</td><td>{half}</td>"
        f"<td>{escape(in_text(shown.unit))}</td><td>{button}</td></tr>"
    )


def varying_drawing(one: VaryingCoefficient) -> str:
    """The coefficient along time or its channel with its 95 % band, as SVG in HTML."""
    width, height, left, top, bottom = 420, 190, 74, 12, 40  # pixels
    half = 1.96 * one.error
    low, high = float(np.min(one.value - half)), float(np.max(one.value + half))
    low, high = (low, high) if high > low else (low - 1.0, high + 1.0)
    x = left + (one.at - one.at[0]) / (one.at[-1] - one.at[0]) * (width - left - 12)

    def y(values: Floats) -> Floats:
        return np.asarray(top + (high - values) / (high - low) * (height - top - bottom), dtype=np.float64)

    def points(across: Floats, up: Floats) -> str:
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))

    band = points(np.concatenate([x, x[::-1]]), np.concatenate([y(one.value + half), y(one.value - half)[::-1]]))
    floor, unit = height - bottom, f" / {in_text(one.along_unit)}" if one.along_unit else ""
    words = [
        f"<text x='{left - 6}' y='{at:.0f}' text-anchor='end'>{number(value, 4)}</text>"
        for value, at in ((high, top + 8), (low, floor))
    ]
    words += [
        f"<text x='{at:.0f}' y='{floor + 16}' text-anchor='{anchor}'>{number(float(value), 4)}</text>"
        for value, at, anchor in ((one.at[0], left, "start"), (one.at[-1], width - 12, "end"))
    ]
    words.append(
        f"<text x='{(left + width) / 2:.0f}' y='{height - 6}' text-anchor='middle'>"
        f"{escape(one.along.replace('_', ' ') + unit)}</text>"
    )
    middle = (top + floor) / 2
    words.append(
        f"<text x='12' y='{middle:.0f}' text-anchor='middle' transform='rotate(-90 12 {middle:.0f})'>"
        f"{escape(f'{one.symbol} / {in_text(one.unit)}')}</text>"
    )
    return (
        f"<svg class='varying' width='{width}' height='{height}' role='img' font-size='11' fill='currentColor'>"
        f"<title>{escape(varying_in_words(one))}</title>"
        f"<path d='M{left},{top} V{floor} H{width - 12}' fill='none' stroke='currentColor' stroke-width='0.8'/>"
        f"<polygon points='{band}' fill='#b5b5b5' fill-opacity='0.7'/>"
        f"<polyline points='{points(x, y(one.value))}' fill='none' stroke='#1f5fa8' stroke-width='1.8'/>"
        f"{''.join(words)}</svg>"
    )
