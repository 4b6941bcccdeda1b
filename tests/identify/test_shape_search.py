"""Points at which a search tries a candidate's shape parameters, written out a second time."""

from types import SimpleNamespace

import numpy as np
import pytest

from study import trials
from study.equations.kernels import WRITTEN_OUT
from study.equations.model import free
from study.equations.possible_effects import candidate_entries
from study.equations.terms import LIBRARY, get
from study.identify.time_domain import part_fit, shape_search
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.shape_search import Baseline
from study.records.prepared import prepare_record

DT, N = 0.02, 4096
TIME = DT * np.arange(N)
U = np.random.default_rng(3).standard_normal(N)
U = 0.004 * np.convolve(U, np.hanning(25), "same") + 0.001
SIZE, RATE = float(np.std(U)), float(np.std(np.gradient(U, DT)) / np.std(U))
LINES = (60.0, 210.5)  # of the spectrum of N samples, what the residual holds


@pytest.fixture(scope="module")
def base() -> SimpleNamespace:
    """A motion, and a residual of two sines."""
    residual = sum(np.sin(2 * np.pi * line * np.arange(N) / N) for line in LINES)
    residual = residual + 1e-3 * np.random.default_rng(4).standard_normal(N)
    fit = SimpleNamespace(residual=residual, samples=N)
    return SimpleNamespace(prescribed=False, fit=fit, prepared=SimpleNamespace(dt=DT, response="displacement"))


POINTS = {
    "dead_band": np.quantile(np.abs(U), np.linspace(0.08, 0.97, 14))[:, None],
    "one_sided_contact": np.quantile(U, np.linspace(0.1, 0.985, 16))[:, None],
    "relaxation": np.geomspace(0.05, 20.0, 12)[:, None] / RATE,
    "hysteresis": np.array([(b, b * g) for b in (0.15, 0.4, 1.0, 2.5, 6.0) for g in (-0.9, -0.3, 0.3, 0.9)]) / SIZE,
    "stribeck_friction": np.geomspace(0.03, 1.5, 7)[:, None] * SIZE * RATE,
}


@pytest.mark.parametrize("name", POINTS)
def test_amplitudes_and_times_come_from_the_motion(name: str, base: SimpleNamespace) -> None:
    found = shape_search.points_to_try(free(get(name)), U, base)
    np.testing.assert_allclose(found, POINTS[name], rtol=1e-12)
    keys = get(name).keys[1:]
    assert all(not get(name).physical(dict(zip(keys, point, strict=True))) for point in found)


def test_frequencies_come_from_the_lines_of_the_residual(base: SimpleNamespace) -> None:
    found = np.array(shape_search.points_to_try(free(get("harmonic_force")), U, base))[:, 0] * N * DT
    for line in LINES:
        for shift in (-0.35, 0.0, 0.35):
            assert np.min(np.abs(found - line - shift)) < 0.05
    assert len(found) % 3 == 0


@pytest.mark.parametrize("pitch", [0.013, 0.03])
def test_the_pitch_of_a_force_is_that_of_the_residual_over_the_displacement(pitch: float) -> None:
    """... beside noise of its own size."""
    rng = np.random.default_rng(5)
    residual = np.cos(2 * np.pi * U / pitch + 0.7) + rng.standard_normal(N)
    basis = np.linalg.qr(np.stack([U, np.gradient(U, DT)], axis=1))[0]  # a coefficient of the model takes a part
    fit = SimpleNamespace(
        residual=residual - basis @ (basis.T @ residual), model=SimpleNamespace(coordinates=("",)),
        outputs=SimpleNamespace(weights=(1.0,)), samples=N,
    )  # fmt: skip
    base = SimpleNamespace(
        several=True, prescribed=False, fit=fit, prepared=SimpleNamespace(dt=DT, response="displacement"),
        paths=lambda size: np.ones((size // 2 + 1, 1, 1)),
    )  # fmt: skip
    found = np.array(shape_search.points_to_try(free(get("cogging")), U, base))[:3, 0]  # to either side of the highest
    assert abs(np.ptp(U) / found[1] - np.ptp(U) / pitch) < 0.2  # of a pitch more or less along the whole motion


@pytest.mark.parametrize("name", [name for name, term in LIBRARY.items() if not term.parameters])
def test_a_term_without_shape_parameters_is_tried_once(name: str, base: SimpleNamespace) -> None:
    assert shape_search.points_to_try(free(get(name)), U, base) == [()]


@pytest.fixture(scope="module")
def fitted() -> Baseline:
    """A linear model beside which two effects are missing."""
    made = trials.make_trial(94181, ("cubic_stiffness", "quadratic_damping"), 0.01, "displacement")
    prepared = prepare_record(made.record).shortened(2048)
    return shape_search.baseline(fit_model(made.believed, prepared), prepared)


def test_effects_along_one_run_are_seen_as_along_runs_of_their_own(fitted: Baseline, monkeypatch: pytest.MonkeyPatch):
    entries = candidate_entries(fitted.fit.model)
    alone = [shape_search.shape_starts(entry, fitted) for entry in entries]
    runs: list[tuple[str, ...]] = []

    def seen(fit, prepared, keys=(), **options):
        runs.append(tuple(keys))
        return part_fit.run_of(fit, prepared, keys, **options)

    monkeypatch.setattr(shape_search, "run_of", seen)
    together = shape_search.starts_of(entries, fitted)
    assert any(together)
    for one, other in zip(alone, together, strict=True):
        assert [start.parameters for start in one] == [start.parameters for start in other]
        np.testing.assert_allclose([s.share for s in one], [s.share for s in other], atol=1e-9)
    assert max(map(len, runs)) > 5
    assert max(1 + len(keys) for keys in runs) <= WRITTEN_OUT
    friction = [entry.symbols for entry in entries if "friction" in entry.term.name]
    assert len(friction) > 1
    for symbols in friction:  # at whose reversals steps are cut
        assert all(keys == symbols for keys in runs if set(symbols) & set(keys))


def test_what_does_not_run_takes_nothing_from_what_it_stands_beside(fitted: Baseline):
    short, gap = free(get("relaxation")), free(get("dead_band"))
    width = float(np.std(fitted.motion[0]))
    none, seen = shape_search.sensitivities([(short, (1e-9,)), (gap, (width,))], fitted)
    alone = shape_search.sensitivity(gap, (width,), fitted)
    assert none is None
    assert seen is not None
    assert alone is not None
    np.testing.assert_allclose(seen, alone, rtol=1e-9)


@pytest.mark.parametrize("size", [1.0, 1e-180, 1e180])
def test_one_column_explains_what_least_squares_find(size: float):
    random = np.random.default_rng(2)
    added, residual = random.standard_normal((40, 1)), random.standard_normal(40)
    found = shape_search.explained_by(size * added, residual, ())
    amount, left = np.linalg.lstsq(added, residual)[:2]
    assert found.coefficients[0] * size == pytest.approx(float(amount[0]), rel=1e-12)
    assert found.share == pytest.approx(1.0 - float(left[0]) / float(residual @ residual), rel=1e-12)
