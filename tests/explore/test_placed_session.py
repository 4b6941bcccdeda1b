"""``study explore`` of a structure without a browser: the session, its columns and words, and what is saved."""

import json
import re
import threading
from dataclasses import replace

import numpy as np
import pytest

from study.compare import history
from study.compare.comparison import compare
from study.equations import model_file
from study.explore import session as sessions
from study.explore.desk import Desk
from study.explore.html_page import seen_of
from study.explore.placed_view import placed_view
from study.explore.saved import saved
from study.explore.saved_files import PAGE, files
from study.records.prepared import prepare_record
from study.records.readers import read_record
from study.support.errors import StudyError
from study.way_in.compare_records import compare_records

CUBIC = "cubic_stiffness[floor2-floor3]"


@pytest.fixture(scope="module")
def begun(hall):
    model = model_file.read_model(hall / "frame.yaml")
    prepared = prepare_record(read_record(hall / "frame.csv", roles=model.roles))
    return sessions.begin_with(compare(model, prepared))


@pytest.fixture(scope="module")
def asked(begun):
    return sessions.with_stage(begun, sessions.examined(begun)[0])


@pytest.fixture(scope="module")
def grown(asked):
    return sessions.with_added(asked, CUBIC)


@pytest.mark.long
def test_what_is_added_where_it_is_missing_lets_the_error_fall_and_undo_brings_it_back(asked, grown):
    before, after = asked.now.comparison.prediction, grown.now.comparison.prediction
    assert asked.now.diagnosis.candidates[0].name == CUBIC
    assert after.error == pytest.approx(after.floor, rel=0.1)
    assert after.error < 0.7 * before.error
    assert [s["added"] for s in grown.steps] == [None, CUBIC]
    assert sessions.undone(grown).stages == asked.stages
    assert sessions.undone(asked) is asked
    with pytest.raises(StudyError, match="no candidate of the present model"):
        sessions.with_added(grown, CUBIC)


def test_a_term_at_a_place_is_dropped_and_a_value_held(begun, grown):
    after = sessions.dropped(grown, CUBIC)
    assert after.now.model == begun.now.model
    error = begun.now.comparison.prediction.error
    assert after.now.comparison.prediction.error == pytest.approx(error, rel=1e-3)
    assert [history.label(s) for s in after.steps] == ["as given", f"+ {CUBIC}", f"- {CUBIC}"]
    held = sessions.with_held(grown, "m[floor1]", True)
    assert held.now.model.values["m[floor1]"] == grown.now.values["m[floor1]"]
    for change, said in (
        (lambda: sessions.dropped(begun, "hysteresis"), "not in the model"),
        (lambda: sessions.with_held(held, "m[floor1]", True), "held already"),
        (lambda: sessions.with_held(held, "m[floor9]", True), "no value of this model"),
        (lambda: sessions.tried(begun, "__import__('os')"), "__import__"),
        (lambda: sessions.tried(begun, "inertia=u**3"), "belongs to the library"),
        (lambda: sessions.tried(begun, "u*wind"), "uses the name 'wind'"),
    ):
        with pytest.raises(StudyError, match=said):
            change()
    assert [t.name for t in sessions.tried(sessions.tried(begun, "u*abs(u)"), "v*u").own] == ["own_1", "own_2"]


def test_every_place_and_sensor_has_its_rows_and_each_source_columns_of_one_length(asked):
    seen = placed_view(asked.now, 0)
    for name, columns in seen.columns.items():
        assert len({len(c) for c in columns.values()}) == 1, name
    places = {link.place.label for link in seen.drawn.links}
    assert set(seen.columns["all_map"]["of"]) <= places
    assert "floor2-floor3" in set(seen.columns["all_map"]["of"]) & set(seen.columns["all_force"]["of"])
    assert {"ground-floor1", "floor1-floor2", "floor2-floor3"} <= set(seen.columns["all_stiffness"]["of"])
    assert set(seen.columns["all_motion"]["of"]) == set(seen.columns["sensors"]["name"])
    assert CUBIC in seen.columns["all_constancy"]["of"]


def test_the_dynamic_stiffness_of_a_joint_is_its_stiffness(grown):
    """Of the right model, in the band that the shaker moves."""
    columns = placed_view(grown.now, 1).columns["all_stiffness"]
    at = np.array([of == "floor1-floor2" for of in columns["of"]])
    inside = at & (np.asarray(columns["f"]) > 3.0) & (np.asarray(columns["f"]) < 7.0)
    model, measured = (np.asarray(columns[n])[inside] for n in ("model", "measured"))
    assert np.all(model == model[0])
    assert np.median(measured) == pytest.approx(model[0], rel=0.15)


def test_words_name_effect_and_place_and_only_a_live_page_has_buttons(asked):
    live, still = (dict(zip(*placed_view(asked.now, 0, live=on).columns["words"].values(), strict=True))
                   for on in (True, False))  # fmt: skip
    first = re.search(r"<li class='candidate' data-row='([^']+)' data-at='([^']+)'", live["candidates"])
    assert first is not None
    assert first.groups() == (CUBIC, "floor2-floor3")
    assert f"data-act='add' data-name='{CUBIC}'" in live["candidates"]
    assert "data-act" not in "".join(still.values())
    assert "missing between floor2 and floor3" in live["verdict"]
    assert 'class="link selected" data-place="floor2-floor3"' in live["sketch"]


@pytest.mark.long
def test_what_is_saved_holds_model_history_tables_pictures_and_the_page(hall, grown, tmp_path):
    made = files(grown, "frame.yaml", (hall / "frame.yaml").read_text(), values=True)
    assert {"frame.yaml", "frame.history.json", "comparison.json", PAGE, "structure.png", "history.png"} <= set(made)
    assert made["frame.yaml"].startswith(b"# hall 3\n")
    (tmp_path / "frame.yaml").write_bytes(made["frame.yaml"])
    assert model_file.read_model(tmp_path / "frame.yaml").values == pytest.approx(grown.now.values, rel=1e-9)
    assert json.loads(made["frame.history.json"])["steps"][1]["added"] == CUBIC
    assert b"http://" not in re.sub(rb"http://www\.w3\.org[^\"' ]*", b"", made[PAGE][:4000])
    assert made[PAGE] == files(grown, "frame.yaml", (hall / "frame.yaml").read_text(), values=True)[PAGE]


def test_several_records_of_a_structure_are_shown_one_by_one(hall):
    """One model is fitted to both parts of the record."""
    model = model_file.read_model(hall / "frame.yaml")
    whole = read_record(hall / "frame.csv", roles=model.roles)
    parts = [replace(whole.part(*span), name=name) for name, span in (("first", (0, 800)), ("then", (800, 1600)))]
    session = sessions.begin_with(compare_records(parts, model).comparison)
    assert [c.record.name for c in session.now.on_each] == ["first", "then"]
    for number, name in enumerate(("first", "then")):
        seen = seen_of(session.now, 0, record=number)
        said = dict(zip(*seen.columns["words"].values(), strict=True))
        assert said["of-record"] == f"of {name}"
        assert said["records"].count("data-act='record'") == 2
        judged = session.now.on_each[number].prediction
        assert seen.columns["all_motion"]["t"][0] == pytest.approx(judged.time[0], abs=1e-3)
        assert seen.columns["sensors"]["error"] == pytest.approx(100.0 * judged.errors, rel=1e-5)
        assert "data-place='floor2-floor3'" in said["places"]
    page = saved(session).decode()
    assert {"words@0.0", "words@0.1", "all_map@0.1"} <= set(re.findall(r"\w+@\d\.\d", page))


@pytest.mark.long
def test_the_desk_takes_a_structure_as_it_takes_one_coordinate(asked, hall, tmp_path):
    desk = Desk(asked, hall / "frame.yaml", (hall / "frame.yaml").read_text(), tmp_path / "out")
    done = threading.Event()
    desk.watch(desk, lambda: None if desk.state.busy else done.set())

    def wait(action, name):
        done.clear()
        desk.ask(action, name)
        assert done.wait(120.0)

    wait("add", "no_such_thing")
    assert "no candidate" in desk.state.notice
    wait("add", CUBIC)
    assert desk.session.now.label == f"+ {CUBIC}"
    wait("save", "open")
    assert (tmp_path / "out" / PAGE).exists()
    desk.close()
