"""A structure's comparison or diagnosis as one page that needs no server and no network.

A sketch of the structure, the error of each sensor and, for the place that is selected in the sketch, what is known of
it: the shares that a force and that functions of the motion there explain, its restoring-force map, its candidates.
Without scripts all places are shown one after the other.
"""

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files

from study.compare import place_panels
from study.compare.comparison import Comparison
from study.compare.comparison_sentences import comparison_in_words
from study.compare.place_pictures import (
    modes,
    responses_figure,
    sensors_figure,
    shared_force_figure,
    sketch_of,
)
from study.diagnose.diagnosis_files import diagnosis_in_words
from study.diagnose.diagnosis_pictures import sketch_of_diagnosis
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import MISSING, Diagnosis
from study.equations.place import Place
from study.equations.place import place_in_words as placed
from study.figures import page
from study.figures.labels import term_names
from study.figures.sketch import Sketch, svg
from study.figures.styles import in_style
from study.support.numbers import percent

PAGE = "structure.html"


def structure_page(comparison: Comparison, diagnosis: Diagnosis | None = None) -> bytes:
    """The page as the content of a file; the same bytes from the same input."""
    drawn = sketch_of(comparison) if diagnosis is None else sketch_of_diagnosis(diagnosis)
    name, model = comparison.prepared.record.name, comparison.model.name
    said = (
        comparison_in_words(comparison)
        if diagnosis is None
        else f"{comparison_in_words(comparison)} {diagnosis_in_words(diagnosis)}"
    )
    sets = [("as given", comparison.modes)]
    if diagnosis is not None and diagnosis.modes_after is not None:
        sets.append(("with the first candidate", diagnosis.modes_after))
    with in_style():
        figures = {
            "Error by sensor": sensors_figure(comparison), "Motions": responses_figure(comparison),
            "Shared residual force": shared_force_figure(comparison), "Modes": modes(comparison, sets),
        }  # fmt: skip
        shown = {title: page.rendered(figure, "png") for title, figure in figures.items()}
        maps = _maps(comparison)
    hint = "A connection glows with the share of what is left that depends on its own motion."
    if diagnosis is not None and diagnosis.verdict == MISSING:
        hint = "A connection glows with the share of what is left that the effect found there explains."
    verdict = "" if diagnosis is None else f"<p class=verdict>{escape(diagnosis.verdict.replace('_', ' '))}</p>"
    most = max(drawn.links, key=lambda link: link.share)
    body = [
        f"<h1>{escape(name)}</h1><p class=model>model {escape(model)}</p>{verdict}<p>{escape(said)}</p>",
        f"<div class=two><div>{svg(drawn, most.place)}<p class=hint>{hint} Select a connection.</p></div>",
        f"<div id=places>{_places(comparison, diagnosis, drawn, maps, most.place)}</div></div>",
        *(f"<section><h2>{title}</h2>{_image(data, title)}</section>" for title, data in shown.items()),
        f"<section><h2>Coefficients</h2>{_coefficients(comparison)}</section>",
    ]
    text = _text("structure.html").replace("{title}", escape(f"{name}: {model}"))
    text = text.replace("{style}", _text("structure.css")).replace("{script}", _text("structure.js"))
    return text.replace("{body}", "\n".join(body)).encode()


def _maps(comparison: Comparison) -> dict[frozenset[str], bytes]:
    """The restoring-force map of each connection that the motion shows, as PNG."""
    found: dict[frozenset[str], bytes] = {}
    for place, _ in comparison.missing.aligned:
        curve = comparison.missing.curves.get(place.label)
        if curve is not None and len(curve.at):
            figure, (axes,) = page.empty_page(
                place.label, "missing force over relative displacement", panel=2.3, headed=False
            )  # fmt: skip
            place_panels.connection_force(axes, comparison.missing, place.label)
            page.shared_legend(figure, [axes])
            found[place.path] = page.rendered(figure, "png")
    return found


def _places(
    comparison: Comparison, diagnosis: Diagnosis | None, drawn: Sketch,
    maps: Mapping[frozenset[str], bytes], selected: Place,
) -> str:  # fmt: skip
    """What is known of each place, one block each."""
    rows = diagnosis.candidates if diagnosis is not None else ()
    shares = {place.path: share for place, share in comparison.missing.aligned}
    blocks: list[str] = []
    for link in drawn.links:
        place, path = link.place, link.place.path
        known = [f"<h2>{escape(_capital(placed(place)))}</h2>", f"<p>{escape(terms_there(comparison, path))}</p>"]
        if path in shares:
            known.append(f"<p>Any force there could make {percent(shares[path])} of what stands above the noise.</p>")
        own = [r for r in rows if r.entry.place.path == path]
        if own:
            known.append(_candidates(own))
        elif diagnosis is not None and path in shares:
            known.append("<p>No effect there explains enough to be fitted.</p>")
        if path in maps:
            known.append(_image(maps[path], f"missing force {placed(place)}"))
        chosen = " selected" if path == selected.path else ""
        blocks.append(f'<div class="place{chosen}" data-place="{escape(place.label)}">{"".join(known)}</div>')
    return "\n".join(blocks)


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def terms_there(comparison: Comparison, path: frozenset[str]) -> str:
    """The terms that the model has at a place, in a sentence."""
    names = [
        term_names(e.term.name)
        for e in comparison.model.terms
        if e.place.path == path and (e.term.name != "inertia" or e.place.kind != "at")
    ]
    return f"The model has {', '.join(names)} there." if names else "The model has no term there."


def _candidates(rows: Sequence[Ranked]) -> str:
    """Candidates at a place, best first."""
    lines = [
        f"<tr><td>{escape(term_names(r.term.name))}<td>{percent(r.gain.explained, 'z.1f', r.gain.error, '.1f')}"
        f"<td>{percent(r.response_error)}<td>{r.coefficient:.4g} ± {1.96 * r.error:.2g} "
        f"{_unit(r.unit)}<td>{r.p_value:.1g}"
        for r in rows
    ]
    head = "<tr><th>candidate<th>explains<th>error with it<th>coefficient<th>p"
    return f"<table>{head}{''.join(lines)}</table>"


def _coefficients(comparison: Comparison) -> str:
    lines = [
        f"<tr><td>{escape(c.key)}<td>{c.value:.5g}<td>"
        + ("held" if c.interval is None else f"{c.interval[0]:.5g} to {c.interval[1]:.5g}")
        + f"<td>{_unit(c.unit)}"
        for c in comparison.coefficients
    ]
    return f"<table><tr><th><th>value<th>95 % interval<th>unit{''.join(lines)}</table>"


def _unit(text: str) -> str:
    """``N/m^3`` with its exponent raised."""
    return re.sub(r"\^(-?\d+)", r"<sup>\1</sup>", escape(text))


def _image(data: bytes, title: str) -> str:
    return f'<img alt="{escape(title)}" src="data:image/png;base64,{b64encode(data).decode()}">'


def _text(name: str) -> str:
    return files("study.structure").joinpath(name).read_text(encoding="utf-8")
