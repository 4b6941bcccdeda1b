"""The wheel, and what it gives in an environment with its plain dependencies and nothing else; no network is asked."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
SOURCES = ("study", "scripts", "setup.py", "pyproject.toml", "README.md", "LICENSE")
EXTRAS = ("bokeh", "h5py", "matplotlib", "pandas", "pydantic", "snakemake", "pytest")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """What ``python -m build --wheel`` makes of the sources, with the build tools that are installed here."""
    folder = tmp_path_factory.mktemp("sources")
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    command = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(folder / "dist"),
        str(folder),
    ]
    subprocess.run(command, check=True, capture_output=True, text=True)
    (found,) = (folder / "dist").glob("*.whl")
    return found


def needed(name, seen):
    """A distribution and all that it needs without extras, by name."""
    if name not in seen:
        seen.add(name)
        for text in importlib.metadata.requires(name) or ():
            wanted = Requirement(text)
            if wanted.marker is None or wanted.marker.evaluate({"extra": ""}):
                needed(wanted.name, seen)
    return seen


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """The interpreter of a new environment with the wheel; its dependencies are those installed here, linked."""
    folder = tmp_path_factory.mktemp("clean")
    venv.create(folder, with_pip=False)
    (site,) = folder.glob("lib/python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
        (metadata,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        lines = archive.read(metadata).decode().splitlines()
    plain = [Requirement(line[15:]) for line in lines if line.startswith("Requires-Dist: ") and "extra ==" not in line]
    assert {"numpy", "scipy"} <= {requirement.name for requirement in plain}
    for name in set().union(*(needed(requirement.name, set()) for requirement in plain)):
        for file in importlib.metadata.files(name) or ():
            top = Path(file.parts[0])
            place = Path(str(importlib.metadata.distribution(name).locate_file(str(top))))
            if top.name not in ("..", "__pycache__") and not (site / top).exists():
                (site / top).symlink_to(place)
    return folder / "bin" / "python"


@pytest.mark.long
def test_the_wheel_holds_the_package_its_types_and_its_looks(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    wanted = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "study").rglob("*")
        if path.is_file() and path.suffix != ".py" and path.parent.name != "__pycache__"
    }
    assert {"study/py.typed", "study/explore/page.html"} <= wanted
    assert wanted <= names
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "study").rglob("*.py")}
    assert modules <= names
    assert not any(name.startswith(("tests", "scripts", "benchmarks")) for name in names)


@pytest.mark.long
def test_commands_work_without_extras(python, tmp_path):
    absent = f"import importlib.util; print([n for n in {EXTRAS!r} if importlib.util.find_spec(n)])"
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment["PATH"] = str(python.parent)  # where no compiler is

    def run(*words):
        done = subprocess.run(
            [python, *words], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert run("-c", absent).strip() == "[]"
    (tmp_path / "rig.yaml").write_text("name: rig\nterms: [inertia, linear_damping, linear_stiffness]\n")
    force = "st.gaussian(samples=512, seed=2)"
    terms = (
        "st.term('inertia', value=1.0), st.term('linear_damping', value=3.77), st.term('linear_stiffness', value=355.3)"
    )
    run("-c", f"import study as st; st.simulate(st.Model({terms}), {force}).save('rig.csv')")
    said = run("-m", "study", "compare", "rig.csv", "--model", "rig.yaml", "--no-measurement", "--out", "out")
    assert "no page" in said
    assert "explore" in said
    assert "no pictures" in said
    run("-m", "study", "export", "rig.yaml", "--to", "fmu", "--data", "rig.csv", "--no-measurement")
    with zipfile.ZipFile(tmp_path / "rig.fmu") as unit:
        assert any(name.startswith("binaries/") for name in unit.namelist())
