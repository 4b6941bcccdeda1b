"""A Bouc-Wen element whose gamma is beyond beta: no law forbids it, and the benchmark of that name has one."""

import pytest

from study.compare.comparison import compare
from study.diagnose.diagnosis_sentences import diagnosis_sentences
from study.diagnose.verdict import MISSING, Diagnosis, diagnose
from study.equations.model import Model, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY, get
from study.records.excitation import Excitation, displacement_noise, force
from study.records.prepared import prepare_record
from study.records.readers import ReadOptions, read_record
from tests.public_records import DATA, needs

BELIEVED = Model("rig", tuple(free(get(name)) for name in ("inertia", "linear_damping", "linear_stiffness")))
VALUES = {"m": 2.0, "c": 10.0, "k": 5e4, "kz": 5e4, "hysteresis.beta": 800.0, "hysteresis.gamma": -1100.0}
RIVALS = ("hysteresis", "cubic_stiffness", "dead_band", "coulomb_friction", "quadratic_damping")


def says_so(diagnosis: Diagnosis) -> bool:
    first = diagnosis.candidates[0]
    assert (diagnosis.verdict, first.name) == (MISSING, "hysteresis")
    for key, value in VALUES.items():
        assert abs(first.fit.values[first.fit.keys.index(key)] / value - 1.0) < 0.03
    return "As fitted it is unusual: beta is" in " ".join(diagnosis_sentences(diagnosis))


def test_what_alone_leaves_nothing_is_missing_and_called_unusual() -> None:
    dt, truth = 1.0 / 750.0, Model("rig", (*BELIEVED.terms, free(get("hysteresis")))).with_values(VALUES)
    drive = 60.0 * force(Excitation(level=1.0, reading="filtered", cutoff=150.0), 4096, dt, 7)
    clean = simulate(truth, {"force": drive}, dt, Integrator("rk4", 8))
    u = clean["displacement"]
    record = clean.with_channels({"displacement": u + displacement_noise(u, 1e-5, 3)})
    without = [name for name in LIBRARY if name not in RIVALS]
    assert says_so(diagnose(compare(BELIEVED, prepare_record(record)), without=without))


@pytest.mark.long
@needs("boucwen")
def test_of_the_benchmark_noise_alone_is_left() -> None:
    read = ReadOptions(columns={"force": "u", "displacement": "y"}, group="multisine", period=8192)
    record = read_record(DATA / "boucwen" / "train.h5", read)
    diagnosis = diagnose(compare(BELIEVED, prepare_record(record)))
    assert says_so(diagnosis)
    first = diagnosis.candidates[0].prediction
    assert first.error < 1.05 * first.floor
