"""Snakemake step: tables of the study -> its pages."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from study.reproduction import study_pages, whole_page
from study.support import document
from study.support.document import Picture
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

WORDS = ("claims", "structure_claims", "part_two_claims")  # tables in which an empty cell is an empty word
OTHERS = ("benchmarks", "pictures", "style", "code")  # inputs that are no tables


def run_times(paths: Sequence[str]) -> pd.DataFrame:
    """Seconds of each job from Snakemake's benchmark files, which are named ``<stage>.<case>.tsv``."""
    rows = []
    for path in paths:
        stage, _, case = Path(path).name.removesuffix(".tsv").partition(".")
        rows.append({"stage": stage, "case": case, "seconds": float(pd.read_csv(path, sep="\t")["s"].iloc[0])})
    return pd.DataFrame(rows, columns=["stage", "case", "seconds"])


def main(inputs: Mapping[str, Sequence[str]], outputs: Mapping[str, str], told: Mapping[str, Any]) -> None:
    """Write the pages that are asked for: ``<table>_table`` as it stands, ``study``, ``html``, and documents."""
    tables = {
        name: pd.concat([pd.read_csv(path, keep_default_na=name not in WORDS) for path in paths], ignore_index=True)
        for name, paths in inputs.items()
        if name not in OTHERS
    }
    tables["times"] = run_times(inputs.get("benchmarks", ()))
    results = study_pages.Results(tables, told["noise"], told.get("setting", ""), told.get("titles", {}))
    for name, path in outputs.items():
        if name.endswith("_table"):
            table = name.removesuffix("_table")
            rows = pd.read_csv(inputs[table][0], keep_default_na=False, dtype=str)
            page = study_pages.table_page(told["tables"][table], rows).encode()
        elif name == "study":
            drawn = zip(told["pictures"], inputs["pictures"], strict=True)
            pictures = [Picture(p["system"], p["number"], p["shows"], Path(file).read_bytes()) for p, file in drawn]
            page = whole_page.study_page(results, pictures)
        elif name == "html":
            page = document.document_page(study_pages.TITLE, study_pages.titled("summary", results)).encode()
        elif name in whole_page.WHOLE_DOCUMENTS:
            page = document.markdown(whole_page.WHOLE_DOCUMENTS[name](results)).encode()
        else:
            page = document.markdown(study_pages.titled(name, results)).encode()
        replace_file(Path(path), page)


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        inputs = {name: [paths] if isinstance(paths, str) else list(paths) for name, paths in step.input.items()}
        main(inputs, dict(step.output.items()), dict(step.params.items()))
