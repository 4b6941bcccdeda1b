"""Whether errors are what they say: `python -m benchmarks.intervals`, some minutes; into docs/estimators.md.

The combined system with noise on the displacement, as in the report's Section 5.4, over many seeds: bias and scatter of
each coefficient, its scatter over the Cramer-Rao bound, and how often the 95 % interval holds the truth.
"""

import argparse
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import t as student

from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.estimators.in_free_run import free_run_fit
from study.records.excitation import Excitation, displacement_noise, force
from study.records.record import Record
from study.records.spectra import Segments
from study.reproduction.config import load_config
from study.support import document
from study.support.cores import side_by_side

ROOT = Path(__file__).parent.parent
MODEL = read_model(ROOT / "models" / "duffing_van_der_pol.yaml")
TOLD = Settings(Segments(), (0.3, 10.0))
NOISES, NAMES = (0.05, 0.1, 0.2), ("output_error", "instrumental")
FIRST = 9001


def one(noise: float, seed: int) -> list[dict[str, object]]:
    """Error, standard error and Cramer-Rao bound of each coefficient by each estimator for one record."""
    sampling = load_config(ROOT / "config").settings.sampling
    made = simulate(MODEL, force(Excitation(), sampling.samples, sampling.dt, seed), sampling.dt, Integrator())
    added = displacement_noise(
        made["displacement"], noise, round(1000.0 * noise) * FIRST + seed
    )  # another at each level
    record = Record(made.dt, {"force": made["force"], "displacement": made["displacement"] + added})
    rows: list[dict[str, object]] = []
    for name in NAMES:
        found = estimators.identify(name, MODEL, record, TOLD)
        fit = free_run_fit(MODEL, record)
        known = np.sqrt(np.mean(added**2)) / fit.rms  # the bound takes the noise's own variance
        assert found.estimate is not None
        for key in found.estimate.symbols:
            true = float(MODEL.numbers()[key])
            bound = np.sqrt(fit.covariance[fit.keys.index(key), fit.keys.index(key)]) * known
            rows.append(
                {
                    "noise": noise, "estimator": name, "key": key, "error": (found.estimate[key] - true) / true,
                    "claimed": found.estimate.error(key) / true, "bound": bound / true, "note": bool(found.note),
                    "widths": float(student.ppf(0.975, found.estimate.freedom)),
                }
            )  # fmt: skip
    return rows


MEASURES = {  # of a coefficient over the seeds, and how each is written
    "scatter (%)": ".2g", "bias / scatter": ".2f", "scatter / bound": ".2f", "scatter / standard error": ".2f",
    "95 % interval holds the truth (%)": ".1f",
}  # fmt: skip


def measures(table: pd.DataFrame) -> pd.DataFrame:
    """One row a level of noise, estimator and coefficient: a column for each of :data:`MEASURES`."""
    rows: list[tuple[float, str, str, *tuple[float, ...]]] = []
    for (noise, name, key), group in table.groupby(["noise", "estimator", "key"], sort=False):
        error, claimed = group["error"].to_numpy(), group["claimed"].to_numpy()
        scatter = float(np.std(error, ddof=1))
        inside = 100.0 * float(np.mean(np.abs(error) < group["widths"].to_numpy() * claimed))
        rows.append(
            (noise, name, key, 100.0 * scatter, abs(float(np.mean(error))) / scatter,
             scatter / float(np.mean(group["bound"])), scatter / float(np.sqrt(np.mean(claimed**2))), inside)
        )  # fmt: skip
    return pd.DataFrame(rows, columns=["noise", "estimator", "key", *MEASURES])


def summary(measured: pd.DataFrame) -> document.Block:
    """One row a level of noise and estimator: from the least of its coefficients to the largest."""
    rows = [
        (f"{100.0 * noise:g} %", name.replace("_", " "),
         *(f"{group[m].min():{form}} to {group[m].max():{form}}" for m, form in MEASURES.items()))
        for (noise, name), group in measured.groupby(["noise", "estimator"], sort=False)
    ]  # fmt: skip
    return document.table(("noise", "estimator", *MEASURES), rows)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=200)
    told = options.parse_args()
    seeds = range(FIRST, FIRST + told.seeds)
    rows = [row for noise in NOISES for found in side_by_side(partial(one, noise), seeds) for row in found]
    table = pd.DataFrame(rows)
    missed = int(table["note"].sum())
    words = f"Over {told.seeds} seeds. {f'{missed} searches did not converge' if missed else 'Every search converged'}."
    document.put(ROOT / "docs" / "estimators.md", "intervals", [document.Text(words), summary(measures(table))])


if __name__ == "__main__":
    main()
