"""The gallery from what climbs leave: what is left is said as it is, and nothing is fetched from anywhere."""

import json
import math
import re
from pathlib import Path

import pytest

from study.commands import measurements
from study.gallery import gallery_page
from study.gallery.gallery_page import Published, found_beside, read_findings
from study.support import document
from study.support.errors import StudyError

ROOT = Path(__file__).parents[2]
PNG = bytes.fromhex("89504e470d0a1a0a") + b"picture"


def step(error, added=None, **values):
    rows = [{"key": k, "value": v, "interval": [v - 1.0, v + 1.0], "unit": "N"} for k, v in values.items()]
    return {
        "terms": ["linear_damping"], "record": "run", "added": added, "dropped": None, "rms": 10.0 * error,
        "unit": "N", "error": {"response": error, "force": None}, "noise_floor": {"response": 0.02},
        "coefficients": rows,
    }  # fmt: skip


def diagnosis(verdict, **more):
    candidate = {
        "term": "dry_friction", "explained": 0.9, "response_error": 0.1, "tied_with": ["dead_band"],
        "changes": {"frequency": 0.3, "amplitude": 0.1},
    }  # fmt: skip
    return {"verdict": verdict, "says": f"says <{verdict}>", "left": 0.05, "candidates": [candidate]} | more


@pytest.fixture
def folder(tmp_path):
    def write(path, content):
        target = tmp_path / "run" / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(json.dumps(content))

    write("history.json", {"steps": [step(0.5, c=2.0), step(0.1, "hysteresis", c=1.0, kz=60.0, beta=20.0)]})
    write("climb/step_0/diagnosis.json", diagnosis("missing_effect"))
    write("climb/step_1/diagnosis.json", diagnosis("unknown_effect"))
    decay = {
        "frequency": [42.0, 40.0, 37.0, 36.8], "frequency_error": [0.1] * 4,
        "damping": [0.004, 0.008, 0.01, 0.002], "damping_error": [0.0001, 0.0001, 0.02, 0.001],
    }  # fmt: skip
    stiffness = {"coefficient": "k", "at": [1.0, 3.0], "value": [500.0, 1100.0], "error": [40.0, 40.0]}
    reached = {"model": {"equation": "c [v] = F"}, "decay": {"measured": decay}, "varying": [stiffness]}
    write("climb/comparison.json", reached)
    (tmp_path / "run" / "climb" / "loops.png").write_bytes(PNG)
    return tmp_path / "run"


def published(key, step="reached", value=50.0):
    return Published(record="run", step=step, key=key, quantity="q", unit="N", value=value, within="near")


def said(folder):
    return document.markdown(gallery_page.of_record(read_findings(folder, "run"), named=True))


def test_what_is_left_is_no_noise_where_the_last_verdict_says_so(folder):
    text = said(folder)
    assert "**What is found.** says <missing_effect>" in text
    assert re.search(r"\+ hysteresis +\| 10 %", text)
    assert "10 % of the response (noise floor 2 %). General functions of the motion explain a part of it" in text
    (folder / "climb/step_1/diagnosis.json").write_text(json.dumps(diagnosis("nothing_missing")))
    assert "noise, as far as this record shows" in said(folder)
    (folder / "climb/step_1/diagnosis.json").write_text(json.dumps(diagnosis("missing_effect")))
    assert "still names dry friction, which the record cannot tell from dead band," in said(folder)
    (folder / "climb/step_1/diagnosis.json").write_text(json.dumps(diagnosis("nothing_missing")))
    (folder / "history.json").write_text(json.dumps({"steps": [step(1.2, c=2.0)]}))
    assert "more than the response itself" in said(folder), "whatever the verdict says"


def test_a_candidate_of_a_structure_has_a_place(folder):
    tied = [{"term": "dead_band", "at": "pitch"}]
    placed = {
        "term": "stop",
        "between": ["ground", "pitch"],
        "explained": 0.9,
        "response_error": 0.1,
        "tied_with": tied,
    }
    (folder / "climb/step_0/diagnosis.json").write_text(
        json.dumps(diagnosis("missing_effect", candidates=[placed | {"tied_with": tied}]))
    )
    text = document.markdown([gallery_page.candidates(read_findings(folder, "run"))])
    assert "stop between ground and pitch" in text
    assert "dead band at pitch" in text


def test_the_last_of_ten_diagnoses_counts(folder):
    """Folders are ordered by number, not by letter."""
    for number in range(2, 11):
        target = folder / f"climb/step_{number}/diagnosis.json"
        target.parent.mkdir()
        target.write_text(json.dumps(diagnosis("nothing_missing" if number == 10 else "unknown_effect")))
    assert read_findings(folder, "run").last["verdict"] == "nothing_missing"


@pytest.mark.parametrize(
    ("key", "at", "found"),
    [
        ("c", "given", 2.0), ("c", "reached", 1.0), ("kz/beta", "reached", 3.0), ("k", "reached", None),
        ("kz/k", "reached", None), ("frequency.loudest", "reached", 42.0), ("damping.largest", "reached", 0.008),
        ("frequency.quiet", "reached", 36.9),
    ],
)  # fmt: skip
def test_values_beside_those_published(folder, key, at, found):
    value = found_beside(published(key, at), read_findings(folder, "run")).found
    assert value == (None if found is None else pytest.approx(found))


def test_the_frequency_follows_what_the_stiffness_varies_with(folder):
    steps = {"steps": [step(0.5, m=2.0), step(0.1, "linear_stiffness_over_pin", m=2.0, k=500.0)]}
    (folder / "history.json").write_text(json.dumps(steps))
    row = found_beside(published("frequency.at 2"), read_findings(folder, "run"))
    assert row.found == pytest.approx((800.0 / 2.0) ** 0.5 / (2.0 * math.pi))
    assert row.interval == pytest.approx([((800.0 + d * 78.4) / 2.0) ** 0.5 / (2.0 * math.pi) for d in (-1, 1)])


def test_a_row_says_by_how_much_a_value_differs(folder):
    row = found_beside(published("kz", value=50.0), read_findings(folder, "run"))
    table = gallery_page.beside_each_other([row, found_beside(published("k"), read_findings(folder, "run"))])
    text = document.markdown([table])
    assert "+20.0 %" in text
    assert "59 to 61" in text
    assert "not in the model" in text


def test_the_page_holds_its_pictures_and_asks_for_nothing(folder):
    row = gallery_page.Literature(entry="damper", title="A <damper>", test="A test", source="Others", known="Much")
    entry = gallery_page.Entry(row, (read_findings(folder, "run"),), ())
    page = gallery_page.gallery_page([entry]).decode()
    assert page.count("data:image/png;base64,") == 1
    assert "A &lt;damper&gt;" in page
    assert not re.search(r'(src|href)="(?!#|data:)', page)
    assert gallery_page.kept(entry.found[0]) == ["climb/loops.png"]


def test_without_results_one_sentence(tmp_path):
    (tmp_path / "history.json").write_text('{"steps": []}')
    with pytest.raises(StudyError, match="holds no diagnosis; expected what 'snakemake run_climb' leaves there"):
        read_findings(tmp_path, "run")


def test_every_entry_has_its_literature_and_every_value_its_record():
    rows = measurements.load_measurements(ROOT / "config")
    assert list(gallery_page.literature(ROOT / "config")) == list(dict.fromkeys(row.entry for row in rows.values()))
    assert {value.record for value in gallery_page.published(ROOT / "config")} <= set(rows)
