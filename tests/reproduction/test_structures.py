"""Structures as cases of the study: their table, their pictures, what is claimed of them."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.compare.comparison import compare
from study.equations.model_file import read_model
from study.records.prepared import prepare_record
from study.reproduction.cases import assumed_model, make_record
from study.reproduction.config import load_structures
from study.reproduction.structure_figures import coherence_figure, connections_figure, modal_figure
from study.reproduction.structure_tables import (
    identify_equations,
    modal_claims,
    modal_model,
    modal_parameters,
    modal_responses,
    structure_claims,
    structure_coherences,
    structure_parameters,
    structure_responses,
)
from study.reproduction.tables import judge_estimate
from study.support.errors import StudyError

ROOT = Path(__file__).parents[2]


def shortened(samples, **of_segments):
    """The structures of the study with shorter records."""
    study = load_structures(ROOT / "config")
    own = study.settings
    cut = own.segments.model_copy(update={"length": of_segments.get("segments", own.segments.length)})
    sampling = own.sampling.model_copy(update={"samples": samples})
    return replace(study, settings=own.model_copy(update={"sampling": sampling, "segments": cut}))


LIMITS = load_structures(ROOT / "config").settings.limits


@pytest.fixture(scope="module")
def two_masses():
    """The first case with a quarter of its samples."""
    study = shortened(4096, segments=1024)
    case, settings = study.cases["two_masses"], study.identification_settings("two_masses")
    model = read_model(ROOT / case.model_file)
    record = make_record(model, study.record_settings("two_masses"))
    return case, settings, record, identify_equations(model, record, settings)


def test_the_assumed_term_stands_at_every_connection_that_lacks_it(two_masses):
    model = read_model(ROOT / two_masses[0].model_file)
    assumed = assumed_model(model, "cubic_stiffness")
    added = {t.name for t in assumed.terms} - {t.name for t in model.terms}
    assert added == {"cubic_stiffness[ground-first]"}
    assert assumed_model(model, "") == model
    assert two_masses[3].model.values["k3[ground-first]"] == 0.0


def test_tables_hold_every_estimator_and_the_truth(two_masses):
    _, settings, _, result = two_masses
    table = structure_parameters(result, settings)
    assert set(table["estimator"]) == set(settings.estimators)
    true = dict(zip(table["parameter"], table["true"], strict=True))
    assert true == {**result.model.values}
    exact = table[(table["estimator"] == "local_polynomial") & (table["true"] != 0.0)]
    assert (exact["relative_error"].abs() < 1e-4).all()
    assert judge_estimate("k3", 0.0, 2e5, settings)["within_tolerance"] is False


def test_siso_changes_and_miso_places(two_masses):
    _, settings, record, result = two_masses
    claims = structure_claims(record, result, settings, LIMITS)
    verdicts = dict(zip(claims["claim"].str.split(":").str[0], claims["verdict"], strict=True))
    assert verdicts["SI/SO"] == "holds"  # every transfer function changes
    measured = claims.loc[0, "measured"]
    assert "first" in measured
    assert "second" in measured


def test_pictures_show_every_input_once_and_every_equation(two_masses):
    case, _, _, result = two_masses
    responses, coherences = structure_responses(result), structure_coherences(result)
    figure = connections_figure(responses, case.title)
    assert len(figure.axes) == 2 * 4  # u and u^3 at either connection
    assert len(coherence_figure(coherences, case.title).axes) == 2
    miso = responses[(responses["estimator"] == "miso") & (responses["shape"] == "u**3")]
    flat = miso[(miso["place"] == "first-second") & (miso["equation"] == "second") & miso["frequency"].between(1, 8)]
    assert flat["real"].median() == pytest.approx(1e7, rel=0.03)  # over the mass, times the true one
    assert flat["exact_real"].to_numpy() == pytest.approx(1e7)
    assert isinstance(coherences, pd.DataFrame)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("structures/two_masses", "structures/two", "there is no model 'structures/two'"),
        ("structures/two_masses", "duffing", "has no 'coordinates'"),
        ("\t\tcubic_stiffness", "\tthird\tcubic_stiffness", r"sensors name \['third'\]"),
        ("three_masses\tstructures", "two_masses\tstructures", "stands twice"),
        ("p4 p7 p10", "p4 p7", "sensors lack p10"),
        ("up_to_30", "up_to_40", "there is no excitation 'up_to_40'; structures.yaml names up_to_12, up_to_30"),
    ],
)
def test_a_bad_row_is_named(tmp_path, old, new, said):
    shutil.copytree(ROOT / "config", tmp_path / "config")
    shutil.copytree(ROOT / "models", tmp_path / "models")
    table = tmp_path / "config" / "structures.tsv"
    text = table.read_text()
    assert old in text
    table.write_text(text.replace(old, new, 1))
    with pytest.raises(StudyError, match=said):
        load_structures(tmp_path / "config")


def test_a_limit_that_is_lost_is_named(tmp_path):
    shutil.copytree(ROOT / "config", tmp_path / "config")
    settings = tmp_path / "config" / "structures.yaml"
    settings.write_text(settings.read_text().replace("by_chance: 0.01, ", ""))
    with pytest.raises(StudyError, match="limits has changed, error; expected changed, by_chance, error"):
        load_structures(tmp_path / "config")


def test_the_beam_is_found_by_its_own_modes():
    study = shortened(8192)
    case, settings, made = study.cases["beam"], study.identification_settings("beam"), study.record_settings("beam")
    structure = read_model(ROOT / case.model_file)
    record, model = make_record(structure, made), modal_model(structure, case.sensors)
    assert [str(s) for s in record.sensors] == [f"{p} displacement" for p in case.sensors]
    assert model.values == {"k3[ground-p10]": None}
    comparison = compare(model, prepare_record(record))
    (claim,) = modal_claims(structure, comparison, settings, LIMITS, case.noise).to_dict("records")
    assert claim["verdict"] == "holds", claim["measured"]
    table = modal_parameters(structure, comparison, settings)
    assert list(table["parameter"][:3]) == ["k3[ground-p10]", "f_n[1]", "zeta[1]"]
    responses = modal_responses(structure, comparison, settings, made.excitation.at_level(1.0).highest)
    linear = responses[(responses["estimator"] == "output_error") & (responses["place"] == "p10")]
    size = np.hypot(linear["exact_real"], linear["exact_imag"])
    off = np.hypot(linear["real"] - linear["exact_real"], linear["imag"] - linear["exact_imag"])
    assert np.sqrt(np.mean(off**2) / np.mean(size**2)) < 0.02
    assert len(modal_figure(responses, case.title).axes) == 2 * 4
