"""Snakemake step: errors of the estimators -> their picture."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from matplotlib import style as styles

from study.figures import page
from study.reproduction.pictures import error_dots
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(table: Path, style: Path, cases: Sequence[str], outputs: Sequence[Path]) -> None:
    with styles.context(style):
        figure = error_dots.error_dots(pd.read_csv(table), cases)
        for path in outputs:
            replace_file(path, page.rendered(figure, path.suffix[1:]))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(Path(step.input.table), Path(step.input.style), step.params.cases, [Path(p) for p in step.output])
