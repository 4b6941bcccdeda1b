"""Snakemake step: run a part of the trials."""

import sys
from pathlib import Path

import pandas as pd

from study.reproduction import tables
from study.reproduction.settings import TrialSettings
from study.support.workflow_step import one_sentence
from study.trials import runs

EVERY = 5  # trials between two signs of life


def main(settings: TrialSettings, number: int, output: str) -> None:
    orders = runs.chunk(runs.orders(settings), number, settings.jobs)
    rows: list[runs.Row] = []
    for done, order in enumerate(orders, start=1):
        rows.append(runs.run_trial(order))
        if done % EVERY == 0 or done == len(orders):
            print(f"part {number}: {done} of {len(orders)} trials", file=sys.stderr, flush=True)
    tables.write_table(pd.DataFrame(rows, columns=list(runs.COLUMNS)), Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(TrialSettings.model_validate(step.params.settings), int(step.wildcards.part), step.output.table)
