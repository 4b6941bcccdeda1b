"""``study explore`` of several sensors and places: the session, its columns and words, and what is saved."""

import json
import re
import threading
from dataclasses import replace

import numpy as np
import pytest
from bokeh.document import Document

from study.compare import history
from study.compare.comparison import compare
from study.equations import model_file
from study.explore import PAGE
from study.explore import session as sessions
from study.explore.desk import Desk
from study.explore.live import Watcher
from study.explore.saved import files, saved
from study.explore.view import View
from study.faults.accounting import Accounted
from study.faults.fault import NOTHING_ASKED, FaultSettings
from study.records.prepared import prepare_record
from study.records.readers import read_record
from study.support.errors import StudyError
from study.way_in.compare_records import compare_records

CUBIC = "cubic_stiffness[floor2-floor3]"


@pytest.fixture(scope="module")
def begun(hall):
    model = model_file.read_model(hall / "frame.yaml")
    prepared = prepare_record(read_record(hall / "frame.csv", roles=model.roles))
    return sessions.begin_with(Accounted.as_compared(compare(model, prepared)))


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
    view = View(asked.now, 0)
    common, joints = view.of_record(asked), {"ground-floor1", "floor1-floor2", "floor2-floor3"}
    assert next(iter(view.places)) == "floor2-floor3"
    assert set(view.places) == joints | {"ground-floor2", "ground-floor3"}
    assert set(view.sensors) == set(common["sensors"]["name"])
    assert 0.0 in common["constancy"]["row"]
    groups = [common, *map(view.of_sensor, view.sensors), *map(view.of_place, view.places)]
    assert groups[1].keys() == groups[3].keys()
    for columns in groups:
        for name, source in columns.items():
            if not name.startswith("would"):  # the script asks for what is there
                assert len({len(c) for c in source.values()}) == 1, name
    for label in view.places:
        columns = view.of_place(label)
        assert len(columns["lacking"]["f"]) > 5
        said = dict(zip(columns["frame_place"]["model"], columns["frame_place"]["value"], strict=True))
        assert (said["none-stiffness"] == "") == (label in joints), label


def test_what_a_candidate_would_leave_is_shown_at_every_sensor_and_place(asked):
    """The cubic stiffness that is missing, at its joint and in the motions of all floors."""
    view, first = View(asked.now, 0), asked.now.diagnosis.candidates[0]
    for number, sensor in enumerate(view.sensors):
        columns, factor = view.of_sensor(sensor), view.focus(sensor, "floor2-floor3").difference.factor
        left = first.prediction.of(number).residual
        assert columns["would_time"]["0"] * factor == pytest.approx(left, rel=1e-4, abs=1e-9)
        assert np.std(columns["would_time"]["0"]) < 0.7 * np.std(columns["time"]["difference"])
    joint = view.of_place("floor2-floor3")
    with_it, without = (np.nanmax(np.abs(joint[a][b])) for a, b in (("would_u", "y0"), ("against_u", "mean")))
    assert with_it < 0.3 * without
    assert set(joint["would_plane"]) == {str(i) for i in range(len(asked.now.shown))}


def test_a_place_whose_motion_no_sensor_shows_says_so(hall):
    model = model_file.read_model(hall / "frame.yaml")
    record = read_record(hall / "frame.csv", roles=model.roles)
    blind = record.with_motions({s: x for s, x in record.motions.items() if s.coordinate != "floor2"})
    session = sessions.begin_with(Accounted.as_compared(compare(model, prepare_record(blind))))
    view = View(session.now, 0)
    assert view.sensors == ("floor1 displacement", "floor3 displacement")
    for label, place in view.places.items():
        columns = view.of_place(label)
        said = dict(zip(columns["frame_place"]["model"], columns["frame_place"]["value"], strict=True))
        seen = "floor2" not in place.moving
        assert ("No sensor shows this motion" in said["none-plane"]) == (not seen), label
    assert len(saved(session)) > 1e5


def test_faults_of_the_measurement_are_corrected_and_said_or_left_alone(hall):
    """A sensor that is read two samples late."""
    model = model_file.read_model(hall / "frame.yaml")
    record = read_record(hall / "frame.csv", roles=model.roles)
    late = {s: np.roll(x, 2) if s.coordinate == "floor2" else x for s, x in record.motions.items()}
    faulty = record.with_motions(late).part(10, len(record))
    notes: list[str] = []
    for settings in (FaultSettings(), NOTHING_ASKED):
        session = sessions.begin_with(compare_records([faulty], model, settings=settings))
        said = View(session.now, 0).of_record(session)["words"]
        notes.append(dict(zip(*said.values(), strict=True))["notes"])
    assert "floor2" in notes[0]
    assert "late" in notes[0]
    assert "late" not in notes[1]


def test_the_dynamic_stiffness_of_a_joint_is_its_stiffness(grown):
    """Of the right model, in the band that the shaker moves."""
    columns = View(grown.now, 1).of_place("floor1-floor2")["stiffness"]
    inside = (columns["f"] > 3.0) & (columns["f"] < 7.0)
    model, measured = (np.asarray(columns[n])[inside] for n in ("model", "measured"))
    assert np.all(model == model[0])
    assert np.median(measured) == pytest.approx(model[0], rel=0.15)


def test_words_name_effect_and_place_and_only_a_live_page_has_buttons(asked):
    live, still = (
        dict(zip(*View(asked.now, 0, live=on).of_record(asked)["words"].values(), strict=True)) for on in (True, False)
    )
    first = re.search(r"<li class='candidate' data-candidate='0' data-row='([^']+)' data-at='([^']+)'",
                      live["candidates"])  # fmt: skip
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
    assert model_file.read_model(tmp_path / "frame.yaml").starts == pytest.approx(grown.now.values, rel=1e-9)
    assert json.loads(made["frame.history.json"])["steps"][1]["added"] == CUBIC
    assert b"http://" not in re.sub(rb"http://www\.w3\.org[^\"' ]*", b"", made[PAGE][:4000])
    assert made[PAGE] == files(grown, "frame.yaml", (hall / "frame.yaml").read_text(), values=True)[PAGE]


def test_several_records_of_a_structure_are_shown_one_by_one(hall):
    """One model is fitted to both parts of the record."""
    model = model_file.read_model(hall / "frame.yaml")
    whole = read_record(hall / "frame.csv", roles=model.roles)
    parts = [replace(whole.part(*span), name=name) for name, span in (("first", (0, 800)), ("then", (800, 1600)))]
    session = sessions.begin_with(compare_records(parts, model))
    assert [c.record.name for c in session.now.on_each] == ["first", "then"]
    for number, name in enumerate(("first", "then")):
        view = View(session.now, 0, record=number)
        common, sensor = view.of_record(session), view.of_sensor(view.sensors[0])
        said = dict(zip(*common["words"].values(), strict=True))
        assert said["of-record"] == f"of {name}"
        assert said["records"].count("data-act='record'") == 2
        judged = session.now.on_each[number].prediction
        assert sensor["time"]["t"][0] == pytest.approx(judged.time[0], abs=1e-3)
        assert common["sensors"]["error"] == pytest.approx(100.0 * judged.errors, rel=1e-5)
        assert "data-place='floor2-floor3'" in said["places"]
    page = saved(session).decode()
    stored = set(re.findall(r"\w+@\d\.\d[.\w -]*", page))
    assert {"words@0.0", "words@0.1", "plane@0.1.place.floor2-floor3"} <= stored
    assert "time@0.1.sensor.floor1 displacement" in stored


def test_the_live_page_turns_to_the_sensor_and_the_place_that_are_asked_for(grown, hall, tmp_path):
    desk = Desk(grown, hall / "frame.yaml", (hall / "frame.yaml").read_text(), tmp_path / "out")
    watcher = Watcher(desk)
    watcher.lay(Document())
    page, seen = watcher.scene.page, [("", "", "")]
    for count, (what, name) in enumerate((("place", "floor1-floor2"), ("sensor", "floor3 displacement"),
                                          ("place", "floor9"), ("sensor", "floor9 displacement"))):  # fmt: skip
        watcher.asked.data = {"act": [what], "name": [name], "count": [count]}
        turned = page.sources["turned"].data
        seen.append((*turned["sensor"], *turned["place"]))
    assert seen[2:] == [("floor3 displacement", "floor1-floor2")] * 3
    view = View(grown.now, 1)
    for source, expected in (
        ("time", view.of_sensor("floor3 displacement")), ("plane", view.of_place("floor1-floor2"))
    ):  # fmt: skip
        for name, column in expected[source].items():
            assert np.array_equal(page.sources[source].data[name], column, equal_nan=True), (source, name)
    watcher.scene.show(sessions.undone(grown))
    assert page.sources["turned"].data["place"] == ["floor1-floor2"]
    desk.close()


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
