"""The library of compiled loops: built from the sources beside it, and safe to call."""

from pathlib import Path

import numpy as np
import pytest

from study.equations import kernels
from study.equations.graph import Graph, Op
from study.support.errors import StudyError

SOURCES = Path(kernels.__file__).parent / "c"


def test_every_operation_is_that_of_numpy() -> None:
    """Both ways of running: one instruction after the other, and prepared, where a result goes on unstored."""
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
    out = np.empty((1, len(expected)))
    point = np.array([[x, y]])
    kernels.evaluate(
        program.code, program.first, program.registers.copy(), np.array([0, 1]), point, program.outputs, out
    )
    np.testing.assert_allclose(out[0], expected, rtol=1e-15)


def test_arrays_that_do_not_fit_are_refused() -> None:
    r, code = np.zeros(4), np.array([[int(Op.ADD), 0, 1]])
    with pytest.raises(ValueError, match="do not fit"):
        kernels.evaluate(code, 3, r, np.array([0, 1]), np.zeros((5, 3)), np.array([3]), np.empty((5, 1)))
    with pytest.raises(ValueError, match="do not fit"):
        kernels.integrate_rk4(code, 3, r, np.array([3]), 0.0, 0.1, 2, np.zeros((9, 1)), np.zeros(2), np.empty((5, 3)))
    with pytest.raises(ValueError, match="do not fit"):
        kernels.run(code, 3, np.zeros(8)[::2])


def test_a_library_that_was_not_built_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """When a loop is called, not when the module is imported: a job that only plans has no library beside it."""
    monkeypatch.setattr(kernels, "LIBRARY", tmp_path / kernels.LIBRARY.name)
    kernels._function.cache_clear()  # pyright: ignore[reportPrivateUsage]
    with pytest.raises(StudyError, match=rf"{tmp_path}.* is not there.*pip install"):
        kernels.run(np.array([[int(Op.ADD), 0, 1]]), 2, np.zeros(3))


def test_the_library_is_of_these_sources() -> None:
    newest = max(path.stat().st_mtime for path in SOURCES.iterdir())
    assert kernels.LIBRARY.stat().st_mtime >= newest, "run `make` or `pip install -e .`: a source has changed"
