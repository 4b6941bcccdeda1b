"""Snakemake step: settings -> the tables of a chapter of Part II."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from study.reproduction import tables
from study.reproduction.chapters.chapter import chapter_settings, get_chapter
from study.reproduction.settings import ClaimSettings
from study.support.workflow_step import one_sentence


def main(chapter: str, study: dict[str, Any], own: dict[str, Any], models: Path, outputs: Mapping[str, str]) -> None:
    told = ClaimSettings.model_validate(study), chapter_settings(chapter, own)
    make = get_chapter(chapter).make
    assert make is not None, "a chapter that another script makes"
    for name, table in make(*told, models).items():
        tables.write_table(table, Path(outputs[name]))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.params.chapter, step.params.study, step.params.own, Path("models"), dict(step.output.items()))
