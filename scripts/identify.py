"""Snakemake step: record -> frequency response functions, coherences and parameters."""

import sys
from pathlib import Path

from study.equations.model_file import read_model
from study.records.record import read_csv
from study.reproduction import tables
from study.reproduction.cases import identify_case
from study.reproduction.settings import IdentificationSettings
from study.support.workflow_step import one_sentence


def main(model: str, record: str, outputs: dict[str, str], settings: IdentificationSettings) -> None:
    system = read_model(Path(model))
    found = identify_case(system, read_csv(Path(record)), settings)
    for note in (f.note for f in found.values() if f.note):
        print(f"{settings.case}: {note}", file=sys.stderr)
    tables.write_table(tables.response_table(system, found), Path(outputs["responses"]))
    tables.write_table(tables.coherence_table(found), Path(outputs["coherences"]))
    tables.write_table(tables.noise_spectra(found), Path(outputs["noise"]))
    tables.write_table(tables.parameter_table(settings.case, system, found, settings), Path(outputs["parameters"]))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        settings = IdentificationSettings.model_validate(step.params.settings)
        main(step.input.model, step.input.record, dict(step.output.items()), settings)
