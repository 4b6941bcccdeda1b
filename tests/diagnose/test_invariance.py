"""The same record told in other ways gives the same verdict, the same ties and the same coefficient."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from study.compare.comparison import compare
from study.diagnose.verdict import diagnose
from study.equations.model import Model
from study.equations.terms import LIBRARY
from study.records.plan import make_plan
from study.records.prepared import prepare_record
from study.records.readers import read_record
from study.records.record import MOTIONS, Record, write_csv
from study.support.units import parse_unit
from study.trials import Trial, make_trial

TRIALS = {
    "cubic_stiffness": (101, 0.01, "displacement"),
    "coulomb_friction": (102, 0.01, "acceleration"),
    "hysteresis": (103, 0.0, "acceleration"),
    "dead_band": (104, 0.01, "displacement"),
    "quadratic_damping": (105, 0.05, "velocity"),
}
TRIED = (*TRIALS, "quintic_stiffness", "relaxation", "constant_force")  # of the library: enough to be confused with
SAMPLES = 2048
ALIKE = 1e-3  # relative change of the coefficient
UNITS = {
    "g": {"acceleration": ("g", 1.0 / 9.80665)},
    "kN and mm": {
        "force": ("kN", 1e-3), "displacement": ("mm", 1e3), "velocity": ("mm/s", 1e3), "acceleration": ("mm/s^2", 1e3),
    },
}  # fmt: skip
PROCESSORS = ("Haswell", "SkylakeX", "Sandybridge", "Prescott")


def trial(name: str) -> Trial:
    seed, noise, response = TRIALS[name]
    made = make_trial(seed, (name,), noise, response)
    return replace(made, record=made.record.part(0, SAMPLES))


def result(model: Model, record: Record, halves: bool = False) -> dict[str, Any]:
    """What a diagnosis says, its coefficient in SI units; candidates of ``TRIED`` alone, which takes less time."""
    n = len(record)
    plan = make_plan(record, (0, n // 2), (n // 2, n)) if halves else None
    others = [name for name in LIBRARY if name not in TRIED]
    diagnosis = diagnose(compare(model, prepare_record(record, plan)), without=others)
    first = diagnosis.candidates[0]
    return {
        "verdict": diagnosis.verdict, "first": first.name, "tied": sorted(first.tied_with),
        "coefficient": first.effect.coefficient, "symbol": first.term.symbols[0],
        "error": diagnosis.comparison.prediction.error, "error_with": first.response_error,
    }  # fmt: skip


def told(record: Record, channels: Mapping[str, np.ndarray], units: Mapping[str, str], folder: Path) -> Record:
    """A record as a file with these columns and units gives it."""
    path = folder / "rig.csv"
    write_csv(Record(record.dt, channels, units, "rig"), path)
    return read_record(path)


def in_units(record: Record, units: Mapping[str, tuple[str, float]], folder: Path) -> Record:
    channels = {name: values * units.get(name, ("", 1.0))[1] for name, values in record.channels.items()}
    return told(record, channels, {**record.units, **{name: unit for name, (unit, _) in units.items()}}, folder)


def assert_alike(own: Mapping[str, Any], other: Mapping[str, Any], factor: float = 1.0) -> None:
    for key in ("verdict", "first", "tied"):
        assert other[key] == own[key]
    assert other["coefficient"] == pytest.approx(own["coefficient"] * factor, rel=ALIKE)
    for key in ("error", "error_with"):
        assert other[key] == pytest.approx(own[key], rel=ALIKE)


@pytest.fixture(scope="module", params=TRIALS)
def case(request):
    made = trial(request.param)
    own = result(made.believed, made.record)
    assert own["first"] == request.param
    return made, own


@pytest.mark.parametrize("units", UNITS)
def test_units_do_not_matter(units, case, tmp_path):
    made, own = case
    record = in_units(made.record, UNITS[units], tmp_path)
    names = {name: UNITS[units].get(name, (unit, 1.0))[0] for name, unit in made.record.units.items()}
    length = "m" if units == "g" else "mm"
    unit, other = (LIBRARY[own["first"]].unit(own["symbol"], *pair) for pair in (("N", "m"), (names["force"], length)))
    assert_alike(own, result(made.believed, record), parse_unit(unit).factor / parse_unit(other).factor)


def test_columns_that_nobody_asked_for_do_not_matter(case, tmp_path):
    made, own = case
    rng = np.random.default_rng(5)
    unused = {name: rng.standard_normal(SAMPLES) for name in ("u", "v", "m", "k", "z", "t2", "c")}
    assert_alike(own, result(made.believed, told(made.record, {**made.record.channels, **unused}, {}, tmp_path)))


def test_the_order_of_columns_and_terms_does_not_matter(case, tmp_path):
    made, own = case
    channels = dict(reversed(made.record.channels.items()))
    model = replace(made.believed, terms=tuple(reversed(made.believed.terms)))
    assert_alike(own, result(model, told(made.record, channels, made.record.units, tmp_path)))


def test_turned_signs_do_not_matter(case):
    made, own = case
    turned = {name: -values for name, values in made.record.channels.items()}
    assert_alike(own, result(made.believed, made.record.with_channels(turned)))


def test_the_default_halves_may_be_given(case):
    made, own = case
    assert_alike(own, result(made.believed, made.record, halves=True))


@cache
def elsewhere(processor: str) -> dict[str, Any]:
    """What a diagnosis says on another processor, by trial; one process for all: it loads longer than it works."""
    threads = str(1 + PROCESSORS.index(processor) % 2)
    environment = {**os.environ, "OPENBLAS_CORETYPE": processor, "OPENBLAS_NUM_THREADS": threads}
    algebra = "import numpy; numpy.ones((64, 64)) @ numpy.ones((64, 64))"
    if subprocess.run([sys.executable, "-c", algebra], env=environment).returncode == -signal.SIGILL:
        pytest.skip(f"this processor lacks instructions of {processor}")
    words = [sys.executable, __file__, *TRIALS]
    root = Path(__file__).parents[2]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, cwd=root)
    return json.loads(done.stdout)


@pytest.mark.long
@pytest.mark.parametrize("processor", PROCESSORS)
def test_the_processor_does_not_matter(processor, case):
    """The kernels of linear algebra of four processors, with one thread and two: sums are ordered otherwise in each."""
    made, own = case
    assert_alike(own, elsewhere(processor)[made.hidden[0]])


def test_one_motion_is_measured_in_each():
    assert {response for _, _, response in TRIALS.values()} == set(MOTIONS)


if __name__ == "__main__":
    made_here = {name: trial(name) for name in sys.argv[1:]}
    print(json.dumps({name: result(made.believed, made.record) for name, made in made_here.items()}))
