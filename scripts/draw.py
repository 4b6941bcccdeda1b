"""Snakemake step: files of a case -> all its figures, those of Section 3 included; errors of estimators -> theirs.

One process for all figures of a case: it begins twice as long as it draws.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from study.figures import page
from study.reproduction import study_figures
from study.reproduction.settings import SegmentSettings
from study.support.workflow_step import one_sentence


def main(inputs: Mapping[str, str], outputs: Mapping[str, Sequence[str]], told: Mapping[str, Any]) -> None:
    files, style = {name: Path(path) for name, path in inputs.items()}, Path(inputs["style"])
    wanted = {kind: [Path(path) for path in paths] for kind, paths in outputs.items()}
    if "errors" in files:
        table, cases = pd.read_csv(files["errors"]), told["cases"]
        page.write_each({"errors": lambda: study_figures.error_dots(table, cases)}, wanted, style)
        return
    segments = SegmentSettings.model_validate(told["segments"]).segments()
    named = {name: files[name] for name in ("record", "model", "responses", "coherences", "parameters")}
    study_figures.draw_case(
        study_figures.CaseFiles(**named, title=told["title"], drawn=told["drawn"], segments=segments), wanted, style
    )


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        inputs = {name: path for name, path in step.input.items() if isinstance(path, str)}
        main(inputs, dict(step.output.items()), dict(step.params.items()))
