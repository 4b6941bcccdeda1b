"""Snakemake step: cases over many seeds -> how often each meets a tolerance, or how far each estimator is off."""

import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from study.equations.model_file import read_model
from study.reproduction import ensemble, tables
from study.reproduction.settings import IdentificationSettings, RecordSettings
from study.support.workflow_step import one_sentence

EVERY = 100  # seeds between two signs of life
JUDGED = {"rates": ensemble.tolerance_rates, "errors": ensemble.estimator_errors}


def main(
    models: Sequence[str], records: Sequence[RecordSettings], identifications: Sequence[IdentificationSettings],
    seeds: range, judged: str, output: str,
) -> None:  # fmt: skip
    def found(model: str, record: RecordSettings, identification: IdentificationSettings) -> pd.DataFrame:
        def progress(done: int) -> None:
            if done % EVERY == 0 or done == len(seeds):
                print(f"{record.case}: {done} of {len(seeds)} seeds", file=sys.stderr, flush=True)

        known = read_model(Path(model))
        return ensemble.estimates(known, record, identification, seeds, workers=1, progress=progress)

    judge = JUDGED[judged]
    parts = [judge(found(*told)) for told in zip(models, records, identifications, strict=True)]
    tables.write_table(pd.concat(parts, ignore_index=True), Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(
            step.input.models, [RecordSettings.model_validate(record) for record in step.params.records],
            [IdentificationSettings.model_validate(settings) for settings in step.params.identifications],
            range(step.params.first_seed, step.params.first_seed + step.params.seeds), step.params.judged,
            step.output.table,
        )  # fmt: skip
