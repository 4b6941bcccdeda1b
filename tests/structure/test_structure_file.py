"""Model files of structures: what is read, written, and refused in a sentence."""

from pathlib import Path

import pytest

from study.equations.linear_part import checked_mass_matrix
from study.equations.model import free
from study.equations.model_file import format_model, parse_model, read_model
from study.equations.place import Place
from study.equations.terms import get
from study.support.errors import StudyError
from tests.model_files import add_term

HERE = Path("frame.yaml")
HEAD = "name: frame\ncoordinates: [a, b]\nforces: {shaker: a}\nterms:\n"
MASSES = "  - {term: inertia, at: a, value: 2.0}\n  - {term: inertia, at: b, value: 1.0}\n"
SPRING = "  - {term: linear_stiffness, between: [a, b], value: 100.0}\n"


def test_a_structure_reads_back_as_it_was_written():
    more = (
        "  - {term: one_sided_contact, between: [ground, b], gap: 1.0e-3}\n"
        "  - {term: inertia, couples: [a, b], value: 0.2}\n"
        "  - {term: bracket, at: b, force: 'u*abs(u)'}\n"
        "  - {term: periodic_stiffness, at: a, amplitude: 3.0, phase: 0.5}\n"
    )
    model = parse_model(HEAD + MASSES + SPRING + more, HERE)
    assert parse_model(format_model(model), HERE) == model
    assert "k[a-b]" in model.values
    assert model.values["one_sided_contact[ground-b].gap"] == 1e-3
    assert model.values["m[a,b]"] == 0.2


def test_a_term_is_added_at_its_place(tmp_path):
    path = tmp_path / "frame.yaml"
    path.write_text(HEAD + MASSES + SPRING)
    add_term(path, free(get("cubic_stiffness"), Place("between", ("a", "b"))))
    assert path.read_text() == HEAD + MASSES + SPRING + "  - {term: cubic_stiffness, between: [a, b]}\n"
    with pytest.raises(StudyError, match="already"):
        add_term(path, free(get("cubic_stiffness"), Place("between", ("a", "b"))))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + MASSES + SPRING.replace("b]", "c]"), "is between 'c', which is no coordinate"),
        (HEAD + MASSES + SPRING.replace("[a, b]", "[a, a]"), "two different ends"),
        (HEAD + MASSES + SPRING.replace("[a, b]", "[a]"), "expected two"),
        (HEAD + MASSES + SPRING.replace("between: [a, b], ", ""), "says not where it acts"),
        (HEAD + MASSES + SPRING + SPRING, "twice"),
        (HEAD + MASSES + SPRING + SPRING.replace("[a, b]", "[b, a]"), "twice"),
        (HEAD + MASSES + "  - {term: linear_stiffness, at: a}\n", "nothing ties the coordinate 'b'"),
        (HEAD + MASSES.splitlines()[0] + "\n" + SPRING, "'b' has no inertia"),
        (HEAD.replace("forces: {shaker: a}\n", "") + SPRING, "for a component test, whose motion"),
        (HEAD + MASSES + "  - {term: linear_stiffness, couples: [a, b]}\n", "couples nothing"),
        (HEAD.replace("shaker: a", "shaker: c") + MASSES + SPRING, "no coordinate of the model"),
        (HEAD.replace("[a, b]", "[a, ground]") + MASSES + SPRING, "never moves"),
        (HEAD.replace("[a, b]", "[a, a]") + MASSES + SPRING, "twice"),
        (HEAD.replace("[a, b]", "[a, 'b c']") + MASSES + SPRING, "expected a name of letters"),
        ("name: x\nterms: [{term: inertia, at: a}]\n", "no 'coordinates'"),
        ("name: x\nforces: {f: a}\nterms: [inertia]\n", "no 'coordinates'"),
        (HEAD + MASSES + SPRING + "  - {term: mine, between: [a, b], force: '2*u'}\n", None),
        (
            HEAD + MASSES + SPRING + "  - {term: linear_damping, at: b}\n  - {term: mine, at: b, force: '2*v'}\n",
            "no other than",
        ),
    ],
)  # fmt: skip
def test_a_bad_structure_gets_its_sentence(text, said):
    if said is None:
        parse_model(text, HERE)  # the spring is held: the two can be told apart
        return
    with pytest.raises(StudyError, match=r"frame\.yaml") as refused:
        parse_model(text, HERE)
    assert said in str(refused.value)
    assert "expected" in str(refused.value) or "did you mean" in str(refused.value) or "leave" in str(refused.value)


def test_a_mass_matrix_that_is_not_positive_definite_is_refused():
    model = parse_model(HEAD + MASSES + SPRING + "  - {term: inertia, couples: [a, b], value: 1.5}\n", HERE)
    with pytest.raises(StudyError, match="not positive definite"):
        checked_mass_matrix(model)


def test_a_single_mass_has_no_places():
    with pytest.raises(StudyError, match="has 'at', and the model no 'coordinates'"):
        parse_model("name: x\nterms: [{term: inertia, at: a}]\n", HERE)
    plain = read_model(Path(__file__).parents[2] / "models" / "duffing.yaml")
    assert (plain.coordinates, plain.named) == (("",), False)
    assert {t.place.label for t in plain.terms} == {""}
    assert list(plain.values) == ["m", "c", "k", "k3"]
