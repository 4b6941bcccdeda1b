"""The sketch of a structure, its pictures, its page; a term dropped at its place."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.cli import main
from study.equations.model_file import format_model, parse_model, read_model
from study.figures.sketch import GROUND_AT, sketch
from study.records.record import write_csv

TREE = """
name: tree
coordinates: [a, b, c]
forces: {shaker: b}
terms:
  - {term: inertia, at: a}
  - {term: inertia, at: b}
  - {term: inertia, at: c}
  - {term: inertia, couples: [a, b]}
  - {term: linear_stiffness, between: [ground, a]}
  - {term: linear_stiffness, between: [a, c]}
"""


@pytest.fixture(scope="module")
def given(tmp_path_factory, record_of, believed, frame):
    """A short record, and models without and with the hardening joint."""
    folder = tmp_path_factory.mktemp("pictures")
    record = record_of()
    short = replace(record.part(0, 2400), name="short")
    write_csv(short, folder / "short.csv")
    (folder / "frame.yaml").write_text(format_model(believed))
    full = frame.with_values(dict.fromkeys(frame.values, None))
    (folder / "full.yaml").write_text(format_model(full))
    return folder


@pytest.fixture(scope="module")
def compared(given):
    assert (
        main(["compare", str(given / "short.csv"), "--model", str(given / "frame.yaml"), "--out", str(given / "c")])
        == 0
    )
    return given / "c"


def test_the_sketch_has_a_line_for_every_connection():
    model = parse_model(TREE, Path("tree.yaml"))
    drawn = sketch(model, ("a", "c"), {frozenset(("a", "c")): 0.7})
    by_path = {link.place.path: link for link in drawn.links}
    assert set(by_path) == {frozenset(p) for p in (("ground", "a"), ("ground", "b"), ("ground", "c"), "ac", "ab")}
    assert by_path[frozenset("ac")].share == 0.7
    assert [link.share for path, link in by_path.items() if path != frozenset("ac")] == [0.0] * 4
    assert [box.measured for box in drawn.boxes] == [True, False, True]
    assert [box.forces for box in drawn.boxes] == [(), ("shaker",), ()]
    tied = {path for path, link in by_path.items() if link.tied}
    assert tied == {frozenset(("ground", "a")), frozenset("ac"), frozenset("ab")}
    assert by_path[frozenset("ab")].place.kind == "couples"
    arc, down = by_path[frozenset("ac")], by_path[frozenset(("ground", "b"))]
    assert arc.middle[1] > 0.5  # above the box between its ends
    assert down.end == (drawn.boxes[1].x, GROUND_AT)
    assert drawn.bottom < GROUND_AT < arc.middle[1] < drawn.top


def test_compare_draws_every_picture_and_the_page(compared):
    wanted = {"structure", "sensors", "response", "shared_force", "modes", "restoring_forces"}
    wanted |= {"missing_force", "error_in_time", "force_error"}
    assert {p.stem for p in compared.glob("*.png")} == wanted == {p.stem for p in compared.glob("*.svg")}
    where = json.loads((compared / "comparison.json").read_text())["where"]
    assert set(where["maps"]) == {
        "ground-floor1", "floor1-floor2", "floor2-floor3", "ground-floor2", "ground-floor3",
    }  # fmt: skip
    assert np.array(where["shared_force"]).shape == (3, 3)
    best = max(where["places"], key=lambda place: place["explained"])
    assert best["between"] == ["floor2", "floor3"]
    assert 0.05 < best["explained"] < best["share"] < 1.0


def blocks(text: str) -> dict[str, str]:
    """What the page says of each place, as it stands there before a script runs."""
    body = text[text.rindex("</style>") : text.index("<script>")]
    return dict(re.findall(r"<div class='about' data-place='([^']+)'[^>]*>(.*?)</div>", body, re.DOTALL))


def test_the_page_needs_no_network_and_has_a_block_for_every_line(compared):
    text = (compared / "explore.html").read_text()
    body = text[text.rindex("</style>") : text.index("<script>")]
    assert "http" not in body
    assert not re.findall("<(?:img|link|iframe|script)[^>]+src=", body)
    lines = re.findall(r'<g class="link[^"]*" data-place="([^"]+)"', body)
    assert lines == list(blocks(text))
    assert len(set(lines)) == 5
    assert re.findall(r'<g class="link selected" data-place="([^"]+)"', body) == ["floor2-floor3"]
    for said in blocks(text).values():
        assert "The model has" in said
        assert "general functions of its own motion explain" in said


def test_a_term_is_dropped_at_its_place(given, capsys):
    model = given / "full.yaml"
    command = ["drop", str(model), "cubic_stiffness", "--data", str(given / "short.csv"), "--out", str(given / "d")]
    assert main([*command, "--between", "floor3", "floor2"]) == 0
    assert "cubic_stiffness[floor2-floor3]" not in read_model(model)
    steps = json.loads((given / "full.history.json").read_text())["steps"]
    assert [s.get("dropped") for s in steps] == [None, "cubic_stiffness[floor2-floor3]"]
    assert steps[1]["error"]["response"] > 1.3 * steps[0]["error"]["response"]
    capsys.readouterr()
    assert main(["history", str(model)]) == 0
    assert "3 inertia, 3 linear_stiffness, 3 linear_damping, cubic_stiffness[floor2-floor3]" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["cubic_stiffness"], "'cubic_stiffness' is not in the model"),
        (["linear_stiffness"], "at several places"),
        (["linear_stiffness", "--between", "floor1", "floor3"], "'linear_stiffness floor1-floor3' is not in the model"),
        (["linear_stiffness", "--between", "floor1", "roof"], "no coordinate of the model"),
        (["inertia", "--at", "floor2"], "'floor2' has no inertia"),
    ],
)
def test_what_cannot_be_dropped_gets_its_sentence(given, capsys, words, said):
    before = (given / "frame.yaml").read_bytes()
    assert main(["drop", str(given / "frame.yaml"), *words, "--data", str(given / "short.csv")]) == 2
    assert said in capsys.readouterr().err
    assert (given / "frame.yaml").read_bytes() == before


@pytest.mark.long
def test_diagnose_writes_a_page_that_needs_no_server(given):
    command = ["diagnose", str(given / "short.csv"), "--model", str(given / "frame.yaml")]
    assert main([*command, "--fit", "0:700", "--judge", "700:1400", "--out", str(given / "e")]) == 0
    text = (given / "e" / "explore.html").read_text()
    assert re.search(r"Tried there: .*cubic stiffness \(\d", blocks(text)["floor2-floor3"])
    assert "An effect is missing" in text
    row = re.search(
        r"<li class='candidate' data-candidate='0' data-row='cubic_stiffness\[floor2-floor3\]'.*?</li>", text, re.DOTALL
    )
    assert row is not None
    assert "N/m³" in row[0]
