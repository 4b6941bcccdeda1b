"""Adding a term to a model file, or taking one out, leaves the rest as the user wrote it."""

from pathlib import Path

import pytest

from study.equations import model_file
from study.equations.model import ModelTerm, free
from study.equations.model_file import read_model, revised
from study.equations.terms import custom, get
from study.support.errors import StudyError
from tests.model_files import add_term, drop_term

LAYOUTS = {
    "block": "# rig\nname: 'rig'  # quoted\nterms:\n  - inertia  # free\n  - {term: linear_stiffness, value: 3.5e2}\n",
    "indentless": "terms:\n- inertia\n- linear_damping\nname: rig\n",
    "comments_behind": "terms:\n  - inertia # last\n\n  # tried: coulomb_friction\n\n# the end\nname: rig\n",
    "mapping_last": "terms:\n  - term: linear_stiffness\n    value: 355.3 # N/m\n    # a note\nname: rig\n",
    "values_last": "terms:\n  - term: harmonic_force\n    values:\n      fh_cos: 1\n      fh_sin: 2\nname: rig\n",
    "no_newline": "name: rig\nterms:\n  - inertia",
    "no_newline_comment": "name: rig\nterms:\n  - inertia # c",
    "flow": "name: rig\nterms: [inertia, 'linear_damping' ]  # short\n",
    "flow_lines": "name: rig\nterms: [\n  inertia,   # mass\n  {term: linear_damping, value: 1},  # damper\n]\n",
    "flow_document": "{name: rig, terms: [inertia]}\n",
    "carriage_returns": "name: rig\r\nterms:\r\n  - inertia\r\n  - linear_damping # c\r\n# end\r\n",
    "quoted": 'name: rig\nterms:\n  - "inertia"\n  - {term: own, force: "u*\\\n      v"}\n',
    "folded": "name: rig\nterms:\n  - inertia\n  - term: own\n    force: >-\n      u*abs(u)\n      + v\n\n# end\n",
    "literal_at_end": "name: rig\nterms:\n  - inertia\n  - term: own\n    force: |\n      u*abs(u)\n",
    "byte_order_mark": "\ufeffname: rig\nterms:\n  - inertia\n",
    "document_marks": "---\nname: rig\nterms:\n  - inertia\n...\n",
    "multi_line_plain": "name: rig\nterms:\n  - term: own\n    force: u*v\n      + u\n# end\n",
    "compact": "terms: [inertia]",
    "key_in_name": "name: terms\nterms:\n    -   inertia\n",
    "not_ascii": "name: Prüfstand № 7 🛠\nterms:\n  - inertia  # Masse\n",
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    "entry",
    [
        free(get("quadratic_damping")),
        ModelTerm(get("one_sided_contact"), (1.25e25,), (-1e-7,)),
        ModelTerm(get("periodic_stiffness"), (None, 3.0), (2.0,)),
        free(custom("null", "max(u, 0)*temperature")),
    ],
    ids=lambda e: e.name,
)
def test_adding_keeps_every_byte(layout: str, entry: ModelTerm, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    old = LAYOUTS[layout].encode()
    path.write_bytes(old)
    before = read_model(path)
    after = add_term(path, entry)
    assert after == read_model(path) == before.with_term(entry)
    new = path.read_bytes()
    start = next((i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), len(old))
    assert new[: start + len(new) - len(old)] + old[start:] == new  # one stretch was put in, nothing else changed
    assert b"\r\n" not in old or new.count(b"\n") == new.count(b"\r\n")


def test_adding_reads_like_what_the_user_would_write(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(LAYOUTS["block"])
    add_term(path, get("quadratic_damping"))
    add_term(path, ModelTerm(get("dead_band"), (None,), (0.0025,)))
    assert path.read_text() == LAYOUTS["block"] + "  - quadratic_damping\n  - {term: dead_band, u_g: 0.0025}\n"
    path.write_bytes(LAYOUTS["carriage_returns"].encode())
    add_term(path, get("cubic_stiffness"))
    assert path.read_bytes().endswith(b"  - linear_damping # c\r\n  - cubic_stiffness\r\n# end\r\n")


def test_adding_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("terms: [inertia]\n")
    with pytest.raises(StudyError, match="'inertia' is already in this model"):
        add_term(path, get("inertia"))
    assert path.read_text() == "terms: [inertia]\n"


def test_a_layout_without_a_clear_place_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("terms: [inertia]\n")
    monkeypatch.setattr(model_file.yaml_text, "with_entry", lambda text, *_: f"{text}!")
    with pytest.raises(StudyError, match="add '- cubic_stiffness' to 'terms' by hand"):
        add_term(path, get("cubic_stiffness"))
    assert path.read_text() == "terms: [inertia]\n"


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_was_added_is_taken_out_to_the_byte(layout: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(LAYOUTS[layout].encode())
    before = read_model(path)
    add_term(path, ModelTerm(get("one_sided_contact"), (1.25e25,), (-1e-7,)))
    assert drop_term(path, "one_sided_contact") == before
    assert path.read_bytes() == LAYOUTS[layout].encode()


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_taking_out_any_entry_leaves_the_others(layout: str, place: int, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(LAYOUTS[layout].encode())
    for name in ("cubic_stiffness", "relaxation"):
        add_term(path, get(name))
    before, old = read_model(path), path.read_text()
    name = before.terms[place].name
    after = drop_term(path, name)
    assert after == read_model(path) == before.without_term(name)
    left, kept = iter(old), path.read_text()
    assert all(letter in left for letter in kept)  # letters are gone, none is new, none has moved


LINES = {
    "head": "# rig\nterms:\n  # the weights\n",
    "inertia": "  - inertia   # weighed\n",
    "linear_damping": "  - linear_damping  # guess\n",
    "between": "  # springs\n",
    "linear_stiffness": "  - linear_stiffness # k\n",
    "tail": "\n# the end\n",
}


@pytest.mark.parametrize("name", ["inertia", "linear_damping", "linear_stiffness"])
def test_comments_stay_but_for_the_one_behind_the_entry(name: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("".join(LINES.values()))
    drop_term(path, name)
    assert path.read_text() == "".join(line for key, line in LINES.items() if key != name)


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("inertia", "terms: [\n  {term: linear_damping, value: 1},  # damper\n  linear_stiffness\n]\n"),
        ("linear_damping", "terms: [\n  inertia,   # mass\n  linear_stiffness\n]\n"),
        ("linear_stiffness", "terms: [\n  inertia,   # mass\n  {term: linear_damping, value: 1},  # damper\n]\n"),
    ],
)
def test_an_entry_of_a_list_in_brackets_goes_with_its_line(name: str, wanted: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(
        "terms: [\n  inertia,   # mass\n  {term: linear_damping, value: 1},  # damper\n  linear_stiffness\n]\n"
    )
    drop_term(path, name)
    assert path.read_text() == wanted


def test_a_term_that_is_not_there_or_alone_is_not_taken_out(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("terms: [inertia]\n")
    for name in ("inertia", "hysteresis"):
        with pytest.raises(StudyError, match=f"rig.yaml: '{name}' cannot be taken out of inertia"):
            drop_term(path, name)
    assert path.read_text() == "terms: [inertia]\n"


def test_a_text_follows_a_model_that_lost_one_term_and_got_another() -> None:
    """A session may drop a term, add others and add it again: it then stands behind them."""
    text = "terms:\n  - inertia # m\n  - linear_damping # c\n  - linear_stiffness # k\n"
    model = model_file.parse_model(text, Path("rig.yaml"))
    lost = model.without_term("linear_damping").with_term(get("cubic_stiffness"))
    again = lost.with_term(get("linear_damping")).with_values({"k": 3.5})
    assert revised(text, "rig.yaml", again) == (
        "terms:\n  - inertia # m\n  - {term: linear_stiffness, value: 3.5} # k\n  - cubic_stiffness\n"
        "  - linear_damping\n"
    )


def test_a_layout_from_which_nothing_can_be_taken_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("terms: [inertia, cubic_stiffness]\n")
    monkeypatch.setattr(model_file.yaml_text, "without_entry", lambda text, *_: f"{text}!")
    with pytest.raises(StudyError, match=r"rig\.yaml: "):
        drop_term(path, "cubic_stiffness")
    assert path.read_text() == "terms: [inertia, cubic_stiffness]\n"
