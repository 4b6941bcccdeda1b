"""Measured and public records; they are found beside the project or where STUDY_DATA says (see the README)."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import loadmat

from study.commands import measurements
from study.compare.comparison import compare
from study.compare.prediction import predict
from study.diagnose.verdict import MISSING, diagnose
from study.equations.model import Model, free
from study.equations.terms import LIBRARY, get
from study.identify.time_domain.fit_model import fit_model
from study.records.plan import make_plan
from study.records.prepared import prepare_record
from study.records.record import Record
from study.support.errors import StudyError
from tests.public_records import DATA, needs

LINEAR = Model("linear", tuple(free(get(n)) for n in ("inertia", "linear_damping", "linear_stiffness")))
RIVALS = {"cubic_stiffness", "hysteresis", "quadratic_stiffness", "quadratic_damping", "dead_band", "constant_force"}
OTHERS = [name for name in LIBRARY if name not in RIVALS and name not in LINEAR]
ROOT = Path(__file__).parents[2]
present = needs("silverbox", "boucwen")


@pytest.fixture(scope="module")
def silverbox() -> Record:
    data = loadmat(DATA / "silverbox" / "SNLS80mV.mat")
    channels = {"force": data["V1"].ravel().astype(float), "displacement": data["V2"].ravel().astype(float)}
    return Record(2**14 / 1e7, channels, name="silverbox")


@present
@pytest.mark.long
def test_the_silverbox_is_first_of_all_a_duffing_oscillator(silverbox):
    """With the offset of V1 in the model; without it, hysteresis with its free state competes on a short stretch."""
    prepared = prepare_record(silverbox, make_plan(silverbox, (40650, 48842), (20000, 28192)))
    diagnosis = diagnose(compare(LINEAR.with_term(get("constant_force")), prepared), without=OTHERS)
    assert diagnosis.verdict == MISSING
    assert diagnosis.candidates[0].name == "cubic_stiffness"


@present
def test_the_silverbox_hides_a_damping_effect(silverbox):
    """The climb's last step on the arrow, in millivolts: published physical models stop at 0.39."""
    names = ("cubic_stiffness", "constant_force", "quadratic_stiffness", "quadratic_damping")
    prepared = prepare_record(silverbox, make_plan(silverbox, (40650, 57034), (100, 40575)))
    rms = []
    for count in (3, 4):
        model = LINEAR
        for name in names[:count]:
            model = model.with_term(get(name))
        fit = fit_model(model, prepared)
        assert fit.converged
        rms.append(1e3 * float(np.sqrt(np.mean(predict(fit, prepared).residual ** 2))))
    assert rms[0] == pytest.approx(0.39, abs=0.02)
    assert rms[1] < 0.33


@present
def test_the_bouc_wen_benchmark_is_hysteresis_and_no_cubic_stiffness():
    with h5py.File(DATA / "boucwen" / "train.h5") as file:
        force, motion = (np.ravel(file[f"multisine/{name}"][()])[:12288] for name in ("u", "y"))
    record = Record(1 / 750, {"force": force, "displacement": motion}, name="boucwen")
    diagnosis = diagnose(compare(LINEAR, prepare_record(record)), without=OTHERS)
    first = diagnosis.candidates[0]
    assert first.name == "hysteresis"
    assert first.effect.coefficient == pytest.approx(5e4, rel=0.02)
    assert first.effect.parameters["beta"] == pytest.approx(800.0, rel=0.05)
    assert first.effect.parameters["gamma"] == pytest.approx(-1100.0, rel=0.05)


def test_data_come_from_the_folder_that_the_variable_names(monkeypatch):
    monkeypatch.setenv("STUDY_DATA", "/data")
    row = measurements.load_measurements(ROOT / "config")["silverbox"]
    assert row.paths == ("/data/silverbox/SNLS80mV.mat",)
    assert row.model == str(ROOT / "models" / "believed" / "oscillator.yaml")
    assert row.options[:2] == ("--column", "force=V1")
    assert measurements.Measurement.model_validate(row.plain()) == row
    with pytest.raises(StudyError, match=r"/data/silverbox/SNLS80mV\.mat is not there; the project holds no data: set"):
        measurements.check_present(Path(row.paths[0]))


def test_without_the_variable_a_job_says_what_to_set(monkeypatch):
    """The workflow itself needs no data: the table is read all the same."""
    monkeypatch.delenv("STUDY_DATA", raising=False)
    row = measurements.load_measurements(ROOT / "config")["silverbox"]
    says = r"STUDY_DATA is not set; expected the folder that holds silverbox/SNLS80mV\.mat"
    with pytest.raises(StudyError, match=says):
        measurements.check_present(Path(row.paths[0]))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "\nsilverbox\t",
            "\nSilverbox\t",
            "record is 'Silverbox'; expected up to 64 of a to z, 0 to 9 and _,",
        ),
        ("oscillator\t6", "oscillator\t21", "(record 'silverbox'): steps is '21'; expected 20 or less"),
        ("oscillator\t6", "oscillator\tsix", "(record 'silverbox'): steps is 'six'; expected a whole number"),
        ("believed/oscillator\t6", "oscilator\t6", "there is no model 'oscilator'; models/ holds "),
        ("--column force=V1", "--out a", "options name --out, which the workflow gives; leave it out"),
        ("--column force=V1", "--column 'force", "cannot be split into words: No closing quotation"),
        ("--fs 610.3515625", "--fs fast", "(record 'silverbox'): options: "),
        ("bouc_wen\t", "silverbox\t", "row 3 (record 'silverbox'): the record stands twice; expected each name once"),
    ],
)
def test_faults_of_a_row(tmp_path, old, new, says):
    shutil.copytree(ROOT / "models", tmp_path / "models")
    (tmp_path / "config").mkdir()
    text = (ROOT / "config" / "measurements.tsv").read_text()
    assert old in text
    (tmp_path / "config" / "measurements.tsv").write_text(text.replace(old, new, 1))
    with pytest.raises(StudyError) as caught:
        measurements.load_measurements(tmp_path / "config")
    assert str(caught.value).startswith(f"{tmp_path / 'config' / 'measurements.tsv'}, row ")
    assert says in str(caught.value)
