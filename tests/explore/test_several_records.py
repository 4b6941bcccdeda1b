"""Several records in a session: one model on all, a record at a time in the panels, coefficients of each by itself."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from bokeh.document import Document

from study.compare import panels
from study.compare.comparison import across_records, compare, on_each_record
from study.compare.each_record import separated
from study.compare.prediction import predict
from study.diagnose import confirmed_faults
from study.diagnose.force_between import diagnose_as_read
from study.equations import model_file
from study.equations.model import Model, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY, get
from study.explore import decimate
from study.explore import session as sessions
from study.explore.desk import Desk
from study.explore.live import Watcher
from study.explore.saved import files, saved
from study.explore.session import Several, by_record, of_own
from study.explore.view import View
from study.records.excitation import Excitation, force
from study.records.record import ALONE, MOTIONS, Record, Sensor
from study.way_in.compare_records import compare_records

NAMES = ("low", "high")
LEVELS = (0.1, 1.0)
BELIEVED = Model("rig", tuple(free(get(n)) for n in ("inertia", "linear_damping", "linear_stiffness")))
TRUTH = BELIEVED.with_term(get("cubic_stiffness")).with_values({"m": 1.0, "c": 3.77, "k": 355.3, "k3": 2e7})


@pytest.fixture(scope="module")
def records() -> list[Record]:
    """Two levels of one hardening rig, with noise on the displacement."""
    made: list[Record] = []
    for seed, (name, level) in enumerate(zip(NAMES, LEVELS, strict=True)):
        history = force(Excitation(level=level, cutoff=12.5), 2048, 0.02, seed)
        record = simulate(TRUTH, history, 0.02, Integrator(steps_per_sample=8))
        u = record["displacement"]
        noisy = u + 0.005 * np.std(u) * np.random.default_rng(seed).standard_normal(len(u))
        channels = {"force": record["force"], "displacement": noisy}
        made.append(replace(record, name=name, channels=channels))
    return made


@pytest.fixture(scope="module")
def begun(records: list[Record]) -> sessions.Session:
    own = [compare_records([record], BELIEVED).comparison for record in records]
    several = Several(tuple(c.prepared for c in own), tuple(records))
    return sessions.begin_with(compare_records(records, BELIEVED), several=several, known=of_own(own))


@pytest.fixture(scope="module")
def grown(begun: sessions.Session) -> sessions.Session:
    few = partial(diagnose_as_read, without=[n for n in LIBRARY if n not in ("cubic_stiffness", "quadratic_damping")])
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(confirmed_faults, "diagnose_as_read", few)
        asked = sessions.with_stage(begun, sessions.examined(begun)[0])
    return sessions.by_itself(sessions.with_added(asked, "cubic_stiffness"))


def test_each_record_shows_its_part_of_the_one_free_run(begun):
    together, each = begun.now.comparison, begun.now.on_each
    assert [c.record.name for c in each] == list(NAMES)
    assert together.record.name == "low, high"
    left = [c.prediction.residual for c in each]
    assert np.array_equal(np.concatenate(left), together.prediction.residual)
    for comparison in each:
        again = predict(comparison.fit, comparison.prepared)
        assert comparison.prediction.predicted == pytest.approx(again.predicted, abs=1e-6 * again.of(0).size)
        motion, anew = (p.motions([Sensor(ALONE, m) for m in MOTIONS]) for p in (comparison.prediction, again))
        assert motion == pytest.approx(anew, rel=1e-4, abs=1e-4 * np.std(anew[:, 2]))
        assert comparison.coefficients == together.coefficients
        assert np.all(np.diff(comparison.prediction.time) > 0.0)
    assert on_each_record(each[0]) == on_each_record(compare(BELIEVED, begun.several.apart[0])) == ()


def test_coefficients_of_their_own_are_those_that_compare_shows(begun, grown):
    own = [compare(BELIEVED, prepared) for prepared in begun.several.apart]
    for shown, expected in zip(begun.now.by_record.levels, across_records(own), strict=True):
        assert shown.value == pytest.approx(expected.value, rel=1e-6)
    assert [level.key for level in begun.now.by_record.levels if level.moves] != []
    assert [level.key for level in grown.now.by_record.levels if level.moves] == []
    assert "cubic_stiffness" in [t.name for t in grown.now.model.terms]
    for comparison, alone in zip(grown.now.on_each, grown.now.by_record.errors, strict=True):
        assert comparison.prediction.error == pytest.approx(alone, rel=0.3)
    for comparison, alone in zip(begun.now.on_each, begun.now.by_record.errors, strict=True):
        assert comparison.prediction.error > 10.0 * comparison.prediction.floor or alone > 0.05


def test_what_a_candidate_would_leave_is_shown_record_by_record(grown):
    stage = grown.stages[0]
    first = stage.diagnosis.candidates[0]
    begin = 0
    for number, name in enumerate(NAMES):
        seen = sessions.on_record(stage, number)
        row = seen.diagnosis.candidates[0]
        end = begin + len(row.residual)
        assert np.array_equal(row.residual, first.residual[begin:end])
        view = View(stage, 0, record=number)
        columns, said = view.of_sensor("displacement"), view.of_record(grown)["words"]
        scale = view.focus("displacement", "").difference.factor
        drawn = columns["would_time"]["0"]
        assert len(drawn) == len(columns["time"]["t"])
        assert drawn[np.isfinite(drawn)] * scale == pytest.approx(row.residual, rel=1e-4, abs=1e-9)
        assert dict(zip(*said.values(), strict=True))["of-record"] == f"of {name}"
        begin = end
    assert begin == len(first.residual)


def test_a_line_breaks_where_time_is_left_out():
    time = np.concatenate([np.arange(50.0), np.arange(80.0, 120.0)])
    for buckets in (1200, 20):
        shown = decimate.times(time, buckets)
        places = decimate.gaps(time, shown, 1.0)
        assert len(places) == 1
        values = decimate.broken(decimate.extremes(time, buckets), places)
        assert np.count_nonzero(np.isnan(values)) == 1
        gap = int(np.flatnonzero(np.isnan(values))[0])
        assert np.nanmax(values[:gap]) < 51.0 + 40.0 * (buckets == 20)
        assert np.nanmin(values[gap:]) > 60.0
    assert len(decimate.gaps(np.arange(9.0), np.arange(9.0), 1.0)) == 0
    drawn = panels.with_breaks(time, time)
    assert np.flatnonzero(np.isnan(drawn[1])).tolist() == [50]
    assert np.all(np.isfinite(drawn[0]))


DRAWN = (
    "study.compare.comparison_pictures.comparison_pictures", "study.compare.comparison_pictures.level_pictures",
    "study.compare.history_picture.history_files",
)  # fmt: skip


def test_a_close_up_shows_one_stretch_of_time(begun):
    for comparison in begun.now.on_each:
        judged = comparison.prediction.of(0)
        assert np.any(np.diff(judged.time) > 1.5 * judged.dt)
        assert np.all(np.diff(judged.time[judged.closeup]) < 1.5 * judged.dt)
        assert len(judged.time[judged.closeup]) >= 16


def test_the_saved_page_and_the_tables_hold_every_record(grown, monkeypatch):
    for drawn in (*DRAWN, "study.explore.saved.diagnosis_files"):  # by tests of their own
        monkeypatch.setattr(drawn, lambda *_: {"response.png": b""})
    contents = files(grown, "rig.yaml", model_file.format_model(BELIEVED))
    assert {"low_response.png", "high_response.png", "coefficients_by_level.csv"} <= set(contents)
    assert contents["comparison.csv"].decode().count("\n") == 1 + len(NAMES)
    text = contents["explore.html"].decode()
    assert text == saved(grown).decode()
    assert {f"time@{step}.{record}.sensor" for step in (0, 1) for record in (0, 1)} <= set(
        re.findall(r"time@\d\.\d\.sensor", text)
    )
    said = [View(stage, 0).of_record(grown)["words"] for stage in grown.stages]
    names = [dict(zip(*fragments.values(), strict=True))["records"] for fragments in said]
    assert [re.findall(r"data-name='(\d)' aria-pressed='true'", fragment) for fragment in names] == [["0"], ["0"]]


def test_a_page_that_was_made_ahead_of_its_visit_shows_what_was_done_since(grown, tmp_path):
    desk = Desk(sessions.undone(grown), tmp_path / "rig.yaml", model_file.format_model(BELIEVED), tmp_path / "out")
    watcher, document = Watcher(desk), Document()
    desk.session = grown
    watcher.lay(document)
    said, known = document.template_variables["said"], View(grown.now, 1).of_record(grown)["words"]
    assert said["figures"] == dict(zip(*known.values(), strict=True))["figures"]
    assert len(document.template_variables["steps"]) == 2
    assert watcher.state.data["undo"] == [True]
    desk.close()


def test_the_live_page_turns_to_the_record_that_is_asked_for(grown, tmp_path):
    desk = Desk(grown, tmp_path / "rig.yaml", model_file.format_model(BELIEVED), tmp_path / "out")
    watcher = Watcher(desk)
    watcher.lay(Document())
    scene = watcher.scene
    for place, name in ((1, "high"), (0, "low")):
        watcher.asked.data = {"act": ["record"], "name": [str(place)], "count": [place]}
        source = scene.page.sources["words"].data
        assert dict(zip(*source.values(), strict=True))["of-record"] == f"of {name}"
        time = scene.page.sources["time"].data["t"]
        assert time[0] == pytest.approx(grown.now.on_each[place].prediction.time[0])
    for wrong in ("2", "-1", "low", ""):
        watcher.asked.data = {"act": ["record"], "name": [wrong], "count": [9]}
        assert scene.record == 0
    desk.close()


@pytest.mark.long
def test_the_saved_page_turns_to_a_record_and_a_step(grown, tmp_path, page):
    (tmp_path / "page.html").write_bytes(saved(grown))
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto((tmp_path / "page.html").as_uri())
    page.wait_for_function("window.study && window.study.ready")
    for step, number, name in ((1, 1, "high"), (0, 1, "high"), (0, 0, "low")):
        page.click(f"[data-act=step][data-name='{step}']")
        page.click(f"[data-act=record][data-name='{number}']")
        assert page.inner_text("#of-record") == f"of {name}"
        shown = float(page.inner_text("#figure-error b").removesuffix("%"))
        error = 100.0 * grown.stages[step].on_each[number].prediction.error
        assert shown == pytest.approx(error, rel=0.01)
        ends = page.evaluate("(r => [r.start, r.end])(Bokeh.documents[0].get_model_by_name('range_time'))")
        assert ends == pytest.approx(grown.now.on_each[number].prediction.time[[0, -1]], rel=1e-5)
    assert not wrong
    assert len(re.findall(rb"/Type /Page\b", page.pdf(format="A4", prefer_css_page_size=True))) == 1
    page.emulate_media(media="print")
    assert all(page.is_visible(f"[data-act=record][data-name='{number}']") for number in (0, 1)), "names are there"


def test_a_coefficient_may_differ_within_the_one_fit(records, monkeypatch):
    model, marked, separate = separated(BELIEVED, records, ["linear_stiffness"])
    together = compare_records(marked, model)
    several = Several((), tuple(records), separate)
    session = sessions.begin_with(together, several=several, known=by_record(several, together.comparison))
    (level,) = session.now.by_record.levels
    assert (level.key, session.now.by_record.names) == ("k", NAMES)
    assert level.moves
    for drawn in DRAWN:
        monkeypatch.setattr(drawn, lambda *_: {})
    text = model_file.format_model(BELIEVED)
    for values in (True, False):
        written = files(session, "rig.yaml", text, values=values)["rig.yaml"].decode()
        assert "k_high" not in written
        assert written.count("term: ") == (3 if values else 0)
    assert level.value[1] - level.value[0] == pytest.approx(together.comparison.fit.model.numbers()["k_high"], rel=1e-9)
