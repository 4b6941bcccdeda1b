"""``study explore`` without a browser: decimation, the session, what is saved, and the desk that runs it all."""

import re
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study import cli, trials
from study.compare import history
from study.compare.comparison import Comparison, compare
from study.compare.force_map import curve, surface
from study.compare.links import power_in_blocks, times_of_blocks, visits_in_blocks
from study.diagnose.adding import added
from study.diagnose.confirmed_faults import Diagnosed
from study.equations import model_file
from study.equations.model import Model, free
from study.equations.terms import get
from study.explore import PAGE, decimate, page_units, words
from study.explore import session as sessions
from study.explore.axis_scales import log_ticks
from study.explore.desk import Desk
from study.explore.saved import files, of_stage, saved
from study.explore.view import View, history_columns
from study.records.prepared import prepare_record
from study.support.errors import StudyError
from study.support.statistics import Gain

TEXT = """# the rig in hall 3
name: rig
terms:
  - inertia            # weighed
  - linear_damping
  - {term: linear_stiffness}   # from the drawing
"""


@pytest.fixture(scope="module")
def trial() -> trials.Trial:
    return trials.make_trial(911, hidden=["quadratic_damping"], noise=0.01, response="displacement")


@pytest.fixture(scope="module")
def begun(trial: trials.Trial) -> sessions.Session:
    record = replace(trial.record.part(0, 4096), name="rig")
    return sessions.begin(trial.believed, prepare_record(record))


@pytest.fixture(scope="module")
def asked(begun: sessions.Session) -> sessions.Session:
    return sessions.with_stage(begun, sessions.examined(begun)[0])


@pytest.fixture(scope="module")
def grown(asked: sessions.Session) -> sessions.Session:
    return sessions.with_added(asked, "quadratic_damping")


@pytest.mark.parametrize("samples", [7, 100, 101, 999, 65536])
def test_decimation_keeps_every_peak(samples):
    values = np.random.default_rng(samples).standard_normal(samples)
    values[samples // 3], values[samples // 2] = 40.0, -50.0
    shown = decimate.extremes(values, 50)
    assert len(shown) == min(samples, 100) == len(decimate.times(np.arange(samples), 50))
    assert (shown.max(), shown.min()) == (40.0, -50.0)
    assert np.all(np.isin(shown, values))


def test_decimated_peaks_stand_where_they_are():
    values = np.zeros(10000)
    values[[1234, 7777]] = 5.0, -5.0
    time = decimate.times(np.arange(10000.0), 100)
    shown = decimate.extremes(values, 100)
    assert abs(time[np.argmax(shown)] - 1234) <= 100
    assert abs(time[np.argmin(shown)] - 7777) <= 100


def test_who_has_the_diagnosis_is_not_sent_to_it(grown):
    assert grown.now.comparison.prediction.of(0).noise.alone
    asked = sessions.examined(grown)[0]
    for stage, live, sent in ((grown.now, False, True), (grown.now, True, False), (asked, False, False)):
        assert ("looks closer" in words.words(stage, 1, live)["says"]) == sent


def test_adding_what_is_missing_lets_the_error_fall_and_undoing_brings_it_back(asked, grown):
    before, after = asked.now.comparison, grown.now.comparison
    assert asked.now.diagnosis.candidates[0].name == "quadratic_damping"
    assert before.prediction.error > 1.4 * before.prediction.floor
    assert after.prediction.error == pytest.approx(after.prediction.floor, rel=0.1)
    assert [s["added"] for s in grown.steps] == [None, "quadratic_damping"]
    assert sessions.undone(grown) == asked
    assert sessions.undone(asked) is asked
    with pytest.raises(StudyError, match="no candidate of the present model"):
        sessions.with_added(grown, "quadratic_damping")


def test_an_added_term_is_what_add_would_have_found(grown):
    error = grown.now.comparison.prediction.error
    after = added(grown.stages[0].comparison, get("quadratic_damping"))
    assert error == pytest.approx(after.prediction.error, rel=1e-3)
    anew = compare(grown.now.model, grown.now.comparison.prepared)
    assert error == pytest.approx(anew.prediction.error, rel=1e-3)


def test_a_value_is_held_where_it_stands_and_freed_again(grown):
    held = sessions.with_held(grown, "k", True)
    assert held.now.model.values["k"] == grown.now.values["k"] == held.now.values["k"]
    assert next(c for c in held.now.comparison.coefficients if c.key == "k").held
    freed = sessions.with_held(held, "k", False)
    assert freed.now.model == grown.now.model
    error = grown.now.comparison.prediction.error
    assert freed.now.comparison.prediction.error == pytest.approx(error, rel=1e-3)
    for key, hold, said in (("k", True, "held already"), ("no", True, "no value of this model"), ("m", False, "free")):
        with pytest.raises(StudyError, match=said):
            sessions.with_held(held, key, hold)


@pytest.fixture(scope="module")
def superfluous(grown: sessions.Session) -> sessions.Session:
    """With a term more than the record shows, and diagnosed."""
    more = added(grown.now.comparison, get("quadratic_stiffness"))
    session = sessions.climbed(grown, more, "+ quadratic_stiffness", "quadratic_stiffness")
    return sessions.with_stage(session, sessions.examined(session)[0])


def test_what_is_not_needed_has_a_button_that_takes_it_out(grown, superfluous):
    now = superfluous.now
    assert [n.name for n in now.unneeded] == ["quadratic_stiffness"]
    assert "Quadratic stiffness is not needed: without it" in now.said
    places = words.words(now, 2, True)
    assert re.findall(r"data-act='drop' data-name='(\w+)'", places["coefficients"]) == ["quadratic_stiffness"]
    assert "not needed" in places["coefficients"]
    saved_ = words.words(now, 2, False)["coefficients"]
    assert "not needed" in saved_
    assert "data-act" not in saved_
    needed = words.words(grown.now, 1, True)["coefficients"]
    assert "data-act='drop'" not in needed


@pytest.mark.long
def test_a_dropped_term_is_gone_and_undoing_brings_it_back(grown, superfluous):
    after = sessions.dropped(superfluous, "quadratic_stiffness")
    assert after.now.label == "- quadratic_stiffness"
    assert after.now.model == grown.now.model
    error = grown.now.comparison.prediction.error
    assert after.now.comparison.prediction.error == pytest.approx(error, rel=1e-3)
    assert [history.label(s) for s in after.steps] == [
        "as given", "+ quadratic_damping", "+ quadratic_stiffness", "- quadratic_stiffness"
    ]  # fmt: skip
    assert history_columns(after)["name"][-1] == "3 - quadratic stiffness"
    assert sessions.undone(after) == superfluous
    model = model_file.format_model(grown.stages[0].model.with_term(get("quadratic_stiffness")))
    contents = files(after, "rig.yaml", f"# hall 3\n{model}")
    assert "quadratic_stiffness" not in contents["rig.yaml"].decode()
    assert contents["rig.yaml"].startswith(b"# hall 3\n")
    assert b'"dropped": "quadratic_stiffness"' in contents["rig.history.json"]
    assert b'"not_needed"' in files(superfluous, "rig.yaml", model)["diagnosis.json"]
    for name, said in (("hysteresis", "not in the model"), ("inertia", "cannot be dropped")):
        with pytest.raises(StudyError, match=said):
            sessions.dropped(after, name)


def test_a_formula_is_tried_beside_the_library(asked):
    tried = sessions.tried(asked, "mine = v*abs(v)")
    row = sessions.candidate(tried, "mine")
    drag = sessions.candidate(tried, "quadratic_damping")
    assert row.gain.explained == pytest.approx(drag.gain.explained, rel=1e-3)
    assert "mine" in drag.tied_with
    assert [t.name for t in tried.own] == ["mine"]
    assert "mine" in [r.name for r in tried.now.shown]
    assert sessions.tried(tried, "u*u*v").own[-1].name == "own_1"
    with pytest.raises(StudyError, match=r"has no finite response on this record; expected one that holds the motion"):
        sessions.tried(tried, "exp(1e5*u)")
    after = sessions.with_added(tried, "mine").now.comparison
    assert after.prediction.error == pytest.approx(after.prediction.floor, rel=0.1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("__import__('os').system('true')", "the functions are"), ("(lambda: 0)()", "expression"), ("", "formula"),
        ("u**99", "power"), ("x*u", "uses the name 'x'"), ("quadratic_damping=u", "belongs to the library"),
        ("<b>=u", "not a name"), ("u" * 400, "characters"), ("1e300*u**9*u**9", "finite response"),
    ],
)  # fmt: skip
def test_a_bad_formula_gets_its_sentence(asked, text, said):
    with pytest.raises(StudyError, match=re.escape(said)) as caught:
        sessions.tried(asked, text)
    assert "\n" not in str(caught.value)


def test_links_add_up_to_the_curves_and_the_map(grown):
    comparison = grown.stages[0].comparison
    tied, lacking = visits_in_blocks(comparison.missing_force), comparison.missing_force
    u, v, force = (x[lacking.inner] for x in (lacking.displacement, lacking.velocity, lacking.force))
    for classes, values in ((tied.displacement, u), (tied.velocity, v)):
        visits, sums = classes.visits.sum(axis=0), classes.force.sum(axis=0)
        mean = (sums / np.maximum(visits, 1))[visits > 0]
        line = curve(values, force)
        assert np.all(np.isclose(line.mean[:, None], mean[None, :], rtol=1e-9).any(axis=1))
    cells = tied.cells.sum(axis=0)
    assert np.all(cells[np.isfinite(surface(u, v, force).mean.ravel())] > 0)
    assert cells.sum() == pytest.approx(len(u), rel=0.01)
    frequency, power = power_in_blocks(comparison.prediction.of(0))
    left = np.mean(comparison.prediction.residual**2)
    assert power.sum() * frequency[1] / len(power) == pytest.approx(left, rel=0.1)
    assert len(times_of_blocks(comparison.prediction)) == len(power) + 1 == len(tied.cells) + 1


def test_what_a_candidate_would_leave_is_what_its_diagnosis_found(asked):
    view = View(asked.now, 0)
    columns = view.of_sensor("displacement") | view.of_place("")
    first = asked.now.diagnosis.candidates[0]
    shown = columns["would_time"]["0"]
    scale = view.focus("displacement", "").difference.factor
    assert np.allclose(shown * scale, first.residual, rtol=1e-5, atol=1e-12)
    with_it, without = (np.nanmax(np.abs(columns[a][b])) for a, b in (("would_v", "y0"), ("against_v", "mean")))
    assert with_it < 0.1 * without


def test_the_history_goes_on_where_the_file_left_it(begun):
    step = begun.steps[0]
    earlier = ({**step, "terms": ["inertia"]}, {**step, "added": "linear_damping"})
    assert len(replace(begun, earlier=earlier).steps) == 2
    names = history_columns(replace(begun, earlier=earlier[:1]))["name"]
    assert names == ["0 as given", "1 as given"]


def test_the_saved_page_is_the_same_twice_and_asks_for_nothing(grown):
    once = saved(grown)
    assert once == saved(grown)
    text = once.decode()
    tags = re.findall(
        r"<(?:script|link|img|iframe)\b[^>]*>", text.split("<style>")[0] + text[text.rindex("</style>") :]
    )
    assert not [t for t in tags if "src=" in t or "http" in t]
    assert [f"{i} {what}" in text for i, what in enumerate(("as given", "+ quadratic damping"))] == [True, True]


def test_the_saved_page_stays_small_however_long_record_and_history(asked):
    """Judged are 2,048 samples, drawn at most 2,400: seven stages take what they would of a record of 131,072."""
    seven = replace(asked, stages=asked.stages * 7)
    assert len(saved(seven)) < 5e6
    long = np.zeros(131072)
    assert len(decimate.extremes(long)) == 2 * decimate.BUCKETS


def test_what_a_user_named_cannot_leave_its_place(asked):
    evil = "</script><script>alert(1)</script>"
    comparison = asked.now.comparison
    record = comparison.record
    prepared = replace(comparison.prepared, record=replace(record, name=evil, units={**record.units, "force": "<b>N"}))
    accounted = replace(asked.now.accounted, comparison=replace(comparison, prepared=prepared))
    hostile = saved(replace(asked, stages=(replace(asked.now, accounted=accounted),))).decode()
    assert "alert(1)</script>" not in hostile
    assert "<b>N" not in hostile
    assert "&lt;b&gt;N" in hostile or "\\u003cb>N" in hostile


def test_units_are_written_as_people_write_them():
    assert page_units.in_text("N s^2/m^2") == "N s²/m²"
    assert page_units.in_text("u**3*v") == "u³·v"
    assert page_units.number(4.897e5) == "4.897·10⁵"
    assert page_units.number(-0.012) == "-0.012"
    assert page_units.rate("m/s^2", 0.02) == page_units.Scale(1e-3, "mm/s^2")
    assert page_units.length("V", 0.02) == page_units.Scale(1.0, "V")
    assert page_units.power("V", 0.012) == page_units.Scale(1e-3, "10^-3 V")
    assert page_units.power("N", 30.0) == page_units.power("N", 0.0) == page_units.Scale(1.0, "N")


def test_the_missing_force_has_one_unit_everywhere(asked):
    stage, factor = asked.now, 1e-5
    comparison, lacking = stage.comparison, stage.comparison.missing_force
    record = comparison.record.with_channels({"force": comparison.record["force"] * factor})
    prepared = replace(comparison.prepared, record=record)
    lacking = replace(lacking, force=lacking.force * factor)
    changed = replace(comparison, prepared=prepared, missing_force=lacking)
    weak = replace(stage, accounted=replace(stage.accounted, comparison=changed))
    (small, scale), (usual, one) = (
        (view.of_place(""), view.focus("displacement", "").force.factor) for view in (View(weak, 0), View(stage, 0))
    )
    assert one == 1.0
    assert scale < 0.01
    for source, column in (("plane", "mean"), ("against_u", "mean"), ("against_v", "high")):
        expected = usual[source][column] * factor / scale
        assert small[source][column] == pytest.approx(expected, rel=1e-4, nan_ok=True), source
    heading = small["frame_place"]["value"][small["frame_place"]["model"].index("force-unit")]
    assert "10⁻" in heading


def test_ties_are_shown_as_ties(asked):
    rows = asked.now.diagnosis.candidates[:2]
    tied = (replace(rows[0], tied_with=(rows[1].name,)), replace(rows[1], tied_with=(rows[0].name,)))
    stage = replace(asked.now, diagnosis=replace(asked.now.diagnosis, candidates=tied))
    html = words.words(stage, 0, True)["candidates"]
    assert re.findall(r"class='rank'>(.)<", html) == ["1", "="]
    assert html.count("class='tie'") == 2


def test_a_set_of_effects_is_a_row_whose_click_adds_all_of_it(asked):
    """Beside the single effects, which are counted by themselves; the preview is of the set."""
    first, second = asked.now.diagnosis.candidates[:2]
    both = replace(first, entries=first.entries + second.entries, effects=first.effects + second.effects, tied_with=())
    diagnosis = replace(asked.now.diagnosis, verdict="missing_effects", sets=(both,))
    stage = sessions.with_diagnosis(replace(asked.now, would={}), Diagnosed(diagnosis, asked.now.accounted, ()))
    assert [row.name for row in stage.shown[:2]] == [both.name, first.name]
    assert both.name in stage.would
    said = words.words(stage, 0, True)
    head, row, *singles = re.findall(r"<li class='(?:kind|candidate)[^>]*>.*?</li>", said["candidates"])
    assert "set of effects" in head
    assert f"data-act='add' data-name='{both.name}'" in row
    assert all(f"<b>{words.in_words(name)}</b>" in row for name in (first.name, second.name))
    assert "together they explain" in row
    assert "single effects" in singles[0]
    assert [re.search(r"class='rank'>(.)<", html)[1] for html in (row, singles[1])] == ["1", "1"]
    assert "Several effects are missing" in said["verdict"]
    assert View(stage, 0).of_sensor("displacement")["would_time"].keys() == {str(i) for i in range(len(stage.shown))}
    assert sessions.candidate(replace(asked, stages=(stage,)), both.name) is both


def test_by_how_much_an_effect_is_worse_is_not_said_nor_an_error_of_nothing(asked, monkeypatch):
    monkeypatch.setattr(words, "offers", lambda *_: True)  # as one of the user's own always is
    first, second = asked.now.diagnosis.candidates[:2]
    sure = replace(first, gain=Gain(1.0, 1e-6, 0.0), tied_with=())
    worse = replace(second, gain=Gain(-7.277, 0.3, 1.0), tied_with=())
    stage = replace(asked.now, diagnosis=replace(asked.now.diagnosis, candidates=(sure, worse)))
    html = words.words(stage, 0, True)["candidates"]
    assert "explains 100.0 %, error" in html
    assert "727" not in html
    assert "± 0" not in html


def test_saving_keeps_the_users_comments(asked, grown, tmp_path):
    given = Model("rig", tuple(free(get(n)) for n in ("inertia", "linear_damping", "linear_stiffness")))
    model = given.with_term(get("quadratic_damping")).with_values({"k": 355.0})
    text = model_file.revised(TEXT, "rig.yaml", model)
    assert text.splitlines()[-2:] == [
        "  - {term: linear_stiffness, value: 355.0}   # from the drawing",
        "  - quadratic_damping",
    ]
    assert text.startswith("# the rig in hall 3\n")
    assert "# weighed" in text
    own = model_file.format_model(asked.stages[0].model)
    made = files(grown, "rig.yaml", own)
    assert {"rig.yaml", "rig.history.json", "comparison.json", PAGE, "response.png", "history.png"} <= set(made)
    for name, content in made.items():
        (tmp_path / name).write_bytes(content)
    assert model_file.read_model(tmp_path / "rig.yaml") == grown.now.model
    assert len(history.read_history(tmp_path / "rig.yaml")) == 2


def test_the_desk_does_one_thing_at_a_time_and_says_what_went_wrong(asked, tmp_path):
    desk = Desk(asked, tmp_path / "rig.yaml", model_file.format_model(asked.stages[0].model), tmp_path / "out")
    done = threading.Event()
    busy: list[str] = []

    def told() -> None:
        busy.append(desk.state.busy)
        if not desk.state.busy:
            done.set()

    def wait(action: str, name: str) -> None:
        done.clear()
        desk.ask(action, name)
        assert done.wait(120.0)

    desk.watch(told, told)
    wait("try", "__import__('os')")
    assert "__import__" in desk.state.answer
    wait("add", "no_such_thing")
    assert "no candidate" in desk.state.notice
    assert desk.session is asked
    desk.ask("format the disk", "now")
    assert desk.state.busy == ""
    wait("add", "quadratic_damping")
    assert desk.session.now.label == "+ quadratic_damping"
    assert "adding quadratic_damping" in busy
    wait("drop", "hysteresis")
    assert "'hysteresis' is not in the model" in desk.state.notice
    wait("drop", "quadratic_damping")
    assert desk.session.now.label == "- quadratic_damping"
    assert "dropping quadratic_damping" in busy
    desk.close()


@pytest.mark.long
def test_what_save_writes_is_drawn_before_it_is_asked_for(asked, tmp_path, monkeypatch):
    drawn: list[Comparison] = []
    ahead = threading.Event()

    def pictures(comparison: Comparison) -> dict[str, bytes]:
        drawn.append(comparison)
        ahead.set()
        return {"response.png": b"drawn"}

    for name in ("study.compare.history_picture.history_files", "study.explore.saved.diagnosis_files"):
        monkeypatch.setattr(name, lambda *_: {})
    monkeypatch.setattr("study.compare.comparison_pictures.comparison_pictures", pictures)
    text = model_file.format_model(asked.stages[0].model)
    desk, done = Desk(asked, tmp_path / "rig.yaml", text, tmp_path / "out"), threading.Event()
    desk.diagnose()  # known: nothing is asked again, but it is drawn
    assert ahead.wait(120.0)
    desk.watch(done, lambda: done.set() if desk.state.notice else None)
    desk.ask("save", "open")
    assert done.wait(120.0)
    assert "Saved in" in desk.state.notice
    desk.close()
    assert drawn == [asked.now.comparison]
    assert (tmp_path / "out" / "response.png").read_bytes() == b"drawn"
    assert files(asked, "rig.yaml", text, drawn=of_stage(asked.now)) == files(asked, "rig.yaml", text)


@pytest.mark.parametrize(
    ("words_", "said"),
    [
        (["rig.csv", "--model", "none.yaml"], "none.yaml"), (["none.csv", "--model", "rig.yaml"], "none.csv"),
        (["rig.csv", "--model", "rig.yaml", "--port", "70000"], "65535"),
        (["rig.csv", "--model", "rig.yaml", "--out", "rig.csv/deeper"], "cannot be written"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence_and_serves_nothing(words_, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("rig.yaml").write_text(TEXT)
    Path("rig.csv").write_text("force,displacement\n1,2\n")
    assert cli.main(["explore", *words_]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("low", "high"), [(0.03, 0.8), (4.2, 7.9), (1e-5, 1e3), (0.9, 1.1e4), (1e-12, 1e-11), (2.0, 2.0)]
)
def test_ticks_of_a_logarithmic_axis_do_not_collide(low, high):
    inside = [tick for tick in log_ticks(low, high) if low <= tick <= high]
    apart = np.diff(np.log10(inside)) / max(np.log10(high / low), 1e-9)
    assert len(inside) <= 8
    assert len(inside) >= (2 if high > 1.5 * low else 0)
    assert np.all(apart > 0.07), "of the height: about 11 pixels"


@pytest.mark.parametrize(
    ("unit", "value", "shown"),
    [("kN s^2/mm", 0.001231, 1231.0), ("N s^2/m", 2.0, 2.0), ("kg", 2.0, 2.0), ("V s^2/V", 2.0, 2.0)],
)
def test_a_mass_is_shown_in_kilograms_where_it_can_be(unit, value, shown):
    scale = page_units.mass(unit)
    assert value / scale.factor == pytest.approx(shown)
    assert scale.unit == ("V s^2/V" if "V" in unit else "kg")


def test_numbers_have_one_format_on_the_page():
    assert page_units.number(204.0, 2) == "200"
    assert page_units.number(2.04e7, 2) == "2·10⁷"
    said = page_units.in_sentence("k is 2.5e+07 +- 1e-3 N/m^3 (p = 6e-14)")
    assert said == "k is 2.5·10⁷ ± 1·10⁻³ N/m³ (p = 6·10⁻¹⁴)"


def test_what_gives_nothing_is_counted_and_not_offered(asked):
    stage = asked.now
    places = words.words(stage, 0, True)
    offered = re.findall(r"data-candidate='(\d+)'", places["candidates"])
    assert [int(i) for i in offered] == [i for i, row in enumerate(stage.shown) if words.offers(stage.diagnosis, row)]
    assert 0 < len(offered) < len(stage.shown)
    assert f"{len(stage.diagnosis.candidates) - len(offered)} more explain no more than chance" in places["candidates"]


def test_the_equation_stands_with_its_values_and_what_follows_from_them(grown):
    places = words.words(grown.now, 1, True)
    known = grown.now.values
    assert f"<b>{page_units.number(known['m'], 4)}</b> d²u/dt²" in places["equation-values"]
    f_n = np.sqrt(known["k"] / known["m"]) / (2.0 * np.pi)
    assert f"<td class='number'>{page_units.number(f_n, 5)}</td>" in places["coefficients"]


def test_saving_with_values_keeps_comments_and_the_next_fit_begins_at_them(grown):
    given = grown.stages[0].model
    text = f"name: {given.name}\nterms:\n" + "".join(f"  - {t.name}  # mine\n" for t in given.terms)
    written = files(grown, "rig.yaml", text, values=True)["rig.yaml"].decode()
    assert written.count("# mine") == len(grown.stages[0].model.terms)
    model = model_file.parse_model(written, Path("rig.yaml"))
    assert model.starts == pytest.approx(grown.now.values)
    assert set(model.values.values()) == {None}, "a fit of it would fit nothing"
