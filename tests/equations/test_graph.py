"""The graph: sharing, folding, exact derivatives, and programs that hold what is needed."""

import numpy as np
import pytest

from study.equations import kernels
from study.equations.graph import Graph, Op

POINTS = np.random.default_rng(0).uniform(0.2, 1.8, (40, 2)) * np.random.default_rng(1).choice([-1.0, 1.0], (40, 2))


def values(graph: Graph, node: int, points: np.ndarray) -> np.ndarray:
    """Node values at rows (a, b) of points, by the compiled kernel."""
    graph.input("a")
    graph.input("b")
    return kernels.evaluate(graph.program([node]), dict(zip("ab", points.T, strict=True)), len(points))[:, 0]


UNARY = {
    Op.NEG: np.negative, Op.ABS: np.abs, Op.SGN: np.sign, Op.SIN: np.sin, Op.COS: np.cos, Op.EXP: np.exp,
    Op.LOG: np.log, Op.SQRT: np.sqrt, Op.TANH: np.tanh,
}  # fmt: skip
BINARY = {
    Op.ADD: np.add, Op.SUB: np.subtract, Op.MUL: np.multiply, Op.DIV: np.divide, Op.MAX: np.maximum,
    Op.MIN: np.minimum, Op.GT: np.greater,
}  # fmt: skip


def of_two(graph: Graph, op: Op, a: int, b: int) -> int:
    made = {Op.ADD: graph.add, Op.SUB: graph.sub, Op.MUL: graph.mul, Op.DIV: graph.div}
    return made[op](a, b) if op in made else graph.binary(op, a, b)


def test_every_operation_is_tested() -> None:
    assert set(UNARY) | set(BINARY) | {Op.POW, Op.INPUT, Op.CONST} == set(Op)


@pytest.mark.parametrize("op", UNARY)
def test_unary_operations_agree_with_numpy(op: Op) -> None:
    graph = Graph()
    points = np.abs(POINTS) if op in (Op.LOG, Op.SQRT) else POINTS
    node = graph.unary(op, graph.input("a"))
    np.testing.assert_allclose(values(graph, node, points), UNARY[op](points[:, 0]), rtol=1e-15)


@pytest.mark.parametrize("op", BINARY)
def test_binary_operations_agree_with_numpy(op: Op) -> None:
    graph = Graph()
    node = of_two(graph, op, graph.input("a"), graph.input("b"))
    np.testing.assert_allclose(values(graph, node, POINTS), BINARY[op](POINTS[:, 0], POINTS[:, 1]), rtol=1e-15)


@pytest.mark.parametrize("op", [*UNARY, *BINARY])
@pytest.mark.parametrize("wrt", ["a", "b"])
def test_derivatives_agree_with_central_differences(op: Op, wrt: str) -> None:
    """Of ``op(inner)`` with inner functions of both inputs, so that every chain rule is walked."""
    graph = Graph()
    a, b = graph.input("a"), graph.input("b")
    inner = graph.add(graph.mul(a, b), graph.unary(Op.SIN, b))
    if op in (Op.LOG, Op.SQRT):
        inner = graph.add(graph.mul(inner, inner), graph.const(0.5))
    node = graph.unary(op, inner) if op in UNARY else of_two(graph, op, inner, graph.add(a, b))
    exact = values(graph, graph.derivative(node, graph.input(wrt)), POINTS)
    step = np.where(np.array(["a", "b"]) == wrt, 1e-6, 0.0)
    difference = (values(graph, node, POINTS + step) - values(graph, node, POINTS - step)) / 2e-6
    np.testing.assert_allclose(exact, difference, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("exponent", [-16, -3, -1, 0, 1, 2, 3, 5, 7, 16, 0.5, -1.5, 2.7, 20])
def test_powers_and_their_derivatives(exponent: float) -> None:
    graph = Graph()
    a, points = graph.input("a"), np.abs(POINTS)
    node = graph.power(a, exponent)
    base = points[:, 0]
    np.testing.assert_allclose(values(graph, node, points), base ** float(exponent), rtol=1e-13)
    slope = values(graph, graph.derivative(node, a), points)
    np.testing.assert_allclose(slope, exponent * base ** (exponent - 1.0), rtol=1e-12)


def test_second_derivative() -> None:
    graph = Graph()
    a, b = graph.input("a"), graph.input("b")
    node = graph.unary(Op.EXP, graph.mul(graph.unary(Op.SIN, a), b))
    twice = graph.derivative(graph.derivative(node, a), b)
    x, y = POINTS.T
    np.testing.assert_allclose(
        values(graph, twice, POINTS), np.exp(y * np.sin(x)) * np.cos(x) * (1.0 + y * np.sin(x)), rtol=1e-12
    )


def test_equal_subexpressions_are_one_node() -> None:
    graph = Graph()
    u = graph.input("u")
    assert graph.mul(u, graph.const(2.0)) == graph.mul(graph.const(2.0), u)
    cube = graph.power(u, 3)
    count = len(graph.nodes)
    assert graph.mul(graph.mul(u, u), u) == cube
    assert len(graph.nodes) == count


def test_neutral_elements_and_constants_fold() -> None:
    graph = Graph()
    u, zero, one = graph.input("u"), graph.const(0.0), graph.const(1.0)
    assert graph.add(u, zero) == u == graph.add(zero, u)
    assert graph.sub(u, zero) == u == graph.mul(one, u) == graph.mul(u, one) == graph.div(u, one)
    assert graph.mul(u, zero) == zero == graph.div(zero, u)
    assert graph.sub(zero, u) == graph.neg(u)
    folded = graph.sub(graph.mul(graph.const(3.0), graph.const(4.0)), graph.neg(graph.const(5.0)))
    assert graph.constant_value(folded) == 17.0
    assert graph.constant_value(graph.power(u, 0)) == 1.0


def test_a_program_computes_what_was_asked_for_and_nothing_else() -> None:
    graph = Graph()
    u, v = graph.input("u"), graph.input("v")
    wanted = graph.mul(u, v)
    graph.unary(Op.EXP, graph.add(u, v))
    program = graph.program([wanted, u])
    assert program.code.tolist() == [[int(Op.MUL), program.inputs["u"], program.inputs["v"]]]
    assert program.first == 2
    assert program.outputs.tolist() == [2, 0]


def test_a_program_may_be_empty() -> None:
    graph = Graph()
    assert values(graph, graph.const(4.5), POINTS).tolist() == [4.5] * len(POINTS)


def test_derivatives_stay_small() -> None:
    """Sharing keeps a deeply nested product linear in size where a tree would be exponential."""
    graph = Graph()
    node = graph.input("u")
    for _ in range(30):
        node = graph.unary(Op.SIN, graph.mul(node, node))
    graph.derivative(node, graph.input("u"))
    assert len(graph.nodes) < 30 * 10
