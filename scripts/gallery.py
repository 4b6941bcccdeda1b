"""Snakemake step: what the climbs left -> the gallery, one page."""

from pathlib import Path
from typing import Any

from study.gallery import gallery_page
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(records: dict[str, list[str]], output: Any) -> None:
    target = Path(output.page)
    replace_file(target, gallery_page.gallery_page(gallery_page.entries(Path("config"), target.parent, records)))


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.params.records, step.output)
