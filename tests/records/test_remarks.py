"""What a reader notices of a record that can be used all the same, and what the user says of a channel."""

from pathlib import Path

import numpy as np
import pytest

from study.equations.model_file import parse_model
from study.records.readers import ReadOptions, read_record
from study.records.record_layout import Layout, laid_out
from study.support.errors import StudyError
from study.way_in.compare_records import made_ready

RATE, SAMPLES = 200.0, 4096


def shaken(sign: float = 1.0) -> np.ndarray:
    """A force and the displacement of 2 kg at 7 Hz, 2 % damped: by the exact response of its frequency lines."""
    force = np.random.default_rng(4).standard_normal(SAMPLES)
    s = 2j * np.pi * np.fft.rfftfreq(SAMPLES, 1.0 / RATE)
    omega = 2.0 * np.pi * 7.0
    motion = np.fft.irfft(np.fft.rfft(force) / (2.0 * (s**2 + 0.04 * omega * s + omega**2)))
    return np.stack([sign * force, motion], axis=1)


def written(path: Path, values: np.ndarray, heads: str = "force [N],displacement [m]", rate: float = RATE) -> Path:
    time = np.arange(len(values)) / rate
    np.savetxt(path, np.column_stack([time, values]), delimiter=",", header=f"time [s],{heads}", comments="")
    return path


def test_a_good_record_is_left_without_a_word(tmp_path: Path) -> None:
    assert read_record(written(tmp_path / "rig.csv", shaken())).remarks == ()


def test_units_that_nobody_gave_are_said(tmp_path: Path) -> None:
    (said,) = read_record(written(tmp_path / "rig.csv", shaken(), "force [N],displacement")).remarks
    assert said == "displacement has no unit and is taken in m (--unit displacement=UNIT says otherwise)"


def test_what_holds_of_all_records_is_said_once_and_else_with_their_names(tmp_path: Path) -> None:
    heads = {"low": "force [N],displacement", "mid": "force [N],displacement", "high": "force,displacement"}
    records = [read_record(written(tmp_path / f"{name}.csv", shaken(), head)) for name, head in heads.items()]
    model = parse_model("name: rig\nterms: [inertia, linear_damping, linear_stiffness]\n", Path("rig.yaml"))
    bare = "displacement has no unit and is taken in m (--unit displacement=UNIT says otherwise)"
    assert bare in made_ready(records[:2], model, Layout())[1].notes
    notes = made_ready(records, model, Layout())[1].notes
    assert f"in low and mid: {bare}" in notes
    assert any(note.startswith("in high: force and displacement have no unit") for note in notes)


def test_a_force_of_the_wrong_sign_is_doubted_and_a_scale_turns_it_round(tmp_path: Path) -> None:
    path = written(tmp_path / "rig.csv", shaken(-1.0))
    assert "--scale force=-1" in read_record(path).remarks[0]
    turned = read_record(path, ReadOptions(scale={"force": -1.0}))
    assert turned.remarks == ("force is the column 'force' times -1",)
    np.testing.assert_array_equal(turned["force"], -read_record(path)["force"])


def test_a_current_is_a_force_in_amperes_or_by_its_factor(tmp_path: Path) -> None:
    path = written(tmp_path / "axis.csv", shaken(), "motor [A],displacement [m]")
    named = {"force": "motor"}
    assert read_record(path, ReadOptions(named)).unit("force") == "A"
    newtons = read_record(path, ReadOptions(named, {"motor": "N"}, scale={"motor": 31.0}))
    assert newtons.unit("force") == "N"
    np.testing.assert_allclose(newtons["force"], 31.0 * read_record(path, ReadOptions(named))["force"])
    with pytest.raises(StudyError, match="'A' is no unit of displacement"):
        read_record(written(path, shaken(), "motor [A],displacement"), ReadOptions(named, {"displacement": "A"}))


@pytest.mark.parametrize("factor", ["0", "nan", "x"])
def test_a_scale_is_a_factor(tmp_path: Path, factor: str) -> None:
    path = written(tmp_path / "rig.csv", shaken())
    (tmp_path / "rig.record.yaml").write_text(f"scale: {{force: {factor}}}")
    with pytest.raises(StudyError, match="the scale of force is"):
        read_record(path)


def test_a_scale_beside_the_file_holds(tmp_path: Path) -> None:
    path = written(tmp_path / "rig.csv", shaken())
    (tmp_path / "rig.record.yaml").write_text("scale: {force: -2}")
    np.testing.assert_allclose(read_record(path)["force"], -2.0 * shaken()[:, 0])


@pytest.mark.parametrize("last", [10.0, 1.5], ids=["far outside", "less far outside"])
def test_junk_and_rest_before_the_motion_are_said_with_what_leaves_them_out(tmp_path: Path, last: float) -> None:
    still = np.zeros((1000, 2)) + 1e-9 * np.random.default_rng(1).standard_normal((1000, 2))
    values = np.concatenate([still, shaken()])
    values[:4, 1] = np.max(np.abs(values[:, 1])) * np.array([10.0, 10.0, -last, last])
    (said,) = read_record(written(tmp_path / "rig.csv", values)).remarks
    assert f"samples 0 to {3 if last == 10.0 else 1} of displacement lie far outside all others" in said
    assert "and the first 5 s are at rest" in said
    assert "(--use 5:" in said


def test_a_decay_begins_loud_and_that_is_no_junk(tmp_path: Path) -> None:
    time = np.arange(SAMPLES) / RATE
    motion = np.exp(-8.0 * time) * np.cos(2.0 * np.pi * 7.0 * time)
    assert read_record(written(tmp_path / "roll.csv", motion[:, None], "displacement [m]")).remarks == ()


@pytest.mark.parametrize(("ppm", "refused"), [(25.0, False), (2000.0, True)])
def test_two_clocks_are_never_quite_the_same(tmp_path: Path, ppm: float, refused: bool) -> None:
    records = [
        read_record(written(tmp_path / "low.csv", shaken())),
        read_record(written(tmp_path / "high.csv", 2.0 * shaken(), rate=RATE * (1.0 + 1e-6 * ppm))),
    ]
    if refused:
        with pytest.raises(StudyError, match=r"0\.2 % apart; expected the same rate"):
            laid_out(records, Layout())
    else:
        notes = laid_out(records, Layout()).notes
        assert any("25 ppm apart as two clocks are: both are taken as 200 Hz (--fs" in note for note in notes)
