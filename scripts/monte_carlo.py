"""Snakemake step: how often a case meets each tolerance over many seeds."""

import sys
from pathlib import Path
from typing import Any

from study import ensemble, tables
from study.modelfile import read_model
from study.step import one_sentence

EVERY = 100  # seeds between two signs of life


def main(model: str, record: dict[str, Any], identification: dict[str, Any], seeds: range, output: str) -> None:
    def progress(done: int) -> None:
        if done % EVERY == 0 or done == len(seeds):
            print(f"{record['case']}: {done} of {len(seeds)} seeds", file=sys.stderr, flush=True)

    found = ensemble.estimates(read_model(Path(model)), record, identification, seeds, workers=1, progress=progress)
    tables.write_csv(ensemble.rates(found), Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    first, count = step.params.ensemble["first_seed"], step.params.ensemble["seeds"]
    with one_sentence():
        main(
            step.input.model, step.params.record, step.params.identification, range(first, first + count),
            step.output.table,
        )  # fmt: skip
