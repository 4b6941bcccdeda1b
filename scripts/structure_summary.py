"""Snakemake step: tables of all cases of structures -> one table of parameters, and a page with what is claimed."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from study.reproduction import tables
from study.reproduction.claims.judgement import SEPARATOR
from study.support import document
from study.support.document import Block
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

SHOWN = ("estimator", "parameter", "true", "estimate", "standard_error", "relative_error", "tolerance")


def blocks(parameters: pd.DataFrame, claims: pd.DataFrame, titles: Mapping[str, str]) -> list[Block]:
    """What is claimed of each case with its conditions, and every parameter."""
    found: list[Block] = [document.Heading("Structures of several coordinates", 1)]
    for case, title in titles.items():
        found.append(document.Heading(title))
        for _, row in claims[claims["case"] == case].iterrows():
            pairs = zip(row["criterion"].split(SEPARATOR), row["measured"].split(SEPARATOR), strict=True)
            lines = tuple(f"{criterion}: {measured}" for criterion, measured in pairs)
            found += [document.Text(f"**{row['verdict']}**: {row['claim']}"), document.Bullets(lines)]
        own = parameters[parameters["case"] == case]
        rows = [
            [f"{v:.5g}" if isinstance(v, float) else str(v) for v in row]
            for row in own[[*SHOWN]].itertuples(index=False)
        ]
        found.append(document.table(list(SHOWN), rows))
    return found


def main(parameters: Sequence[str], claims: Sequence[str], table: str, page: str, titles: Mapping[str, str]) -> None:
    joined = pd.concat([pd.read_csv(path) for path in parameters], ignore_index=True)
    said = pd.concat([pd.read_csv(path, keep_default_na=False) for path in claims], ignore_index=True)
    tables.write_csv(joined, Path(table))
    replace_file(Path(page), document.markdown(blocks(joined, said, titles)).encode())


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.input.parameters, step.input.claims, step.output.table, step.output.page, step.params.titles)
