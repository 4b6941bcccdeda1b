"""Part II: settings and claims, theory against records, small chapters from settings to verdicts, the page."""

from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.commands import ladder as ladder_module
from study.commands.ladder import climbed_ladder, load_ladders, missing_ladder
from study.commands.measurements import load_measurements
from study.equations.model import Model
from study.equations.model_file import read_model
from study.equations.terms import get
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.frequency_domain.noisy_inputs import expected_spectra
from study.records.excitation import displacement_noise
from study.records.prepared import prepare_record
from study.records.spectra import Segments, cross_spectra
from study.reproduction import whole_page
from study.reproduction.cases import make_record
from study.reproduction.chapters import measured_ladders, noise_both_sides, not_constant, other_forces, other_spectra
from study.reproduction.chapters.chapter import (
    PartTwoSettings,
    chance_bound,
    chapter_settings,
    check_expected,
    get_chapter,
    judged_claims,
)
from study.reproduction.chapters.contents import CHAPTERS
from study.reproduction.claims.reported import load_reported
from study.reproduction.config import load_config
from study.support.config_files import read_yaml
from study.support.document import Picture, markdown
from study.support.errors import StudyError
from study.trials import DRIVEN_MASS, make_trial
from tests.public_records import needs
from tests.reproduction.test_summary import study

ROOT = Path(__file__).parents[2]
CONFIG, MODELS = ROOT / "config", ROOT / "models"


@pytest.fixture(scope="module")
def expected():
    return load_reported(CONFIG / "expected.tsv")


@pytest.fixture(scope="module")
def shared():
    return load_config(CONFIG).settings.claims


@pytest.fixture(scope="module")
def own():
    return read_yaml(CONFIG / "part_two.yaml", PartTwoSettings)


def test_every_claim_has_its_row_and_every_row_its_claim(expected):
    check_expected(expected, CONFIG / "expected.tsv")
    rows = {name: row for name, row in expected.statements.items() if name != "noise_repeated_best"}
    with pytest.raises(StudyError, match="noise_repeated_best"):
        check_expected(replace(expected, statements=rows), CONFIG / "expected.tsv")


def test_settings_survive_the_way_to_a_job(own):
    for name in CHAPTERS:
        if get_chapter(name).make is not None:
            assert chapter_settings(name, own.plain()[name]) == getattr(own, name)


def test_the_more_is_looked_at_the_farther_chance_reaches():
    assert chance_bound(1, 1e9) == pytest.approx(2.576, abs=1e-3)
    assert chance_bound(80, 7.0) > chance_bound(5, 7.0) > chance_bound(5, 100.0)


# ---- theory


def test_expected_spectra_are_the_mean_of_spectra_with_noise(shared, own):
    model, segments = read_model(MODELS / "duffing_van_der_pol.yaml"), Segments(512)
    inputs = reverse_inputs(model)
    record = make_record(model, _record(shared, own), seed=3)
    variance = [0.2 * float(np.mean(record[name] ** 2)) for name in ("displacement", "force")]
    theory = expected_spectra(inputs, record, *variance, segments).density
    found = []
    for seed in range(30):
        noisy = record.with_channels({
            name: record[name] + displacement_noise(record[name], 0.2, 10 * seed + k)
            for k, name in enumerate(("displacement", "force"))
        })  # fmt: skip
        found.append(cross_spectra([*histories(inputs, noisy), noisy["force"]], record.dt, segments).density)
    scale = np.sqrt(np.einsum("fii->fi", theory).real)
    apart = (np.mean(found, axis=0) - theory) / (scale[:, :, None] * scale[:, None, :])
    assert np.all(np.abs(apart.mean(axis=0)) < 0.02)
    without = expected_spectra(inputs, record, 0.0, 0.0, segments).density
    np.testing.assert_allclose(
        without, cross_spectra([*histories(inputs, record), record["force"]], record.dt, segments).density,
        rtol=1e-9, atol=1e-12 * np.abs(without).max(),
    )  # fmt: skip


def _record(shared, own):
    from study.reproduction.settings import RecordSettings

    return RecordSettings(
        case=own.noise.system, excitation=shared.excitation, level=1.0, noise=0.0, sampling=shared.sampling,
        integrator=shared.integrator,
    )  # fmt: skip


# ---- small chapters


def test_noise_on_the_displacement_biases_miso_as_theory_says(shared, own):
    few = own.noise.model_copy(
        update={
            "seeds": 3,
            "levels": (0.0, 0.1),
            "estimators": ("miso",),
            "periodic_estimators": ("errors_in_variables",),
        }
    )
    made = noise_both_sides.make_noise(shared, few, MODELS)
    t = made["noise"]
    k3 = t[(t["estimator"] == "miso") & (t["parameter"] == "k3")].set_index(["force_noise", "displacement_noise"])
    assert k3.loc[(0.0, 0.1), "bias"] < -0.15
    np.testing.assert_allclose(k3["bias"], k3["theory"], atol=0.05)
    assert len(made["noise_best"]) == 8
    assert set(made["noise_best"]["best"]) == {"miso", "errors_in_variables"}


def test_a_narrow_band_breaks_miso_down_and_not_output_error(shared, own, expected, monkeypatch):
    monkeypatch.setattr(other_spectra, "SYSTEMS", ("duffing",))
    few = own.excitations.model_copy(update={"seeds": 2, "forces": {}, "widths": (4.0, 0.5)})
    made = other_spectra.make_excitations(shared, few, MODELS)
    worst = other_spectra.worst_by_system(made["excitations"]).set_index(["force", "noise", "estimator"])
    assert worst.loc[("report", 0.0, "miso"), "over_tolerance"] < 1.0
    assert worst.loc[("0.5 octaves", 0.0, "miso"), "over_tolerance"] > 10.0
    assert worst.loc[("0.5 octaves", few.sensor_noise, "output_error"), "over_tolerance"] < 1.0
    (held,) = list(other_spectra.spectra_bands_output_error(made, expected))[:1]
    assert held.met
    assert "How narrow" in markdown(other_spectra.told_excitations(made))


def test_a_wrong_law_of_damping_has_a_coherence_near_unity_and_leaves_more(shared, own, expected):
    few = own.forces.model_copy(update={"cases": {"drag": own.forces.cases["drag"]}})
    made = other_forces.make_forces(shared, few, MODELS)
    judged = judged_claims("forces", made, expected).set_index("id")
    assert judged["verdict"]["forces_in_reverse"] == "holds"
    assert judged["verdict"]["forces_coherence_wrong"] == "does not hold"
    assert judged["verdict"]["forces_left"] == "holds"
    assert "quadratic drag" in judged["why"]["forces_coherence_wrong"]


@pytest.mark.long
def test_a_coefficient_that_drifts_is_found_and_a_constant_one_leaves_more(shared, own, expected):
    few = own.varying.model_copy(
        update={"cases": {"drift": own.varying.cases["drift"]}, "mathieu_seeds": 2, "moments": 20}
    )
    made = not_constant.make_varying(shared, few, MODELS)
    judged = judged_claims("varying", made, expected).set_index("id")["verdict"]
    assert list(judged[["varying_in_reverse", "varying_free_run", "varying_left"]]) == ["holds"] * 3
    with pytest.raises(StudyError, match="expected the step"):
        not_constant.make_varying(shared, few.model_copy(update={"step_at": 91.0}), MODELS)


# ---- measured records


def test_a_record_that_is_not_there_is_left_out_and_said_so(expected, monkeypatch, tmp_path):
    monkeypatch.setenv("STUDY_DATA", str(tmp_path))
    rows = load_measurements(CONFIG)
    ladders = load_ladders(CONFIG, rows)
    made = {"ladders": pd.concat([missing_ladder(rows[n], ladder, n) for n, ladder in ladders.items()])}
    (sentence,) = measured_ladders.left_out_records(made)
    assert all(name in sentence for name in ladders)
    assert "study data" in sentence
    judged = judged_claims("measured", made, expected)
    assert set(judged["verdict"]) == {"not tested"}
    assert judged["measured"].str.contains("left out").all()
    said = whole_page.part_two_sentence(judged)
    assert "0 of 0 claims hold" in said
    assert f"{len(judged)} more are not tested" in said


def test_ladders_name_records_and_terms_that_there_are(tmp_path):
    rows = load_measurements(CONFIG)
    head = "record\tterms\tfit\tfaults\tpublished\n"
    wrong = (
        "nobody\tcubic_stiffness\t\t", "silverbox\tno_term\t\t", "silverbox\tcubic_stiffness\t\tno_fault",
        "brake\tcoulomb_friction:band2_force:w>0\t\t",
    )  # fmt: skip
    for row, named in zip(wrong, ("nobody", "no_term", "no_fault", "w > 0"), strict=True):
        (tmp_path / "ladders.tsv").write_text(f"{head}{row}\tx\n")
        with pytest.raises(StudyError, match=named):
            load_ladders(tmp_path, rows)


def test_a_ladder_corrects_the_faults_that_it_names_of_the_values_that_its_last_model_tells():
    """Beside the first model, which lacks a quadratic stiffness, the offset is another one."""
    made = make_trial(560_001, ("quadratic_stiffness",), 1e-4, "displacement", "offset", DRIVEN_MASS)
    given, offset = prepare_record(made.record), made.fault["value"]
    off = {}
    for terms in ((), ("quadratic_stiffness",)):
        last = reduce(Model.with_term, map(get, terms), made.believed)
        corrected = ladder_module._corrected(given, ("offset",), last)
        removed = given.record["displacement"] - corrected.record["displacement"]
        assert np.ptp(removed) < 1e-12
        off[terms] = abs(float(np.mean(removed)) / offset - 1.0)
    assert off["quadratic_stiffness",] < 0.05 < off[()]
    assert ladder_module._corrected(given, (), made.believed) is given


def test_a_step_of_a_ladder_begins_where_the_one_below_ended(monkeypatch):
    made, begun = make_trial(560_001, ("quadratic_stiffness",), 1e-4, "displacement", "none", DRIVEN_MASS), []
    prepared, fit = prepare_record(made.record), ladder_module.fit_model
    monkeypatch.setattr(ladder_module, "fit_model", lambda model, part: begun.append(model) or fit(model, part))
    first = ladder_module._fitted(made.believed, prepared)
    second = ladder_module._fitted(made.believed.with_term(get("quadratic_stiffness")), prepared, first.fit.model)
    ladder_module._fitted(made.believed.with_term(get("dead_band")), prepared, first.fit.model)
    assert [model.starts for model in begun] == [{}, {**first.fit.model.numbers(), "k2": 0.0}, {}]
    assert second.prediction.worst.error < 0.5 * first.prediction.worst.error


@needs("friction_damper")
def test_a_ladder_may_add_friction_that_follows_a_channel_in_one_direction(monkeypatch):
    from tests.public_records import DATA

    monkeypatch.setenv("STUDY_DATA", str(DATA))
    rows = load_measurements(CONFIG)
    made = climbed_ladder(rows["brake"], load_ladders(CONFIG, rows)["brake"], "Band brake")
    bands = ["coulomb_friction_forward_over_band2_force", "coulomb_friction_backward_over_band1_force"]
    assert made["added"].tolist() == ["", *bands]
    assert made["error"].tolist() == sorted(made["error"], reverse=True)
    assert made["error"].iloc[-1] < 0.25 * made["error"].iloc[0]


@pytest.mark.long
@needs("pendulum")
def test_a_ladder_lowers_the_error_on_what_was_not_fitted(monkeypatch):
    from tests.public_records import DATA

    monkeypatch.setenv("STUDY_DATA", str(DATA))
    rows = load_measurements(CONFIG)
    made = climbed_ladder(rows["pendulum"], load_ladders(CONFIG, rows)["pendulum"], "Pendulum")
    assert made["error"].is_monotonic_decreasing
    assert list(made["added"]) == ["", "coulomb_friction", "quadratic_damping"]


# ---- the page


def test_chapters_follow_part_one_in_one_table_of_contents(monkeypatch, expected):
    monkeypatch.setattr(whole_page, "CHAPTERS", {"measured": CHAPTERS["measured"]})
    ladders = pd.DataFrame(
        [("silverbox", "Silverbox", 0, "", 0.2, 0.01, "V", 0.001, "0.39 mV", ""),
         ("silverbox", "Silverbox", 1, "cubic_stiffness", 0.02, 0.001, "V", 0.001, "0.39 mV", ""),
         ("pendulum", "Pendulum", 0, "", None, None, "", None, "x", "not there")],
        columns=["record", "title", "step", "added", "error", "rms", "unit", "floor", "published", "note"],
    )  # fmt: skip
    claims = judged_claims("measured", {"ladders": ladders}, expected)
    results = study(part_two_claims=claims, ladders=ladders)
    page = whole_page.study_page(results, [Picture("measured", "Measured", "errors", b"png")]).decode()
    assert page.index(whole_page.ONE) < page.index(whole_page.TWO)
    assert page.count("<nav>") == 1
    assert 'href="#part-two-measured"' in page
    assert "Pendulum is left out" in page
    assert page.count('class="thumb"') == 1
    assert "cubic stiffness" in markdown(whole_page.part_two_blocks(results))
