"""A record that cannot be used is refused in one sentence that names file and place and says what was expected."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import pyuff
from scipy.io import savemat

from study.records.readers import ReadOptions, read_record
from study.support.errors import StudyError

N = 64
TIME = 0.02 * np.arange(N)
RNG = np.random.default_rng(3)
FORCE = RNG.standard_normal(N)
MOTION = RNG.standard_normal(N)
HEADER = "time,force,displacement"


def lines(*columns: Any) -> list[str]:
    return [",".join(repr(float(x)) for x in row) for row in zip(*(columns or (TIME, FORCE, MOTION)), strict=True)]


def table(header: str = HEADER, *columns: Any, change: dict[int, str] | None = None) -> str:
    body = lines(*columns)
    for row, text in (change or {}).items():
        body[row] = text
    return "\n".join([header, *body]) + "\n"


def sentence(path: Path, options: ReadOptions | None = None) -> str:
    """What the user is told; anything but a StudyError of one line that names the file is a failure."""
    with pytest.raises(StudyError) as caught:
        read_record(path, options)
    said = str(caught.value)
    assert "\n" not in said
    assert path.name in said
    assert len(said) < 600
    return said


def cell(row: int, column: int, text: str) -> dict[int, str]:
    cells = lines()[row].split(",")
    cells[column] = text
    return {row: ",".join(cells)}


def with_values(values: np.ndarray, **changes: float) -> np.ndarray:
    out = values.copy()
    for place, value in changes.items():
        out[int(place[1:])] = value
    return out


WIDE = np.random.default_rng(1).standard_normal(2000)
CLIPPED = np.clip(WIDE, -1.5, 1.5)
LONG = 0.02 * np.arange(2000)
TEXTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "empty": ("", ("empty", "expected")),
    "only blanks": ("\n \n\t\n", ("empty",)),
    "only a header": (HEADER + "\n", ("no line with numbers",)),
    "only words": ("once upon a time\nthere was a rig\n" * 20, ("no line with numbers",)),
    "one column": (table("force", FORCE), ("displacement, velocity or acceleration", "1 'force'")),
    "no force": (table("time,x,y", TIME, FORCE, MOTION), ("force", "2 'x'", "--column force=NAME")),
    "no motion": (table("time,force,temperature"), ("displacement, velocity or acceleration", "'temperature'")),
    "duplicate column": (table("time,force,displacement,force", TIME, FORCE, MOTION, FORCE),
                         ("'force'", "2 times", "2 and 4", "number")),
    "two forces": (table("time,F,x,load", TIME, FORCE, MOTION, FORCE), ("'F' and 'load'", "force")),
    "a gap in a cell": (table(change=cell(6, 1, "")), ("'force'", "no number", "line 8")),
    "nan": (table(change=cell(6, 2, "nan")), ("'displacement'", "no number", "line 8")),
    "infinite": (table(change=cell(6, 2, "-inf")), ("'displacement'", "infinite", "line 8")),
    "too large": (table(change=cell(6, 2, "1e999")), ("'displacement'", "line 8")),
    "text in a cell": (table(change=cell(20, 1, "overload")), ("'force'", "'overload'", "line 22", "number")),
    "text in the first row": (table(change=cell(0, 1, "start")), ("'force'", "'start'", "line 2")),
    "text in the time": (table(change=cell(9, 0, "12:00:01")), ("'time'", "'12:00:01'", "line 11")),
    "a hostile cell": (table(change=cell(9, 1, "__import__('os')")), ("'force'", "line 11")),
    "header repeated halfway": (table(change={30: HEADER}), ("'time'", "line 32")),
    "a row too long": (table(change={12: "1,2,3,4,5"}), ("line 14", "5 cells", "3")),
    "a first row too long": (table(change={0: "1,2,3,4"}), ("line 2", "4 cells", "3")),
    "a first row too long, no header": ("1,2,3,4\n" + "\n".join(lines()), ("line 1", "4 cells", "3")),
    "a row too short": (table(change={12: "0.24,1.0"}), ("'displacement'", "no number", "line 14")),
    "comments between": ("# a\n# b\n" + table(change=cell(6, 1, "")).replace("0.04,", "# c\n0.04,", 1), ("line 11",)),
    "a lost sample": (table(HEADER, np.delete(TIME, 30), FORCE[1:], MOTION[1:]), ("gap", "0.04 s", "0.02 s")),
    "uneven": (table(HEADER, TIME**1.2, FORCE, MOTION), ("uneven", "even sampling")),
    "two decimal marks": (table().replace(",", ";").replace("0.02;", "0,02;"), ("line 3",)),
    "decimal mark by column": ("\n".join(["time;force;x", *[f"0,{k:02d};{k % 7}.5;{k * k % 11}.5" for k in range(64)]]),
                               ("'time'", "'0,00'", "line 2")),
    "a comment hides cells": (table(change={0: "0.0,1.0 # , 2.0"}), ("line 2", "cells")),
    "comments hide cells": ("\n".join([HEADER, *[x.replace(",", " #,", 2).replace(" #", "", 1) for x in lines()]]),
                            ("line 2", "2 cells", "expected 3")),
    "time runs backwards": (table(HEADER, TIME[::-1], FORCE, MOTION), ("backwards", "line 3")),
    "time jumps back": (table(HEADER, with_values(TIME, _40=0.1), FORCE, MOTION), ("backwards", "line 42")),
    "time stands still": (table(HEADER, 0.0 * TIME, FORCE, MOTION), ("stands still", "line 3")),
    "no time, no rate": (table("force,x", FORCE, MOTION), ("--fs", "--column time=")),
    "two samples": (table(HEADER, TIME[:2], FORCE[:2], MOTION[:2]), ("2 samples", "16")),
    "constant force": (table(HEADER, TIME, 0.0 * FORCE + 3.5, MOTION), ("'force'", "3.5 throughout")),
    "constant motion": (table(HEADER, TIME, FORCE, 0.0 * MOTION), ("'displacement'", "0 throughout")),
    "saturated": (table(HEADER, LONG, RNG.standard_normal(2000), CLIPPED), ("'displacement'", "1.5", "saturated")),
    "saturated below": (table("time,Force,displacement", LONG, np.maximum(WIDE, -1.0), WIDE),
                        ("'Force' (force)", "lowest", "-1 ", "saturated")),
    "no such unit": (table("time,force [banana],x"), ("'force'", "'banana'", "N, kN")),
    "unit of something else": (table("time,force [mm],x"), ("'mm'", "force", "N, kN")),
    "time in newtons": (table("time [N],force,x"), ("'N'", "time", "s, ms")),
    "force in seconds": (table("time,force,x\ns,s,m"), ("'s'", "force")),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_text(name: str, tmp_path: Path) -> None:
    text, parts = TEXTS[name]
    path = tmp_path / "rig.csv"
    path.write_text(text)
    said = sentence(path)
    for part in parts:
        assert part in said, said


BYTES: dict[str, tuple[bytes, str]] = {
    "rubbish": (np.random.default_rng(0).bytes(5000), "no text"),
    "zeros": (bytes(5000), "no text"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(100), "no text"),
    "a spreadsheet": (b"PK\x03\x04" + bytes(100), "spreadsheet"),
    "gzip": (b"\x1f\x8b\x08" + bytes(100), "gzip"),
    "a zero byte deep inside": (table().encode() + b"\0" * 3, "no text"),
    "half a UTF-16": ("time,force".encode("utf-16")[:-1], "numbers"),
}


@pytest.mark.parametrize("name", BYTES)
def test_no_text(name: str, tmp_path: Path) -> None:
    data, part = BYTES[name]
    path = tmp_path / "rig.csv"
    path.write_bytes(data)
    assert part in sentence(path)


@pytest.mark.parametrize("suffix", [".mat", ".h5", ".parquet", ".uff"])
@pytest.mark.parametrize("content", [b"", b"time,force,x\n1,2,3\n", np.random.default_rng(5).bytes(3000), bytes(3000)])
def test_content_that_is_not_what_the_name_says(suffix: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"rig{suffix}"
    path.write_bytes(content)
    sentence(path)


def _uff(path: Path) -> None:
    for node, kind, values in ((1, 13, FORCE), (2, 8, MOTION)):
        made = pyuff.prepare_58(
            func_type=1, rsp_node=node, rsp_dir=3, ref_node=1, ref_dir=3, data=values, x=TIME, binary=0,
            ord_data_type=4, abscissa_spacing=1, num_pts=N, abscissa_min=0.0, abscissa_inc=0.02,
            abscissa_spec_data_type=17, ordinate_spec_data_type=kind, orddenom_spec_data_type=0,
            z_axis_spec_data_type=0,
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets(made, "add")


ARRAYS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "complex": ({"force": FORCE + 1j, "displacement": MOTION}, ("'force'", "complex", "real")),
    "three dimensions": ({"force": np.zeros((2, 3, 4)), "displacement": MOTION}, ("'force'", "(2, 3, 4)", "periods")),
    "square": ({"force": np.eye(8), "displacement": MOTION}, ("'force'", "(8, 8)")),
    "different lengths": ({"force": FORCE, "displacement": MOTION[:-1]}, ("64", "63", "length")),
    "rate of zero": ({"force": FORCE, "displacement": MOTION, "fs": 0.0}, ("'fs'", "above zero")),
    "only one number": ({"force": 1.0, "displacement": 2.0}, ("no column of numbers",)),
    "nan": ({"force": with_values(FORCE, _7=np.nan), "displacement": MOTION}, ("'force'", "sample 7")),
}


@pytest.mark.parametrize("name", ARRAYS)
@pytest.mark.parametrize("suffix", ["mat", "h5"])
def test_arrays(name: str, suffix: str, tmp_path: Path) -> None:
    arrays, parts = ARRAYS[name]
    arrays = {"fs": 50.0, **arrays}
    path = tmp_path / f"rig.{suffix}"
    if suffix == "mat":
        savemat(path, arrays)
    else:
        with h5py.File(path, "w") as file:
            for key, value in arrays.items():
                file[key] = value
    said = sentence(path)
    for part in parts:
        assert part in said, said


def test_parquet_with_text_and_gaps(tmp_path: Path) -> None:
    path = tmp_path / "rig.parquet"
    pd.DataFrame({"time": TIME, "force": ["a"] * N, "displacement": MOTION}).to_parquet(path)
    assert "'force' holds" in sentence(path)
    pd.DataFrame({"time": TIME, "force": [None, *FORCE[1:]], "displacement": MOTION}).to_parquet(path)
    assert "no number in sample 0" in sentence(path)


def test_uff_without_time_histories(tmp_path: Path) -> None:
    path = tmp_path / "rig.uff"
    pyuff.UFF(str(path)).write_sets(
        pyuff.prepare_58(
            func_type=4, rsp_node=1, rsp_dir=3, ref_node=1, ref_dir=3, data=FORCE + 1j * MOTION, x=TIME, binary=0,
            ord_data_type=6, abscissa_spacing=1, num_pts=N, abscissa_min=0.0, abscissa_inc=0.02,
            abscissa_spec_data_type=18, ordinate_spec_data_type=8, orddenom_spec_data_type=13, z_axis_spec_data_type=0,
        ), "add",
    )  # fmt: skip
    assert "time histories" in sentence(path)
    path.write_text("    -1\n   151\nname\n\n\n\n\n\n\n    -1\n")
    assert "58" in sentence(path)


def test_uff_that_states_more_samples_than_it_holds(tmp_path: Path) -> None:
    path = tmp_path / "rig.uff"
    _uff(path)
    path.write_text(path.read_text().replace(f"{N:10d}         1", f"{N + 9:10d}         1", 1))
    assert f"states {N + 9} samples and holds {N}" in sentence(path)


OPTIONS: dict[str, tuple[ReadOptions, tuple[str, ...]]] = {
    "no such column": (ReadOptions(columns={"force": "F9"}), ("'F9'", "2 'force'", "--column")),
    "number too high": (ReadOptions(columns={"force": 4}), ("column 4", "1 'time'")),
    "number zero": (ReadOptions(columns={"force": 0}), ("column 0",)),
    "negative number": (ReadOptions(columns={"force": -1}), ("column -1",)),
    "extra that is not there": (ReadOptions(columns={"strain": "eps"}), ("'eps'", "strain")),
    "samples beyond the end": (ReadOptions(samples=(0, 65)), ("65", "64")),
    "samples from beyond the end": (ReadOptions(samples=(90, None)), ("90", "64")),
    "too few samples": (ReadOptions(samples=(10, 12)), ("2 samples", "16")),
    "period too long": (ReadOptions(period=65), ("65", "64")),
    "period of what does not repeat": (ReadOptions(period=16), ("16 samples later differs by", "repeats")),
    "group of a text": (ReadOptions(group="run"), ("'run'", "leave it out")),
    "nonsense unit": (ReadOptions(units={"force": "bananas"}), ("'bananas'", "N, kN")),
    "unit of nothing": (ReadOptions(units={"velocity": "m/s"}), ("'velocity'", "channels")),
    "unit of something else": (ReadOptions(units={"displacement": "N"}), ("'N'", "m, mm")),
}


@pytest.mark.parametrize("name", OPTIONS)
def test_options_that_do_not_fit(name: str, tmp_path: Path) -> None:
    options, parts = OPTIONS[name]
    path = tmp_path / "rig.csv"
    path.write_text(table())
    said = sentence(path, options)
    for part in parts:
        assert part in said, said


# what must not be refused


def test_a_text_column_or_gaps_that_nobody_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    state = [f"{x},{'' if k == 5 else k}" for k, x in enumerate(lines())]
    path.write_text("\n".join([HEADER + ",spare", *state]))
    record = read_record(path)
    assert record.extra == ()
    said = sentence(path, ReadOptions(columns={"spare": "spare"}))
    assert "line 7" in said


def test_a_gap_can_be_cut_away(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(table(change=cell(6, 1, "")))
    record = read_record(path, ReadOptions(samples=(7, None)))
    assert len(record) == N - 7
    assert record.start == pytest.approx(0.14)
    path.write_text(table(change=cell(6, 1, "") | cell(40, 1, "")))
    assert "line 42" in sentence(path, ReadOptions(samples=(7, None)))


@pytest.mark.parametrize(
    "force",
    [
        np.sign(np.sin(LONG)),
        np.where(LONG % 5 < 0.1, np.sin(np.pi * (LONG % 5) / 0.1), 0.0),
        np.sin(2.0 * np.pi * LONG / 0.4),
        np.round(100.0 * np.sin(0.3 * LONG)),
        np.round(127.0 * np.sin(0.01 * LONG)),
        np.tile(RNG.standard_normal(100), 20),
        np.round(RNG.standard_normal(2000) * 300.0),
        np.concatenate([np.zeros(900), RNG.standard_normal(1100)]),
    ],
    ids=["square", "blows", "sine", "digitised sine", "slow sine", "periodic", "digitised noise", "starts late"],
)
def test_signals_that_are_not_saturated(force: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(table(HEADER, LONG, force, np.random.default_rng(8).standard_normal(2000)))
    np.testing.assert_array_equal(read_record(path)["force"], force)


def test_a_plateau_can_be_accepted(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(table(HEADER, LONG, CLIPPED, RNG.standard_normal(2000)))
    assert "accept_saturated" in sentence(path)
    assert len(read_record(path, ReadOptions(accept_saturated=True))) == 2000
