"""Snakemake step: what the integrator's setting does to each recovered parameter."""

from pathlib import Path
from typing import Any

from study.identify.estimators.base import Settings
from study.records.excitation import READINGS
from study.reproduction import ensemble, tables
from study.reproduction.claims.evidence import Drive, models_of, record_settings
from study.reproduction.claims.reported import SYSTEMS
from study.reproduction.settings import ClaimSettings
from study.support.workflow_step import one_sentence

SHARE = 5  # differences on the same forces scatter little: a fifth of the ensemble's seeds is plenty


def main(models: str, settings: dict[str, Any], output: str) -> None:
    told = ClaimSettings.model_validate(settings)
    first, count = told.ensembles.first_seed, max(2, told.ensembles.seeds // SHARE)
    record = record_settings(told, Drive(SYSTEMS[0]))
    low, high = told.fit_band
    own = record.excitation.reading or READINGS[0]
    readings = [own, *(r for r in READINGS if r != own)]
    known = models_of(Path(models))
    table = ensemble.integrator_study(
        {name: known[name] for name in SYSTEMS if name in known},
        record, Settings(told.segments.segments(), (low, high)), range(first, first + count), readings,
    )  # fmt: skip
    tables.write_table(table, Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.params.models, step.params.settings, step.output.csv)
