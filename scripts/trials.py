"""Snakemake step: run a part of the trials of a table."""

import sys
from pathlib import Path

import pandas as pd

from study.reproduction import tables
from study.reproduction.settings import TrialSettings
from study.support.workflow_step import one_sentence
from study.trials import runs
from study.trials.kept import KEPT_TABLES, Row

EVERY = 5  # trials between two signs of life


def main(table: str, settings: TrialSettings, number: int, jobs: int, output: str) -> None:
    # Every jobs-th, so that all parts take equally long.
    orders = runs.orders(table, settings)[number::jobs]
    rows: list[Row] = []
    for done, order in enumerate(orders, start=1):
        rows.append(runs.run_trial(order))
        if done % EVERY == 0 or done == len(orders):
            print(f"{table}, part {number}: {done} of {len(orders)}", file=sys.stderr, flush=True)
    tables.write_table(pd.DataFrame(rows, columns=list(KEPT_TABLES[table].columns)), Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        settings = TrialSettings.model_validate(step.params.settings)
        main(step.wildcards.table, settings, int(step.wildcards.part), step.params.jobs, step.output.table)
