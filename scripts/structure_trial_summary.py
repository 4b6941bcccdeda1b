"""Snakemake step: all trials of structures -> one table, rates, both confusions, and their pictures."""

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
from study.trials import structure_rates, trial_pictures

TITLES = {
    "effects": "Trials of structures: which effect was hidden, and what diagnose said (% of each row)",
    "places": "Trials of structures: where the effect was hidden, and where diagnose found it (% of each row)",
}


def main(
    parts: Sequence[str], outputs: Mapping[str, str], drawings: Mapping[str, Sequence[str]], style: Path
) -> None:  # fmt: skip
    table = pd.concat([pd.read_csv(part, keep_default_na=False, na_values=["nan"]) for part in parts])
    table = table.sort_values("seed")
    rows = [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]
    counts = {
        "effects": structure_rates.confusion_of_effects(rows), "places": structure_rates.confusion_of_places(rows),
    }  # fmt: skip
    found = {"trials": table, "rates": pd.DataFrame(structure_rates.structure_rates(rows)), **counts}
    for name, path in outputs.items():
        tables.write_table(found[name], Path(path))
    print(found["rates"].to_string(index=False), file=sys.stderr)
    with styles.context(style):
        for name, paths in drawings.items():
            drawn = _confusion(TITLES[name], counts[name])
            for path in paths:
                replace_file(Path(path), page.rendered(drawn, Path(path).suffix[1:]))


def _confusion(title: str, counts: pd.DataFrame) -> Figure:
    down, across = counts.shape
    figure = Figure(figsize=(4.4 + 0.42 * max(across, 9), 2.6 + 0.32 * down), layout="constrained")
    axes = figure.subplots()
    trial_pictures.confusion_panel(axes, counts)
    figure.suptitle(title, fontweight="bold", fontsize=10)
    return figure


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(
            step.input.parts, {name: step.output[name] for name in ("trials", "rates", "effects", "places")},
            {"effects": step.output.effects_figure, "places": step.output.places_figure}, Path(step.input.style),
        )  # fmt: skip
