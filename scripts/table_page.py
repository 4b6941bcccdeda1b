"""Snakemake step: tables -> pages that a browser shows, for the report page."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from study.support import document
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(tables: Sequence[str], pages: Sequence[str], titles: Mapping[str, str]) -> None:
    for table, page in zip(tables, pages, strict=True):
        title = titles[Path(table).stem]
        rows = pd.read_csv(table, keep_default_na=False, dtype=str)
        blocks = [document.Heading(title, 1), document.table([str(c) for c in rows.columns], rows.to_numpy().tolist())]
        replace_file(Path(page), document.document_page(title, blocks).encode())


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.input.tables, step.output.pages, step.params.titles)
