"""Processor time and peak memory of whole commands against the size of the record: ``python -m benchmarks.commands``.

``study compare`` and ``study diagnose`` of a CSV file, as a user types them: reading, fits, pictures and page included.
The table goes into docs/cost.md. What is measured is kept in results/benchmarks/commands.csv: ``--sizes`` adds rows.
"""

import argparse
import csv
import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
KEPT = ROOT / "results" / "benchmarks" / "commands.csv"
SIZES = (8192, 131_072, 1_000_000)
BELIEVED = "name: rig\nterms: [inertia, linear_damping, linear_stiffness]\n"  # it lacks the cubic spring of the record
Row = tuple[str, int]


def run(*words: str, folder: str) -> tuple[float, float]:
    """Processor seconds and peak memory in megabytes of a command of the project."""
    settings = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.execve(sys.executable, [sys.executable, "-m", "study", *words], settings)
    _, status, used = os.wait4(child, 0)
    if status:
        raise SystemExit(f"study {' '.join(words)} has ended with {os.waitstatus_to_exitcode(status)}")
    unit = 1e6 if sys.platform == "darwin" else 1e3
    return used.ru_utime + used.ru_stime, used.ru_maxrss / unit


def measured(command: str, samples: int) -> tuple[float, float]:
    """The same of a command on a Duffing record of so many samples."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "rig.yaml").write_text(BELIEVED)
        model = str(ROOT / "models" / "duffing.yaml")
        run("simulate", model, "--samples", str(samples), "--out", "rig.csv", folder=folder)
        return run(command, "rig.csv", "--model", "rig.yaml", "--out", "out", folder=folder)


def kept() -> dict[Row, tuple[float, float]]:
    """What was measured so far."""
    if not KEPT.exists():
        return {}
    with KEPT.open(newline="") as file:
        return {(c, int(n)): (float(s), float(m)) for c, n, s, m in list(csv.reader(file))[1:]}


def table(found: dict[Row, tuple[float, float]]) -> str:
    """Markdown, the time a sample beside that of 131,072."""
    rows = ["| command | samples | processor time (s) | time a sample, beside 131,072 | peak memory (MB) |"]
    rows.append("|---|--:|--:|--:|--:|")
    for (command, samples), (seconds, memory) in sorted(found.items()):
        base = found.get((command, SIZES[1]))
        ratio = f"{seconds / samples / (base[0] / SIZES[1]):.2f}" if base else ""
        rows.append(f"| `study {command}` | {samples:,} | {seconds:.3g} | {ratio} | {memory:.0f} |")
    return "\n".join(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES), help="samples (default: %(default)s)")
    parser.add_argument("--commands", nargs="+", default=["compare", "diagnose"])
    told = parser.parse_args()
    found = kept()
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    for command in told.commands:
        for samples in told.sizes:
            found[command, samples] = measured(command, samples)
            print(f"{command:10} {samples:>11,}", *found[command, samples], flush=True)
            with KEPT.open("w", newline="") as file:
                rows = ((*key, *values) for key, values in sorted(found.items()))
                csv.writer(file).writerows([("command", "samples", "seconds", "megabytes"), *rows])
    from study.support import document

    document.put(ROOT / "docs" / "cost.md", "commands", [document.Text(table(found))])


if __name__ == "__main__":
    main()
