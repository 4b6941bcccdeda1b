"""Write numbers, picture and table of docs/estimators.md from the run with many seeds: ``make estimators``."""

from pathlib import Path

import pandas as pd

from study.reproduction import study_pages
from study.reproduction.config import load_config
from study.support import document
from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence


def main(page: Path, table: Path, picture: Path) -> None:
    for path in (table, picture):
        if not path.is_file():
            raise StudyError(f"{path}: there is no such file; run 'snakemake -j2 estimators' first")
    errors = pd.read_csv(table)
    for mark, block in {
        "about": document.Text(study_pages.about_errors(errors)),
        "errors": study_pages.error_overview(errors),
    }.items():
        document.put(page, mark, [block])
    replace_file(page.with_suffix(".png"), picture.read_bytes())
    replace_file(page.with_suffix(".csv"), table.read_bytes())


if __name__ == "__main__":
    with one_sentence():
        stem = f"estimators_{load_config(Path('config')).settings.estimator_errors.many}"
        main(Path("docs/estimators.md"), Path(f"results/{stem}.csv"), Path(f"figures/{stem}.png"))
