"""Write docs/tool.md's tables of the trials from docs/trials.csv; ``make trials`` puts the newest run there first.

python scripts/trial_docs.py [results/trials/trials.csv figures/trials_confusion.png]
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from study.reproduction.config import load_config
from study.support import document
from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence
from study.trials import trial_pages


def main(page: Path, wanted: Mapping[str, Sequence[float]], newest: Sequence[Path] = ()) -> None:
    kept = page.with_name("trials.csv")
    for path in newest or (kept,):
        if not path.is_file():
            raise StudyError(f"{path}: there is no such file; run 'snakemake -j2 trials' first")
    for path in newest:
        replace_file(kept if path.suffix == ".csv" else page.with_name(path.name), path.read_bytes())
    table = pd.read_csv(kept)
    document.put(page, "reach", trial_pages.reached(table, wanted))
    document.put(page, "constants", trial_pages.constants(table))


if __name__ == "__main__":
    with one_sentence():
        targets = load_config(Path("config")).settings.trials.wanted.plain()
        main(Path("docs/tool.md"), targets, [Path(name) for name in sys.argv[1:]])
