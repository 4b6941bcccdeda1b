"""A read-only installation whose user has no writable home, as in a container: it works, and asks for no more."""

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DROP_CAPABILITY, OVERRIDES = 24, (1, 2)  # prctl's PR_CAPBSET_DROP; what lets root write where nobody may
SEEN = """import numpy as np
from study.equations import kernels
from study.equations.graph import Graph

graph = Graph()
program = graph.program([graph.mul(graph.input("a"), graph.input("b"))])
assert kernels.evaluate(program, {"a": np.array([2.0]), "b": np.array([3.0])}, 1)[0, 0] == 6.0
"""


def _without_privileges() -> None:
    libc = ctypes.CDLL(None)
    for capability in OVERRIDES:
        libc.prctl(DROP_CAPABILITY, capability, 0, 0, 0)


@pytest.fixture
def installed() -> Iterator[Path]:
    """A copy of the package that nobody can write to."""
    folder = Path(tempfile.mkdtemp())
    shutil.copytree(
        ROOT / "study" / "equations", folder / "study" / "equations", ignore=shutil.ignore_patterns("__py*")
    )
    shutil.copytree(ROOT / "study" / "support", folder / "study" / "support", ignore=shutil.ignore_patterns("__py*"))
    shutil.copy(ROOT / "study" / "__init__.py", folder / "study")
    (folder / "probe.py").write_text(SEEN)
    (folder / "home").mkdir()
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    yield folder
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    shutil.rmtree(folder)


def test_a_read_only_installation_works_and_says_nothing(installed: Path) -> None:
    bare = {k: v for k, v in os.environ.items() if not k.startswith(("XDG", "PYTHON"))}
    done = subprocess.run(
        [sys.executable, str(installed / "probe.py")], cwd=installed, capture_output=True, text=True, timeout=120,
        env={**bare, "HOME": str(installed / "home"), "PYTHONPATH": str(installed)}, preexec_fn=_without_privileges,
        check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
