"""Snakemake step: both readings of unit variance against the numbers that the report quotes."""

from pathlib import Path
from typing import Any

from study.reproduction import tables
from study.reproduction.claims import dead_band, evidence, reported
from study.reproduction.settings import ClaimSettings
from study.support.workflow_step import one_sentence


def main(models: str, statements: str, settings: dict[str, Any], output: str) -> None:
    found = evidence.Evidence(ClaimSettings.model_validate(settings), evidence.models_of(Path(models)), [])
    stated = reported.load_reported(Path(statements))
    tables.write_table(dead_band.both_readings(found, stated), Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.params.models, step.input.statements, step.params.settings, step.output.table)
