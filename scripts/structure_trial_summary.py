"""Snakemake step: rates, confusion of effects and of places, of the trials of structures."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from study.reproduction import tables
from study.support.workflow_step import one_sentence
from study.trials import structure_runs


def main(parts: Sequence[str], trials: str, rates: str, effects: str, places: str) -> None:
    table = pd.concat([pd.read_csv(part, keep_default_na=False, na_values=["nan"]) for part in parts])
    table = table.sort_values("seed")
    tables.write_csv(table, Path(trials))
    rows = [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]
    tables.write_csv(pd.DataFrame(structure_runs.rates(rows)), Path(rates))
    for columns, path in ((("hidden", "first"), effects), (("place", "first_place"), places)):
        counts = table.groupby(list(columns)).size().rename("trials").reset_index()
        tables.write_csv(counts, Path(path))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.input.parts, step.output.trials, step.output.rates, step.output.effects, step.output.places)
