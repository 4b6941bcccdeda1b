"""The library of compiled loops: built from the sources beside it, and safe to call."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from study.equations import kernels
from study.equations.graph import Graph, Op, Program
from study.equations.model import Model
from study.equations.motion_program import motion_program
from study.support.errors import StudyError

SOURCES = Path(kernels.__file__).parent / "c"


def test_every_operation_is_that_of_numpy() -> None:
    graph = Graph()
    a, b = graph.input("a"), graph.input("b")
    binary = [graph.add(a, b), graph.sub(a, b), graph.mul(a, b), graph.div(a, b)]
    binary += [graph.binary(op, a, b) for op in (Op.MAX, Op.MIN, Op.GT, Op.POW)]
    unary = [
        graph.neg(a),
        *(graph.unary(op, a) for op in (Op.ABS, Op.SGN, Op.SIN, Op.COS, Op.EXP, Op.LOG, Op.SQRT, Op.TANH)),
    ]
    program = graph.program([*binary, *unary])
    assert {int(op) for op in program.code[:, 0]} == {int(op) for op in Op if op not in (Op.INPUT, Op.CONST)}
    x, y = 1.7, 0.6
    expected = [x + y, x - y, x * y, x / y, max(x, y), min(x, y), 1.0, x**y, -x, abs(x), 1.0]
    expected += [float(f(x)) for f in (np.sin, np.cos, np.exp, np.log, np.sqrt, np.tanh)]
    out = kernels.evaluate(program, {"a": np.array([x]), "b": np.array([y])}, 1)
    np.testing.assert_allclose(out[0], expected, rtol=1e-15)


def product() -> Program:
    graph = Graph()
    return graph.program([graph.mul(graph.input("a"), graph.input("b"))])


def test_arrays_that_do_not_fit_are_refused(systems: dict[str, Model]) -> None:
    with pytest.raises(ValueError, match="could not broadcast"):
        kernels.evaluate(product(), {"a": np.zeros(4), "b": np.zeros(5)}, 5)
    motion, start, bounds = motion_program(systems["linear"], (), ()), np.zeros(1), np.array([0, 5])
    drive, states, out = np.zeros((17, 1)), np.zeros((1, 2, 1)), np.empty((5, 0, 1))
    assert kernels.integrate(motion, start, 0.1, 2, drive, bounds, states, out)[0] == -1
    wrong = [
        (start, drive[:16], bounds, states, out), (start, drive, bounds, states[:, :1], out),
        (start, drive, np.array([0, 6]), states, out), (np.zeros(2), drive, bounds, states, out),
        (start, drive, bounds, states, np.empty((5, 1, 1))), (start, drive, bounds, np.zeros((1, 4, 1))[:, ::2], out),
    ]  # fmt: skip
    for begin, driving, ends, begun, room in wrong:
        with pytest.raises(ValueError, match="do not fit"):
            kernels.integrate(motion, begin, 0.1, 2, driving, ends, begun, room)


def test_a_library_that_was_not_built_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "COMPILED", tmp_path / kernels.COMPILED.name)
    monkeypatch.setattr(kernels, "PROJECT", "a project that is not installed")
    kernels._function.cache_clear()  # pyright: ignore[reportPrivateUsage]
    with pytest.raises(StudyError, match=r"_kernels.* is not there.*pip install"):
        kernels.evaluate(product(), {}, 1)


def test_sources_without_a_library_take_that_of_the_installed_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a job of a cluster does, whose sources are those that Git knows."""
    installed = tmp_path / "study" / "equations"
    installed.mkdir(parents=True)
    shutil.copy(kernels.COMPILED, installed)
    (tmp_path / "reverse_miso_study-0.1.0.dist-info").mkdir()
    (tmp_path / "reverse_miso_study-0.1.0.dist-info" / "METADATA").write_text("Name: reverse-miso-study\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(kernels, "COMPILED", tmp_path / kernels.COMPILED.name)
    kernels._function.cache_clear()  # pyright: ignore[reportPrivateUsage]
    assert kernels.evaluate(product(), {"a": np.array([2.0]), "b": np.array([3.0])}, 1)[0, 0] == 6.0


def test_the_library_is_of_these_sources() -> None:
    newest = max(path.stat().st_mtime for path in SOURCES.iterdir())
    assert kernels.COMPILED.stat().st_mtime >= newest, "run `make` or `pip install -e .`: a source has changed"
