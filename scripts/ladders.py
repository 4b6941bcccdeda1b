"""Snakemake step: measured records -> the ladders of Part II; those whose files are not there are named as missing."""

from pathlib import Path

import pandas as pd

from study.commands.ladder import LADDER_COLUMNS, Ladder, climbed_ladder, missing_ladder
from study.commands.measurements import Measurement
from study.reproduction import tables
from study.support.workflow_step import one_sentence


def main(rows: dict[str, Measurement], ladders: dict[str, Ladder], titles: dict[str, str], output: Path) -> None:
    made = [
        (climbed_ladder if all(Path(path).is_file() for path in rows[name].paths) else missing_ladder)(
            rows[name], ladder, titles[name]
        )
        for name, ladder in ladders.items()
    ]
    rows_of_all = [row for table in made for row in table.to_dict("records")]
    tables.write_table(pd.DataFrame(rows_of_all, columns=LADDER_COLUMNS), output)


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        main(
            {name: Measurement.model_validate(row) for name, row in step.params.rows.items()},
            {name: Ladder.model_validate(row) for name, row in step.params.ladders.items()},
            dict(step.params.titles), Path(step.output.ladders),
        )  # fmt: skip
