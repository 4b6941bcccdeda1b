"""The words of a structure's page as fragments of HTML, by the name of their place; what a user typed is escaped."""

import math
from collections.abc import Sequence
from html import escape
from typing import Any

from study.compare.comparison import Comparison
from study.compare.comparison_sentences import comparison_in_words
from study.compare.dependence import explained_by_place
from study.compare.fitted_coefficients import Coefficient
from study.diagnose.ranked import Ranked
from study.equations.linear_part import Modes
from study.equations.place import Place
from study.equations.place import place_in_words as placed
from study.explore.page_units import in_percent, in_sentence, in_text, with_error
from study.explore.session import Stage
from study.explore.words import HEAD, NOT_ASKED, UNKNOWN, VERDICTS, WAITING, bar, figure, gives, in_table, in_words
from study.figures.labels import power_of_ten
from study.figures.sketch import Sketch, svg
from study.structure.structure_page import terms_there
from study.support.numbers import percent

SHOWN, TRIED = 12, 8  # candidates; those named of one place


def placed_words(stage: Stage, drawn: Sketch, step: int, live: bool) -> dict[str, Any]:
    """Every fragment of a structure, as columns ``place`` and ``html``."""
    comparison = stage.comparison
    chosen = max(drawn.links, key=lambda link: link.share).place
    fragments = {
        "figures": _figures(comparison),
        "says": escape(in_sentence(comparison_in_words(comparison))),
        "sketch": svg(drawn, chosen),
        "sketch-hint": escape(_hint(stage)),
        "places": _places(stage, drawn),
        "verdict": _verdict(stage, live),
        "candidates": _candidates(stage, live),
        "coefficients": _coefficients(stage, live),
        "modes": _modes(stage),
        "notes": escape(in_sentence("; ".join(comparison.notes))),
        "step": escape(f"{step} {in_words(stage.label)}"),
    }
    return {"place": list(fragments), "html": list(fragments.values())}


def _figures(comparison: Comparison) -> str:
    prediction = comparison.prediction
    worst = max(zip(prediction.errors, prediction.prepared.sensors, strict=True), key=lambda pair: pair[0])
    about = f"worst {in_percent(worst[0])} at {worst[1].coordinate}"
    cells = (
        ("error", "Error of the motions", in_percent(prediction.error), about),
        ("floor", "Noise floor", in_percent(prediction.floor), "what no model could explain"),
        ("force", "Error of the forces", in_percent(comparison.missing.share), "of the power of those of inertia"),
    )  # fmt: skip
    return "".join(figure(*cell) for cell in cells)


def _hint(stage: Stage) -> str:
    if stage.diagnosis is not None and stage.diagnosis.verdict in VERDICTS and stage.diagnosis.candidates:
        first = stage.diagnosis.candidates[0]
        if gives(first):
            return "A connection glows with the share of what is left that the effect found there explains."
    return "A connection glows with the share of what is left that general functions of its own motion explain."


def _verdict(stage: Stage, live: bool) -> str:
    if stage.diagnosis is None:
        return f"<p class='waiting'>{WAITING if live else NOT_ASKED}</p>"
    head = VERDICTS.get(stage.diagnosis.verdict, UNKNOWN)
    return f"<h3 class='{stage.diagnosis.verdict}'>{head}</h3><p>{escape(in_sentence(stage.said))}</p>"


def _places(stage: Stage, drawn: Sketch) -> str:
    """What is known of each place, one block each: the script shows that of the selected one."""
    comparison = stage.comparison
    shares = {place.path: share for place, share in comparison.missing.aligned}
    general = explained_by_place(comparison.leftovers)
    rows = stage.diagnosis.candidates if stage.diagnosis is not None else ()
    blocks: list[str] = []
    for link in drawn.links:
        path = link.place.path
        known = [f"<h3>{escape(_capital(placed(link.place)))}</h3><p>{escape(terms_there(comparison, path))}</p>"]
        if path in shares:
            known.append(
                f"<p>Any force there could make {in_percent(shares[path])} of what stands above the noise; general "
                f"functions of its own motion explain {in_percent(general.get(path, 0.0))} of what is left, held "
                "out.</p>"
            )
        own = [r for r in rows if r.entry.place.path == path]
        if own:
            more = f"; {len(own) - TRIED} more" if len(own) > TRIED else ""
            known.append("<p>Tried there: " + "; ".join(_tried(r) for r in own[:TRIED]) + f"{more}.</p>")
        elif stage.diagnosis is not None and path in shares:
            known.append("<p>No effect there explains enough to be fitted.</p>")
        label, ends = escape(link.place.label), escape(" ".join(link.place.moving))
        blocks.append(f"<div class='about' data-place='{label}' data-ends='{ends}'>{''.join(known)}</div>")
    return "".join(blocks)


def _tried(row: Ranked) -> str:
    return f"{escape(in_words(row.term.name))} ({percent(row.gain.explained, 'z.1f', row.gain.error, '.1f')})".replace(
        "+-", "±"
    )


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _candidates(stage: Stage, live: bool) -> str:
    if stage.diagnosis is None:
        return ""
    offered = [r for r in stage.diagnosis.candidates if gives(r)][:SHOWN]
    left = stage.diagnosis.asked - len(offered)
    rest = f"<li class='more'>{left} more effects and places explain less, or no more than chance would</li>"
    return f"<ol>{HEAD}{''.join(_row(i, r, stage, live) for i, r in enumerate(offered))}{rest}</ol>"


def _row(number_: int, row: Ranked, stage: Stage, live: bool) -> str:
    name, where = escape(in_words(row.term.name)), row.entry.place
    add = f"<button data-act='add' data-name='{escape(row.name)}'>Add</button>" if live else ""
    ties = next((r.tied_with for r in (stage.diagnosis.candidates if stage.diagnosis else ())), ())
    rank = "=" if number_ and row.name in ties else str(number_ + 1)
    tie = f"<span class='tie' title='{escape(_tied(row))}'>tie {len(row.tied_with) + 1}</span>" if row.tied_with else ""
    explained = f"{round(100.0 * row.gain.explained, 1) + 0.0:.1f} %"
    return (
        f"<li class='candidate' data-row='{escape(row.name)}' data-at='{escape(_drawn_label(where, stage))}' "
        f"data-label='{escape(_axis(row))}' tabindex='0' aria-label='{name} {escape(placed(where)) if where else ''}, "
        f"explains {explained}'><span class='rank'>{rank}</span><span class='name' title='{name}'><b>{name}</b> "
        f"<i>{escape(where.label) if where else ''}</i></span>{tie or '<span></span>'}{bar(row.gain)}"
        f"<span class='explained'>{explained}</span>{add}<small hidden>{_detail(row)}</small></li>"
    )


def _tied(row: Ranked) -> str:
    return f"cannot be told from {', '.join(in_words(n) for n in row.tied_with)}"


def _drawn_label(place: Place, stage: Stage) -> str:
    """The label under which the sketch has a place, whichever end comes first."""
    from study.equations.linear_part import connections

    known = {p.path: p.label for p in connections(stage.comparison.model)}
    return known.get(place.path, place.label)


def _axis(row: Ranked) -> str:
    before = power_of_ten(abs(row.coefficient))[1]
    return f"{row.term.symbols[0]} / {in_text(before + row.unit)}"


def _detail(row: Ranked) -> str:
    unit = in_text(row.unit)
    size = f"{' ± '.join(with_error(row.coefficient, 1.96 * row.error))} {unit}"
    where = f" {escape(placed(row.entry.place))}" if row.entry.place else ""
    return (
        f"<b>{escape(in_words(row.term.name))}</b>{where} <i>{escape(in_text(row.term.formula))}</i>, coefficient "
        f"<em>{escape(size)}</em>; error with it {in_percent(row.response_error)}. "
        f"{escape(_capital(row.term.meaning))}."
        + (f" As fitted it is no physical effect: {escape(row.unphysical)}." if row.unphysical else "")
    )


def _coefficients(stage: Stage, live: bool) -> str:
    """A row each; that of a term's first coefficient says whether the term is not needed."""
    head = "<tr><th></th><th>term</th><th>value</th><th>95 % interval</th><th>unit</th><th></th></tr>"
    waiting = {f"{n.entry.keys[0]}": n for n in stage.unneeded or ()}
    entries = {key: entry for entry in stage.model.terms for key in entry.keys}
    rows: list[str] = []
    for c in stage.comparison.coefficients:
        drop = ""
        if c.key in waiting:
            button = f" <button data-act='drop' data-name='{escape(entries[c.key].name)}'>Drop</button>" if live else ""
            drop = f"<span class='unneeded' title='{escape(waiting[c.key].sentence())}'>not needed{button}</span>"
        rows.append(_coefficient(c, drop, live))
    return f"<table>{head}{''.join(rows)}</table>"


def _coefficient(c: Coefficient, drop: str, live: bool) -> str:
    size, half = in_table(c.value, c.error)
    act, label = ("free", "Free") if c.error is None else ("hold", "Hold")
    button = f"<button data-act='{act}' data-name='{escape(c.key)}'>{label}</button>" if live else ""
    symbol, where = c.key.partition("[")[0].rpartition(".")[2], c.place.label if c.place else ""
    return (
        f"<tr data-key='{escape(c.key)}'><td><i>{escape(symbol)}</i></td><td>{escape(in_words(c.term))} "
        f"<i>{escape(where)}</i>{drop}</td><td class='number'>{size}</td><td>{half}</td>"
        f"<td>{escape(in_text(c.unit))}</td><td>{button}</td></tr>"
    )


def _modes(stage: Stage) -> str:
    """Modes of the underlying linear system, and with the first candidate where an effect is missing."""
    before, after = stage.comparison.modes, stage.diagnosis.modes_after if stage.diagnosis is not None else None
    sets = [("as fitted", before)] + ([("with the first candidate", after)] if after is not None else [])
    heads = "".join(f"<th colspan=2>{title}</th>" for title, _ in sets)
    under = "".join("<th>natural frequency / Hz</th><th>damping ratio / %</th>" for _ in sets)
    names: Sequence[str] = stage.comparison.model.coordinates
    rows = "".join(
        f"<tr><td>{i + 1}</td>{''.join(_mode(m, i) for _, m in sets)}<td>{_shape(sets[-1][1], i)}</td></tr>"
        for i in range(len(names))
    )
    under += f"<th>shape at {escape(', '.join(names))}</th>"
    return f"<table><tr><th></th>{heads}<th></th></tr><tr><th></th>{under}</tr>{rows}</table>"


def _mode(m: Modes, i: int) -> str:
    return (
        f"<td class='number'>{' ± '.join(with_error(m.frequency[i], 1.96 * m.frequency_error[i]))}</td>"
        f"<td>{' ± '.join(with_error(100.0 * m.damping[i], 196.0 * m.damping_error[i]))}</td>"
    )


def _shape(m: Modes, i: int) -> str:
    return ", ".join(f"{x:.2f}" if math.isfinite(x) else "-" for x in m.shape[i])
