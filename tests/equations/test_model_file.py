"""Model files: what they say is what is read, and what is not a model gets one sentence."""

import errno
import math
import os
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume
from hypothesis import strategies as st

from study.equations.model import Model, ModelTerm
from study.equations.model_file import parse_model, read_model
from study.equations.redundancy import repeated_force
from study.equations.simulate import simulate
from study.equations.terms import LIBRARY, custom, get
from study.support.errors import StudyError
from tests.model_files import add_term

MODELS = Path(__file__).parents[2] / "models"
HERE = Path("rig.yaml")

TABLE_1 = {
    "linear": {"m": 1.0, "c": 3.77, "k": 355.3},
    "duffing": {"m": 1.0, "c": 3.77, "k": 355.3, "k3": 2e7},
    "van_der_pol": {"m": 1.0, "c": 3.77, "k": 355.3, "c3": 2e6},
    "duffing_van_der_pol": {"m": 1.0, "c": 3.77, "k": 355.3, "k3": 2e7, "c3": 2e6},
    "mathieu": {"m": 1.0, "c": 3.77, "k": 355.3, "km_cos": 177.7, "km_sin": 0.0, "periodic_stiffness.f_m": 1.0},
    "dead_band": {"m": 1.0, "c": 1.89, "k": 355.3, "kg": -355.3, "dead_band.u_g": 0.0025},
    "extreme": {"m": 1.0, "c": 0.0, "k": 0.0, "k3": 2e7, "c3": 2e6},
}


@pytest.mark.parametrize("name", TABLE_1)
def test_table_1_files_hold_the_reports_systems(name: str) -> None:
    model = read_model(MODELS / f"{name}.yaml")
    assert model.name == name
    assert model.values == TABLE_1[name]


def test_every_model_file_is_read() -> None:
    assert {p.stem for p in MODELS.glob("*.yaml")} >= set(TABLE_1)
    for path in MODELS.glob("*.yaml"):
        assert read_model(path).terms


def test_the_example_of_the_format() -> None:
    model = parse_model(
        "name: rig\nterms:\n  - inertia   # fitted\n  - linear_damping\n  - {term: linear_stiffness, value: 355.3}\n"
        '  - {term: dead_band, u_g: 0.0025}\n  - {term: bracket, force: "u*abs(u) + 0.1*v**3"}\n',
        HERE,
    )
    assert model.values == {
        "m": None, "c": None, "k": 355.3, "kg": None, "dead_band.u_g": 0.0025, "q_bracket": None,
    }  # fmt: skip
    assert model.terms[-1].term.components[0].shape == "u*abs(u) + 0.1*v**3"


def test_a_model_without_a_name_is_called_after_its_file() -> None:
    assert parse_model("terms: [inertia]", Path("some/rig.yaml")).name == "rig"


@pytest.mark.parametrize("phase", [0.0, 0.7, math.pi / 2, -2.0])
def test_amplitude_and_phase_give_the_cosine_they_describe(phase: float) -> None:
    model = parse_model(f"terms: [{{term: harmonic_force, f: 1.5, amplitude: 3.0, phase: {phase}}}]", HERE)
    t = np.linspace(0.0, 2.0, 101)
    cosine, sine = model.terms[0].coefficients
    assert cosine is not None
    assert sine is not None
    angle = 2 * np.pi * 1.5 * t
    np.testing.assert_allclose(cosine * np.cos(angle) + sine * np.sin(angle), 3.0 * np.cos(angle + phase), atol=1e-14)


def test_values_name_each_coefficient() -> None:
    text = "terms: [{term: periodic_stiffness, values: {km_sin: 2, km_cos: -1.5}}]"
    assert parse_model(text, HERE).terms[0] == ModelTerm(get("periodic_stiffness"), (-1.5, 2.0), (None,))
    text = "terms: [{term: periodic_stiffness, values: {km_sin: 2}}]"
    assert parse_model(text, HERE).terms[0].coefficients == (None, 2.0)


@pytest.mark.parametrize(
    ("text", "value"), [("2.0e7", 2e7), ("2e7", 2e7), ("-1", -1.0), ("1_000", 1000.0), (".5", 0.5), ("0x10", 16.0)]
)
def test_numbers_as_people_write_them(text: str, value: float) -> None:
    assert parse_model(f"terms: [{{term: linear_stiffness, value: {text}}}]", HERE).values == {"k": value}


def test_a_term_of_the_users_own_may_name_a_measured_channel() -> None:
    text = 'terms: [{term: inertia, value: 1}, {term: wind, force: "wind_speed*v", value: 0.5}]'
    model = parse_model(text, HERE)
    force, wind = np.zeros(64), np.ones(64)
    record = simulate(model, force, 0.01, initial=(0.0, 1.0), extra={"wind_speed": wind})
    np.testing.assert_allclose(record["velocity"], np.exp(-0.5 * record.time), rtol=1e-6)


# Broken files: the content, and what the sentence must name.
BROKEN: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty"),
    "comment_only": (b"# nothing\n", "is empty"),
    "list": (b"- inertia\n- linear_damping\n", "['inertia', 'linear_damping']"),
    "text": (b"just words\n", "'just words'"),
    "number": (b"3.5\n", "3.5"),
    "binary": (bytes(range(256)), "no UTF-8"),
    "null_bytes": (b"\x00" * 100, "not YAML"),
    "png": (b"\x89PNG\r\n\x1a\n\x00\x00", "no UTF-8"),
    "utf16": ("name: rig".encode("utf-16"), "no UTF-8"),
    "open_bracket": (b"terms: [inertia\n", "not YAML"),
    "tab_indent": (b"terms:\n\t- inertia\n", "line 2"),
    "colon": (b"name: rig: 2\nterms: [inertia]\n", "line 1"),
    "two_documents": (b"terms: [inertia]\n---\nterms: [inertia]\n", "not YAML"),
    "no_terms": (b"name: rig\n", "'terms' is missing"),
    "terms_empty": (b"terms: []\n", "'terms' is []"),
    "terms_null": (b"terms:\n", "'terms' is None"),
    "terms_text": (b"terms: inertia\n", "'terms' is 'inertia'"),
    "terms_mapping": (b"terms: {inertia: 1}\n", "'terms' is {'inertia': 1}"),
    "misspelt_top_key": (b"nam: rig\nterms: [inertia]\n", "did you mean 'name'"),
    "unknown_top_key": (b"colour: red\nterms: [inertia]\n", "'colour'"),
    "numeric_top_key": (b"3: red\nterms: [inertia]\n", "unknown key 3"),
    "complex_key": (b"? [a, b]\n: 1\nterms: [inertia]\n", "rig.yaml"),
    "mapping_key": (b"? {a: b}\n: 1\nterms: [inertia]\n", "rig.yaml"),
    "name_number": (b"name: 7\nterms: [inertia]\n", "the name is 7"),
    "name_empty": (b"name: ''\nterms: [inertia]\n", "the name is ''"),
    "name_control": (b'name: "a\\e[31m"\nterms: [inertia]\n', "the name is"),
    "name_lines": (b'name: "a\\nb"\nterms: [inertia]\n', "the name is"),
    "unknown_term": (b"terms: [cubic_stifness]\n", "did you mean 'cubic_stiffness'"),
    "unknown_term_mapping": (b"terms: [{term: quadratic_dampin, value: 1}]\n", "did you mean 'quadratic_damping'"),
    "nothing_like_it": (b"terms: [flux_capacitor]\n", "'flux_capacitor'"),
    "long_term": (b"terms: [" + b"a" * 5000 + b"]\n", "5000 characters"),
    "long_own": (b"terms: [{term: " + b"a" * 5000 + b", force: u}]\n", "5000 characters"),
    "duplicate_term": (b"terms: [inertia, inertia]\n", "'inertia' twice"),
    "duplicate_own": (b"terms: [{term: a, force: u}, {term: a, force: v}]\n", "'a' twice"),
    "duplicate_key": (b"terms: [{term: inertia, value: 1, value: 2}]\n", "duplicate key"),
    "duplicate_top_key": (b"terms: [inertia]\nterms: [inertia]\n", "duplicate key"),
    "entry_number": (b"terms: [3]\n", "entry 1"),
    "entry_null": (b"terms:\n  - inertia\n  -\n", "entry 2"),
    "entry_list": (b"terms: [[inertia]]\n", "entry 1"),
    "entry_without_term": (b"terms: [{value: 1}]\n", "'term' is missing"),
    "short_form": (b"terms: [{linear_stiffness: 355.3}]\n", "'term' is missing"),
    "term_null": (b"terms: [{term: , value: 1}]\n", "'term' is None"),
    "term_number": (b"terms: [{term: 3}]\n", "'term' is 3"),
    "misspelt_key": (b"terms: [{term: inertia, valeu: 1}]\n", "did you mean 'value'"),
    "wrong_parameter": (b"terms: [{term: dead_band, gap: 1}]\n", "'gap'"),
    "value_text": (b"terms: [{term: inertia, value: heavy}]\n", "value of inertia is 'heavy'"),
    "value_comma": (b'terms: [{term: inertia, value: "1,5"}]\n', "'1,5'"),
    "value_quoted": (b'terms: [{term: inertia, value: "1.5"}]\n', "'1.5'"),
    "value_bool": (b"terms: [{term: inertia, value: true}]\n", "is True"),
    "value_nan": (b"terms: [{term: inertia, value: .nan}]\n", "is nan"),
    "value_inf": (b"terms: [{term: inertia, value: -.inf}]\n", "is -inf"),
    "value_overflow": (b"terms: [{term: inertia, value: 1e999}]\n", "is inf"),
    "value_many_digits": (b"terms: [{term: inertia, value: " + b"9" * 400 + b"}]\n", "value of inertia"),
    "value_too_many_digits": (b"terms: [{term: inertia, value: " + b"9" * 5000 + b"}]\n", "rig.yaml"),
    "value_long_hex": (b"terms: [{term: inertia, value: 0x" + b"f" * 9000 + b"}]\n", "too many digits"),
    "value_date": (b"terms: [{term: inertia, value: 2001-01-01}]\n", "datetime.date(2001, 1, 1)"),
    "value_no_date": (b"terms: [{term: inertia, value: 2001-99-99}]\n", "rig.yaml"),
    "value_list": (b"terms: [{term: inertia, value: [1]}]\n", "is [1]"),
    "value_empty": (b"terms: [{term: inertia, value: }]\n", "value of inertia is empty"),
    "parameter_text": (b"terms: [{term: dead_band, u_g: wide}]\n", "u_g of dead_band is 'wide'"),
    "parameter_zero": (b"terms: [{term: relaxation, tau: 0}]\n", "tau of relaxation is 0"),
    "parameter_negative": (b"terms: [{term: dead_band, u_g: -1}]\n", "u_g of dead_band is -1"),
    "amplitude_alone": (b"terms: [{term: harmonic_force, amplitude: 1}]\n", "'amplitude' alone"),
    "phase_alone": (b"terms: [{term: harmonic_force, phase: 1}]\n", "'phase' alone"),
    "value_of_two": (b"terms: [{term: harmonic_force, value: 1}]\n", "unknown key 'value'"),
    "amplitude_of_one": (b"terms: [{term: inertia, amplitude: 1, phase: 0}]\n", "unknown key 'amplitude'"),
    "value_and_values": (b"terms: [{term: inertia, value: 1, values: {m: 1}}]\n", "'value' and 'values'"),
    "values_number": (b"terms: [{term: harmonic_force, values: 3}]\n", "values of harmonic_force is 3"),
    "values_unknown": (b"terms: [{term: harmonic_force, values: {fh_co: 3}}]\n", "did you mean 'fh_cos'"),
    "values_text": (b"terms: [{term: harmonic_force, values: {fh_cos: x}}]\n", "fh_cos of harmonic_force"),
    "force_of_library": (b"terms: [{term: inertia, force: u}]\n", "belongs to the library"),
    "force_number": (b"terms: [{term: own, force: 3}]\n", "force of 'own' is 3"),
    "force_empty": (b"terms: [{term: own, force: ''}]\n", "not a formula"),
    "force_import": (b"terms: [{term: own, force: \"__import__('os').system('true')\"}]\n", "__import__"),
    "force_attribute": (b'terms: [{term: own, force: "u.__class__"}]\n', "u.__class__"),
    "force_lambda": (b'terms: [{term: own, force: "(lambda: u)()"}]\n', "lambda"),
    "force_index": (b'terms: [{term: own, force: "u[0]"}]\n', "u[0]"),
    "force_power_tower": (b'terms: [{term: own, force: "9**9**9**9"}]\n', "power"),
    "force_nan_power": (b'terms: [{term: own, force: "u**(1e300*1e300-1e300*1e300)"}]\n', "too large a number"),
    "force_overflow": (b'terms: [{term: own, force: "u*1e300*(1e300*1e300)"}]\n', "too large a number"),
    "force_unbalanced": (b'terms: [{term: own, force: "' + b"(" * 140 + b'u"}]\n', "not a formula"),
    "force_deep": (b'terms: [{term: own, force: "' + b"-" * 250 + b'u"}]\n', "deep"),
    "force_long": (b'terms: [{term: own, force: "' + b"u+" * 500 + b'u"}]\n', "1001 characters"),
    "force_unicode": ('terms: [{term: own, force: "µ*u"}]\n'.encode(), "plain ASCII"),
    "own_name_space": (b"terms: [{term: my bracket, force: u}]\n", "'my bracket' is not a name"),
    "python_tag": (b"terms: !!python/object/apply:os.system ['true']\n", "tag"),
    "python_tag_value": (b"terms: [{term: inertia, value: !!python/name:os.system x}]\n", "tag"),
    "float_tag": (b"terms: [{term: inertia, value: !!float 3}]\n", "tag"),
    "own_tag": (b"terms: !rig [inertia]\n", "tag '!rig'"),
    "alias": (b"a: &x [inertia]\nterms: *x\n", "anchor"),
    "bomb": (
        b"a: &a [x,x,x,x,x,x,x,x,x]\n"
        + b"".join(b"%c: &%c [%s]\n" % (n, n, b",".join([b"*%c" % (n - 1)] * 9)) for n in range(98, 110)),
        "anchor",
    ),
    "self_alias": (b"terms: &t [*t]\n", "anchor"),
    "deep_lists": (b"terms: " + b"[" * 20_000, "deeply nested"),
    "deep_block": (b"".join(b" " * n + b"a:\n" for n in range(300)), "deeply nested"),
    "many_entries": (b"terms:\n" + b"- inertia\n" * 60_000, "too large"),
    "many_own": (b"terms:\n" + b"".join(b"- {term: a%d, force: u}\n" % n for n in range(300)), "300 entries"),
    "over_1_mb": (b"# " + b"x" * 1_000_000, "1000000 bytes"),
    "yaml_1_1": (b"%YAML 1.1\n---\nterms: [inertia]\n", "%YAML"),
    "directive": (b"%TAG ! tag:x,2000:\n---\nterms: !a [inertia]\n", "tag"),
    "merge_key": (b"terms: [{term: inertia, <<: {value: 1, term: x}, <<: 3}]\n", "rig.yaml"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_gets_one_sentence(name: str, tmp_path: Path) -> None:
    content, names = BROKEN[name]
    path = tmp_path / "rig.yaml"
    path.write_bytes(content)
    started = time.perf_counter()
    with pytest.raises(StudyError) as caught:
        read_model(path)
    message = str(caught.value)
    assert time.perf_counter() - started < 5.0
    assert names in message
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < len(str(path)) + 500
    before = path.read_bytes()
    with pytest.raises(StudyError):
        add_term(path, get("quadratic_damping"))
    assert path.read_bytes() == before


def test_what_is_no_readable_file(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"rig\.yaml: there is no such file"):
        read_model(tmp_path / "rig.yaml")
    with pytest.raises(StudyError, match="this is a folder"):
        read_model(tmp_path)
    with pytest.raises(StudyError, match="not a regular file"):
        read_model(Path("/dev/null"))
    with pytest.raises(StudyError, match=r"null (byte|character)"):
        read_model(Path("a\0b"))
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(StudyError, match="loop"):
        read_model(tmp_path / "loop")


def test_a_file_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("terms: [inertia]\n")

    def refuse(*_: object, **__: object) -> None:  # as the kernel does to anybody but root
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(StudyError, match="cannot be read"):
        read_model(path)


VALUES = st.none() | st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.none() | st.floats(min_value=0.0, exclude_min=True, allow_infinity=False)


@st.composite
def models(draw: st.DrawFn) -> Model:
    chosen = draw(st.lists(st.sampled_from([*LIBRARY, "own", "null", "y"]), min_size=1, max_size=6, unique=True))
    entries: list[ModelTerm] = []
    for name in chosen:
        term = LIBRARY[name] if name in LIBRARY else custom(name, draw(st.sampled_from(["u*v", "max(u, 0)", "wind*v"])))
        coefficients = tuple(draw(VALUES) for _ in term.symbols)
        parameters = tuple(draw(VALUES if p.signed else POSITIVE) for p in term.parameters)
        entries.append(ModelTerm(term, coefficients, parameters))
    name = draw(st.text(min_size=1, max_size=20).filter(lambda s: s.isprintable() and s.strip()))
    model = Model(name, tuple(entries))
    assume(repeated_force(model) is None)  # no file may hold such a one: tests/equations/test_redundancy.py
    return model
