"""Snakemake step: judge every claim of the report."""

import sys
from pathlib import Path
from typing import Any, cast

import pandas as pd

from study.reproduction import tables
from study.reproduction.claims import claims_table, evidence, reported
from study.reproduction.claims.judgement import Claim
from study.reproduction.settings import ClaimSettings
from study.support.workflow_step import one_sentence


def main(models: str, statements: str, steps: str, settings: dict[str, Any], output: str) -> None:
    rows = cast(list[dict[str, Any]], pd.read_csv(steps).to_dict("records"))
    found = evidence.Evidence(ClaimSettings.model_validate(settings), evidence.models_of(Path(models)), rows)
    stated = reported.load_reported(Path(statements))

    count = len(claims_table.claim_names(stated))

    def progress(number: int, claim: Claim) -> None:
        print(f"{number} of {count}: {claim.id}: {claim.verdict}", file=sys.stderr, flush=True)

    judged = claims_table.judge_all(found, stated, progress)
    tables.write_table(judged, Path(output))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(
            step.params.models, step.input.statements, step.input.steps, step.params.settings,
            step.output.csv,
        )  # fmt: skip
