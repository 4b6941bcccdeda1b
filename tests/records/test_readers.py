"""Every kind of file gives the record that was written into it."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.records.readers import ReadOptions, assignments, read_options, read_record
from study.records.record import MOTIONS, Record, write_csv
from study.support.errors import StudyError

RNG = np.random.default_rng(11)
TIME = 0.02 * np.arange(40)
FORCE = RNG.standard_normal(40)
DISPLACEMENT = 1e-3 * RNG.standard_normal(40)


def rows(delimiter: str = ",", decimal: str = ".", *columns: np.ndarray) -> str:
    columns = columns or (TIME, FORCE, DISPLACEMENT)
    lines = (delimiter.join(repr(float(x)) for x in row) for row in zip(*columns, strict=True))
    return "\n".join(line.replace(".", decimal) for line in lines) + "\n"


def check(record: Record, force: np.ndarray = FORCE, displacement: np.ndarray = DISPLACEMENT) -> None:
    assert record.dt == 0.02
    np.testing.assert_array_equal(record["force"], force)
    np.testing.assert_array_equal(record["displacement"], displacement)


TEXTS = {
    "comma": ("time,force,displacement\n" + rows(), "N", "m"),
    "usual short names": ("t, F, x\n" + rows(", "), "N", "m"),
    "semicolon, decimal comma": ("Zeit;Force;Disp\n" + rows(";", ","), "N", "m"),
    "semicolon, decimal point": ("time;force;disp\n" + rows(";"), "N", "m"),
    "tab": ("time\tforce\tdisplacement\n" + rows("\t"), "N", "m"),
    "tab, decimal comma": ("time\tforce\tdisplacement\n" + rows("\t", ","), "N", "m"),
    "blanks": ("  time   force  displacement\n" + rows("   "), "N", "m"),
    "blanks, units in brackets": ("time [s]  force [kN]  disp [mm]\n" + rows("  "), "kN", "mm"),
    "units in square brackets": ("Time [s],Force [kN],Displacement [mm]\n" + rows(), "kN", "mm"),
    "units in round brackets": ("time (s),force (lbf),disp (in)\n" + rows(), "lbf", "in"),
    "units behind a stroke": ("t/s,F/N,x / mm\n" + rows(), "N", "mm"),
    "units behind the name": ("time_s,force_kN,disp_mm\n" + rows(), "kN", "mm"),
    "units row": ("time,force,displacement\ns,kN,µm\n" + rows(), "kN", "um"),
    "units row in brackets": ("time,force,displacement\n[s],[N],[mm]\n" + rows(), "N", "mm"),
    "preamble": ("Rig 7, channel A\nOperator: me\n\nSample rate,50\ntime,force,displacement\n" + rows(), "N", "m"),
    "comments": ("# rig 7\n# 50 Hz\ntime,force,displacement\n" + rows() + "# end\n", "N", "m"),
    "header in a comment": ("# rig 7\n# time force displacement\n" + rows(" "), "N", "m"),
    "percent comments": ("% rig 7\ntime,force,displacement\n" + rows(), "N", "m"),
    "quoted": (re.sub(r"([^,\n]+)", r'"\1"', "time,force,displacement\n" + rows()), "N", "m"),
    "delimiter at line ends": ("time,force,displacement,\n" + rows().replace("\n", ",\n"), "N", "m"),
    "known by units alone": ("time,channel 1 [N],channel 2 [m]\n" + rows(), "N", "m"),
    "blank lines": ("time,force,displacement\n\n" + rows().replace("\n", "\n\n"), "N", "m"),
    "a text column that nobody needs": (
        "time,force,displacement,state\n" + rows().replace("\n", ",ok\n"), "N", "m"),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"], ids=["unix", "windows", "old mac"])
def test_text(name: str, ending: str, tmp_path: Path) -> None:
    text, force, displacement = TEXTS[name]
    path = tmp_path / "rig.csv"
    path.write_bytes(text.replace("\n", ending).encode("utf-8"))
    options = ReadOptions(columns={"time": "Zeit"}) if "Zeit" in text else None
    record = read_record(path, options)
    check(record)
    assert (record.units["force"], record.units["displacement"]) == (force, displacement)
    assert record.extra == ()
    assert record.name == "rig"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_encodings(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.txt"
    path.write_bytes(("time [s],force [N],displacement [µm]\n" + rows()).encode(encoding))
    record = read_record(path)
    check(record)
    assert record.units["displacement"] == "um"


def test_without_header_or_time(tmp_path: Path) -> None:
    path = tmp_path / "rig.dat"
    path.write_text(rows(" ", ".", FORCE, DISPLACEMENT))
    check(read_record(path, ReadOptions(columns={"force": 1, "displacement": "2"}, fs=50.0)))
    with pytest.raises(StudyError, match=r"no column is known to be the force.*1 'column 1', 2 'column 2'.*--column"):
        read_record(path)
    with pytest.raises(StudyError, match=r"--fs"):
        read_record(path, ReadOptions(columns={"force": 1, "displacement": "2"}))


def test_full_names_come_before_short_ones(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text("time,force,displacement,input,x\n" + rows(",", ".", TIME, FORCE, DISPLACEMENT, TIME**2, TIME**3))
    record = read_record(path)
    check(record)
    assert record.extra == ("input", "x")


def test_integers(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    counts = np.arange(40) ** 2 % 37
    path.write_text("force,acc\n" + "".join(f"{c},{c % 7}\n" for c in counts))
    record = read_record(path, ReadOptions(dt=0.5))
    np.testing.assert_array_equal(record["force"], counts.astype(float))
    assert record["acceleration"].dtype == np.float64


@pytest.mark.parametrize(
    "header",
    [
        "time,u,y",
        "time,V1,V2",
        "time,force,F 2,channel",
        "time,f,input,x",
        "time,force,output",
        "time,x,F [kN],load [N]",
    ],
)
def test_ambiguous_columns_are_asked_for(header: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(f"{header}\n" + rows(",", ".", TIME, *[RNG.standard_normal(40) for _ in header.split(",")[1:]]))
    with pytest.raises(StudyError) as caught:
        read_record(path)
    message = str(caught.value)
    assert "rig.csv" in message
    assert "--column force=NAME" in message
    assert "\n" not in message
    for name in header.split(","):
        assert name.split(" [")[0] in message


def test_units_tell_u_and_y_apart(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text("t,u [m],y [N]\n" + rows(",", ".", TIME, DISPLACEMENT, FORCE))
    check(read_record(path))


@settings(max_examples=60, deadline=None)
@given(
    dt=st.floats(1e-6, 1e3), start=st.sampled_from([0.0, 1.0, 100.02, -3.3]), seed=st.integers(0, 2**32 - 1),
    extra=st.sampled_from(["", "strain", "c h 4"]), motions=st.sets(st.sampled_from(MOTIONS), min_size=1),
)  # fmt: skip
def test_what_write_csv_writes_is_read_bit_for_bit(
    tmp_path_factory: Any, dt: float, start: float, seed: int, extra: str, motions: set[str]
) -> None:
    rng = np.random.default_rng(seed)
    names = ["force", *sorted(motions), *([extra] if extra else [])]
    written = Record(dt, {n: rng.standard_normal(50) * 10.0 ** rng.uniform(-20, 20, 50) for n in names}, start=start)
    path = tmp_path_factory.mktemp("trip") / "rig.csv"
    write_csv(written, path)
    read = read_record(path)
    assert list(read.channels) == names
    for name in names:
        np.testing.assert_array_equal(read[name], written[name])
    # The interval is told by times that are rounded where the record begins late.
    rounding = 4.0 * np.finfo(float).eps * float(np.max(np.abs(written.time)))
    np.testing.assert_allclose(read.time, written.time, rtol=0.0, atol=rounding)
    assert read.units == written.units
    if start == 0.0:
        assert read.dt == dt


def test_units_survive_the_way_through_a_file(tmp_path: Path) -> None:
    units = {"force": "kN", "displacement": "mm", "strain": "um/m"}
    record = Record(0.02, {"force": FORCE, "displacement": DISPLACEMENT, "strain": TIME}, units)
    write_csv(record, tmp_path / "rig.csv")
    assert {k: read_record(tmp_path / "rig.csv").units[k] for k in units} == units


@pytest.mark.parametrize("unit", ["m/s^2", "g"])
def test_the_motion_of_a_base_is_none_of_the_response(unit: str, tmp_path: Path) -> None:
    """As ``study trial --test base`` writes it: the unit alone would make it the measured acceleration."""
    channels = {"base_acceleration": TIME, "force": 0.0 * FORCE, "displacement": DISPLACEMENT}
    write_csv(Record(0.02, channels, {"base_acceleration": unit}), tmp_path / "shaken.csv")
    read = read_record(tmp_path / "shaken.csv")
    assert set(read.channels) == set(channels)
    np.testing.assert_array_equal(read["base_acceleration"], TIME)


def test_a_tab_in_the_name_of_a_file_is_a_space_in_that_of_the_record(tmp_path: Path) -> None:
    write_csv(Record(0.02, {"force": FORCE, "displacement": DISPLACEMENT}), tmp_path / "run\t2.csv")
    assert read_record(tmp_path / "run\t2.csv").name == "run 2"


def test_the_simulator_names_its_records_by_folder(tmp_path: Path) -> None:
    (tmp_path / "duffing").mkdir()
    write_csv(Record(0.02, {"force": FORCE, "displacement": DISPLACEMENT}), tmp_path / "duffing" / "record.csv")
    assert read_record(tmp_path / "duffing" / "record.csv").name == "duffing"


@pytest.mark.parametrize("fs", [750.0, 610.3515625, 44100.0, 1.0 / 3.0])
def test_printed_times_give_the_rate_they_were_made_with(fs: float, tmp_path: Path) -> None:
    n = 3000
    time = np.round(np.arange(n) / fs, int(np.ceil(np.log10(fs))) + 2)
    path = tmp_path / "rig.csv"
    table = {"time": time, "force": RNG.standard_normal(n), "displacement": RNG.standard_normal(n)}
    pd.DataFrame(table).to_csv(path, index=False)
    assert read_record(path).dt == pytest.approx(1.0 / fs, rel=1e-5)


def test_jitter_below_one_percent_is_even(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    ends = np.array([-1.0, *np.tile([1.0, -1.0], 19), 1.0])  # the line through the first and the last leaves the others
    for shares in (RNG.uniform(-1, 1, 40), ends):
        jitter = 0.02 * 0.008 * shares
        path.write_text("time,force,displacement\n" + rows(",", ".", TIME + jitter, FORCE, DISPLACEMENT))
        assert read_record(path).dt == pytest.approx(0.02, rel=1e-3)
    path.write_text("time,force,displacement\n" + rows(",", ".", TIME + 0.02 * 0.02 * ends, FORCE, DISPLACEMENT))
    with pytest.raises(StudyError, match="sampling is uneven"):
        read_record(path)


def test_times_in_milliseconds(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text("t [ms],force,displacement\n" + rows(",", ".", 20.0 * np.arange(40), FORCE, DISPLACEMENT))
    check(read_record(path))


# options


def test_yaml_beside_the_file_and_options_over_it(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text("V1,V2\n" + rows(",", ".", FORCE, DISPLACEMENT))
    mapping = "columns: {force: V1, displacement: V2}\nunits: {force: V, displacement: V}\n"
    (tmp_path / "rig.record.yaml").write_text(mapping + "fs: 50\nsamples: [4, 36]\nperiod: 32\n")
    record = read_record(path)
    assert (len(record), record.dt, record.period, record.start) == (32, 0.02, 32, 0.08)
    assert record.units["displacement"] == "V"
    np.testing.assert_array_equal(record["force"], FORCE[4:36])
    other = read_record(path, ReadOptions(columns={"force": "V2", "displacement": "V1"}, dt=0.5, units={"force": "mV"}))
    np.testing.assert_array_equal(other["force"], DISPLACEMENT[4:36])
    assert (other.dt, other.units["force"], other.units["displacement"]) == (0.5, "mV", "V")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("- force", "no mapping"),
        ("colums: {force: V1}", "no key 'colums'"),
        ("columns: [force]", "columns is"),
        ("columns: {force: 1.5}", "the column of force is 1.5"),
        ("columns: {force: }", "the column of force is None"),
        ("units: {force: 3}", "the unit of force is 3"),
        ("fs: fast", "fs is 'fast'"),
        ("fs: 1e7/2**14", "fs is '1e7/2"),
        ("fs: 0", "fs is 0"),
        ("dt: -1", "dt is -1"),
        ("dt: .nan", "dt is nan"),
        ("dt: 1\nfs: 1", "both"),
        ("samples: 7", "samples is 7"),
        ("samples: [9, 3]", "samples is 9 to 3"),
        ("samples: [a, 3]", "the first sample is 'a'"),
        ("period: 1", "period is 1"),
        ("period: 2.5", "period is 2.5"),
        ("accept_saturated: 1", "accept_saturated is 1"),
        ("fs: &a 50\ndt: *a", "anchor"),
        ("fs: !!python/object:os.system 1", "tag"),
        ("{{{", "YAML"),
    ],
)
def test_wrong_options_are_one_sentence(text: str, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.record.yaml"
    path.write_text(text)
    with pytest.raises(StudyError, match=r"rig\.record\.yaml") as caught:
        read_options(path)
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)


def test_assignments() -> None:
    assert assignments(["force=V1", " velocity = a=b "], "--column") == {"force": "V1", "velocity": "a=b"}
    for wrong in (["force"], ["=V1"], ["force="], ["force=1", "force=2"]):
        with pytest.raises(StudyError, match="--column"):
            assignments(wrong, "--column")
