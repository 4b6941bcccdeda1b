"""Write what docs say of the trials from their kept tables; ``make trials`` puts the newest run of one there first.

python scripts/trial_docs.py [TABLE results/TABLE/trials.csv]
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
from study.trials.kept import TRIALS
from study.trials.pages import CONFUSIONS, PAGES, blocks


def main(docs: Path, name: str, wanted: Mapping[str, Sequence[float]], newest: Path | None = None) -> None:
    kept = docs / f"{name}.csv"
    new = {} if newest is None else {newest: kept}
    if newest is not None:
        new |= {Path("figures") / f"{picture}.png": docs / f"{picture}.png" for picture in CONFUSIONS[name]}
    for path in new or (kept,):
        if not path.is_file():
            raise StudyError(f"{path}: there is no such file; run 'make trials TABLE={name}' first")
    for path, page in new.items():
        replace_file(page, path.read_bytes())
    for place, said in blocks(pd.read_csv(kept), name, wanted if name == TRIALS else None).items():
        document.put(docs / PAGES[name], place, said)


if __name__ == "__main__":
    with one_sentence():
        targets = load_config(Path("config")).settings.trials.wanted.plain()
        for table in sys.argv[1:2] or [name for name in PAGES if (Path("docs") / f"{name}.csv").is_file()]:
            main(Path("docs"), table, targets, Path(sys.argv[2]) if len(sys.argv) > 2 else None)
