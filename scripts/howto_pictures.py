"""Pictures of docs/howto.md, by the calls that it shows: ``make howto_pictures`` draws them.

Records are simulated, with noise on the displacement: of a Duffing system, and of two masses.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import study as st
from study.equations.model_file import read_model
from study.equations.simulate import simulate
from study.figures import page
from study.figures.styles import in_style
from study.records.excitation import Excitation, force
from study.support.arrays import Floats
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

SAMPLES, DT, NOISE = 4096, 0.02, 0.005  # noise of the rms displacement
LINEAR = ("inertia", "linear_damping", "linear_stiffness")


def main(models: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    low, high = (measured(models / "duffing.yaml", level, name) for level, name in ((0.05, "low"), (0.5, "high")))
    model = st.Model(*LINEAR, name="rig")
    with in_style():
        fit = model.fit(high, measurement=False)
        save(folder / "levels.png", lambda axes: fit.across([low, high]).plot("k", ax=axes))
        found = fit.diagnose(candidates={"bushing": "u*abs(u)"})
        save(folder / "own_effect.png", lambda axes: found.plot(ax=axes), 3.2)
        two = model.fit(two_modes(models / "structures" / "two_masses.yaml"), near=2.1, up_to=2.4, measurement=False)
        save(folder / "one_mode.png", lambda axes: two.plot_frf(ax=axes))


def measured(path: Path, level: float, name: str) -> st.Record:
    """Force and displacement of a model."""
    made = simulate(read_model(path), force(Excitation(level=level, cutoff=8.0), SAMPLES, DT, 1), DT)
    return as_measured(made["force"], made["displacement"], name)


def two_modes(path: Path) -> st.Record:
    """Force and displacement of the first of two masses, whose joint is linear, as if there were no second."""
    model = read_model(path)
    linear = model.without_term(next(t.name for t in model.terms if t.term.name == "cubic_stiffness"))
    drive = force(Excitation(level=1.0, cutoff=8.0), SAMPLES, DT, 1)
    made = simulate(linear, {"shaker": drive}, DT)
    return as_measured(drive, made["first displacement"], "two_modes")


def as_measured(drive: Floats, displacement: Floats, name: str) -> st.Record:
    noise = NOISE * np.std(displacement) * np.random.default_rng(1990).standard_normal(len(drive))
    units = {"force": "N", "displacement": "m"}
    return st.record({"force": drive, "displacement": displacement + noise}, units=units, dt=DT, name=name)


def save(path: Path, draw: Callable[[Axes], object], height: float = 2.6) -> None:
    figure = Figure(figsize=(6.0, height), layout="constrained")
    draw(figure.subplots())
    replace_file(path, page.rendered(figure, "png"))
    print(path)


if __name__ == "__main__":
    with one_sentence():
        main(Path(sys.argv[1]), Path(sys.argv[2]))
