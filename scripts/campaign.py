"""Snakemake step: comparisons and diagnoses of many records -> one page."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from study.compare.campaign import MEASURED_RECORDS, campaign_blocks, measured_of_row
from study.support import document
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(rigs: Mapping[str, str], comparisons: Sequence[str], diagnoses: Sequence[str], output: str) -> None:
    read = [[json.loads(Path(path).read_text()) for path in paths] for paths in (comparisons, diagnoses)]
    rows = zip(rigs.items(), *read, strict=True)
    records = [record for (name, rig), *found in rows for record in measured_of_row(name, rig, *found)]
    replace_file(Path(output), document.document_page(MEASURED_RECORDS, campaign_blocks(records)).encode())


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(step.params.rigs, step.input.comparisons, step.input.diagnoses, step.output.page)
