"""Snakemake step: tables of all cases of structures -> one of parameters, one of claims, and a page of both."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from study.reproduction import structure_pages, tables
from study.support import document
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(
    parameters: Sequence[str], claims: Sequence[str], table: str, claimed: str, page: str, titles: Mapping[str, str]
) -> None:
    joined = pd.concat([pd.read_csv(path) for path in parameters], ignore_index=True)
    said = pd.concat([pd.read_csv(path, keep_default_na=False) for path in claims], ignore_index=True)
    tables.write_table(joined, Path(table))
    tables.write_table(said, Path(claimed))
    found = structure_pages.Structures(joined, said, titles)
    shown = [document.Heading("Structures of several coordinates", 1), *structure_pages.structure_blocks(found)]
    replace_file(Path(page), document.markdown(shown).encode())


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        output = step.output
        main(step.input.parameters, step.input.claims, output.table, output.claims, output.page, step.params.titles)
