"""Trials by kind of test: ``kind_trials.py docs/trials_by_test.csv 50 free_decay ...`` adds their rows."""

import csv
import sys
from pathlib import Path

from study.trials.kind_runs import COLUMNS, run_test


def main(table: Path, seeds: range, tests: list[str]) -> None:
    """Append the trials that the table lacks, one row after the other."""
    rows = list(csv.DictReader(table.open())) if table.is_file() else []
    known = {(row["test"], int(row["seed"])) for row in rows}
    with table.open("a", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        if not rows:
            writer.writeheader()
        for seed in seeds:
            for test in tests:
                if (test, seed) not in known:
                    writer.writerow(run_test(test, seed))
                    stream.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), range(int(sys.argv[2])), sys.argv[3:])
