"""Snakemake step: say which estimates meet their tolerance too seldom."""

import sys
from pathlib import Path

import pandas as pd

from study.reproduction import ensemble
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(rates: str, noise: dict[str, float], output: str) -> None:
    page = ensemble.ensemble_page(pd.read_csv(rates), noise)
    replace_file(Path(output), page.encode())
    print(page, file=sys.stderr)


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.input.table, step.params.noise, step.output.page)
