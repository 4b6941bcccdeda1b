"""Records in MATLAB, HDF5, Parquet and UFF files, and the public measured ones."""

import gc
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import pyuff
from scipy.io import savemat

import study as st
from study.records.readers import ReadOptions, read_record
from study.records.record import Record
from study.support.errors import StudyError
from tests.public_records import DATA, needs

RNG = np.random.default_rng(11)
TIME = 0.02 * np.arange(40)
FORCE = RNG.standard_normal(40)
DISPLACEMENT = 1e-3 * RNG.standard_normal(40)
BOUC_WEN = {"force": "u", "displacement": "y"}


def check(record: Record, force: np.ndarray = FORCE, displacement: np.ndarray = DISPLACEMENT) -> None:
    assert record.dt == 0.02
    np.testing.assert_array_equal(record["force"], force)
    np.testing.assert_array_equal(record["displacement"], displacement)


# binary formats


def test_matlab_5_with_structures(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {"run": {"F": FORCE, "acc": DISPLACEMENT[:, None], "fs": 50.0, "note": "x"}, "version": 3})
    record = read_record(path)
    assert record.dt == 0.02
    np.testing.assert_array_equal(record["force"], FORCE)
    np.testing.assert_array_equal(record["acceleration"], DISPLACEMENT)
    assert read_record(path, ReadOptions(group="run")).name == "rig_run"
    dotted = ReadOptions(columns={"force": "run.F", "velocity": "run.acc"})
    np.testing.assert_array_equal(read_record(path, dotted)["velocity"], DISPLACEMENT)


def test_matlab_4(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {"force": FORCE, "displacement": DISPLACEMENT, "dt": 0.02}, format="4")
    check(read_record(path))


def test_matlab_7_3_is_hdf5_behind_512_bytes(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["force"] = FORCE[None, :]
        file["displacement"] = DISPLACEMENT[None, :]
        file["Ts"] = [[0.02]]
        file["#refs#/a"] = FORCE
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")
    check(read_record(path))


def test_hdf5_periods_side_by_side(tmp_path: Path) -> None:
    path = tmp_path / "rig.h5"
    force, response = RNG.standard_normal((64, 5)), RNG.standard_normal((64, 5))
    with h5py.File(path, "w") as file:
        file["run/force"] = force
        file["run/x"] = response.T  # MATLAB writes it this way round
        file["run/force"].attrs["units"] = "kN"
        file["run/fs"] = 50.0
    record = read_record(path)
    assert (len(record), record.period, record.units["force"]) == (320, 64, "kN")
    np.testing.assert_array_equal(record["force"][64:128], force[:, 1])
    np.testing.assert_array_equal(record["displacement"][128:192], response[:, 2])
    assert record.part(64, 192).period == 64


def test_one_matrix_is_a_table(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {"data": np.column_stack([TIME, FORCE, DISPLACEMENT])})
    check(read_record(path, ReadOptions(columns={"time": 1, "force": 2, "displacement": 3})))
    check(read_record(path, ReadOptions(columns={"time": "data:1", "force": "data:2", "displacement": 3})))


def test_groups_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "rig.h5"
    with h5py.File(path, "w") as file:
        for name, rate in (("low", 50.0), ("high", 100.0)):
            file[f"{name}/force"], file[f"{name}/x"], file[f"{name}/fs"] = FORCE, DISPLACEMENT, rate
    with pytest.raises(StudyError, match="--group high or low"):
        read_record(path)
    check(read_record(path, ReadOptions(group="low")))
    assert read_record(path, ReadOptions(group="high")).dt == 0.01


@pytest.mark.parametrize("names", [["time", "force", "displacement"], ["t [s]", "Force [kN]", "Displ (mm)"]])
def test_parquet(names: list[str], tmp_path: Path) -> None:
    path = tmp_path / "rig.parquet"
    pd.DataFrame(dict(zip(names, (TIME, FORCE, DISPLACEMENT), strict=True))).to_parquet(path)
    record = read_record(path)
    check(record)
    assert record.units["force"] == ("kN" if "[" in names[0] else "N")


def test_parquet_with_moments_in_time(tmp_path: Path) -> None:
    path = tmp_path / "rig.parquet"
    moments = pd.date_range("2024-02-03 04:05:06", periods=40, freq="20ms")
    pd.DataFrame({"time": moments, "force": FORCE, "displacement": DISPLACEMENT}).to_parquet(path)
    check(read_record(path))


def universal(values: np.ndarray, kind: int, node: int, dt: float = 0.02, **changes: Any) -> dict[str, Any]:
    made = pyuff.prepare_58(
        func_type=1, rsp_node=node, rsp_dir=3, ref_node=1, ref_dir=3, data=values, x=dt * np.arange(len(values)),
        binary=0, ord_data_type=4, abscissa_spacing=1, num_pts=len(values), abscissa_min=0.0, abscissa_inc=dt,
        abscissa_spec_data_type=17, ordinate_spec_data_type=kind, orddenom_spec_data_type=0, z_axis_spec_data_type=0,
    )  # fmt: skip
    return {**made, **changes}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # pyuff leaves open what it writes
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("fs", [50.0, 750.0])
@pytest.mark.parametrize("even", [0, 1])
def test_uff_58(binary: int, fs: float, even: int, tmp_path: Path) -> None:
    path = tmp_path / "rig.uff"
    common = {"dt": 1.0 / fs, "binary": binary, "abscissa_spacing": even}
    force = universal(FORCE, 13, 1, **common)
    response = universal(DISPLACEMENT, 12, 2, **common, ordinate_axis_units_lab="g")
    pyuff.UFF(str(path)).write_sets([force, response], "add")
    gc.collect()
    record = read_record(path)
    assert record.dt == pytest.approx(1.0 / fs, rel=1e-12 if even else 1e-4)
    np.testing.assert_allclose(record["force"], FORCE, rtol=1e-10)
    np.testing.assert_allclose(record["acceleration"], DISPLACEMENT, rtol=1e-10)
    assert record.units["acceleration"] == "g"


# public records


@needs("silverbox", "boucwen")
def test_silverbox() -> None:
    mapping = {"force": "V1", "displacement": "V2"}
    volts = dict.fromkeys(mapping, "V")
    options = ReadOptions(columns=mapping, units=volts, fs=1e7 / 2**14)
    matlab = read_record(DATA / "silverbox" / "SNLS80mV.mat", options)
    text = read_record(DATA / "silverbox" / "SNLS80mV.csv", options)
    assert len(matlab) == len(text) == 131072
    assert matlab.dt == 2**14 / 1e7
    for channel in mapping:
        np.testing.assert_allclose(text[channel], matlab[channel], rtol=1e-4, atol=1e-6)
    for name in ("SNLS80mV.mat", "SNLS80mV.csv"):
        with pytest.raises(StudyError, match=r"'V1'.*--column force=NAME"):
            read_record(DATA / "silverbox" / name)


@needs("silverbox", "boucwen")
def test_bouc_wen() -> None:
    train = read_record(DATA / "boucwen" / "train.h5", ReadOptions(columns=BOUC_WEN, period=8192))
    assert (len(train), train.dt, train.period) == (40960, 1.0 / 750.0, 8192)
    sweep = read_record(DATA / "boucwen" / "test.h5", ReadOptions(columns=BOUC_WEN, group="sinesweep"))
    assert (len(sweep), sweep.name) == (153000, "test_sinesweep")
    assert np.std(train["force"]) > 1.0 > np.std(train["displacement"])
    with pytest.raises(StudyError, match="--group multisine or sinesweep"):
        read_record(DATA / "boucwen" / "test.h5", ReadOptions(columns=BOUC_WEN))
    with pytest.raises(StudyError, match=r"'multisine/u'.*--column"):
        read_record(DATA / "boucwen" / "train.h5")


def test_heavy_imports_wait() -> None:
    import subprocess
    import sys

    code = "import sys, study.records.readers; print([m for m in ('h5py', 'pyuff', 'pyarrow') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_each_cell_of_matlab_is_a_record(tmp_path: Path) -> None:
    runs = np.empty(2, dtype=object)
    runs[0], runs[1] = ({"time": TIME, "force": k * FORCE, "displacement": k * DISPLACEMENT} for k in (1.0, 2.0))
    savemat(tmp_path / "runs.mat", {"runs": runs})
    matrices = np.empty((1, 2), dtype=object)
    matrices[0, 0], matrices[0, 1] = (np.stack([TIME, k * FORCE, k * DISPLACEMENT], axis=1) for k in (1.0, 2.0))
    savemat(tmp_path / "matrices.mat", {"runs": matrices})
    with pytest.raises(StudyError, match="choose --group runs/1 or runs/2"):
        read_record(tmp_path / "runs.mat")
    by_number: dict[str, str | int] = {"time": 1, "force": 2, "displacement": 3}
    for path, columns in ((tmp_path / "runs.mat", {}), (tmp_path / "matrices.mat", by_number)):
        record = read_record(path, ReadOptions(columns, group="runs/2"))
        assert record.name == f"{path.stem}_runs_2"
        np.testing.assert_array_equal(record["force"], 2.0 * FORCE)


def test_cells_of_each_channel_are_chosen_by_their_number_and_share_the_rate_beside_them(tmp_path: Path) -> None:
    force, displacement = np.empty(2, dtype=object), np.empty(2, dtype=object)
    for place, k in enumerate((1.0, 2.0)):
        force[place], displacement[place] = k * FORCE, k * DISPLACEMENT
    savemat(tmp_path / "rig.mat", {"force": force, "displacement": displacement, "fs": 50.0})
    with pytest.raises(StudyError, match="choose --group 1 or 2"):
        read_record(tmp_path / "rig.mat")
    with pytest.raises(StudyError, match="holds 1, 2, displacement/1, displacement/2, force/1, force/2; expected"):
        read_record(tmp_path / "rig.mat", ReadOptions(group="3"))
    record = read_record(tmp_path / "rig.mat", ReadOptions(group="2"))
    np.testing.assert_array_equal(record["force"], 2.0 * FORCE)
    np.testing.assert_array_equal(record["displacement"], 2.0 * DISPLACEMENT)
    assert (record.name, record.dt) == ("rig_2", 0.02)
    (tmp_path / "rig.record.yaml").write_text("group: 2\n")
    for again in (st.read(tmp_path / "rig.mat"), st.read(tmp_path / "rig.mat", group=2)):
        np.testing.assert_array_equal(again["force"], record["force"])


def test_each_cell_of_matlab_7_3_is_a_record(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "runs.mat", "w") as file:
        kept = file.create_group("#refs#")
        for name, k in (("a", 1.0), ("b", 2.0)):
            for channel, values in (("time", TIME), ("force", k * FORCE), ("displacement", k * DISPLACEMENT)):
                kept[f"{name}/{channel}"] = values
        file["runs"] = np.array([kept["a"].ref, kept["b"].ref], dtype=h5py.ref_dtype)
    record = read_record(tmp_path / "runs.mat", ReadOptions(group="runs/2"))
    np.testing.assert_array_equal(record["displacement"], 2.0 * DISPLACEMENT)
