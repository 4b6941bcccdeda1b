"""Snakemake step: errors of estimators -> their figure."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from study.figures import page
from study.reproduction import study_figures
from study.support.workflow_step import one_sentence


def main(errors: Path, style: Path, outputs: Sequence[Path], cases: Sequence[str]) -> None:
    table = pd.read_csv(errors)
    page.write_each({"errors": lambda: study_figures.error_dots(table, cases)}, {"errors": outputs}, style)


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(
            Path(step.input.errors), Path(step.input.style), [Path(path) for path in step.output.errors],
            step.params.cases,
        )  # fmt: skip
