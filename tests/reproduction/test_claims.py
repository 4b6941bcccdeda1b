"""Claims: verdicts follow from what is measured."""

import math
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from study.equations.model_file import read_model
from study.identify.estimators.base import Settings
from study.records.record import Record
from study.reproduction import config, ensemble, study_pages
from study.reproduction.claims import (
    claims_table,
    dead_band,
    evidence,
    judgement,
    levels,
    preliminary_claims,
    sample,
)
from study.reproduction.claims import reported as stated
from study.reproduction.claims.judgement import Condition
from study.reproduction.claims.reported import Reported, Statement
from study.reproduction.claims.sample import Sample, departure
from study.reproduction.preliminary import model_restoring_force, natural_frequency, read_dead_band
from study.reproduction.settings import ClaimSettings, Ensembles
from study.support import document

ROOT = Path(__file__).parents[2]
SEEDS = 6
MET, MISSED = Condition("c", "m", True), Condition("x above 2", "x 1", False)


@pytest.fixture(scope="module")
def settings() -> ClaimSettings:
    ensembles = Ensembles(seeds=SEEDS, first_seed=5001)
    return config.load_config(ROOT / "config").settings.claims.model_copy(update={"ensembles": ensembles})


@pytest.fixture(scope="module")
def report() -> Reported:
    return stated.load_reported(ROOT / "config" / "reported.tsv")


@pytest.fixture(scope="module")
def steps(settings: ClaimSettings) -> pd.DataFrame:
    models = evidence.models_of(ROOT / "models")
    record = evidence.record_settings(settings, evidence.Drive("linear", level=4.0))
    told = Settings(settings.segments.segments(), settings.fit_band)
    chosen = {name: models[name] for name in ("linear", "van_der_pol")}
    return ensemble.integrator_study(chosen, record, told, range(5001, 5004), ["raw", "filtered"])


@pytest.fixture(scope="module")
def found(settings: ClaimSettings, steps: pd.DataFrame) -> evidence.Evidence:
    return evidence.Evidence(settings, evidence.models_of(ROOT / "models"), steps.to_dict("records"))


@pytest.fixture(scope="module")
def judged(found: evidence.Evidence, report: Reported) -> pd.DataFrame:
    return claims_table.judge_all(found, report)


@pytest.mark.parametrize(
    ("met", "said"),
    [
        ([True, True], "reproduced"),
        ([True, False], "partly"),
        ([False, False], "not reproduced"),
        ([True], "reproduced"),
        ([False], "not reproduced"),
    ],
)
def test_verdict_counts_conditions(met: list[bool], said: str) -> None:
    assert judgement.verdict(met) == said


def one_statement() -> Reported:
    return Reported(
        {
            "a": Statement(
                id="a", where="p. 1", what="it is so", value=3.0, unit="Hz", systems="", levels="", holds_if="", why=""
            )
        }
    )


def test_a_claim_that_holds_needs_no_reason() -> None:
    claim = judgement.conclude(one_statement(), "a", *judgement.explained("never said", [MET]))
    assert (claim.verdict, claim.why, claim.reported) == ("reproduced", "", "3 Hz")


def test_a_claim_that_fails_says_what_and_why() -> None:
    claim = judgement.conclude(one_statement(), "a", *judgement.explained("of this", [MET, MISSED]))
    assert claim.verdict == "partly"
    assert claim.why == "x 1, where the criterion is x above 2: of this"
    others = [judgement.Condition("c", f"m {i}", False, f"r {i}") for i in (1, 1, 2, 3)]
    same = judgement.explained("of this", others)
    assert judgement.conclude(one_statement(), "a", *same).why == "r 1 (2 more like it): of this"
    assert judgement.conclude(one_statement(), "a", *others).why == "r 1; r 2; r 3"


def test_together_is_met_only_as_a_whole() -> None:
    assert judgement.together("both", [MET, MET]).met
    whole = judgement.together("both", [MET, MISSED])
    assert not whole.met
    assert whole.why.startswith("both: x 1")


@pytest.mark.parametrize(("value", "met"), [(104.9, True), (105.1, False), (95.1, True), (94.9, False)])
def test_close_stands_at_its_edge(value: float, met: bool) -> None:
    assert judgement.within_share("x", Sample((value, value)), 100.0, 0.05).met is met


def test_a_sample_shows_mean_error_and_own_record() -> None:
    values = Sample((1.0, 2.0, 3.0), 5.0)
    assert (values.mean, values.scatter, values.error) == pytest.approx((2.0, 1.0, 1.0 / math.sqrt(3.0)))
    assert str(values) == "2 +- 0.58 (own record 5)"


def test_a_correlated_sample_is_worth_less() -> None:
    noise = np.random.default_rng(1).standard_normal(8192)
    assert sample.effective_size(noise) == pytest.approx(8192, rel=0.02)
    held = np.repeat(noise[:1024], 8)  # rho falls linearly over 8 samples: 1 + 2 sum (1 - k/8)^4
    expected = 8192 / (1.0 + 2.0 * sum((1.0 - k / 8.0) ** 4 for k in range(1, 8)))
    assert sample.effective_size(held) == pytest.approx(expected, rel=0.1)


def test_the_gaussian_is_refused_as_often_as_the_level_says(found: evidence.Evidence) -> None:
    random = np.random.default_rng(7)
    colour = np.fft.rfft(found.records(evidence.Drive("linear"))[0]["displacement"])
    refused = 0
    for _ in range(200):  # the linear response's own autospectrum with new Gaussian lines
        lines = np.abs(colour) * (random.standard_normal(len(colour)) + 1j * random.standard_normal(len(colour)))
        refused += not sample.is_gaussian(np.fft.irfft(lines))
    assert refused <= 0.05 * 200 + 3.0 * math.sqrt(200 * 0.05 * 0.95)
    assert not sample.is_gaussian(random.uniform(size=8192))
    assert not sample.is_gaussian(random.standard_t(4, size=8192))


@pytest.mark.long
def test_every_statement_is_judged_once(judged: pd.DataFrame, report: Reported) -> None:
    assert list(judged["id"]) == [s for s in report.statements if "." not in s]
    assert len(judged) >= 30
    assert list(judged.columns) == ["id", "where", "claim", "reported", "measured", "criterion", "verdict", "why"]


def test_every_failure_has_a_reason_and_no_success_has(judged: pd.DataFrame) -> None:
    failed = judged["verdict"] != "reproduced"
    assert (judged.loc[failed, "why"].str.len() > 0).all()
    assert (judged.loc[~failed, "why"] == "").all()
    assert (judged["measured"].str.len() > 0).all()
    assert (judged["criterion"].str.len() > 0).all()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("duffing_cubic", "reproduced"),
        ("siso_stiffness", "reproduced"),
        ("levels_invariant", "reproduced"),
        ("levels_siso", "reproduced"),
        ("dead_band_pattern", "reproduced"),
        ("mathieu_lines", "reproduced"),
        ("linear_leakage", "reproduced"),
        ("averages", "partly"),
        ("added_terms", "partly"),
        ("error_free", "not reproduced"),
        ("exact_stiffness", "not reproduced"),
        ("duffing_share", "not reproduced"),
        ("dead_band_share", "not reproduced"),
        ("noise_random_only", "not reproduced"),
        ("noise_instruments", "reproduced"),
    ],
)
def test_what_the_study_finds(judged: pd.DataFrame, name: str, said: str) -> None:
    row = judged.set_index("id").loc[name]
    assert row["verdict"] == said, row["measured"]


def test_the_page_holds_every_row(judged: pd.DataFrame) -> None:
    page = document.markdown(study_pages.titled("claims", study_pages.Results({"claims": judged}, {})))
    assert page.count("\n| [") == len(judged)
    assert page.count("<details>") == len(judged)
    beside = judged["where"].str.startswith(judgement.BESIDE)
    assert list(judged["id"][beside]) == ["noise_instruments"]
    assert f" of {len(judged) - 1} statements are reproduced" in page, "what the report does not state is not counted"
    width = next(line for line in page.splitlines() if line.startswith("|")).replace("\\|", "").count("|")
    assert all(line.replace("\\|", "").count("|") == width for line in page.splitlines() if line.startswith("|"))


def changed(folder: Path, settings: ClaimSettings, system: str, old: str, new: str) -> evidence.Evidence:
    shutil.copytree(ROOT / "models", folder / "models")
    path = folder / "models" / f"{system}.yaml"
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    return evidence.Evidence(settings, evidence.models_of(folder / "models"), [])


@pytest.mark.parametrize(
    ("system", "old", "new", "claims"),
    [
        (
            "duffing", "2.0e7", "3.0e7",
            ["duffing_cubic", "siso_stiffness", "duffing_pattern", "table_1"],
        ),
        ("duffing_van_der_pol", "2.0e6", "1.0e6", ["combined_cubic", "levels_invariant"]),
        ("linear", "3.77", "3.9", ["oval_width"]),
        ("dead_band", "0.0025", "0.0035", ["system_stiffness_gap", "dead_band_pattern"]),
    ],
)  # fmt: skip
def test_a_changed_coefficient_changes_the_verdicts(
    tmp_path: Path, settings: ClaimSettings, found: evidence.Evidence, report: Reported,
    system: str, old: str, new: str, claims: list[str],
) -> None:  # fmt: skip
    other = changed(tmp_path, settings, system, old, new)
    for claim in claims:
        assert claims_table.judge_claim(claim, found, report).verdict == "reproduced"
        assert claims_table.judge_claim(claim, other, report).verdict != "reproduced"


def test_a_changed_statement_changes_the_verdict(found: evidence.Evidence, report: Reported) -> None:
    rows = dict(report.statements)
    rows["siso_stiffness"] = rows["siso_stiffness"].model_copy(update={"value": 400.0})
    assert claims_table.judge_claim("siso_stiffness", found, Reported(rows)).verdict == "not reproduced"


def test_the_same_evidence_twice(settings: ClaimSettings, found: evidence.Evidence, report: Reported) -> None:
    again = evidence.Evidence(settings, evidence.models_of(ROOT / "models"), [])
    first, second = (claims_table.judge_claim("siso_frequency", whose, report) for whose in (found, again))
    assert first == second


def test_the_dead_band_is_read_from_its_pattern(found: evidence.Evidence) -> None:
    record = found.records(evidence.Drive("dead_band"))[0]
    assert read_dead_band(record, 1.0) == pytest.approx(0.0025, rel=0.05)


@pytest.mark.parametrize("pace", [0.8, 1.25])
def test_the_envelope_is_that_of_the_figures_harmonic_motion(pace: float) -> None:
    """A slower motion than one at f_n stays within by as much as it is slower; a faster one stands beyond it."""
    model = read_model(ROOT / "models" / "linear.yaml")
    omega, time = 2.0 * math.pi * pace * natural_frequency(model.numbers()), 0.001 * np.arange(8000)
    u, v = np.sin(omega * time), omega * np.cos(omega * time)
    force = model_restoring_force(model, u, v, time) - omega**2 * u
    record = Record(
        0.001, {"force": force, "displacement": u, "velocity": v, "acceleration": -(omega**2) * u}, name="harmonic"
    )
    inside, width = preliminary_claims.envelope(model, record, 1.0)
    assert width == pytest.approx(pace, rel=1e-3)
    assert (inside > 0.99) == (pace < 1.0)


def test_what_the_cubic_terms_add_at_the_lowest_level_is_what_siso_finds_too_much(
    found: evidence.Evidence, report: Reported
) -> None:
    spring, damper = levels.cubic_shares(found, report, 0.2)
    single = found.at("duffing_van_der_pol", 0.2)
    assert single.siso("k").mean / 355.3 - 1.0 == pytest.approx(spring, rel=0.2)
    assert single.siso("c").mean / 3.77 - 1.0 == pytest.approx(damper, rel=0.2)
    assert (
        f"adds {100 * spring:.0f} % to the force that follows u"
        in claims_table.judge_claim("levels_similar", found, report).why
    )


def test_a_histogram_is_far_from_gaussian_by_its_shape_not_by_its_length(
    found: evidence.Evidence, report: Reported
) -> None:
    claim = claims_table.judge_claim("combined_histogram", found, report)
    assert "2.6 % lie beyond two standard deviations where a Gaussian has 4.6 %" in claim.why
    record = found.records(evidence.Drive("duffing_van_der_pol"))[0]["displacement"]
    short = np.split(record, 8)
    assert np.mean([sample.kurtosis(s) for s in short]) == pytest.approx(sample.kurtosis(record), abs=0.1)
    gaussian = np.random.default_rng(3).standard_normal(100_000)
    assert sample.outer_share(gaussian) == pytest.approx(sample.GAUSSIAN_OUTER_SHARE, rel=0.05)


def test_the_resonance_of_the_fast_mathieu_system_is_drawn_towards_half_its_stiffness_s_frequency(
    found: evidence.Evidence, report: Reported
) -> None:
    """Floquet's exponents of u'' + c u' + (k + k_m cos) u = 0 say where its lines are."""
    model = read_model(ROOT / "models" / "mathieu.yaml").numbers()
    period, (c, k, k_m) = 0.2, (model[n] for n in ("c", "k", "km_cos"))

    def slope(t: float, y: Any) -> list[float]:
        return [y[1], -c * y[1] - (k + k_m * math.cos(2.0 * math.pi * t / period)) * y[0]]

    ends = [solve_ivp(slope, (0.0, period), y0, rtol=1e-9, atol=1e-12).y[:, -1] for y0 in ([1.0, 0.0], [0.0, 1.0])]
    turn = abs(np.angle(np.linalg.eigvals(np.array(ends).T)[0])) / (2.0 * math.pi)  # of a cycle in each period
    line = (1.0 - turn) / period
    assert 2.5 < line < 2.9
    claim = claims_table.judge_claim("mathieu_fast", found, report)
    said = re.search(r"to ([0-9.]+) Hz, and its sum with f_m to ([0-9.]+) Hz", claim.why)
    assert said
    assert [float(x) for x in said.groups()] == pytest.approx([line, 5.0 + line], abs=0.11)


def test_instruments_are_judged_at_every_noise_by_their_own_bias(
    monkeypatch: pytest.MonkeyPatch, found: evidence.Evidence, report: Reported
) -> None:
    asked: list[float] = []

    def off(_: evidence.Evidence, __: Reported, noise: float) -> dict[str, Sample]:
        asked.append(noise)
        return {"m": Sample((-0.098, 0.0) if noise == 0.1 else (-0.01, 0.02)), "c": Sample((-0.2, 0.21))}

    monkeypatch.setattr(levels, "relative_errors", off)
    claim = claims_table.judge_claim("noise_instruments", found, report)
    assert asked == [0.05, 0.1, 0.2]
    assert claim.verdict == "reproduced", "a bias below the limit, and scatter that explains it"
    assert "10 % noise: m -4.9 +- 4.9 %, c +0.5 +- 20 %" in claim.measured
    assert not levels.small("m", Sample((-0.06, -0.06)), 0.05).met
    assert levels.small("m", Sample((-0.0101, -0.0099)), 0.05).met


def test_raw_is_the_nearer_reading(found: evidence.Evidence, report: Reported) -> None:
    rows = dead_band.both_readings(found, report)
    raw, filtered = ((rows["nearer"] == reading).sum() for reading in ("raw", "filtered"))
    assert raw > filtered
    stiffness = rows.iloc[0]
    assert stiffness["raw_distance"] == pytest.approx(stiffness["raw_mean"] - 500.0)
    assert abs(stiffness["raw_distance"]) < abs(stiffness["filtered_distance"])


def test_steps_take_the_integrator_s_error_away(steps: pd.DataFrame) -> None:
    rows = steps[(steps["system"] == "linear") & (steps["reading"] == "raw") & (steps["parameter"] == "zeta")]
    error = rows.set_index(["method", "steps_per_sample"])["relative_error"]
    assert error["abm4", 1] == pytest.approx(-0.18, abs=0.02)
    assert abs(error["abm4", 2]) < 0.05
    assert abs(error["abm4", 8]) < 1e-4
    assert abs(error["rk4", 4]) < 1e-4


def integrated(error: float, diverged: int = 0) -> list[dict[str, Any]]:
    """Rows of the integrator study: one system, one parameter moved by a share, runs lost in the other reading."""
    row = {"system": "linear", "method": "abm4", "steps_per_sample": 1, "true": 1.0, "standard_error": 1e-4, "seeds": 4}
    return [
        {**row, "reading": reading, "parameter": name, "relative_error": error, "diverged": lost}
        for reading, lost in (("raw", 0), ("filtered", diverged))
        for name in ("k", "f_n", "m", "c", "zeta")
    ]


@pytest.mark.parametrize(
    ("error", "diverged", "said"),
    [
        (1e-4, 0, "reproduced"),
        (1e-4, 2, "partly"),
        (0.1, 0, "not reproduced"),  # runs that merely end make nothing free of error
        (0.1, 2, "not reproduced"),
    ],
)
def test_a_run_that_diverges_makes_error_free_worse_and_none_makes_it_better(
    settings: ClaimSettings, report: Reported, error: float, diverged: int, said: str
) -> None:
    some = evidence.Evidence(settings, evidence.models_of(ROOT / "models"), integrated(error, diverged))
    claim = claims_table.judge_claim("error_free", some, report)
    assert claim.verdict == said
    assert ("2 of 4 runs of linear diverge (unit variance filtered)" in claim.measured) == (diverged == 2)


def test_diverged_runs_are_counted_by_name(steps: pd.DataFrame) -> None:
    rows = steps[(steps["system"] == "van_der_pol") & (steps["method"] == "abm4") & (steps["steps_per_sample"] == 1)]
    assert (rows["diverged"] > 0).all()
    named = rows["diverged_seeds"].iloc[0].split(", ")
    assert len(named) == rows["diverged"].iloc[0]
    assert all(" at " in n and n.endswith(" s") for n in named)
    results = study_pages.Results({"integrator_steps": steps}, {})
    page = document.markdown(study_pages.titled("integrator_steps", results))
    assert f"| {rows['diverged'].iloc[0]} of {rows['seeds'].iloc[0]} " in page


def test_a_white_spectrum_is_uniform_and_a_bump_is_seen() -> None:
    """Four lines in a thousand of white spectra may be refused, not one in two."""
    rng = np.random.default_rng(4)
    white = rng.chisquare(2 * 29, (300, 24, 120))
    assert np.mean([not departure(spectra).uniform for spectra in white]) < 0.03
    bump = white[:20].copy()
    bump[:, :, 60] *= 1.25
    found = [departure(spectra) for spectra in bump]
    assert np.mean([f.uniform for f in found]) < 0.2
    assert np.median([f.share for f in found]) == pytest.approx(0.25, abs=0.05)
