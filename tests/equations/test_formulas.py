"""Formulas: what is on the whitelist agrees with NumPy, everything else is an ExpressionError."""

import gc
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.equations import formulas
from study.equations.formulas import ExpressionError
from study.equations.graph import Graph
from study.equations.terms import custom

U = np.linspace(-2.0, 2.0, 41)
V = 1.3 * np.cos(3.0 * U)
NUMPY: dict[str, object] = {
    "abs": np.abs, "sgn": np.sign, "sign": np.sign, "sin": np.sin, "cos": np.cos, "exp": np.exp, "log": np.log,
    "sqrt": np.sqrt, "tanh": np.tanh, "max": np.maximum, "min": np.minimum, "pi": np.pi, "__builtins__": {},
}  # fmt: skip


def build(text: str) -> Graph:
    graph = Graph()
    formulas.add_formula(graph, text, {name: graph.input(name) for name in ("u", "v", "t")})
    return graph


def by_numpy(text: str) -> np.ndarray:
    """The test's own formulas by NumPy; never a user's text."""
    return np.broadcast_to(eval(text, {**NUMPY, "u": U, "v": V}), U.shape)


@pytest.mark.parametrize(
    "text",
    [
        "u", "+u", "-u", "u*abs(u) + 0.1*v**3", "2**3*u", "u**-2 + 0*v", "-u**2", "2*u/(1 + v*v)", "u - -v",
        "u**0.5*0 + v",
        "max(min(u, 0.7), -0.7)", "sgn(v)*sqrt(abs(u))", "sign(v)", "exp(-u**2)*cos(2*pi*v)", "log(3 + u)",
        "tanh(50*v)",
        "1e3*u", "1_000*u", "0x10*u", "(u)", "((((((((u))))))))", "u**(1 + 1)", "u**+2", " u * v ", "u**16", "1",
        "abs(abs(u) - 1)", "u/2/2", "u - v - 1", "2 - u**2**1",
    ],
)  # fmt: skip
def test_valid_formulas_agree_with_numpy(text: str, value_of: Callable[..., np.ndarray]) -> None:
    u = np.abs(U) if "0.5*0" in text else U
    with np.errstate(all="ignore"):
        expected = by_numpy(text) if u is U else V
        np.testing.assert_allclose(value_of(text, u=u, v=V), expected, rtol=1e-13, atol=1e-15)


leaves = st.sampled_from(["u", "v", "pi"]) | st.floats(-5, 5, allow_subnormal=False).map(lambda x: f"({x!r})")


def grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    one = st.tuples(st.sampled_from(["abs", "sgn", "sin", "cos", "tanh"]), inner).map(lambda p: f"{p[0]}({p[1]})")
    two = st.tuples(st.sampled_from(["max", "min"]), inner, inner).map(lambda p: f"{p[0]}({p[1]}, {p[2]})")
    sums = st.tuples(inner, st.sampled_from(["+", "-", "*"]), inner).map(lambda p: f"({p[0]} {p[1]} {p[2]})")
    ratio = st.tuples(inner, inner).map(lambda p: f"({p[0]}/(2 + sin({p[1]})))")
    power = st.tuples(inner, st.integers(0, 4)).map(lambda p: f"(sin({p[0]}))**{p[1]}")
    sign = inner.map(lambda x: f"(-{x})")
    return one | two | sums | ratio | power | sign


@settings(max_examples=150, deadline=None)
@given(st.recursive(leaves, grown, max_leaves=8).filter(lambda text: len(text) <= formulas.CHARACTERS))
def test_random_valid_formulas_agree_with_numpy(value_of: Callable[..., np.ndarray], text: str) -> None:
    with np.errstate(all="ignore"):
        expected = by_numpy(text)
    got = value_of(text, u=U, v=V)
    # A sine or a sign of a large argument turns rounding of its argument into anything: leave those out.
    if np.all(np.abs(expected) < 1e6) and "sgn" not in text:
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9)


HOSTILE = [
    "", " ", "()", "u +", "u u", "u v", "1 2", "u;v", "u\nv", "#", "u = 1", "import os", "return u", "pass",
    "__import__('os')", "__import__('os').system('true')", "os.system('true')", "u.__class__", "u.real",
    "(1).__class__",
    "lambda: u", "(lambda x: x)(u)", "[u for u in (1, 2)]", "{u: v}", "{u}", "[u]", "(u, v)", "(u for u in v)",
    "{x: x for x in v}", "f'{u}'", "f'{__import__(\"os\")}'", "'u'", "\"u\"", "b'u'", "'a'*9", "u[0]", "u[:]", "*u",
    "**u",
    "u if v else t", "u and v", "not u", "u or v", "u < v", "u == v", "u is v", "u in v", "u != v", "~u", "u // v",
    "u % v",
    "u @ v", "u << 2", "u | v", "u ^ 2", "u & v", "(u := 3)", "u := 3", "await u", "yield u", "(yield)", "...",
    "None",
    "True", "False", "1j*u", "3j", "nan", "inf", "NaN", "Infinity", "1e400", "-1e400*u", "1e301*u", "9" * 301,
    "9**9**9", "9**9**9**9", "u**9**9", "(-8)**0.5", "0**-0.5", "(1e300)**-16*0 + (1e300)**2", "u**17", "u**-17",
    "u**v", "u**(v)", "2**u", "u**nan", "u**1e400", "(1e300)**16",
    "1e300*1e300", "1e300*1e300 - 1e300*1e300", "1e300 + 1e300*1e10", "1/1e-320", "u/0", "u/(1 - 1)", "1/0", "0/0",
    "0**-1",
    "u/0.0", "u/-0.0", "w", "x", "z", "force", "U", "sin", "abs", "abs()", "abs(u, v)", "abs(u, key=v)", "abs(*u)",
    "abs(**u)", "max(u)", "max(u, v, t)", "max()", "eval('u')", "exec('u')", "open('x')", "print(u)",
    "getattr(u, 'x')",
    "abs(u)(v)", "abs.__call__(u)", "sin(sin)", "np.sin(u)", "math.pi", "pow(u, 2)", "u(1)", "u.v(1)", "pi()", "2(u)",
    "\uff55", "\u03c0*u", "u\u00b2", "u\u2212v", "\u202eu", "u\x00", "\x00", "u\u200b", "caf\u00e9", "\ud800",
    "(" * 150 + "u" + ")" * 149, "-" * 299 + "u", "u" + "+u" * 200, "(" * 100 + "u" + "+u)" * 60, "u" * 301,
    "abs(" * 60 + "u" + ")" * 60,
    "sin(" * 59 + "u" + ")" * 59, "u" + "**1" * 60, "1" + "*(1" * 60 + ")" * 60, "-" * 41 + "u", "u\\", "'\\d'",
    "1if u else 2",
    "0777", "1__0", "u!", "u?", "$u", "`u`", "@u", "async", "class", "del u", "assert u", "global u", "u -> v",
    "u: int",
    "print u", "exec u", "\t", "\r\n", "u\fv", "-", "+", "*", "/", "**", "=", ",", "u,", ".", "u.", ".u", "1e", "0x",
    "1_",
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_formulas_are_refused(text: str) -> None:
    with pytest.raises(ExpressionError):
        build(text)


@pytest.mark.parametrize("text", ["__import__('os')", "lambda: u", "u.real", "u**99", "[u]", "1e400", "u <", "eval(u)"])
def test_a_users_term_is_refused_when_it_is_made(text: str) -> None:
    with pytest.raises(ExpressionError):
        custom("mine", text)


def test_the_message_names_the_piece() -> None:
    for text, piece in (("u + x", "'x'"), ("open(u)", "'open'"), ("u**99", "'99'"), ("u[0]", r"u\[0\]")):
        with pytest.raises(ExpressionError, match=piece):
            build(text)


PIECES = st.sampled_from([
    "u", "v", "(", ")", "+", "-", "*", "/", "**", ",", ".", " ", "1", "1e9", "abs", "sin", "max", "lambda", ":", "=",
    "[",
    "]", "if", "else", "for", "in", "'", '"', "\\", "\n", "__", "import", "{", "}", "j", "_", "0x", "é", "\x00", "#",
    "~",
])  # fmt: skip


@settings(max_examples=400, deadline=None)
@given(st.text(max_size=60) | st.lists(PIECES, max_size=25).map("".join))
def test_any_text_is_a_formula_or_an_expression_error(text: str) -> None:
    try:
        graph = build(text)
    except ExpressionError:
        return
    assert all(np.isfinite(value) for value in graph.values)
    assert list(formulas.names(text)) == sorted(set(formulas.names(text)))


def test_the_longest_formula_is_read_and_one_more_character_is_not() -> None:
    text = "u" + "*1" * 30
    padded = text + " " * (formulas.CHARACTERS - len(text))
    build(padded)
    with pytest.raises(ExpressionError, match="301 characters"):
        build(padded + " ")


def test_names_lists_variables_not_functions() -> None:
    assert formulas.names("u*abs(v) + max(w, u_g)*pi") == ("u", "u_g", "v", "w")


def test_formulas_are_read_in_many_threads_while_others_collect_garbage():
    """Without a lock Python before 3.13 says "AST constructor recursion depth mismatch" to one of a hundred."""

    class Cycle:
        def __init__(self) -> None:
            self.me: object = self

        def __del__(self) -> None:
            sum(range(200))

    def read(_: int) -> None:
        Cycle()
        formulas.parse("+".join(["u*max(u, 0.1)"] * 18))

    threshold, interval = gc.get_threshold(), sys.getswitchinterval()
    gc.set_threshold(5, 1, 1)
    sys.setswitchinterval(1e-7)
    try:
        with ThreadPoolExecutor(8) as pool:
            assert len(list(pool.map(read, range(4000)))) == 4000
    finally:
        gc.set_threshold(*threshold)
        sys.setswitchinterval(interval)
