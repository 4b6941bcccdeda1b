"""How near the width of the report's dead band is found: `python -m benchmarks.width --seeds 40`, a minute or two.

The model leaves u_g open; everything else is what a user of ``output_error`` gets.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.records.excitation import Excitation, displacement_noise, force
from study.records.spectra import Segments
from study.reproduction.config import load_config

ROOT = Path(__file__).parent.parent
FIRST = 6000


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=40)
    options.add_argument("--noise", type=float, default=0.05, help="mean square over that of the displacement")
    told = options.parse_args()
    model, sampling = read_model(ROOT / "models" / "dead_band.yaml"), load_config(ROOT / "config").settings.sampling
    true = model.numbers()["dead_band.u_g"]
    unknown = tuple(replace(t, parameters=(None,)) if t.name == "dead_band" else t for t in model.terms)
    asked = replace(model, terms=unknown)
    error, standard, seconds, notes = [], [], [], []
    for seed in range(FIRST, FIRST + told.seeds):
        values = force(Excitation(), sampling.samples, sampling.dt, seed)
        record = simulate(model, values, sampling.dt, Integrator("abm4", 16))
        noise = displacement_noise(record["displacement"], told.noise, seed)
        record = record.with_channels({"displacement": record["displacement"] + noise})
        begun = time.perf_counter()
        found = estimators.identify("output_error", asked, record, Settings(Segments(), (0.3, 10.0)))
        seconds.append(time.perf_counter() - begun)
        width = next(p for p in found.parameters if p.name == "u_g")
        error.append(100.0 * (width.value / true - 1.0))
        standard.append(100.0 * width.error / true)
        notes.append(found.note)
        print(f"{seed}: {error[-1]:+.2f} +- {standard[-1]:.2f} %, {seconds[-1]:.1f} s {found.note}", flush=True)
    size, covered = np.abs(error), np.abs(error) < 1.96 * np.array(standard)
    print(
        f"median error {np.median(size):.2g} %, rms {np.sqrt(np.mean(size**2)):.2g} %, largest {size.max():.2g} %; "
        f"within 1 % in {np.sum(size < 1.0)} of {len(size)}; interval holds the truth in "
        f"{np.sum(covered)}; not converged {sum(map(bool, notes))}; median {np.median(seconds):.1f} s"
    )


if __name__ == "__main__":
    main()
