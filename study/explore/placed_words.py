"""The words of a structure's page as fragments of HTML, by the name of their place; what a user typed is escaped."""

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from study.compare.comparison import Comparison
from study.compare.dependence import explained_by_place
from study.diagnose.ranked import Ranked
from study.equations.linear_part import Modes
from study.equations.place import place_in_words as placed
from study.explore import record_words
from study.explore.page_units import in_percent, with_error
from study.explore.session import Stage
from study.explore.words import VERDICTS, figure, gives, in_words, shared_words
from study.figures.sketch import Sketch, svg
from study.support.numbers import percent

TRIED = 8  # candidates that are named of one place


def placed_words(found: Stage, stage: Stage, drawn: Sketch, step: int, live: bool) -> dict[str, Any]:
    """Every fragment of a structure, as found of all records and as one shows it, as columns ``place`` and ``html``."""
    comparison = stage.comparison
    chosen = max(drawn.links, key=lambda link: link.share).place
    fragments = (
        shared_words(stage, stage.shown, step, live)
        | {
            "figures": _figures(comparison),
            "sketch": svg(drawn, chosen),
            "sketch-hint": escape(_hint(stage)),
            "places": _places(stage, drawn, explained_by_place(found.comparison.leftovers)),
            "modes": _modes(stage),
        }
        | record_words.words(found, comparison.record.name, live)
    )
    return {"place": list(fragments), "html": list(fragments.values())}


def _figures(comparison: Comparison) -> str:
    prediction = comparison.prediction
    worst = max(zip(prediction.errors, prediction.prepared.sensors, strict=True), key=lambda pair: pair[0])
    about = f"worst {in_percent(worst[0])} at {worst[1].coordinate}"
    cells = (
        ("error", "Error of the motions", in_percent(prediction.error), about),
        ("floor", "Noise floor", in_percent(prediction.floor), "what no model could explain"),
        ("force", "Error of the forces", in_percent(comparison.missing.share), "of the power of those of inertia"),
    )[: 3 if comparison.missing.equations else 2]  # fmt: skip
    return "".join(figure(*cell) for cell in cells)


def _hint(stage: Stage) -> str:
    if stage.diagnosis is not None and stage.diagnosis.verdict in VERDICTS and stage.diagnosis.candidates:
        first = stage.diagnosis.candidates[0]
        if gives(first):
            return "A connection glows with the share of what is left that the effect found there explains."
    return "A connection glows with the share of what is left that general functions of its own motion explain."


def _places(stage: Stage, drawn: Sketch, general: Mapping[frozenset[str], float]) -> str:
    """What is known of each place, one block each: the script shows that of the selected one.

    ``general`` is what functions of the motion of each place explain of what is left.
    """
    comparison = stage.comparison
    shares = {place.path: share for place, share in comparison.missing.aligned}
    rows = stage.diagnosis.candidates if stage.diagnosis is not None else ()
    blocks: list[str] = []
    for link in drawn.links:
        path = link.place.path
        known = [f"<h3>{escape(_capital(placed(link.place)))}</h3><p>{escape(_terms_there(comparison, path))}</p>"]
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


def _terms_there(comparison: Comparison, path: frozenset[str]) -> str:
    """The terms that the model has at a place, in a sentence."""
    names = [
        in_words(e.term.name)
        for e in comparison.model.terms
        if e.place.path == path and (e.term.name != "inertia" or e.place.kind != "at")
    ]
    return f"The model has {', '.join(names)} there." if names else "The model has no term there."


def _tried(row: Ranked) -> str:
    return f"{escape(in_words(row.term.name))} ({percent(row.gain.explained, 'z.1f', row.gain.error, '.1f')})".replace(
        "+-", "±"
    )


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _modes(stage: Stage) -> str:
    """Modes of the underlying linear system, and with the first candidate where an effect is missing."""
    before, after = stage.comparison.modes, stage.diagnosis.modes_after if stage.diagnosis is not None else None
    sets = [("as fitted", before)] + ([("with the first candidate", after)] if after is not None else [])
    heads = "".join(f"<th colspan=2>{title}</th>" for title, _ in sets)
    under = "".join("<th>natural frequency / Hz</th><th>damping ratio / %</th>" for _ in sets)
    names: Sequence[str] = stage.comparison.model.coordinates
    rows = "".join(
        f"<tr><td>{i + 1}</td>{''.join(_mode(m, i) for _, m in sets)}<td>{_shape(sets[-1][1], i)}</td></tr>"
        for i in range(max(len(m.frequency) for _, m in sets))
    )
    under += f"<th>shape at {escape(', '.join(names))}</th>"
    return f"<table><tr><th></th>{heads}<th></th></tr><tr><th></th>{under}</tr>{rows}</table>"


def _mode(m: Modes, i: int) -> str:
    """Frequency and damping ratio; empty where a model has fewer modes."""
    if i >= len(m.frequency):
        return "<td colspan=2></td>"
    return (
        f"<td class='number'>{' ± '.join(with_error(m.frequency[i], 1.96 * m.frequency_error[i]))}</td>"
        f"<td>{' ± '.join(with_error(100.0 * m.damping[i], 196.0 * m.damping_error[i]))}</td>"
    )


def _shape(m: Modes, i: int) -> str:
    return ", ".join(f"{x:.2f}" if math.isfinite(x) else "-" for row in m.shape[i : i + 1] for x in row)
