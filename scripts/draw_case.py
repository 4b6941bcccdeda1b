"""Snakemake step: record, model and products of a case -> all its figures, those of Section 3 included.

One process for all of them: it begins twice as long as it draws.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from study.reproduction.config import IDENTIFIED
from study.reproduction.pictures import identified_figures, preliminary_figures
from study.reproduction.settings import SegmentSettings
from study.support.workflow_step import one_sentence


def main(inputs: Mapping[str, str], outputs: Mapping[str, Sequence[str]], told: Mapping[str, Any]) -> None:
    files = {name: Path(path) for name, path in inputs.items()}
    wanted = {kind: [Path(p) for p in paths] for kind, paths in outputs.items()}
    identified_figures.draw_identified(
        files["record"], files["responses"], files["coherences"],
        {kind: paths for kind, paths in wanted.items() if kind in IDENTIFIED}, title=told["title"],
        style=files["style"], drawn=told["drawn"], parameters_csv=files["parameters"],
    )  # fmt: skip
    preliminary_figures.draw_preliminary(
        preliminary_figures.Source(files["record"], files["model"], told["title"]),
        {kind: paths for kind, paths in wanted.items() if kind not in IDENTIFIED}, style=files["style"],
        segments=SegmentSettings.model_validate(told["segments"]).segments(),
    )  # fmt: skip


if "snakemake" in globals():
    step = globals()["snakemake"]
    inputs = {
        name: getattr(step.input, name)
        for name in ("record", "model", "responses", "coherences", "parameters", "style")
    }
    with one_sentence():
        main(inputs, dict(step.output.items()), dict(step.params.items()))
