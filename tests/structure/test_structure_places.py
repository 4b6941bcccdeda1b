"""Places that cannot be told apart; structures and records that cannot be, each with its sentence."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from study.compare.comparison import compare
from study.diagnose.candidates import elsewhere
from study.diagnose.diagnosis_files import diagnosis_in_words
from study.diagnose.next_test import suggested
from study.diagnose.verdict import diagnose
from study.equations.equations_of_motion import loose_motions
from study.equations.linear_part import check_held_masses
from study.equations.model import free
from study.equations.model_file import parse_model
from study.equations.place import Place
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY, get
from study.identify.time_domain.shape_search import Screened, Start
from study.records.completion import consistent
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.readers import ReadOptions, read_record
from study.records.record import Sensor, write_csv
from study.records.record_layout import Layout
from study.support.errors import StudyError
from study.support.thresholds import PROMISING
from study.way_in.compare_records import made_ready

HERE = Path("twin.yaml")
HEAD = "name: twin\ncoordinates: [trunk, left, right]\nforces: {shaker: trunk}\nterms:\n"
MASSES = "".join(
    f"  - {{term: inertia, at: {c}, value: {m}}}\n" for c, m in (("trunk", 5.0), ("left", 1.0), ("right", 1.0))
)
FOOT = "  - {term: linear_stiffness, between: [ground, trunk], value: 4000.0}\n"
FOOT += "  - {term: linear_damping, between: [ground, trunk], value: 8.0}\n"
BRANCHES = "".join(
    f"  - {{term: linear_stiffness, between: [trunk, {c}], value: 900.0}}\n"
    f"  - {{term: linear_damping, between: [trunk, {c}], value: 2.0}}\n"
    for c in ("left", "right")
)


def twin_record(sensors):
    """Two equal branches on a trunk, the joint of the right one hardening, 3 % noise."""
    truth = parse_model(HEAD + MASSES + FOOT + BRANCHES, HERE)
    truth = truth.with_term(
        replace(free(get("cubic_stiffness"), Place("between", ("trunk", "right"))), coefficients=(4e5,))
    )
    drive = force(Excitation(level=400.0, cutoff=12.5), 3000, 0.02, 1)
    wanted = tuple(Sensor(c, "displacement") for c in sensors)
    quiet = simulate(truth, {"shaker": drive}, 0.02, Integrator("rk4", 8), sensors=wanted)
    rng = np.random.default_rng(5)
    return quiet.with_motions(
        {s: x + 0.03 * np.std(x) * rng.standard_normal(len(x)) for s, x in quiet.motions.items()}
    )  # fmt: skip


@pytest.mark.parametrize(("sensors", "tied"), [(("trunk",), True), (("trunk", "right"), False)])
def test_places_that_the_sensors_cannot_tell_apart_are_a_tie(sensors, tied):
    model = parse_model(HEAD + MASSES + FOOT + BRANCHES, HERE)
    comparison = compare(model, prepare_record(twin_record(sensors)))
    others = [n for n in LIBRARY if n not in ("cubic_stiffness", "quadratic_damping", "constant_force")]
    diagnosis = diagnose(comparison, without=others)
    first, said = diagnosis.candidates[0], diagnosis_in_words(diagnosis)
    assert diagnosis.verdict == "missing_effect"
    assert first.term.name == "cubic_stiffness"
    places = {"cubic_stiffness[trunk-left]", "cubic_stiffness[trunk-right]"}
    if tied:
        assert {first.name, *first.tied_with} == places
        assert "cannot tell it from cubic stiffness between trunk and" in said
        found = suggested(diagnosis)
        assert found is not None
        assert found.choice.sensor is not None
        assert found.choice.sensor.coordinate in ("left", "right"), "only there do they differ"
        assert f"at {found.choice.sensor.coordinate} measured" in said
    else:
        assert (first.name, first.tied_with) == ("cubic_stiffness[trunk-right]", ())
        assert "apart" not in said


def test_the_best_effect_is_tried_wherever_it_explains_as_much():
    def candidate(term, place, share):
        entry = free(get(term), Place("between", place))
        return Screened(entry, (Start((), (), share),))

    ordered = [
        candidate("quintic_stiffness", ("a", "b"), 0.9), candidate("cubic_stiffness", ("a", "b"), 0.8),
        candidate("cubic_stiffness", ("a", "c"), 0.79), candidate("cubic_stiffness", ("ground", "a"), 0.78 * PROMISING),
    ]  # fmt: skip
    tried = [
        SimpleNamespace(entry=item.entry, name=item.entry.name, unphysical="", prediction=SimpleNamespace(error=error))
        for item, error in zip(ordered, (0.2, 0.1), strict=False)
    ]
    assert [item.entry.name for item in elsewhere(tried, ordered)] == ["cubic_stiffness[a-c]"]
    assert elsewhere([], ordered) == []


def test_masses_that_are_given_may_not_couple_too_much():
    coupled = HEAD + MASSES.replace("left, value: 1.0", "left") + FOOT + BRANCHES
    check_held_masses(parse_model(coupled + "  - {term: inertia, couples: [trunk, left], value: 3.0}\n", HERE))
    wrong = parse_model(coupled + "  - {term: inertia, couples: [trunk, right], value: 3.0}\n", HERE)
    with pytest.raises(StudyError, match=r"\[5 3; 3 1\], is not positive definite; expected"):
        made_ready([twin_record(("trunk",))], wrong, Layout())


def test_a_mechanism_is_named_where_no_fit_begins():
    loose = parse_model(HEAD + MASSES + BRANCHES, HERE)
    assert loose_motions(loose) == 1
    assert loose_motions(parse_model(HEAD + MASSES + FOOT + BRANCHES, HERE)) == 0
    damped = "  - {term: linear_damping, between: [ground, trunk]}\n"
    assert loose_motions(parse_model(HEAD + MASSES + BRANCHES + damped, HERE)) == 1
    slack = "  - {term: hysteresis, between: [ground, trunk], beta: 1.0, gamma: 0.0}\n"
    assert loose_motions(parse_model(HEAD + MASSES + BRANCHES + slack, HERE)) == 1, "its force follows the velocity"
    swirl = "  - {term: van_der_pol_damping, between: [ground, trunk]}\n"
    assert loose_motions(parse_model(HEAD + MASSES + BRANCHES + swirl, HERE)) == 1, "it vanishes at rest"
    open_values = loose.with_values(dict.fromkeys(loose.values))
    drive = force(Excitation(level=400.0, cutoff=12.5), 2000, 0.02, 1)
    free_body = simulate(loose, {"shaker": drive}, 0.02, Integrator("rk4", 8))
    rng = np.random.default_rng(5)  # noise in proportion to the drift, in which what vibrates is lost
    moved = {s: x for s, x in free_body.motions.items() if s.motion == "displacement"}
    drifting = free_body.with_motions(
        {s: x + 0.1 * np.std(x) * rng.standard_normal(len(x)) for s, x in moved.items()}
    )  # fmt: skip
    with pytest.raises(
        StudyError, match=r"nothing ties 'twin' down and what is measured drifts; expected acceleration"
    ):
        compare(open_values, prepare_record(drifting))
    steady = free_body.with_motions({s: x for s, x in free_body.motions.items() if s.motion == "acceleration"})
    comparison = compare(open_values, prepare_record(steady))
    assert comparison.prediction.error < 1e-3
    assert any("may drift away as a whole" in note for note in comparison.notes)


@pytest.mark.parametrize(
    ("heads", "units", "said"),
    [
        (("trunk [mm]", "right displacement"), {}, "trunk displacement in mm, right displacement in no unit; expected"),
        (("trunk [V]", "right [m]"), {}, "trunk displacement in V, right displacement in m cannot be compared"),
        (("trunk [mm]", "right displacement"), {"right.displacement": "mm"}, None),
        (("trunk displacement", "right displacement"), {"displacement": "mm"}, None),
    ],
)  # fmt: skip
def test_sensors_in_different_units(tmp_path, heads, units, said):
    record = twin_record(("trunk", "right"))
    write_csv(record, tmp_path / "twin.csv")
    lines = (tmp_path / "twin.csv").read_text().splitlines(keepends=True)
    lines[0] = ",".join(["time", "shaker", *heads]) + "\n"
    (tmp_path / "twin.csv").write_text("".join(lines))
    model = parse_model(HEAD + MASSES + FOOT + BRANCHES, HERE)
    if said is None:
        read, _ = consistent(read_record(tmp_path / "twin.csv", ReadOptions(units=units), model.roles))
        for sensor in record.sensors:
            np.testing.assert_allclose(read[sensor], record[sensor])
            assert read.unit(sensor) == "mm"
        assert read.force_and_length == ("N", "mm")
        return
    with pytest.raises(StudyError, match=said):
        consistent(read_record(tmp_path / "twin.csv", ReadOptions(units=units), model.roles))
