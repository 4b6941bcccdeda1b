"""Comparisons whose coefficients come from an estimator of the user's choice."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study import cli
from study.compare.by_estimator import FREE_RUN
from study.compare.comparison import CHAOTIC, Comparison, compare
from study.compare.comparison_report import comparison_document, comparison_summary
from study.compare.fitted_coefficients import Coefficient
from study.compare.local_force_error import local_force_error
from study.compare.prediction import predict
from study.equations.model import Model, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.records.excitation import Excitation, displacement_noise, force
from study.records.plan import Plan
from study.records.prepared import prepare_record
from study.records.record import Record, write_csv
from study.records.spectra import Segments
from study.support.errors import DivergenceError, StudyError

NAMES = ("inertia", "linear_damping", "linear_stiffness", "cubic_stiffness")
VALUES = {"m": 1.0, "c": 3.77, "k": 355.3, "k3": 2e7}
OPEN = Model("believed", tuple(free(get(n)) for n in NAMES))


def record(periods: int = 1, noise: float = 0.005, on_force: float = 0.0) -> Record:
    kind = "gaussian_lowpass" if periods == 1 else "random_phase_multisine"
    drive = np.tile(force(Excitation(kind), 8192 if periods == 1 else 512, 0.02, 1), periods)
    made = simulate(OPEN.with_values(VALUES), drive, 0.02, Integrator("rk4", 4))
    rng = np.random.default_rng(2)
    shares = {"force": on_force, "displacement": noise}
    channels = {n: made[n] + s * np.std(made[n]) * rng.standard_normal(len(made)) for n, s in shares.items()}
    return Record(0.02, channels, name="rig", period=512 if periods > 1 else None)


def off(comparison: Comparison) -> dict[str, float]:
    """Each coefficient's error in its own standard errors."""
    return {c.key: (c.value - VALUES[c.key]) / (c.error or np.nan) for c in comparison.coefficients}


def compared(believed: Model, made: Record, *, estimator: str = FREE_RUN) -> Comparison:
    return compare(believed, prepare_record(made), estimator=estimator)


@pytest.fixture(scope="module")
def local() -> Comparison:
    return compared(OPEN, record(), estimator="local_polynomial")


def test_an_estimator_in_reverse_stands_in_for_the_free_run(local: Comparison) -> None:
    assert all(abs(error) < 4.0 for error in off(local).values()), off(local)
    assert all(c.error is not None and c.error < 0.01 * c.value for c in local.coefficients)
    assert local.prediction.error < 3.0 * local.prediction.floor, "judged in free run, like any other"
    assert comparison_document([local])["fit"]["estimator"] == "local_polynomial"
    assert "fitted to samples 0:4096 by local_polynomial, judged on 4096:8192" in comparison_summary([local])


def test_the_error_of_the_force_is_without_leakage() -> None:
    made = record(noise=0.0)
    own, report = (compared(OPEN, made, estimator=name).forces[0] for name in ("local_polynomial", "miso"))
    assert own.total < 1e-6 < 1e-3 < report.total, "nothing is missing"
    assert own.parametric_total < 1e-5
    assert own.frequency[1] - own.frequency[0] == pytest.approx(own.frequency[2] - own.frequency[1])
    linear = Model("believed", OPEN.terms[:3])
    one, other = (compared(linear, made, estimator=name).forces[0] for name in ("local_polynomial", "miso"))
    assert one.total == pytest.approx(other.total, rel=0.15), "what is missing is seen by both"
    assert one.parametric_total == pytest.approx(other.parametric_total, rel=0.15)
    assert np.all(np.diff(own.cumulative, axis=0) >= 0.0)


def test_a_judging_part_too_short_for_two_bands(local: Comparison) -> None:
    prepared = prepare_record(record(), Plan("displacement", (0, 4096), (4096, 4160)))
    prediction = predict(local.fit, prepared)
    with pytest.raises(StudyError, match="the part of rig to judge has 64 samples, too few for two bands of 17 lines"):
        local_force_error(local.fit.model, prediction.of(0))


def test_noise_on_the_force_is_allowed_for_where_there_are_periods() -> None:
    made = record(periods=18, noise=0.1, on_force=0.2)
    comparison = compared(OPEN, made, estimator="errors_in_variables")
    assert all(abs(error) < 4.0 for error in off(comparison).values()), off(comparison)
    assert comparison.forces[0].inputs, "the rest of the comparison is as ever"


def simulated(model: Model, noise: float, seed: int, samples: int = 8192) -> Record:
    made = simulate(model, force(Excitation(), samples, 0.02, seed), 0.02, Integrator("rk4", 8))
    u = made["displacement"]
    return Record(0.02, {"force": made["force"], "displacement": u + displacement_noise(u, noise, seed)}, name="rig")


def test_a_chaotic_motion_that_one_free_run_loses_is_fitted_in_pieces(systems: dict[str, Model]) -> None:
    """The Dead-Band system with nothing given: one free run ends in a side valley, far from the truth."""
    model = systems["dead_band"]
    comparison = compared(model.with_values(dict.fromkeys(model.values)), simulated(model, 0.05, 1))
    assert CHAOTIC in comparison.notes
    for c in comparison.coefficients:
        assert c.interval is not None
        true = model.values[c.key]
        assert true is not None
        assert abs(c.value - true) < 4.0 * (c.interval[1] - c.interval[0]) / 3.92, c.key
        assert c.value == pytest.approx(true, rel=0.02)


@pytest.mark.parametrize("chaotic", [True, False])
def test_where_pieces_fail_too_the_free_run_stands(
    chaotic: bool, local: Comparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise DivergenceError("nothing in common", 0.0)

    where = "study.identify.time_domain.settling"
    monkeypatch.setattr(f"{where}.is_poor", lambda *_: True)
    monkeypatch.setattr(f"{where}.is_chaotic", lambda *_: chaotic)
    monkeypatch.setattr(f"{where}.fit_in_segments", fails)
    comparison = compared(OPEN, local.record)
    assert CHAOTIC not in comparison.notes
    assert all(abs(error) < 4.0 for error in off(comparison).values())


def test_a_regular_motion_is_not_called_chaotic(local: Comparison) -> None:
    assert CHAOTIC not in compared(OPEN, local.record).notes
    assert CHAOTIC not in local.notes


@pytest.mark.parametrize("name", ["instrumental", "miso_free_shape"])
def test_shape_parameters_come_with_the_coefficients(name: str, systems: dict[str, Model]) -> None:
    model = systems["mathieu"]
    believed = model.with_values(dict.fromkeys(model.values))
    made = simulated(model, 0.0025, 2)
    comparison = compared(believed, made, estimator=name)
    frequency = next(c for c in comparison.coefficients if c.key == "periodic_stiffness.f_m")
    assert frequency.error is not None
    assert abs(frequency.value - 1.0) < 1e-3
    assert comparison.prediction.error < 0.2, "5 % is noise"
    if name == "miso_free_shape":
        given = believed.with_values({"periodic_stiffness.f_m": 1.0})
        with pytest.raises(StudyError, match=r"gives periodic_stiffness\.f_m; the estimator miso_free_shape"):
            compared(given, made, estimator=name)


def test_a_search_that_fails_is_told(local: Comparison, monkeypatch: pytest.MonkeyPatch) -> None:
    identified = estimators.identify("miso", OPEN, local.record, Settings(Segments(), (0.3, 10.0)))
    monkeypatch.setattr(estimators, "identify", lambda *_: replace(identified, note="stuck after 9 free runs"))
    comparison = compared(OPEN, local.record, estimator="instrumental")
    assert not comparison.fit.converged
    assert "did not arrive at a minimum (stuck after 9 free runs)" in comparison_summary([comparison])


def test_lines_that_are_noise_are_left_out() -> None:
    """Under 5 % noise the displacement is lost above some 8 Hz; MI/SO over these lines finds a third of the mass."""
    found = {
        c.key: c for c in compared(OPEN, simulated(OPEN.with_values(VALUES), 0.05, 3), estimator="miso").coefficients
    }
    assert found["m"].value == pytest.approx(1.0, rel=0.15)


def test_few_degrees_of_freedom_widen_the_interval() -> None:
    one, many = (Coefficient("k", "linear_stiffness", 1.0, 0.1, "N/m", freedom) for freedom in (1.0, np.inf))
    assert one.interval == pytest.approx((1.0 - 1.27062, 1.0 + 1.27062), rel=1e-5)
    assert many.interval == pytest.approx((1.0 - 0.195996, 1.0 + 0.195996), rel=1e-5)


def test_what_is_held_and_what_is_not_found(local: Comparison) -> None:
    held = OPEN.with_values({"k": 355.3})
    with pytest.raises(StudyError, match="'believed' holds k; the estimator local_polynomial finds every coefficient"):
        compared(held, local.record, estimator="local_polynomial")
    offset = replace(OPEN, terms=(*OPEN.terms, free(get("constant_force"))))
    with pytest.raises(
        StudyError, match=r"local_polynomial finds no .* in rig from .* Hz; take output_error or another"
    ):
        compared(offset, local.record, estimator="local_polynomial")


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def asked(*_: object, estimator: str, **__: object) -> Comparison:
        raise StudyError(f"asked for {estimator}")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("study.faults.accounting.compare", asked)
    write_csv(record(), Path("rig.csv"))
    Path("rig.yaml").write_text(f"name: rig\nterms: [{', '.join(NAMES)}]\n")
    for words, name in (([], "output_error"), (["--estimator", "local_polynomial"], "local_polynomial")):
        assert cli.main(["compare", "rig.csv", "--model", "rig.yaml", *words]) == 2
        assert f"asked for {name}" in capsys.readouterr().err
