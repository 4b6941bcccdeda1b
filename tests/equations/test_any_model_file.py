"""Whatever a model file holds: a model, or one sentence; and what was written reads back as itself."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from study.equations.model import Model, ModelTerm
from study.equations.model_file import format_model, parse_model
from study.equations.redundancy import repeated_force
from study.equations.terms import LIBRARY, custom, get
from study.support.errors import StudyError

HERE = Path("rig.yaml")


# Properties: whatever is in the file, there is a model or a StudyError.


def _model_or_error(text: str) -> None:
    model, message = None, ""
    try:
        model = parse_model(text, HERE)
    except StudyError as error:
        message = str(error)
    if model is None:
        assert message.startswith("rig.yaml: ")
        assert "\n" not in message
    else:
        assert parse_model(format_model(model), HERE) == model


@settings(deadline=None)
@given(st.binary(max_size=300))
def test_random_bytes(content: bytes) -> None:
    _model_or_error(content.decode("latin-1"))


@settings(deadline=None)
@given(
    st.text(
        alphabet=st.sampled_from("terms: inertia\n-[]{}&*!?|>'\"%@`#,01e._~<\\\tuv()+\x85\u2028\ufeff"), max_size=120
    )
)
def test_random_yaml_like_text(text: str) -> None:
    _model_or_error(text)
    _model_or_error("terms:\n  - inertia\n  - " + text)
    _model_or_error("terms: [{term: own, force: " + text)


NAMES = st.sampled_from(
    [*LIBRARY, "own", "term", "value", "values", "force", "terms", "name", "amplitude", "phase", "u_g"]
)
LEAVES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), NAMES, st.text(max_size=12), st.sampled_from(["u*v", "u**3"])
)
TREES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=5) | st.dictionaries(NAMES | st.text(max_size=5), inner, max_size=5)
)
ENTRIES = st.one_of(NAMES, st.dictionaries(NAMES, LEAVES, max_size=5).map(lambda d: {"term": "inertia", **d}), TREES)


def _as_yaml(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_as_yaml(k)}: {_as_yaml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_as_yaml, value)) + "]"
    if isinstance(value, str):
        return '"' + "".join(c if c.isalnum() and c.isascii() else f"\\U{ord(c):08x}" for c in value) + '"'
    return {"None": "null", "True": "true", "False": "false", "nan": ".nan", "inf": ".inf", "-inf": "-.inf"}.get(
        str(value), str(value)
    )


@settings(deadline=None)
@given(TREES)
def test_random_structures(tree: object) -> None:
    _model_or_error(_as_yaml(tree))


@settings(deadline=None)
@given(st.fixed_dictionaries({"terms": st.lists(ENTRIES, max_size=5)}, optional={"name": LEAVES}))
def test_random_structures_shaped_like_a_model(tree: dict[str, object]) -> None:
    _model_or_error(_as_yaml(tree))


SIZES = st.floats(min_value=1e-50, max_value=1e50)  # what a file may hold
VALUES = st.none() | st.just(0.0) | SIZES | SIZES.map(lambda size: -size)
POSITIVE = st.none() | SIZES


@st.composite
def models(draw: st.DrawFn) -> Model:
    chosen = draw(st.lists(st.sampled_from([*LIBRARY, "own", "null", "y"]), min_size=1, max_size=6, unique=True))
    entries: list[ModelTerm] = []
    for name in chosen:
        term = LIBRARY[name] if name in LIBRARY else custom(name, draw(st.sampled_from(["u*v", "max(u, 0)", "wind*v"])))
        coefficients = tuple(draw(POSITIVE if name == "inertia" else VALUES) for _ in term.symbols)
        parameters = tuple(draw(VALUES if p.signed else POSITIVE) for p in term.parameters)
        entries.append(ModelTerm(term, coefficients, parameters))
    name = draw(st.text(min_size=1, max_size=20).filter(lambda s: s.isprintable() and s.strip()))
    model = Model(name, tuple(entries))
    assume(repeated_force(model) is None)  # no file may hold such a one: tests/equations/test_redundancy.py
    return model


@settings(deadline=None)
@given(models())
def test_a_written_model_reads_back_as_itself(model: Model) -> None:
    assert parse_model(format_model(model), HERE) == model


def test_numpy_numbers_are_written_as_numbers() -> None:
    model = Model("rig", (ModelTerm(get("inertia"), (np.float64(1.5),), ()),))
    assert "value: 1.5}" in format_model(model)
    with pytest.raises(StudyError, match="m of inertia is nan"):
        format_model(Model("rig", (ModelTerm(get("inertia"), (math.nan,), ()),)))
