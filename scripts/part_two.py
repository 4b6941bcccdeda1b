"""Snakemake step: tables of Part II -> the claims of all chapters with verdicts, or the figures of one."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import pandas as pd

from study.figures import page
from study.reproduction import tables
from study.reproduction.chapters.chapter import get_chapter, judged_claims, tables_of
from study.reproduction.chapters.contents import CHAPTERS
from study.reproduction.claims.reported import load_reported
from study.support.workflow_step import one_sentence


def judge(folder: Path, statements: Path, output: Path) -> None:
    expected = load_reported(statements)
    judged = [judged_claims(chapter, tables_of(folder, chapter), expected) for chapter in CHAPTERS]
    tables.write_table(pd.concat(judged, ignore_index=True), output)


def draw(folder: Path, chapter: str, outputs: Mapping[str, Sequence[Path]], style: Path) -> None:
    made = tables_of(folder, chapter)
    kinds = {name: partial(figure, made) for name, figure in get_chapter(chapter).figures.items()}
    page.write_each(kinds, outputs, style)


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        folder = Path(step.input.tables[0]).parent
        if "claims" in dict(step.output.items()):
            judge(folder, Path(step.input.statements), Path(step.output.claims))
        else:
            drawn = {name: [Path(path) for path in paths] for name, paths in step.output.items()}
            draw(folder, step.params.chapter, drawn, Path(step.input.style))
