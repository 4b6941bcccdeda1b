"""Snakemake step: tables of the study -> the page that a reader opens first."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from study.reproduction import structure_pages, study_page, summary
from study.support import document
from study.support.document import Picture
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def run_times(paths: Sequence[str]) -> pd.DataFrame:
    """Seconds of each job from Snakemake's benchmark files, which are named ``<stage>.<case>.tsv``."""
    rows = []
    for path in paths:
        stage, _, case = Path(path).name.removesuffix(".tsv").partition(".")
        rows.append({"stage": stage, "case": case, "seconds": float(pd.read_csv(path, sep="\t")["s"].iloc[0])})
    return pd.DataFrame(rows, columns=["stage", "case", "seconds"])


def main(
    parameters: Sequence[str], inputs: Mapping[str, str], benchmarks: Sequence[str], drawn: Sequence[str],
    told: Mapping[str, Any], outputs: Mapping[str, str],
) -> None:  # fmt: skip
    tables = summary.Tables(
        parameters=pd.concat([pd.read_csv(path) for path in parameters], ignore_index=True),
        claims=pd.read_csv(inputs["claims"], keep_default_na=False),
        reading=pd.read_csv(inputs["reading"]),
        errors=pd.read_csv(inputs["errors"]),
        times=run_times(benchmarks),
        noise=told["noise"],
        setting=told["setting"],
        structures=structure_pages.Structures(
            pd.read_csv(inputs["structures"]),
            pd.read_csv(inputs["structure_claims"], keep_default_na=False),
            told["structures"],
        ),
    )
    blocks = summary.summary_blocks(tables)
    replace_file(Path(outputs["page"]), document.markdown(blocks).encode())
    replace_file(Path(outputs["html"]), document.document_page(study_page.TITLE, blocks).encode())
    replace_file(Path(outputs["estimators"]), document.markdown(summary.estimator_blocks(tables)).encode())
    pictures = [
        Picture(p["system"], p["number"], p["shows"], Path(file).read_bytes())
        for p, file in zip(told["pictures"], drawn, strict=True)
    ]
    replace_file(Path(outputs["study"]), study_page.study_page(tables, pictures))


NAMES = ("claims", "reading", "errors", "structures", "structure_claims")  # of inputs that are one table each

if "snakemake" in globals():
    step = globals()["snakemake"]
    tables = {name: getattr(step.input, name) for name in NAMES}
    with one_sentence():
        main(
            step.input.parameters,
            tables,
            step.input.benchmarks,
            step.input.pictures,
            step.params.told,
            dict(step.output.items()),
        )
