"""Snakemake step: tables with the same heading -> one table."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(tables: Sequence[str], without: Sequence[str], output: str) -> None:
    """Join tables, their cells as they stand; columns ``without`` are left out."""
    read = [pd.read_csv(path, dtype=str, keep_default_na=False) for path in tables]
    for path, table in zip(tables, read, strict=True):
        if list(table.columns) != list(read[0].columns):
            raise StudyError(f"{path}: its heading differs from that of {tables[0]}")
    joined = pd.concat(read).drop(columns=list(without))
    replace_file(Path(output), joined.to_csv(index=False, lineterminator="\n").encode())


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.input.tables, step.params.get("without", ()), step.output.table)
