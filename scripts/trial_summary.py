"""Snakemake step: all trials of a table -> one table, reach, confusion, error by noise, and their pictures."""

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
from study.trials import rates, trial_pictures
from study.trials.kept import TRIALS
from study.trials.pages import CONFUSIONS

KINDS = {"single": "one effect hidden", "pair": "two effects hidden"}
LADDER = "trials_ladder"


def main(
    name: str, parts: Sequence[str], wanted: Mapping[str, Sequence[float]] | None, outputs: Sequence[str],
    drawings: Sequence[str], style: Path,
) -> None:  # fmt: skip
    table = pd.concat([pd.read_csv(path) for path in parts], ignore_index=True).sort_values("seed", kind="stable")
    made = zip(CONFUSIONS[name], (rates.confusion, rates.confusion_of_places), strict=False)
    counts = {picture: count(table) for picture, count in made}
    found = {"trials": table, "summary": rates.target_summary(table, name, wanted), **counts}
    if name == TRIALS:
        found |= {LADDER: rates.error_by_noise(table)}
        found |= {"alpha": rates.against_alpha(table), "k": rates.against_k(table)}
    for path in map(Path, outputs):
        tables.write_table(found[path.stem], path)
    print(found["summary"].to_string(index=False), file=sys.stderr)
    with styles.context(style):
        for path in map(Path, drawings):
            own = found[path.stem]
            figure = _ladder(own) if path.stem == LADDER else _confusion(CONFUSIONS[name][path.stem], own)
            replace_file(path, page.rendered(figure, path.suffix[1:]))


def _confusion(title: str, counts: pd.DataFrame) -> Figure:
    down, across = counts.shape
    figure = Figure(figsize=(4.4 + 0.42 * max(across, 9), 2.6 + 0.32 * down), layout="constrained")
    trial_pictures.confusion_panel(figure.subplots(), counts)
    figure.suptitle(f"{title} (% of each row)", fontweight="bold", fontsize=10)
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
            step.params.table, step.input.parts, step.params.wanted, step.output.tables, step.output.figures,
            Path(step.input.style),
        )  # fmt: skip
