"""Every benchmark of pytest, and the ratios that the docs quote of them: ``python -m benchmarks.ratios``.

SciPy's integrators get a compiled right-hand side, whose compiler holds NumPy back: they run in the environment that
``benchmarks/peers.sh`` makes. Times are those of the processor, so that other work on the machine counts for little.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "results" / "benchmarks"
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
HERE, AMONG_PEERS = [sys.executable, "-m"], ["sh", str(ROOT / "benchmarks" / "peers.sh")]
FILES = {"test_speed": HERE, "test_structures": HERE, "test_simulation": AMONG_PEERS}
RATIOS = (  # what, and what it is held against: names of benchmarks
    ("spectral matrix over its bare transforms", "test_matrix", "test_ffts[bare]"),
    ("spectral matrix over its windowed transforms", "test_matrix", "test_ffts[windowed]"),
    ("scipy.signal.csd over the spectral matrix", "test_matrix_by_scipy_csd", "test_matrix"),
    ("local_polynomial over miso, 100,000 samples", "test_local_polynomial", "test_miso"),
    ("miso of 1,000,000 samples over that of 100,000", "test_miso_of_a_million", "test_miso"),
    ("free run with derivatives over one without", "test_respond[derivatives]", "test_respond[alone]"),
    ("a chain of two masses over one of one", "test_chain[2]", "test_chain[1]"),
    ("a chain of three masses over one of one", "test_chain[3]", "test_chain[1]"),
    ("a chain of five masses over one of one", "test_chain[5]", "test_chain[1]"),
    ("a chain of one over a single mass", "test_chain[1]", "test_single_mass"),
    *((f"SciPy's {peer} over abm4, at equal error", f"test_scipy[{peer}]", "test_ours[abm4]")
      for peer in ("DOP853", "RK45", "LSODA", "Radau")),
)  # fmt: skip


def medians(name: str, words: list[str]) -> dict[str, float]:
    """Seconds of each benchmark of a file, by its name."""
    written = RESULTS / f"{name}.json"
    command = [*FILES[name], "pytest", "-q", "-p", "no:cacheprovider", f"benchmarks/{name}.py"]
    command += ["--benchmark-timer=time.process_time", f"--benchmark-json={written}", *words]
    subprocess.run(command, cwd=ROOT, env=os.environ | ONE_THREAD, check=True, stdout=sys.stderr)
    return {row["name"]: row["stats"]["median"] for row in json.loads(written.read_text())["benchmarks"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=FILES, action="append", help="a file of benchmarks (default: all)")
    parser.add_argument("--select", default="", help="benchmarks whose names hold a word, as pytest -k")
    told = parser.parse_args()
    RESULTS.mkdir(parents=True, exist_ok=True)
    seconds: dict[str, float] = {}
    for name in told.only or FILES:
        seconds |= medians(name, ["-k", told.select] if told.select else [])
    for what, one, other in RATIOS:
        if one in seconds and other in seconds:
            print(f"{what:55} {seconds[one] / seconds[other]:8.2f}    ({seconds[one]:.3g} s / {seconds[other]:.3g} s)")
        elif not (told.only or told.select):
            raise SystemExit(f"{what}: there is no benchmark {one} or none {other}")


if __name__ == "__main__":
    main()
