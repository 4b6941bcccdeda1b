"""Two floors on a table whose motion is measured instead of a force, compared and diagnosed by the command line."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.cli import main
from study.equations.free_run import prepare
from study.equations.model import Model, ModelTerm
from study.equations.place import Place
from study.equations.terms import get
from study.records.excitation import Excitation, force
from study.records.record import MOTIONS, Sensor, record_of

N, DT = 4096, 0.02
BELIEVED = """
name: floors
coordinates: [low, top]
terms:
  - {term: inertia, at: low, value: 2.0}
  - {term: inertia, at: top, value: 1.5}
  - {term: linear_stiffness, between: [ground, low]}
  - {term: linear_stiffness, between: [low, top]}
  - {term: linear_damping, between: [ground, low]}
  - {term: linear_damping, between: [low, top]}
"""
TRUE = {"k[ground-low]": 900.0, "k[low-top]": 700.0, "c[ground-low]": 2.0, "c[low-top]": 1.5}
HARD = 4e5


def on_a_support() -> Model:
    """The truth another way: a support whose motion is prescribed, and floors that move absolutely."""
    first, joint = Place("between", ("base", "low")), Place("between", ("low", "top"))
    found = [ModelTerm(get("inertia"), (m,), (), Place("at", (c,))) for c, m in (("low", 2.0), ("top", 1.5))]
    for place, k, c in ((first, 900.0, 2.0), (joint, 700.0, 1.5)):
        found += [
            ModelTerm(get("linear_stiffness"), (k,), (), place),
            ModelTerm(get("linear_damping"), (c,), (), place),
        ]
    found.append(ModelTerm(get("cubic_stiffness"), (HARD,), (), joint))
    return Model("truth", tuple(found), ("base", "low", "top"), ())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("table")
    shaken = 2e-3 * force(Excitation(level=1.0, cutoff=10.0), N, DT, 3)
    lines = 2j * np.pi * np.fft.rfftfreq(N, DT)
    base = [np.fft.irfft(np.fft.rfft(shaken) * lines**order, N) for order in range(3)]
    motions = {Sensor("base", m): x for m, x in zip(MOTIONS, base, strict=True)}
    floors = [Sensor(c, "displacement") for c in ("low", "top")]
    run = prepare(on_a_support(), record_of(DT, {}, motions), sensors=floors, steps_per_sample=8)
    absolute, rng = run.respond({}, np.zeros(4))[0].T, np.random.default_rng(4)
    noise = 0.005 * np.std(absolute - base[0], axis=1, keepdims=True) * rng.standard_normal((2, N))
    for name, seen in (("absolute", absolute), ("relative", absolute - base[0])):
        columns = {"time": DT * np.arange(N), "base_displacement": base[0], "base_acceleration": base[2]}
        columns |= {str(s): x for s, x in zip(floors, seen + noise, strict=True)}
        pd.DataFrame(columns).to_csv(place / f"{name}.csv", index=False, float_format="%.17g")
    (place / "floors.yaml").write_text(BELIEVED)
    (place / "right.yaml").write_text(BELIEVED + "  - {term: cubic_stiffness, between: [low, top]}\n")
    (place / "open.yaml").write_text(BELIEVED.replace(", value: 1.5", ""))
    return place


@pytest.mark.parametrize(("name", "words"), [("relative", ()), ("absolute", ("--absolute",))])
def test_the_right_model_follows_the_floors(folder: Path, name: str, words: tuple[str, ...]) -> None:
    out = folder / f"compared_{name}"
    named = [str(folder / f"{name}.csv"), "--model", str(folder / "right.yaml"), "--out", str(out), *words]
    assert main(["compare", *named, "--no-measurement"]) == 0
    found = json.loads((out / "comparison.json").read_text())
    assert found["error"]["response"] < 0.02
    values = {row["key"]: row for row in found["coefficients"]}
    assert values["k[low-top]"]["unit"] == "N/m"
    for key, value in {**TRUE, "k3[low-top]": HARD}.items():
        low, high = values[key]["interval"]
        assert abs(values[key]["value"] - value) < 2.0 * (high - low) + 0.02 * value


def test_what_is_missing_between_the_floors_is_named(folder: Path) -> None:
    out = folder / "diagnosed"
    words = [str(folder / "absolute.csv"), "--model", str(folder / "floors.yaml"), "--out", str(out), "--absolute"]
    assert main(["diagnose", *words, "--no-measurement"]) == 0
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["verdict"] == "missing_effect"
    first = found["candidates"][0]
    assert (first["term"], first["between"]) == ("cubic_stiffness", ["low", "top"])
    assert first["coefficient"] == pytest.approx(HARD, rel=0.03)


def test_masses_that_are_open_are_refused_in_one_sentence(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [str(folder / "relative.csv"), "--model", str(folder / "open.yaml"), "--out", str(folder / "x")]
    assert main(["compare", *words]) == 2
    told = capsys.readouterr().err
    assert "the base acts through the masses of 'floors', and m[top] is open" in told
    assert told.strip().count("\n") == 0
