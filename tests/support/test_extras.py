"""What a plain installation has, and what it says of what it lacks."""

import os
import subprocess
import sys
import tomllib
from importlib.resources import files
from pathlib import Path

import pytest

from study.cli import main
from study.support.cores import cores
from study.support.extras import lacking, needed

ROOT = Path(__file__).parents[2]
MODEL = str(ROOT / "models" / "duffing.yaml")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
HEADS = {
    "h5": (b"\x89HDF\r\n\x1a\n", "h5py", "HDF5"),
    "parquet": (b"PAR1", "pyarrow.parquet", "Parquet"),
    "uff": (b"    -1\n    58\n    -1\n", "pyuff", "UFF"),
}


@pytest.mark.parametrize("ending", HEADS)
def test_a_format_without_its_package_is_one_sentence(tmp_path, monkeypatch, capsys, ending):
    head, module, kind = HEADS[ending]
    path = tmp_path / f"a.{ending}"
    path.write_bytes(head)
    monkeypatch.setitem(sys.modules, module, None)
    assert main(["compare", str(path), "--model", MODEL, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said == (
        f"study: {path}: reading {kind} needs {module.partition('.')[0]}; "
        "expected an installation with 'pip install reverse-miso-study[formats]'\n"
    )


def test_the_page_without_its_package_is_one_sentence(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "bokeh", None)
    assert main(["explore", "rig.csv", "--model", MODEL]) == 2
    said = capsys.readouterr().err
    assert said.startswith("study: 'study explore' needs bokeh; expected an installation with 'pip install")
    assert said.endswith("[explore]'\n")


def test_a_comparison_without_its_page_is_written_all_the_same(tmp_path, monkeypatch, capsys):
    record, out = tmp_path / "rig.csv", tmp_path / "out"
    assert main(["simulate", MODEL, "--samples", "1024", "--out", str(record)]) == 0
    monkeypatch.setitem(sys.modules, "bokeh", None)
    assert main(["compare", str(record), "--model", MODEL, "--out", str(out)]) == 0
    assert "no page (explore.html needs bokeh; expected an installation" in capsys.readouterr().out
    assert (out / "response.png").is_file()
    assert not (out / "explore.html").exists()


def test_what_is_installed_is_given():
    assert lacking("json", "this", "formats") == ""
    assert needed("json", "this", "formats").dumps([1]) == "[1]"


def test_a_fault_within_a_package_is_not_a_missing_package(tmp_path, monkeypatch):
    (tmp_path / "broken_package.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ZeroDivisionError):
        needed("broken_package", "this", "formats")


def test_every_extra_that_is_named_is_there_and_dev_has_them_all():
    extras = PROJECT["optional-dependencies"]
    assert {"workflow", "explore", "formats", "docs"} <= set(extras)
    assert f"{PROJECT['name']}[workflow,explore,formats,data,docs]" in extras["dev"]


def test_what_is_no_python_is_installed_too():
    """The style sheet, and the files of the page: without them pictures are not the project's own."""
    data = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["package-data"]
    listed = {(package, name) for package, names in data.items() for name in names if "*" not in name}
    assert data["study.equations"] == ["c/*.c", "c/*.h"]  # the sources of the compiled loops, to be read
    beside = {
        (".".join(path.parent.relative_to(ROOT).parts), path.name)
        for path in (ROOT / "study").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.suffix not in (".py", ".c", ".h", ".so", ".dll")
    }
    assert listed == beside
    assert all(files(package).joinpath(name).is_file() for package, name in listed)


def test_cores_are_those_that_the_process_may_use():
    assert 1 <= cores() <= (os.cpu_count() or 1)
    if hasattr(os, "sched_setaffinity"):
        code = "import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n"
        code += "from study.support.cores import cores; print(cores())"
        told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
        assert told.stdout == "1\n"
