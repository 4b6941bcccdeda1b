"""Snakemake step: the trials of one kind of test.

By hand, ``kind_trials.py TABLE FIRST_SEED COUNT KIND ...``, the trials that the table lacks are run and added one after
the other, a seed of every kind before the next seed.
"""

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

from study.support.workflow_step import one_sentence
from study.trials.kind_runs import COLUMNS, run_test


def main(path: Path, seeds: range, tests: Sequence[str]) -> None:
    """Append the trials that the table lacks."""
    rows = list(csv.DictReader(path.open())) if path.is_file() else []
    known = {(row["test"], int(row["seed"])) for row in rows}
    with path.open("a", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        if not rows:
            writer.writeheader()
        for seed, test in ((s, t) for s in seeds for t in tests if (t, s) not in known):
            writer.writerow(run_test(test, seed))
            stream.flush()


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        output = Path(step.output.table)
        output.unlink(missing_ok=True)
        main(output, range(step.params.first, step.params.first + step.params.trials), [step.wildcards.kind])
elif __name__ == "__main__":
    first, count = int(sys.argv[2]), int(sys.argv[3])
    with one_sentence():
        main(Path(sys.argv[1]), range(first, first + count), sys.argv[4:])
