"""Snakemake step: all trials -> one table, confusion, reach, ladder, and their pictures."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd
from matplotlib import style as styles
from matplotlib.figure import Figure

from study.figures import page
from study.reproduction import tables
from study.support.files import replace_file
from study.support.workflow_step import one_sentence
from study.trials import constants_table, reach, trial_pictures

KINDS = {"single": "one effect hidden", "pair": "two effects hidden"}


def main(
    parts: Sequence[str], wanted: Mapping[str, Sequence[float]], outputs: Mapping[str, str],
    drawings: Mapping[str, Sequence[str]], style: Path,
) -> None:  # fmt: skip
    table = pd.concat([pd.read_csv(path) for path in parts], ignore_index=True).sort_values("seed")
    summary, confusion, ladder = (
        reach.target_summary(table, wanted),
        reach.confusion(table),
        reach.error_by_noise(table),
    )
    found = {
        "trials": table, "summary": summary, "confusion": confusion, "ladder": ladder,
        "alpha": constants_table.against_alpha(table), "k": constants_table.against_k(table),
    }  # fmt: skip
    for name, path in outputs.items():
        tables.write_table(found[name], Path(path))
    print(summary.to_string(index=False), file=sys.stderr)
    with styles.context(style):
        figures = {"confusion": _confusion(confusion), "ladder": _ladder(ladder)}
        for name, paths in drawings.items():
            for path in paths:
                replace_file(Path(path), page.rendered(figures[name], Path(path).suffix[1:]))


def _confusion(counts: pd.DataFrame) -> Figure:
    figure = Figure(figsize=(10.2, 8.6), layout="constrained")
    axes = figure.subplots()
    axes.set_title("Trials: which effect was hidden, and what diagnose said (% of each row)", fontweight="bold")
    trial_pictures.confusion_panel(axes, counts)
    return figure


def _ladder(rows: pd.DataFrame) -> Figure:
    figure, axes = page.empty_page(
        "Trials with hidden effects", "Mean held-out response error, with 95 % intervals", columns=2,
        width=page.width(2), panel=2.9, legend_rows=1,
    )  # fmt: skip
    for panel, kind in zip(axes, KINDS, strict=True):
        trial_pictures.error_by_noise_panel(panel, rows[rows["kind"] == kind])
    page.letter(axes, list(KINDS.values()))
    page.shared_legend(figure, axes[1:])
    return figure


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(
            step.input.parts, step.params.wanted,
            {name: step.output[name] for name in ("trials", "summary", "confusion", "ladder", "alpha", "k")},
            {"confusion": step.output.confusion_figure, "ladder": step.output.ladder_figure}, Path(step.input.style),
        )  # fmt: skip
