"""The words of what is looked at of several places: the sketch, what is known of each place, modes; as HTML."""

import math
from collections.abc import Mapping
from html import escape

import numpy as np

from study.compare.comparison import Comparison
from study.compare.dependence import explained_by_place
from study.compare.force_map import FEWEST_VISITS, surface
from study.diagnose.diagnosis_report import explained_share
from study.diagnose.ranked import Ranked
from study.equations.linear_part import Modes
from study.equations.place import place_in_words
from study.explore.axis_scales import Focus
from study.explore.page_units import in_percent, in_sentence, in_text, with_error
from study.explore.session import Stage
from study.explore.words import in_words
from study.figures.sketch import Link, Sketch, svg

NAMED_AS_TRIED = 8  # candidates of one place
READ = "a dash: below zero; a dot: may be noise"
UNSEEN = "No sensor shows this motion, too little of it is judged, or the difference there is noise."
UNTIED = "The model ties nothing here, or no equation with it is measured."


def one_place(focus: Focus, seen: bool, tied: bool) -> dict[str, str]:
    """The fragments of the place that is looked at: whether its motion is ``seen``, and its stiffness known."""
    plane = surface(*focus.within).mean
    short = f"no cell is visited {FEWEST_VISITS} times: too short a record for a map"
    unseen = "" if seen else UNSEEN
    return {
        "force-unit": escape(in_text(focus.force.unit)),
        "plane-hint": (READ if np.any(np.isfinite(plane)) else short) if seen else "",
        "none-plane": unseen, "none-lacking": unseen, "none-stiffness": "" if tied else UNTIED,
    }  # fmt: skip


def several_places(found: Stage, stage: Stage, drawn: Sketch | None, nearest: Mapping[str, str]) -> dict[str, str]:
    """The fragments by their place, as found of all records and as one shows it; none of a single mass.

    ``nearest`` is the sensor that is looked at beside each place.
    """
    if drawn is None:
        return {}
    chosen = max(drawn.links, key=lambda link: link.share).place
    general = explained_by_place(found.comparison.leftovers)
    return {
        "sketch": svg(drawn, chosen),
        "sketch-hint": escape(_hint(stage)),
        "places": "".join(_place(stage, link, general, nearest[link.place.label]) for link in drawn.links),
        "modes": _modes(stage),
    }


def _hint(stage: Stage) -> str:
    if stage.diagnosis is not None and stage.diagnosis.answer is not None:
        return "A connection glows with the share of what is left that the effect found there explains."
    return "A connection glows with the share of what is left that general functions of its own motion explain."


def _place(stage: Stage, link: Link, general: Mapping[frozenset[str], float], sensor: str) -> str:
    """What is known of a place: the script shows that of the selected one.

    ``general`` is what functions of the motion of each place explain of what is left.
    """
    comparison, path = stage.comparison, link.place.path
    shares = {place.path: share for place, share in comparison.missing.aligned}
    title = place_in_words(link.place)
    known = [f"<h3>{escape(title[0].upper() + title[1:])}</h3><p>{escape(_terms_there(comparison, path))}</p>"]
    if path in shares:
        known.append(
            f"<p>Any force there could make {in_percent(shares[path])} of what stands above the noise; general "
            f"functions of its own motion explain {in_percent(general.get(path, 0.0))} of what is left, held out.</p>"
        )
    rows = stage.diagnosis.candidates if stage.diagnosis is not None else ()
    own = [row for row in rows if row.entry.place.path == path]
    if own:
        more = f"; {len(own) - NAMED_AS_TRIED} more" if len(own) > NAMED_AS_TRIED else ""
        known.append("<p>Tried there: " + "; ".join(_tried(row) for row in own[:NAMED_AS_TRIED]) + f"{more}.</p>")
    elif stage.diagnosis is not None and path in shares:
        known.append("<p>No effect there explains enough to be fitted.</p>")
    label = escape(link.place.label)
    return f"<div class='about' data-place='{label}' data-sensor='{escape(sensor)}'>{''.join(known)}</div>"


def _terms_there(comparison: Comparison, path: frozenset[str]) -> str:
    """The terms that the model has at a place, in a sentence."""
    names = [
        in_words(e.term.name)
        for e in comparison.model.terms
        if e.place.path == path and (e.term.name != "inertia" or e.place.kind != "at")
    ]
    return f"The model has {', '.join(names)} there." if names else "The model has no term there."


def _tried(row: Ranked) -> str:
    return f"{escape(in_words(row.term.name))} ({in_sentence(explained_share(row.gain))})"


def _modes(stage: Stage) -> str:
    """Modes of the underlying linear system, and with the first candidate where an effect is missing.

    None of a component, whose motion is prescribed.
    """
    if stage.comparison.model.prescribed:
        return ""
    before, after = stage.comparison.modes, stage.diagnosis.modes_after if stage.diagnosis is not None else None
    sets = [("as fitted", before)] + ([("with what is missing", after)] if after is not None else [])
    heads = "".join(f"<th colspan=2>{title}</th>" for title, _ in sets)
    under = "".join("<th>natural frequency / Hz</th><th>damping ratio / %</th>" for _ in sets)
    names = stage.comparison.model.coordinates
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
