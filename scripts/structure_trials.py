"""Snakemake step: run a part of the trials of structures."""

import sys
from pathlib import Path

import pandas as pd

from study.reproduction import tables
from study.support.workflow_step import one_sentence
from study.trials import structure_runs

EVERY = 5  # trials between two signs of life


def main(count: int, number: int, jobs: int, output: str) -> None:
    orders = structure_runs.structure_orders(count)[number::jobs]
    rows: list[structure_runs.Row] = []
    for done, order in enumerate(orders, start=1):
        rows.append(structure_runs.run_structure(order))
        if done % EVERY == 0 or done == len(orders):
            print(f"part {number}: {done} of {len(orders)} trials of structures", file=sys.stderr, flush=True)
    tables.write_table(pd.DataFrame(rows, columns=list(structure_runs.COLUMNS)), Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.params.trials, int(step.wildcards.part), step.params.jobs, step.output.table)
