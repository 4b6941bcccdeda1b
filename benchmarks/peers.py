"""Errors and times of other packages beside ours, on the same records, into docs/peers.md.

Run with ``sh benchmarks/peers.sh``, which makes the environment that this needs (the extra ``peers``).
"""

import argparse
import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from benchmarks.peer_methods import OURS, PEERS, WANTED
from study.equations.model import Model
from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, displacement_noise, force
from study.records.record import Record
from study.support import document

ROOT = Path(__file__).parent.parent
DT = 0.02
EXACT = Integrator("rk4", 16)  # finer than the study's, so that the record's own error is not what is compared
NOISES = {"clean": 0.0, "5 % noise": 0.05}  # rms of the noise over that of the displacement
METHODS = {**PEERS, **OURS}
KEYS, NUMBERS = ["seed", "record", "method"], [*WANTED, "s"]
WORST = f"worst of {', '.join(WANTED)}"
WARM_UP = 2048  # samples of a first run that is not timed


def record(model: Model, samples: int, seed: int, noise: float) -> Record:
    """Force and displacement of the Duffing system, nothing else."""
    full = simulate(model, force(Excitation(), samples, DT, seed), DT, EXACT)
    u = full["displacement"]
    return replace(full, channels={"force": full["force"], "displacement": u + displacement_noise(u, noise**2, seed)})


def measure(model: Model, samples: int, seeds: int, path: Path) -> pd.DataFrame:
    """One row a seed, kind of record and method: relative errors in percent, processor seconds.

    Rows are added to the file as they come, and those that it holds are not measured again.
    """
    for run in METHODS.values():
        run(model, record(model, WARM_UP, 0, 0.0))
    known = pd.read_csv(path) if path.exists() else pd.DataFrame(columns=[*KEYS, *NUMBERS])
    done = set(known[KEYS].itertuples(index=False, name=None))
    for seed, (kind, noise) in product(range(1, seeds + 1), NOISES.items()):
        data = record(model, samples, seed, noise)
        for method, run in METHODS.items():
            if (seed, kind, method) in done:
                continue
            begun = time.process_time()
            found = run(model, data)
            seconds = time.process_time() - begun
            errors = [100.0 * abs(found[key] / model.values[key] - 1.0) for key in WANTED]
            row = pd.DataFrame([[seed, kind, method, *errors, seconds]], columns=[*KEYS, *NUMBERS])
            row.to_csv(path, mode="a", header=not path.exists(), index=False)
            print(f"{samples:>9,}", *row.to_string(header=False, index=False).split("\n"), flush=True)
    return pd.read_csv(path)


def table(measured: pd.DataFrame) -> pd.DataFrame:
    """The worst coefficient's error and the time, medians over the seeds: a row a method, columns by kind of record.

    nan is nothing found or not run.
    """
    middle = measured.groupby(["method", "record"])[NUMBERS].median()
    middle[WORST] = middle[[*WANTED]].max(axis=1, skipna=False)
    return middle.unstack("record").reindex(
        index=[*METHODS], columns=[(number, kind) for kind in NOISES for number in (WORST, "s")]
    )


def shown(middle: pd.DataFrame) -> str:
    """Markdown; the best of each column in bold."""
    best = middle.min()
    cells = middle.astype(object)
    for column in middle:
        for method, value in middle[column].items():
            text = "-" if np.isnan(value) else f"{value:.2g}" if value < 10.0 else f"{value:.0f}"
            cells.loc[method, column] = f"**{text}**" if value == best[column] else text
    cells.columns = [f"{kind}: {'time (s)' if number == 's' else f'{number} (%)'}" for number, kind in middle.columns]
    return cells.rename_axis(None).to_markdown(disable_numparse=True)


def leads(middle: pd.DataFrame) -> str:
    """Where a peer is ahead of all of ours, and by how much; computed, whichever way it comes out."""
    behind = []
    for number, kind in middle.columns:
        column = middle[number, kind]
        theirs, mine = column[list(PEERS)].min(), column[list(OURS)].min()
        if theirs < mine:
            name = column[list(PEERS)].idxmin()
            behind.append(f"{'time' if number == 's' else number} ({kind}): {name}, {mine / theirs:.2g} times")
    ahead = (
        f"A peer is ahead in: {'; '.join(behind)}." if behind else "One of ours has the smallest number of each column."
    )
    missing = [
        f"{method} ({kind})" for kind in NOISES for method in METHODS if np.isnan(middle.loc[method, ("s", kind)])
    ]
    return f"{ahead} Not run: {'; '.join(missing)}." if missing else ahead


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5, help="records of 8,192 samples (default 5)")
    parser.add_argument("--long-seeds", type=int, default=1, help="records of 1,000,000 samples (default 1)")
    parser.add_argument("--resume", action="store_true", help="keep what an interrupted run has measured")
    told = parser.parse_args()
    model = read_model(ROOT / "models" / "duffing.yaml")
    results = ROOT / "results" / "benchmarks"
    results.mkdir(parents=True, exist_ok=True)
    for name, samples, seeds in (("short", 8192, told.seeds), ("long", 1_000_000, told.long_seeds)):
        if seeds < 1:
            continue
        path = results / f"peers_{name}.csv"
        if not told.resume:
            path.unlink(missing_ok=True)
        with threadpool_limits(1):
            measured = measure(model, samples, seeds, path)
        middle = table(measured)
        heading = f"{samples:,} samples, median over {seeds} record{'s' if seeds > 1 else ''}:"
        said = [document.Text(words) for words in (heading, shown(middle), leads(middle))]
        document.put(ROOT / "docs" / "peers.md", name, said)


if __name__ == "__main__":
    main()
