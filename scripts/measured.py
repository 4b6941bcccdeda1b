"""Snakemake step: a measured record and a model -> comparison, diagnosis, or a climb from model to model."""

import sys
from pathlib import Path
from typing import Any

from study import cli
from study.commands.climb import climb
from study.commands.measurements import Measurement, check_present
from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(what: str, row: Measurement, output: Any) -> None:
    record, model = Path(row.path), Path(row.model)
    check_present(record)
    if what != "climb":
        words = (what, str(record), "--model", str(model), *row.options, "--out", str(Path(output[0]).parent))
        if code := cli.main(words):  # which has said why
            sys.exit(code)
        return
    target = Path(output.history)
    steps = climb(record, model, row.options, row.steps, target.parent)
    if len(steps) < 2:
        raise StudyError(f"{row.record}: nothing was added to {model}; {target.parent}/climb/step_0 says why")
    replace_file(Path(output.reached), (target.parent / "climb" / model.name).read_bytes())


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.params.what, Measurement.model_validate(step.params.row), step.output)
