"""Snakemake step: how often each tolerance is met over many seeds, for some of the cases."""

from pathlib import Path
from typing import Any

import pandas as pd

from study import ensemble, tables
from study.modelfile import read_model


def main(cases: list[dict[str, Any]], seeds: range, output: str) -> None:
    frames = []
    for case in cases:
        print(f"{case['record']['case']}: {len(seeds)} seeds", flush=True)
        model = read_model(Path(case["model"]))
        found = ensemble.estimates(model, case["record"], case["identification"], seeds)
        frames.append(ensemble.rates(found))
    tables.write_csv(pd.concat(frames, ignore_index=True), Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    count, first = step.params.ensemble["seeds"], step.params.ensemble["first_seed"]
    main(step.params.cases, range(first, first + count), step.output.table)
