"""A measured structure: the free decay of a wing that heaves and pitches (K. H. Lee, D. Barton and others, Bristol)."""

from pathlib import Path

import numpy as np
import pytest

from study.compare.comparison import compare
from study.diagnose.candidates import screened
from study.diagnose.dropping import compared_without
from study.diagnose.needless import needless
from study.diagnose.verdict import UNKNOWN, diagnose, search_base
from study.equations.model import Model, free
from study.equations.model_file import parse_model
from study.equations.place import Place
from study.equations.possible_effects import candidate_entries
from study.equations.terms import LIBRARY, get
from study.records.plan import make_plan
from study.records.prepared import prepare_record
from study.records.readers import ReadOptions, read_record
from study.records.record_layout import Layout
from study.support.errors import StudyError
from study.way_in.compare_records import made_ready
from tests.public_records import DATA, needs

pytestmark = needs("wing")
M_T, M_W, B, A, RHO = 16.9, 5.3, 0.15, -0.5, 1.204
AUTHORS = {"model_1": (0.1724, 0.24, 3529.0, 54.1), "model_2": (0.1726, 0.234, 3318.0, 60.3)}
TERMS = """
name: wing
coordinates: [heave, pitch]
terms:
  - {{term: inertia, at: heave, value: {heave}}}
  - {{term: inertia, at: pitch, value: {pitch}}}
  - {{term: inertia, couples: [heave, pitch], value: {coupling}}}
  - {{term: linear_stiffness, between: [ground, heave]}}
  - {{term: linear_stiffness, between: [ground, pitch]}}
  - {{term: linear_damping, between: [ground, heave]}}
  - {{term: linear_damping, between: [ground, pitch]}}
"""


def wing(name):
    inertia, x, _, _ = AUTHORS[name]
    values = {
        "heave": M_T + np.pi * RHO * B**2, "coupling": M_W * x * B - A * np.pi * RHO * B**3,
        "pitch": inertia + np.pi * (1 / 8 + A**2) * RHO * B**4,
    }  # fmt: skip
    return parse_model(TERMS.format(**values), Path("wing.yaml"))


@pytest.mark.parametrize("name", list(AUTHORS))
def test_stiffness_is_found_and_what_is_missing_is_in_pitch(name):
    model = wing(name)
    record = read_record(DATA / "wing" / f"{name}.csv", roles=model.roles)
    prepared = prepare_record(record, make_plan(record, (0, 2500), (2500, 4000)))
    comparison = compare(model, prepared)
    _, _, heave, pitch = AUTHORS[name]
    values = comparison.fit.model.values
    assert values["k[ground-heave]"] == pytest.approx(heave, rel=0.15)
    assert values["k[ground-pitch]"] == pytest.approx(pitch, rel=0.15)
    ordered = screened(candidate_entries(model), search_base(comparison))
    best = {c: max(item.share for item in ordered if item.entry.place.moving == (c,)) for c in model.coordinates}
    assert best["heave"] < 0.5 * best["pitch"]
    stiffening = {c: _share(ordered, "quadratic_stiffness", c) for c in model.coordinates}
    assert stiffening["pitch"] > 0.5 * best["pitch"]
    assert stiffening["heave"] < 0.05 * stiffening["pitch"]
    # one body: nothing lies between its motions
    assert not any(len(item.entry.place.moving) > 1 for item in ordered)


def _share(ordered, effect, coordinate):
    """What an effect at a coordinate explains in the reverse system of what the linear terms leave."""
    entries = ((item.entry, item.share) for item in ordered)
    return next((s for e, s in entries if e.term.name == effect and e.place.moving == (coordinate,)), 0.0)


def test_heave_of_the_second_wing_has_dry_friction():
    """With friction and a stiffness of second and third order in pitch; about 2.7 N, as it comes to rest."""
    model = wing("model_2")
    for effect, where in (
        ("quadratic_stiffness", "pitch"), ("cubic_stiffness", "pitch"), ("coulomb_friction", "heave"),
        ("coulomb_friction", "pitch"),
    ):  # fmt: skip
        model = model.with_term(free(get(effect), Place("between", ("ground", where))))
    record = read_record(DATA / "wing" / "model_2.csv", roles=model.roles)
    comparison = compare(model, prepare_record(record, make_plan(record, (0, 2400), (2400, 4000))))
    found = {c.key: c for c in comparison.coefficients}
    friction = found["fc[ground-heave]"]
    assert friction.value == pytest.approx(2.7, rel=0.1)
    assert friction.error is not None
    assert friction.value > 3.0 * friction.error
    _, _, heave, pitch = AUTHORS["model_2"]
    assert found["k[ground-heave]"].value == pytest.approx(heave, rel=0.15)
    assert found["k[ground-pitch]"].value == pytest.approx(pitch, rel=0.15)
    left = np.sqrt(np.mean(comparison.fit.misfit**2, axis=0)) / comparison.prepared.scale
    assert left[1] < 0.2, "of pitch; linear terms alone leave 0.43"


def test_a_prediction_worse_than_none_is_never_said_to_lack_nothing():
    """Pitch is at rest in the judged part, and linear terms alone let it swing on."""
    model = wing("model_2")
    record = read_record(DATA / "wing" / "model_2.csv", roles=model.roles)
    comparison = compare(model, prepare_record(record, make_plan(record, (0, 2500), (2500, 4000))))
    assert comparison.prediction.error > 1.0
    others = [name for name in LIBRARY if name != "constant_force"]
    assert diagnose(comparison, without=others).verdict == UNKNOWN


def test_without_a_force_masses_must_be_given():
    model = wing("model_1")
    free = model.with_values({"m[heave]": None})
    record = read_record(DATA / "wing" / "model_1.csv", roles=free.roles)
    with pytest.raises(StudyError, match=r"says nothing of m\[heave\]; expected a value"):
        compare(free, prepare_record(record, make_plan(record, (0, 2500), (2500, 4000))))


SEARCHED = ("quadratic_stiffness", "cubic_stiffness", "bilinear_stiffness", "coulomb_friction")


@pytest.mark.long
@pytest.mark.parametrize("name", list(AUTHORS))
def test_as_a_user_runs_it_the_missing_stiffness_is_in_pitch(name):
    """Without parts named: every other stretch of one and a half periods is judged, from a state of its own."""
    model = wing(name)
    record = read_record(DATA / "wing" / f"{name}.csv", roles=model.roles)
    comparison = compare(model, made_ready([record], model, Layout())[1])
    _, _, heave, pitch = AUTHORS[name]
    values = comparison.fit.model.values
    assert values["k[ground-heave]"] == pytest.approx(heave, rel=0.15)
    assert values["k[ground-pitch]"] == pytest.approx(pitch, rel=0.15)
    diagnosis = diagnose(comparison, without=[effect for effect in LIBRARY if effect not in SEARCHED])
    first = diagnosis.candidates[0]
    assert first.name in ("bilinear_stiffness[ground-pitch]", "bilinear_stiffness[pitch-ground]")
    assert diagnosis.answer is not None
    assert first.name in diagnosis.answer.names, "alone, or beside friction there"
    assert first.gain.explained > 0.5
    assert "quadratic_stiffness[ground-pitch]" in first.tied_with


@pytest.mark.parametrize(("fit", "judge"), [((0, 2500), (2500, 4000)), ((1250, 2500), (2500, 3750))])
def test_no_division_of_a_decay_lacks_nothing(fit, judge):
    """As long as its free run leaves a hundred times the noise; a free run of seconds has lost the motion there."""
    model = wing("model_1")
    record = read_record(DATA / "wing" / "model_1.csv", roles=model.roles)
    others = [effect for effect in LIBRARY if effect != "constant_force"]
    for prepared in (
        made_ready([record], model, Layout((), fit, judge))[1],
        prepare_record(record, make_plan(record, fit, judge)),
    ):
        comparison = compare(model, prepared)
        assert comparison.prediction.error > 30.0 * comparison.prediction.floor
        assert diagnose(comparison, without=others).verdict == UNKNOWN


def test_what_is_taken_out_leaves_no_more_than_was_foretold():
    """Heave alone with a loop: without viscous damping a fit that first holds the loop's shape ends with 7.6 %."""
    loop = {"kz": 200.0, "hysteresis.beta": 3750.0, "hysteresis.gamma": -3700.0}
    values = {"m": M_T + np.pi * RHO * B**2, "c": 6.4, "k": 3265.0, **loop}
    names = ("inertia", "linear_damping", "linear_stiffness", "hysteresis")
    model = Model("heave", tuple(free(get(name)) for name in names)).with_values({"m": values.pop("m")})
    record = read_record(DATA / "wing" / "model_1.csv", ReadOptions(columns={"displacement": "heave"}, free=True))
    comparison = compare(model, made_ready([record], model, Layout())[1], start=values)
    (found,) = needless(comparison)
    assert found.name == "linear_damping"
    assert compared_without(comparison, found.name).prediction.error < 1.01 * found.error_without
