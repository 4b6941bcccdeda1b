"""Recommendation 5: actual systems and measured data, each as a ladder of models judged on what was not fitted.

The ladders themselves are climbed by ``study.commands.ladder``, in the words of the command line. Where a record is not
there it is left out, and said so.
"""

# Matplotlib leaves the **kwargs of its methods untyped, pandas what comes out of a mask or a group.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

import textwrap
from collections.abc import Iterator
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from study.figures import page
from study.figures.labels import term_names
from study.reproduction.chapters.chapter import Chapter, Tables, judges
from study.reproduction.claims.judgement import Condition
from study.reproduction.claims.reported import Reported
from study.support.document import Block, Text, table
from study.support.numbers import enumerated, percent

SILVERBOX, BOUC_WEN = "silverbox", "bouc_wen"


def _there(tables: Tables) -> pd.DataFrame:
    """Steps of records whose files are there."""
    t = tables["ladders"]
    return t[t["error"].notna()]


def _last(tables: Tables, record: str) -> "pd.Series[Any] | None":
    own = _there(tables)
    own = own[own["record"] == record]
    return None if own.empty else own.iloc[-1]


def measured_silverbox(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The arrow, which no model was fitted to, with mass, damping, stiffness, cubic and quadratic stiffness."""
    published, allowed = (expected.value(f"measured_silverbox.{name}") for name in ("published", "allowed"))
    words = f"error on the arrow within {percent(allowed)} of the published {published:g} mV, or less"
    last = _last(tables, SILVERBOX)
    if last is None:
        return
    rms = 1e3 * float(last["rms"])
    yield Condition(words, f"{rms:.3g} mV", rms <= (1.0 + allowed) * published)


def measured_bouc_wen(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """A polynomial imitates a hysteresis in part; with the right element the noise is all that is left."""
    times = expected.value("measured_bouc_wen.times")
    words = f"error with the hysteretic element at most {times:g} times the noise floor"
    last = _last(tables, BOUC_WEN)
    if last is None:
        return
    yield Condition(
        words, f"{percent(last['error'])}, noise floor {percent(last['floor'])}",
        bool(last["error"] <= times * last["floor"]),
    )  # fmt: skip


def measured_steps(tables: Tables, _: Reported) -> Iterator[Condition]:
    """Whether every step up a ladder lowers the error on what was not fitted."""
    for record, rows in _there(tables).groupby("record", sort=False):
        errors = rows["error"].tolist()
        steps = zip(rows["added"].tolist()[1:], errors[1:], errors, strict=False)
        worse = [f"{term_names(added)} {percent(after)}" for added, after, before in steps if not after < before]
        yield Condition(
            f"{record}: every term that is added lowers the held-out error",
            f"{record}: {' to '.join(percent(e) for e in errors)}" + (f", not {enumerated(worse)}" if worse else ""),
            not worse, because="a term that imitates another effect may fit one part of a record and fail on the other",
        )  # fmt: skip


def measured_noise(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Whether the last model of a ladder leaves noise alone."""
    times = expected.value("measured_bouc_wen.times")
    for record in dict.fromkeys(str(r) for r in _there(tables)["record"]):
        last = _last(tables, record)
        assert last is not None
        yield Condition(
            f"{record}: at most {times:g} times the noise floor is left",
            f"{record}: {percent(last['error'])}, noise floor {percent(last['floor'])}",
            bool(last["error"] <= times * last["floor"]),
            because="an actual system has more than the few effects that its ladder names",
        )  # fmt: skip


def ladders_figure(tables: Tables) -> Figure:
    """Held-out error of every model and the noise floor."""
    rows = _there(tables)
    records = list(dict.fromkeys(str(r) for r in rows["record"]))
    figure, axes = page.empty_page(
        "Measured records", "error on what was not fitted, model after model; dashed: the noise floor",
        rows=max(1, -(-len(records) // 3)), columns=3, width=12.0, panel=2.3, legend_rows=0, share=False,
    )  # fmt: skip
    for panel, record in zip(axes, records, strict=False):
        own = rows[rows["record"] == record]
        labels = ["as given", *(f"+ {term_names(added)}" for added in own["added"].tolist()[1:])]
        panel.plot(range(len(own)), 100.0 * own["error"], "o-", color="C0", markersize=5.0, linewidth=1.4)
        panel.plot(range(len(own)), 100.0 * own["floor"], color="black", linewidth=1.0, linestyle=(0, (5.0, 2.0)))
        panel.set_yscale("log")
        panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_locator(NullLocator())
        panel.set_xticks(range(len(own)), [textwrap.fill(label, 18) for label in labels], fontsize=7.5)
        panel.set_xlim(-0.4, len(own) - 0.6)
    for panel in axes[len(records) :]:
        panel.set_axis_off()
    for panel in axes[: len(records) : 3]:
        panel.set_ylabel("error (%)")
    if not records:
        axes[0].text(0.0, 0.5, "left out: the data are not there", transform=axes[0].transAxes)
    titles = dict(zip(rows["record"], rows["title"], strict=True))
    page.letter(axes[: len(records)], [str(titles[record]) for record in records])
    return figure


def told_measured(tables: Tables) -> list[Block]:
    """Every ladder beside what the literature reaches."""
    rows = [
        [str(r["title"]), f"+ {term_names(str(r['added']))}" if r["step"] else "as given",
         percent(r["error"]), f"{r['rms']:.3g} {r['unit']}", percent(r["floor"]),
         str(r["published"]) if not r["step"] else ""]
        for _, r in _there(tables).iterrows()
    ]  # fmt: skip
    said = (
        "Each ladder begins with the model that an engineer would believe in (config/measurements.tsv); its errors are "
        "those of a free run along the part of the record that was not fitted. An offset of the Silverbox's "
        "response is corrected as the last model has it."
    )
    left = [Text(sentence) for sentence in left_out_records(tables)]
    head = ("record", "model", "error", "rms", "noise floor", "literature")
    return [*left, Text(said), table(head, rows)]


def left_out_records(tables: Tables) -> list[str]:
    """One sentence, if the data of some records are not there."""
    t = tables["ladders"]
    missing = list(dict.fromkeys(str(r) for r in t[t["error"].isna() & (t["step"] == 0)]["title"]))
    if not missing:
        return []
    verb = "is" if len(missing) == 1 else "are"
    return [
        f"{enumerated(missing)} {verb} left out: the data are no part of the project; `study data` says where they "
        "are, and STUDY_DATA names the folder that holds them."
    ]


CHAPTER = Chapter(
    claims=judges(measured_silverbox, measured_bouc_wen, measured_steps, measured_noise),
    figures={"ladders": ladders_figure}, told=told_measured,
    numbers=("measured_silverbox.published", "measured_silverbox.allowed", "measured_bouc_wen.times"),
    left_out=left_out_records,
)  # fmt: skip
