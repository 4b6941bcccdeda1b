"""Snakemake step: settings of a case -> its record."""

from pathlib import Path

from study.equations.model_file import read_model
from study.records.record import write_csv
from study.reproduction.cases import make_record
from study.reproduction.settings import RecordSettings
from study.support.files import replacing
from study.support.workflow_step import one_sentence


def main(model: str, output: str, settings: RecordSettings) -> None:
    record = make_record(read_model(Path(model)), settings)
    with replacing(Path(output)) as beside:
        write_csv(record, beside)


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.input.model, step.output.record, RecordSettings.model_validate(step.params.settings))
