"""Snakemake step: tables with the same heading -> one table."""

from collections.abc import Sequence
from pathlib import Path

from study.errors import StudyError
from study.files import replace_file
from study.step import one_sentence


def main(tables: Sequence[str], output: str) -> None:
    heading, rows = "", []
    for path in tables:
        first, *others = Path(path).read_text(encoding="utf-8").splitlines(keepends=True)
        if heading and first != heading:
            raise StudyError(f"{path}: its heading differs from that of {tables[0]}")
        heading, rows = first, rows + others
    replace_file(Path(output), "".join([heading, *rows]).encode())


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.input.tables, step.output.table)
