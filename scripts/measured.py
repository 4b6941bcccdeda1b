"""Snakemake step: measured records and a model -> comparison, diagnosis, or a climb from model to model."""

import sys
from pathlib import Path
from typing import Any

from study import cli
from study.commands.climb import climb
from study.commands.measurements import Measurement, check_present
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(what: str, row: Measurement, output: Any) -> None:
    records, model = [Path(path) for path in row.paths], Path(row.model)
    for record in records:
        check_present(record)
    if what != "climb":
        words = (what, *map(str, records), "--model", str(model), *row.options, "--out", str(Path(output[0]).parent))
        if code := cli.main(words):  # which has said why
            sys.exit(code)
        return
    target = Path(output.history)
    climb(records, model, row.options, row.steps, target.parent)
    replace_file(Path(output.reached), (target.parent / "climb" / model.name).read_bytes())


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.params.what, Measurement.model_validate(step.params.row), step.output)
