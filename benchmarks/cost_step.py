"""One measurement of ``benchmarks/cost.py``, in a process of its own so that its peak memory is its own.

Prints processor seconds and the peak memory in bytes beyond what the program needs for hardly any record.
"""

import resource
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain.free_run_fit import fit_free_run
from study.records.excitation import Excitation, force
from study.records.record import Record
from study.records.spectra import Segments, cross_spectra_in_pieces

MODEL = read_model(Path(__file__).parent.parent / "models" / "duffing.yaml")
INPUTS = reverse_inputs(MODEL)
SETTINGS = Settings(Segments(), (0.3, 10.0))
DT, PERIOD = 0.02, 100_000  # the force repeats itself after so many samples, and in time so does the response
PIECE = 65_536  # samples that are read at a time
ROW = 2 * 8  # bytes of a sample: displacement and force
SHORTEST = 0.2  # seconds: short tasks are repeated until they add up to this
FIRST = 4096  # samples of the run that compiles and loads everything


def make(path: Path, samples: int) -> None:
    """Write a record of any length: one period of the settled response, again and again."""
    drive = np.tile(force(Excitation(), PERIOD, DT, 1), 2)
    settled = simulate(MODEL, drive, DT, Integrator("abm4", 8)).part(PERIOD, 2 * PERIOD)
    rows = np.column_stack([settled["displacement"], settled["force"]])
    with path.open("wb") as file:
        for first in range(0, samples, PERIOD):
            rows[: samples - first].tofile(file)


def read(path: Path, first: int, count: int) -> Record:
    """Some samples of the file."""
    rows = np.fromfile(path, dtype=np.float64, count=2 * count, offset=ROW * first).reshape(-1, 2)
    return Record(DT, {"displacement": rows[:, 0].copy(), "force": rows[:, 1].copy()}, name="duffing")


def channels(path: Path, samples: int) -> Iterator[list[np.ndarray]]:
    """Inputs and output of the reverse system, piece by piece."""
    for first in range(0, samples, PIECE):
        piece = read(path, first, min(PIECE, samples - first))
        yield [*histories(INPUTS, piece), piece["force"]]


def miso_in_pieces(path: Path, samples: int) -> None:
    """Read, cross-spectra, MI/SO, coefficients."""
    matrix = cross_spectra_in_pieces(channels(path, samples), DT, SETTINGS.segments)
    coefficients.fit_coefficients(
        conditioned.analyse(matrix), INPUTS, SETTINGS.band, SETTINGS.segments.line_inflation()
    )


def miso_whole(path: Path, samples: int) -> None:
    """The same with the record in memory."""
    estimators.identify("miso", MODEL, read(path, 0, samples), SETTINGS)


def local_polynomial(path: Path, samples: int) -> None:
    """Local polynomials."""
    estimators.identify("local_polynomial", MODEL, read(path, 0, samples), SETTINGS)


def output_error(path: Path, samples: int) -> None:
    """A fit in free run, begun with the true coefficients so that every length takes as many runs."""
    fit_free_run(MODEL, read(path, 0, samples))


def simulation(path: Path, samples: int) -> None:
    """The study's integrator under the record's force."""
    simulate(MODEL, read(path, 0, samples)["force"], DT, Integrator("abm4", 8))


TASKS = {f.__name__: f for f in (miso_in_pieces, miso_whole, local_polynomial, output_error, simulation)}


def peak() -> int:
    """Largest resident memory so far, in bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main() -> None:
    task, path, samples = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    if task == "make":
        make(path, samples)
        return
    TASKS[task](path, FIRST)
    before, begun, count = peak(), time.process_time(), 0
    while time.process_time() - begun < SHORTEST:
        TASKS[task](path, samples)
        count += 1
    print((time.process_time() - begun) / count, peak() - before)


if __name__ == "__main__":
    main()
