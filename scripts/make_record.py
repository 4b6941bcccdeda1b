"""Snakemake step: settings of a case -> its record."""

from pathlib import Path
from typing import Any

from study.case import make_record
from study.modelfile import read_model
from study.record import write_csv


def main(model: str, output: str, settings: dict[str, Any]) -> None:
    write_csv(make_record(read_model(Path(model)), settings), Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    main(step.input.model, step.output.record, step.params.settings)
