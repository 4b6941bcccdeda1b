"""The page of a diagnosis as files: one sheet of A4 as PDF, and the same as one HTML file that prints on one."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

import base64
import html
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties

from study.compare.prediction import SensorPrediction
from study.diagnose.one_page import OnePage
from study.equations import dimensions
from study.figures import page
from study.figures.styles import in_style
from study.records.spectra import Segments, cross_spectra_within
from study.support.arrays import Floats, Ints

PRINTED = """\
@page { size: A4; margin: 14mm }
body { font: 9.5pt/1.35 system-ui, sans-serif; color: #111; max-width: 182mm; margin: 0 auto }
h1 { font-size: 15pt; margin: 0 0 2mm } h2 { font-size: 10pt; margin: 3.5mm 0 1mm; border-bottom: 1px solid #999 }
p { margin: 0 0 1mm } table { border-collapse: collapse; width: 100% }
td, th { text-align: left; padding: 0.2mm 3mm 0.2mm 0 }
th { font-weight: 600; color: #444 } img { width: 100%; display: block; margin-top: 1mm }
.notes, footer { font-size: 8pt; color: #444 }
code { font: inherit; font-style: italic } .option { white-space: nowrap }"""


def one_page_files(content: OnePage) -> dict[str, bytes]:
    """``report.html`` and ``report.pdf``."""
    with in_style():
        picture = Figure(figsize=(_Sheet.inner(), 2.5))
        draw(list(picture.subplots(1, 2, gridspec_kw={"wspace": 0.3}).flat), content)
        picture.subplots_adjust(left=0.13, right=0.99, bottom=0.17, top=0.84)
        drawn = page.rendered(picture, "svg")
        return {"report.html": as_html(content, drawn), "report.pdf": page.rendered(sheet(content), "pdf")}


def draw(axes: Sequence[Axes], content: OnePage) -> None:
    """What the model misses: a close-up in time, and its spectrum, without and with what is missing."""
    before, after = content.before, content.after
    worst = next(i for i, view in enumerate(before.views) if view is before.worst)
    shown, unit = before.prediction.of(worst), before.record.unit(before.worst.sensor)
    near = shown.closeup
    axes[0].plot(shown.time[near], shown.measured[near], color="0.7", linewidth=3.0, label="measured")
    axes[0].plot(shown.time[near], shown.predicted[near], color="0.1", linestyle=(0, (3, 1.5)), label="model as given")
    left: list[tuple[str, SensorPrediction, str, Any]] = [("left by the model as given", shown, "0.1", (0, (3, 1.5)))]
    if after is not None:
        better = after.prediction.of(worst)
        same = same_motion(better.time, better.measured, shown.time[near], shown.measured[near])
        axes[0].plot(better.time[same], better.predicted[same], color="C0", label="with what is missing")
        left.append(("left with what is missing", better, "C0", "-"))
    axes[0].set_title("close-up where most is missing")
    axes[0].set_xlabel("time (s)")
    axes[0].set_ylabel(f"{before.worst.sensor} ({dimensions.pretty(unit)})")
    axes[1].plot(*_spectrum(shown.measured, content), color="0.7", linewidth=2.0, label="measured")
    for label, seen, colour, dash in left:
        axes[1].plot(*_spectrum(seen.residual, content), color=colour, linestyle=dash, label=label)
    axes[1].set_yscale("log")
    axes[1].set_xlim(0.0, min([force.highest for force in before.forces], default=0.5 / before.prediction.dt))
    axes[1].set_title("what is left, by frequency")
    axes[1].set_xlabel("frequency (Hz)")
    axes[1].set_ylabel(f"{dimensions.pretty(unit)} per root Hz")
    for panel in axes:
        panel.legend(fontsize=7, loc="upper right", frameon=True, framealpha=0.8, edgecolor="none")
        panel.margins(x=0.0)
        scale = panel.yaxis.get_transform()
        low, high = scale.transform(np.array(panel.get_ylim()))
        room = np.array([low - 0.05 * (high - low), high + 0.5 * (high - low)])  # for the legend, and below
        panel.set_ylim(*scale.inverted().transform(room))


def same_motion(time: Floats, measured: Floats, shown_time: Floats, shown: Floats) -> Ints:
    """Samples at the times that are shown: of records whose times overlap those of the one that was measured so."""
    found = np.flatnonzero(np.isin(time, shown_time)).astype(np.int64)
    runs: list[Ints] = np.split(found, np.flatnonzero(np.diff(found) > 1) + 1)
    values = dict(zip(shown_time.tolist(), shown.tolist(), strict=True))

    def apart(run: Ints) -> float:
        return float(np.mean([(measured[i] - values[time[i]]) ** 2 for i in run]))

    return min(runs, key=apart) if len(found) else found


def _spectrum(values: Floats, content: OnePage) -> tuple[Floats, Floats]:
    """Frequency, and the root of the density of a history along the judged part."""
    prepared = content.before.prediction.prepared
    first, last = prepared.plan.judge
    joints = [joint - first for joint in prepared.record.joints if first < joint < min(last, first + len(values))]
    length = min(1024, 2 ** int(np.log2(max(len(values) // 8, 16))))
    centred = np.asarray(values - np.mean(values), dtype=np.float64)
    matrix = cross_spectra_within([centred], joints, content.before.prediction.dt, Segments(length))
    return matrix.frequency, np.sqrt(np.maximum(matrix.density[:, 0, 0].real, 0.0))


def as_html(content: OnePage, picture: bytes) -> bytes:
    """The page for a browser; printed, it is one sheet."""
    image = f'<img alt="what the model misses" src="data:image/svg+xml;base64,{base64.b64encode(picture).decode()}">'
    completed = f"<p>with it: <code>{_marked_up(content.completed)}</code></p>" if content.completed else ""
    heads = ("", "as given", "with what is missing")
    body = [
        f"<h1>{html.escape(content.headline)}</h1><p>{html.escape(content.record)}</p>",
        f"<h2>Equation</h2><p><code>{_marked_up(content.equation)}</code></p>{completed}",
        f"<h2>Errors before and after</h2>{_table(heads, content.errors)}",
        f"<h2>What is missing, and how sure that is</h2><p>{_marked_up(' '.join(content.says))}</p>{image}",
        f"<h2>Coefficients</h2>{_table(('', 'term', 'value', '95 % interval', 'unit'), _first(content.coefficients))}",
        f'<p class="notes">{_marked_up(_joined(content.notes))}</p><footer>{content.version}</footer>',
    ]
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(content.headline)}</title>\n'
        f"<style>\n{PRINTED}\n</style></head><body>\n{chr(10).join(body)}\n</body></html>\n"
    ).encode()


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in heads)
    lines = ("".join(f"<td>{_marked_up(cell)}</td>" for cell in row) for row in rows)
    return f"<table><tr>{head}</tr>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _marked_up(text: str) -> str:
    """A sentence or an equation: powers are raised, an option of the command line keeps to one line."""
    options = re.sub(r"--[a-z]+", r'<span class="option">\g<0></span>', html.escape(text))
    return re.sub(r"\^(-?[0-9]+)", r"<sup>\1</sup>", options)


def _first(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """As many rows as the page holds, and how many more there are."""
    if len(rows) <= _Sheet.most:
        return list(rows)
    return [*rows[: _Sheet.most - 1], (f"and {len(rows) - _Sheet.most + 1} more", "from study compare", "", "", "")]


def _joined(notes: Sequence[str]) -> str:
    """Notes as sentences, each with a full stop and a capital."""
    return " ".join(f"{note[0].upper()}{note[1:].rstrip('.')}." for note in notes)


def sheet(content: OnePage) -> Figure:
    """The page as a figure of the size of a sheet."""
    filled = _Sheet(Figure(figsize=(_Sheet.width, _Sheet.height)))
    filled.text(content.headline, 14.0, bold=True)
    filled.text(content.record)
    filled.heading("Equation")
    filled.text(dimensions.pretty(content.equation), slanted=True)
    if content.completed:
        filled.text(f"with it: {dimensions.pretty(content.completed)}", slanted=True)
    filled.heading("Errors before and after")
    filled.rows([("", "as given", "with what is missing"), *content.errors], (0.0, 3.0, 4.6))
    filled.heading("What is missing, and how sure that is")
    filled.text(dimensions.pretty(" ".join(content.says)))
    filled.down(0.12)
    listed = [tuple(dimensions.pretty(cell) for cell in row) for row in _first(content.coefficients)]
    below = (len(listed) + 12) * filled.size * filled.leading / 72.0  # the table, and room for notes
    draw(filled.panels(min(max(filled.at - filled.margin - below - 0.65, 1.3), 3.2)), content)
    filled.heading("Coefficients")
    filled.rows([("", "term", "value", "95 % interval", "unit"), *listed], (0.0, 1.35, 3.05, 4.05, 6.15))
    filled.down(0.1)
    filled.text(_joined(content.notes), 7.0, colour="0.3", until=filled.margin)
    filled.figure.text(filled.margin / filled.width, 0.45 / filled.height, content.version, fontsize=7.0, color="0.3")
    return filled.figure


class _Sheet:
    """A sheet that is filled from the top down; lengths in inches, letters in points."""

    width, height, margin = 8.27, 11.69, 0.7  # A4
    size, leading = 8.5, 1.35  # of letters; lines to their size
    most = 18  # coefficients

    @classmethod
    def inner(cls) -> float:
        """Width of a line."""
        return cls.width - 2.0 * cls.margin

    def __init__(self, figure: Figure) -> None:
        self.figure, self.at = figure, self.height - self.margin  # inches from the bottom

    def down(self, inches: float) -> None:
        self.at -= inches

    def heading(self, words: str) -> None:
        self.down(0.12)
        self.text(words, 10.0, bold=True)

    def text(
        self, words: str, size: float = size, *, bold: bool = False, slanted: bool = False, colour: str = "black",
        until: float = 0.0,
    ) -> None:  # fmt: skip
        """A paragraph, in lines as wide as the sheet; what would go below ``until`` inches is left out."""
        font = FontProperties(size=size, weight="bold" if bold else "normal", style="italic" if slanted else "normal")
        for line in lines(words, font, self.inner()):
            if self.at < until:
                return
            self.down(size * self.leading / 72.0)
            self.figure.text(self.margin / self.width, self.at / self.height, line, fontproperties=font, color=colour)

    def rows(self, cells: Sequence[Sequence[str]], places: Sequence[float]) -> None:
        """A table; ``places`` are those of its columns in inches from the margin."""
        for number, row in enumerate(cells):
            self.down(self.size * self.leading / 72.0)
            for cell, place in zip(row, places, strict=True):
                self.figure.text(
                    (self.margin + place) / self.width,
                    self.at / self.height,
                    cell,
                    fontsize=self.size,
                    color="black" if number else "0.35",
                )

    def panels(self, height: float) -> list[Axes]:
        """Two panels side by side, so many inches high with all around them."""
        self.down(height + 0.65)
        wide = (self.inner() - 1.3) / 2.0
        boxes = [(self.margin + 0.55, wide), (self.margin + wide + 1.3, wide)]
        return [
            self.figure.add_axes(
                (left / self.width, (self.at + 0.4) / self.height, width / self.width, height / self.height)
            )
            for left, width in boxes
        ]


def lines(words: str, font: FontProperties, width: float) -> list[str]:
    """A text in lines of a width in inches at most."""
    found, line = list[str](), ""
    for word in words.split():
        longer = f"{line} {word}".strip()
        if line and page.text_width(longer, font) > width:
            found.append(line)
            longer = word
        line = longer
    return [*found, line] if line else found
