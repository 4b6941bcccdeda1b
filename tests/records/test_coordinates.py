"""Records of several coordinates: read by the reader of a single mass, with every option it has."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.records.completion import complete, consistent
from study.records.readers import ReadOptions, Roles, read_record
from study.records.readers.options import OPTION_KEYS
from study.records.record import MOTIONS, Record, Sensor, write_csv
from study.support.errors import StudyError

ROLES = Roles(("floor1", "floor2"), ("shaker",))
SAMPLES, DT = 400, 0.01
RNG = np.random.default_rng(3)
TIME = DT * np.arange(SAMPLES)
SHAKER = np.tile(RNG.standard_normal(SAMPLES // 4), 4)
FIRST, SECOND = (np.cumsum(RNG.standard_normal(SAMPLES)) for _ in range(2))
PLAIN = {"time": TIME, "shaker": SHAKER, "floor1 displacement": FIRST, "floor2 displacement": SECOND}


def written(folder: Path, columns: dict[str, np.ndarray], name: str = "rig.csv") -> Path:
    path = folder / name
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.17g")
    return path


def headed(folder: Path, *heads: str) -> Path:
    return written(folder, dict(zip(heads, PLAIN.values(), strict=True)))


@pytest.mark.parametrize(
    ("heads", "sensors"),
    [
        (("t", "Shaker", "floor1 acceleration", "floor2_acc"), ("acceleration", "acceleration")),
        (("time [ms]", "F [kN]", "floor1.v [m/s]", "Floor2 [mm]"), ("velocity", "displacement")),
        (("seconds", "load cell [N]", "floor1 (m/s^2)", "floor2"), ("acceleration", "displacement")),
    ],
)
def test_columns_are_called_after_coordinate_and_motion(tmp_path: Path, heads: tuple[str, ...], sensors) -> None:
    units = {"floor2.displacement": "m"} if heads[-1] == "floor2" else {}
    record = read_record(headed(tmp_path, *heads), ReadOptions(units=units, dt=None), ROLES)
    assert record.sensors == tuple(Sensor(f"floor{i}", m) for i, m in enumerate(sensors, start=1))
    np.testing.assert_array_equal(record["shaker"], SHAKER)
    np.testing.assert_array_equal(record[Sensor("floor2", sensors[1])], SECOND)
    assert record.dt == pytest.approx(DT * (1e-3 if "ms" in heads[0] else 1.0))


@pytest.mark.parametrize(("option", "given", "heads"), [
    ("columns", {"shaker": "B", "floor1.a": "C", "floor2.displacement": 4}, ("time", "B", "C", "D")),
    ("units", {"displacement": "mm", "shaker": "kN"}, None),
    ("dt", 0.01, None),
    ("fs", 100.0, None),
    ("samples", (100, 300), None),
    ("period", 100, None),
    ("accept_saturated", True, None),
    ("accept_swapped", True, None),
    ("free", True, None),
])  # fmt: skip
def test_every_option_of_reading_is_honoured(tmp_path: Path, option: str, given: object, heads) -> None:
    columns = dict(PLAIN)
    if option in ("dt", "fs"):
        del columns["time"]
    if option == "accept_saturated":
        columns["floor2 displacement"] = np.minimum(SECOND, np.quantile(SECOND, 0.8))
    path = headed(tmp_path, *heads) if heads else written(tmp_path, columns)
    record = read_record(path, ReadOptions(**{option: given}), ROLES)
    kept = slice(*given) if option == "samples" else slice(None)
    assert record.dt == DT
    np.testing.assert_array_equal(record["shaker"], 0.0 if option == "free" else SHAKER[kept])
    first = Sensor("floor1", "acceleration" if option == "columns" else "displacement")
    np.testing.assert_array_equal(record[first], FIRST[kept])
    assert record.unit(first) == {"units": "mm", "columns": "m/s^2"}.get(option, "m")
    assert record.unit("shaker") == ("kN" if option == "units" else "N")
    assert record.period == (100 if option == "period" else None)
    if option in ("dt", "fs", "accept_saturated"):
        with pytest.raises(StudyError, match=r"no sampling rate|saturated"):
            read_record(path, None, ROLES)


def test_a_group_of_a_file_is_read_and_is_named_after(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "rig.h5"
    with h5py.File(path, "w") as file:
        for group, factor in (("low", 1.0), ("high", 3.0)):
            for name, values in PLAIN.items():
                file[f"{group}/{name}"] = values if name == "time" else factor * values
    record = read_record(path, ReadOptions(group="high"), ROLES)
    assert record.name == "rig_high"
    np.testing.assert_array_equal(record[Sensor("floor2", "displacement")], 3.0 * SECOND)
    with pytest.raises(StudyError, match=r"could each be the shaker.*--group high or low"):
        read_record(path, None, ROLES)


def test_what_stands_beside_the_file_counts_for_structures(tmp_path: Path) -> None:
    path = headed(tmp_path, "time", "B", "C", "D")
    (tmp_path / "rig.record.yaml").write_text(
        "columns: {shaker: B, floor1.v: C, floor2.v: D}\nunits: {velocity: mm/s}\n"
    )
    record = read_record(path, None, ROLES)
    assert [str(s) for s in record.sensors] == ["floor1 velocity", "floor2 velocity"]
    assert record.unit("floor2 velocity") == "mm/s"


def test_no_option_is_forgotten_here() -> None:
    """Faults and thinning, which are said beside a file too, are no matter of reading it."""
    assert set(OPTION_KEYS) - {"measurement", "as_sampled"} == {
        "columns", "units", "dt", "fs", "group", "samples", "period", "accept_saturated", "accept_swapped",
        "free", "scale",
    }  # fmt: skip


@pytest.mark.parametrize(("columns", "options", "said"), [
    (("time", "x1", "floor1.x", "x2"), ReadOptions(), "no column is known to be the force 'shaker' .or say --free"),
    (("time", "shaker", "x1", "x2"), ReadOptions(), "no column is known to be a motion of floor1, floor2; the columns"),
    (("time", "shaker", "floor1.a", "floor1 acceleration"), ReadOptions(columns={"floor9.a": 2}),
     "names 'floor9.a', which the model does not have"),
    (("time", "shaker", "floor1.x", "floor1_disp"), ReadOptions(), "'floor1.x' and 'floor1_disp' could each be the"),
    (("time", "shaker", "floor1.x", "floor2"), ReadOptions(columns={"floor1.x": 3, "floor1 displacement": 4}),
     "names the floor1 displacement twice"),
    (("time", "shaker", "floor1.x", "floor2"), ReadOptions(units={"floor1.a": "g"}), "unit is given for 'floor1.a'"),
    (("time", "shaker [m]", "floor1.x", "floor2"), ReadOptions(), "'m' is no unit of force"),
    (("time", "shaker", "floor1.x", "floor2"), ReadOptions(period=77), "the force 'shaker' 77 samples later differs"),
    (("time", "shaker", "floor1.x", "floor2"), ReadOptions(dt=0.02), "its times step by 0.01 s"),
    (("time", "shaker", "shaker", "floor2"), ReadOptions(), "there 2 times.*--column shaker=2"),
])  # fmt: skip
def test_what_cannot_be_read_is_refused_in_one_sentence(tmp_path: Path, columns, options, said: str) -> None:
    path = tmp_path / "rig.csv"
    rows = np.column_stack(list(PLAIN.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    with pytest.raises(StudyError, match=said) as refused:
        read_record(path, options, ROLES)
    assert "\n" not in str(refused.value)


def test_a_channel_with_a_gap_or_on_its_stop_is_refused_wherever_it_is(tmp_path: Path) -> None:
    gap = np.where(np.arange(SAMPLES) == 17, np.nan, SECOND)
    with pytest.raises(StudyError, match=r"floor2 displacement.*no number in line 19"):
        read_record(written(tmp_path, PLAIN | {"floor2 displacement": gap}), None, ROLES)
    stop = np.minimum(SECOND, np.quantile(SECOND, 0.8))
    with pytest.raises(StudyError, match=r"floor2 displacement.*saturated channel"):
        read_record(written(tmp_path, PLAIN | {"floor2 displacement": stop}), None, ROLES)
    with pytest.raises(StudyError, match="shaker and floor1 displacement hold the same numbers"):
        read_record(written(tmp_path, PLAIN | {"floor1 displacement": SHAKER}), None, ROLES)


def test_a_single_mass_reads_the_same_as_one_named_coordinate(tmp_path: Path) -> None:
    path = written(tmp_path, {"t": TIME, "Input [kN]": SHAKER, "disp_mm": FIRST, "temperature": SECOND})
    alone, named = read_record(path), read_record(path, None, Roles(("mass",), ("shaker",)))
    for one, other in ((alone, named), (complete(alone).record, complete(named).record)):
        np.testing.assert_array_equal(one["force"], other["shaker"])
        for motion in MOTIONS:
            assert (motion in one) == (Sensor("mass", motion) in other)
            if motion in one:
                np.testing.assert_array_equal(one[motion], other[Sensor("mass", motion)])
                assert one.units[motion] == other.unit(Sensor("mass", motion))
        np.testing.assert_array_equal(one["temperature"], other["temperature"])
        assert (one.dt, one.start, one.name, one.extra) == (other.dt, other.start, other.name, other.extra)
    np.testing.assert_array_equal(complete(named).record.motion("mass")[0], FIRST)


def test_lengths_are_one_and_stay_the_users(tmp_path: Path) -> None:
    path = headed(tmp_path, "time", "shaker [kN]", "floor1 [mm]", "floor2 [m/s^2]")
    record, notes = consistent(read_record(path, None, ROLES))
    assert record.force_and_length == ("kN", "mm")
    np.testing.assert_array_equal(record[Sensor("floor1", "displacement")], FIRST)
    np.testing.assert_allclose(record[Sensor("floor2", "acceleration")], 1e3 * SECOND)
    assert notes == ("floor2 acceleration is converted from m/s^2 to mm/s^2",)
    completed = complete(record).record
    assert completed.unit(Sensor("floor2", "displacement")) == "mm"
    assert completed.motion("floor2").shape == (3, SAMPLES)


def test_angles_are_radians_and_moments_forces_times_the_length(tmp_path: Path) -> None:
    columns = {"time": TIME, "push [N]": SHAKER, "twist [N m]": SHAKER[::-1], "heave [mm]": FIRST, "pitch (°)": SECOND}
    record = read_record(written(tmp_path, columns), None, Roles(("heave", "pitch"), ("push", "twist")))
    assert record.rotations == {"pitch"}
    same, _ = consistent(record)
    np.testing.assert_allclose(same[Sensor("pitch", "displacement")], np.radians(SECOND))
    np.testing.assert_allclose(same["twist"], 1e3 * SHAKER[::-1])
    assert (same.unit("twist"), same.unit(Sensor("pitch", "velocity"))) == ("N mm", "rad/s")


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    units = {"shaker": "kN", "floor1 displacement": "mm", "floor2 displacement": "mm"}
    channels = {name: values for name, values in PLAIN.items() if name != "time"}
    record = Record(DT, channels, units, "rig", coordinates=ROLES.coordinates, forces=ROLES.forces)
    write_csv(record, tmp_path / "rig.csv")
    again = read_record(tmp_path / "rig.csv", None, ROLES)
    for name, values in channels.items():
        np.testing.assert_array_equal(again[name], values)
    assert {name: again.unit(name) for name in channels} == units
    assert replace(again, units={}).unit("floor1 displacement") == "m"


def test_read_without_their_model_it_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, PLAIN)
    with pytest.raises(StudyError, match="'floor1 displacement' is known to a model with coordinates"):
        read_record(path)
    with pytest.raises(StudyError) as said:
        read_record(written(tmp_path, {"time": TIME, "load": SHAKER, "x1": FIRST}, "single.csv"))
    assert "coordinates" not in str(said.value)
