"""Write docs/structures.md's table of the trials from docs/trials_of_structures.csv.

``make structure_trials`` puts the newest run there first.

python scripts/structure_trial_docs.py [results/trials_mdof/trials.csv figures/trials_of_structures_effects.png ...]
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from study.support import document
from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence
from study.trials import structure_rates

KEPT = "trials_of_structures.csv"


def main(page: Path, newest: Sequence[Path] = ()) -> None:
    kept = page.with_name(KEPT)
    for path in newest or (kept,):
        if not path.is_file():
            raise StudyError(f"{path}: there is no such file; run 'snakemake -j2 trials_mdof' first")
    for path in newest:
        replace_file(kept if path.suffix == ".csv" else page.with_name(path.name), path.read_bytes())
    table = pd.read_csv(kept, keep_default_na=False, na_values=["nan"])
    rows = [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]
    document.put(page, "trials", structure_rates.in_document(rows))


if __name__ == "__main__":
    with one_sentence():
        main(Path("docs/structures.md"), [Path(name) for name in sys.argv[1:]])
