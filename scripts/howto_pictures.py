"""Pictures of docs/howto.md, by the calls that it shows: ``make howto_pictures`` draws them.

Records are simulated, with noise on the displacement: of a Duffing system, and of two masses.
"""

import base64
import contextlib
import io
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

import study as st
from study import cli
from study.equations.model_file import read_model
from study.equations.simulate import simulate
from study.figures import page
from study.figures.styles import in_style
from study.interface.showing import LEGEND_ABOVE
from study.records.excitation import Excitation, force
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

SAMPLES, DT, NOISE = 4096, 0.02, 0.005  # noise of the rms displacement
LINEAR = ("inertia", "linear_damping", "linear_stiffness")
DAYS = {"2026-03-02": 1.0, "2026-03-09": 1.0, "2026-03-16": 0.93, "2026-03-23": 0.93}  # stiffness, relative


def main(models: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    duffing = st.Model.load(models / "duffing.yaml")
    low, high = (measured(models / "duffing.yaml", level, name) for level, name in ((0.05, "low"), (0.5, "high")))
    model = st.Model(*LINEAR, name="rig")
    with in_style():
        fit = model.fit(high, measurement=False)
        save(folder / "levels.png", lambda axes: fit.across([low, high]).plot("k", ax=axes))
        save(folder / "factor.png", lambda axes: scaled(high).plot("force", ax=axes), 2.0)
        found = fit.diagnose(candidates={"bushing": "u*abs(u)"})
        save(folder / "own_effect.png", lambda axes: found.plot(ax=axes), 3.2)
        save(folder / "constancy.png", lambda axes: found.plot_constancy(ax=axes), 2.9)
        better = fit.add("cubic_stiffness")
        save(folder / "exported.png", lambda axes: exported(axes, better))
        swept = better.given.fit(sweeps(duffing), fit=(0, SAMPLES // 2), judge=(SAMPLES // 2, SAMPLES))
        save(folder / "sweep.png", lambda axes: swept.plot(ax=axes))
        again = st.multisine(0.3, samples=SAMPLES, dt=DT, periods=4, seed=4)
        repeated = st.simulate(duffing, again, noise=NOISE**2, name="multisine")
        periodic = model.fit(repeated, measurement=False)
        save(folder / "periodic.png", lambda axes: periodic.plot_residual(ax=axes))
        shaken = accelerometer(duffing)
        alone = better.given.fit(shaken, cutoff=0.5, measurement=False)
        save(folder / "accelerometer.png", lambda axes: alone.plot_frf(ax=axes))
        two = model.fit(two_modes(models / "structures" / "two_masses.yaml"), near=2.1, up_to=2.4, measurement=False)
        save(folder / "one_mode.png", lambda axes: two.plot_frf(ax=axes))
    campaign(models / "linear.yaml", folder / "campaign.png")


def sweeps(model: st.Model) -> st.Record:
    """Two sweeps, one after the other."""
    once = st.sweep(0.3, samples=SAMPLES // 2, dt=DT, band=(0.5, 8.0))
    return st.simulate(model, st.Force(np.tile(once.values, 2), DT), noise=NOISE**2, name="sweep")


def scaled(record: st.Record) -> st.Record:
    """A record whose force was measured as a current, with the factor of the motor."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rig.csv"
        columns = np.column_stack([record.time, record["force"] / 31.2, record["displacement"]])
        np.savetxt(path, columns, delimiter=",", header="time [s],motor,displacement [m]", comments="")
        return st.read(path, columns={"force": "motor"}, scale={"force": 31.2}, units={"force": "N"})


def accelerometer(model: st.Model) -> st.Record:
    """Force and acceleration alone."""
    whole = st.simulate(model, st.gaussian(0.5, samples=SAMPLES, dt=DT, cutoff=8.0, seed=5))
    a = whole["acceleration"]
    noise = NOISE * np.std(a) * np.random.default_rng(1990).standard_normal(len(a))
    units = {"force": "N", "acceleration": "m/s^2"}
    return st.record({"force": whole["force"], "acceleration": a + noise}, units=units, dt=DT, name="base")


def exported(axes: Axes, fit: st.Fit) -> None:
    """The exported function under a sine, with its stiffness and with another one."""
    names: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rig2.py"
        fit.export(path)
        exec(compile(path.read_text(encoding="utf-8"), "rig2.py", "exec"), names)

    def drive(t: float) -> float:
        return 2.0 * float(np.sin(12.0 * t))

    for label, values, dash in (
        ("as fitted", names["VALUES"], "-"), ("with k = 500 N/m", names["VALUES"] | {"k": 500.0}, "--"),
    ):  # fmt: skip
        motion = solve_ivp(
            names["slopes"], (0.0, 4.0), [0.0, 0.0], args=(drive, values), rtol=1e-9, atol=1e-12, max_step=0.01
        )
        axes.plot(motion.t, 1e3 * motion.y[0], linestyle=dash, label=label)
    axes.set(xlabel="time (s)", ylabel="displacement (mm)")
    axes.legend(**LEGEND_ABOVE)


def campaign(path: Path, picture: Path) -> None:
    """What ``study campaign --by date`` draws of a rig whose stiffness fell between two days."""
    given = st.Model.load(path)
    with tempfile.TemporaryDirectory() as folder:
        records, out, model = Path(folder) / "measured", Path(folder) / "out", Path(folder) / "rig.yaml"
        records.mkdir()
        st.Model(*LINEAR, name="rig").save(model)
        for seed, (day, share) in enumerate(DAYS.items()):
            stiffness = share * float(given.values["k"] or 0.0)
            drive = st.gaussian(0.5, samples=SAMPLES // 2, dt=DT, cutoff=8.0, seed=seed)
            st.simulate(given.hold(k=stiffness), drive, noise=NOISE**2).save(records / f"rig_{day}.csv")
        asked = ["campaign", str(records), "--model", str(model), "--by", "date", "--no-measurement", "--out", str(out)]
        with contextlib.redirect_stdout(io.StringIO()):
            done = cli.main(asked)
        if done:
            raise StudyError(f"'study {' '.join(asked)}' failed; expected a campaign of {len(DAYS)} records")
        shown = (out / "campaign.html").read_text(encoding="utf-8")
        drawn = re.search(r"data:image/png;base64,([A-Za-z0-9+/=]+)", shown)
        if drawn is None:
            raise StudyError("the page of the campaign shows no picture; expected one of its coefficients")
        replace_file(picture, base64.b64decode(drawn[1]))
    print(picture)


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
