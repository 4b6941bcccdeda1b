"""Processor time and peak memory against the size of the record, into docs/cost.md: ``python -m benchmarks.cost``.

Imports nothing large before it has measured: a process takes over the peak memory of the one that started it.
"""

import argparse
import csv
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
LARGEST = {  # samples: as far as memory of a few gigabytes and patience go
    "miso_in_pieces": 10**8, "miso_whole": 10**7, "local_polynomial": 10**6, "output_error": 10**6, "simulation": 10**6,
}  # fmt: skip
NAMES = {
    "miso_in_pieces": "MI/SO, record read in pieces", "miso_whole": "MI/SO, record in memory",
    "local_polynomial": "`local_polynomial`", "output_error": "`output_error`", "simulation": "simulation",
}  # fmt: skip
MARKS = ("o-", "s--", "^-.", "D-", "v:")  # told apart in grey
REFERENCE = 10**5
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
Measured = dict[tuple[str, int], tuple[float, float]]


def step(task: str, path: Path, samples: int) -> list[float]:
    """Run one measurement in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.cost_step", task, str(path), str(samples)]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | ONE_THREAD, check=True, capture_output=True, text=True)
    return [float(word) for word in done.stdout.split()]


def measure(largest: int, rounds: int) -> Measured:
    """Median seconds and largest memory of every task and size; rounds go through all of them in turn."""
    sizes = [10**p for p in range(4, 9) if 10**p <= largest]
    seen: dict[tuple[str, int], list[list[float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record"
        step("make", path, sizes[-1])
        for _ in range(rounds):
            for size in sizes:
                for task in (task for task, most in LARGEST.items() if size <= most):
                    seen.setdefault((task, size), []).append(step(task, path, size))
                    print(f"{task:18} {size:>11,}", *seen[task, size][-1], flush=True)
    return {key: (statistics.median(t for t, _ in runs), max(m for _, m in runs)) for key, runs in seen.items()}


def table(measured: Measured) -> str:
    """Markdown, the largest record of each task: seconds, time a sample as a ratio to the reference, megabytes."""
    largest = {(task, max(size for other, size in measured if other == task)) for task, _ in measured}
    rows = [
        "| task | samples | processor time (s) | time a sample, beside 1e5 | peak memory (MB) |",
        "|---|--:|--:|--:|--:|",
    ]
    for (task, size), (seconds, memory) in sorted(
        measured.items(), key=lambda item: ([*NAMES].index(item[0][0]), item[0][1])
    ):
        if (task, size) not in largest:
            continue
        ratio = seconds / size / (measured[task, REFERENCE][0] / REFERENCE)
        rows.append(f"| {NAMES[task]} | {size:,} | {seconds:.2g} | {ratio:.2f} | {memory / 1e6:.0f} |")
    return "\n".join(rows)


def picture(measured: Measured, path: Path) -> None:
    """Time and memory against size, both logarithmic."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for (task, name), mark in zip(NAMES.items(), MARKS, strict=True):
        sizes = sorted(size for known, size in measured if known == task)
        label = name.replace("`", "")
        left.loglog(sizes, [measured[task, s][0] for s in sizes], mark, label=label)
        right.loglog(sizes, [max(measured[task, s][1] / 1e6, 1.0) for s in sizes], mark, label=label)
    sizes = sorted({size for _, size in measured})
    first = measured["miso_in_pieces", REFERENCE][0] / REFERENCE
    left.loglog(sizes, [0.4 * first * s for s in sizes], "k:", label="in proportion to the size")
    left.set(xlabel="samples", ylabel="processor time (s)")
    right.set(xlabel="samples", ylabel="peak memory (MB), at least 1")
    left.legend(fontsize="x-small", handlelength=3.5)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--largest", type=int, default=10**8, help="samples of the longest record (default 1e8: 1.6 GB)"
    )
    parser.add_argument("--rounds", type=int, default=3, help="measurements of each, of which the median counts")
    told = parser.parse_args()
    measured = measure(max(told.largest, REFERENCE), told.rounds)
    results = ROOT / "results" / "benchmarks"
    results.mkdir(parents=True, exist_ok=True)
    with (results / "cost.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("task", "samples", "seconds", "bytes"), *((*k, *v) for k, v in measured.items())])
    from study.support import document  # now that all is measured

    document.put(ROOT / "docs" / "cost.md", "cost", [document.Text(table(measured))])
    picture(measured, ROOT / "docs" / "cost.png")


if __name__ == "__main__":
    main()
