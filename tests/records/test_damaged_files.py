"""Damaged, mangled and random files: each gives a sound record or one sentence, as does what is no file."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import pyuff
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from study.records.readers import ReadOptions, read_record
from study.records.record import Record
from study.support.errors import StudyError

N = 64
TIME = 0.02 * np.arange(N)
RNG = np.random.default_rng(3)
FORCE = RNG.standard_normal(N)
MOTION = RNG.standard_normal(N)
HEADER = "time,force,displacement"
MAPPED = ReadOptions(columns={"force": "force", "displacement": "displacement"}, fs=50.0)


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


def _parquet(path: Path) -> None:
    pd.DataFrame({"time": TIME, "force": FORCE, "displacement": MOTION}).to_parquet(path)


def _uff(path: Path) -> None:
    for node, kind, values in ((1, 13, FORCE), (2, 8, MOTION)):
        made = pyuff.prepare_58(
            func_type=1, rsp_node=node, rsp_dir=3, ref_node=1, ref_dir=3, data=values, x=TIME, binary=0,
            ord_data_type=4, abscissa_spacing=1, num_pts=N, abscissa_min=0.0, abscissa_inc=0.02,
            abscissa_spec_data_type=17, ordinate_spec_data_type=kind, orddenom_spec_data_type=0,
            z_axis_spec_data_type=0,
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets(made, "add")


def _hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["force"], file["displacement"], file["fs"] = FORCE, MOTION, 50.0


def _matlab(path: Path) -> None:
    savemat(path, {"force": FORCE, "displacement": MOTION, "fs": 50.0}, do_compression=True)


WRITERS: dict[str, Callable[[Path], None]] = {"mat": _matlab, "h5": _hdf5, "parquet": _parquet, "uff": _uff}


@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.45, 0.7, 0.9, 0.97])
def test_truncated(suffix: str, share: float, tmp_path: Path) -> None:
    path = tmp_path / f"rig.{suffix}"
    WRITERS[suffix](path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    said = sentence(path)
    if share >= 0.1:
        assert "cut short" in said


@pytest.mark.parametrize("suffix", WRITERS)
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 30))
def test_damaged_bytes_give_a_record_or_a_sentence(tmp_path_factory: Any, suffix: str, seed: int, count: int) -> None:
    path = tmp_path_factory.mktemp("damaged") / f"rig.{suffix}"
    WRITERS[suffix](path)
    rng = np.random.default_rng(seed)
    data = bytearray(path.read_bytes())
    for place in rng.integers(0, len(data), count):
        data[place] = rng.integers(0, 256)
    path.write_bytes(bytes(data))
    record_or_sentence(path, None)


def record_or_sentence(path: Path, options: ReadOptions | None, named: str | None = None) -> None:
    try:
        record = read_record(path, options)
    except StudyError as error:
        said = str(error)
    else:
        said = path.name
        check_sound(record)
    assert "\n" not in said
    assert (named or path.name) in said


def check_sound(record: Record) -> None:
    """What every record promises that was read at all."""
    assert record.dt > 0.0
    assert np.isfinite(record.dt)
    for values in record.channels.values():
        assert values.dtype == np.float64
        assert values.shape == (len(record),)
        assert np.isfinite(values).all()


def test_what_is_no_file(tmp_path: Path) -> None:
    assert "folder" in sentence(tmp_path)
    assert "no such file" in sentence(tmp_path / "absent.csv")
    assert "cannot be read" in sentence(tmp_path / ("x" * 300), None)
    with pytest.raises(StudyError, match="cannot be read"):
        read_record(Path("a\0b.csv"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_no_permission(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(table())
    path.chmod(0)
    assert "ermission" in sentence(path)


def test_permission_refused_by_the_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(table())

    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    assert "Permission denied" in sentence(path)


# any bytes at all


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=400))
def test_any_bytes(tmp_path_factory: Any, data: bytes) -> None:
    path = tmp_path_factory.mktemp("bytes") / "rig.csv"
    path.write_bytes(data)
    record_or_sentence(path, None)
    record_or_sentence(path, ReadOptions(columns={"force": 1, "displacement": 2}, fs=50.0))


MANGLES = st.lists(
    st.tuples(
        st.integers(0, 5000),
        st.integers(0, 40),
        st.text(alphabet=" ,;\t\n\r\"'#%.-+eE0123456789naNiINf[]()µ\0x", max_size=6),
    ),
    min_size=1,
    max_size=8,
)


@settings(max_examples=400, deadline=None)
@given(MANGLES, st.booleans())
def test_mangled_text(tmp_path_factory: Any, mangles: list[tuple[int, int, str]], mapped: bool) -> None:
    text = table()
    for place, removed, added in mangles:
        at = place % len(text)
        text = text[:at] + added + text[at + removed :]
    path = tmp_path_factory.mktemp("mangled") / "rig.csv"
    path.write_text(text, encoding="utf-8", newline="")
    record_or_sentence(path, MAPPED if mapped else None)


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, N - 1),
    st.integers(0, 2),
    st.sampled_from(["x", "1,5", "--", "1e", "0x10", "1 2", '"', "NULL", "TRUE", "1;2"]),
)
def test_a_bad_cell_is_never_read_as_something_else(tmp_path_factory: Any, row: int, column: int, text: str) -> None:
    path = tmp_path_factory.mktemp("cell") / "rig.csv"
    path.write_text(table(change=cell(row, column, text)))
    said = sentence(path)
    if '"' not in text and "," not in text:
        assert f"line {row + 2}" in said, said


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=200))
def test_any_yaml_beside(tmp_path_factory: Any, text: str) -> None:
    folder = tmp_path_factory.mktemp("yaml")
    (folder / "rig.csv").write_text(table())
    (folder / "rig.record.yaml").write_text(text, encoding="utf-8")
    record_or_sentence(folder / "rig.csv", None, named="rig")
