"""A prediction of several sensors: each by itself, and all together."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from study.compare import noise
from study.compare.prediction import Prediction, predict
from study.equations.model import Model
from study.identify.time_domain.fit_model import fit_model
from study.records.plan import Plan
from study.records.prepared import Prepared, prepare_record
from study.records.record import Record, Sensor, record_of
from study.support.arrays import Floats

DT, PERIOD, PERIODS = 0.01, 1024, 4
SENSORS = Sensor("floor1", "displacement"), Sensor("floor2", "acceleration")
SIZES = np.array([1e-3, 5.0])


def predicted(left: Floats, *, low: float = 0.0, shaker: Floats | None = None) -> Prediction:
    """What two sensors show of a periodic motion; ``left`` is measured less predicted over the sizes, (n, 2)."""
    n = PERIODS * PERIOD
    turn = 2.0 * np.pi * np.arange(n) / PERIOD
    motion = SIZES * np.sqrt(2.0) * np.stack([np.sin(16.0 * turn), np.cos(24.0 * turn)], axis=1)
    force = np.sin(16.0 * turn) if shaker is None else shaker
    shown = motion + SIZES * left
    record = record_of(DT, {"shaker": force}, dict(zip(SENSORS, shown.T, strict=True)))
    plan = Plan("displacement", (0, n // 2), (n // 2, n))
    prepared = Prepared(replace(record, period=PERIOD), plan, (low, 0.5 / DT), 0, low=low, sensors=SENSORS)
    return Prediction(prepared, None, motion[n // 2 :], np.zeros(2))


def noisy(shares: tuple[float, float]) -> Floats:
    """White noise at both sensors, over their sizes."""
    return np.array(shares) * np.random.default_rng(5).standard_normal((PERIODS * PERIOD, 2))


def test_each_sensor_is_judged_in_its_own_size() -> None:
    found = predicted(noisy((0.02, 0.1)))
    assert found.errors == pytest.approx([0.02, 0.1], rel=0.05)
    assert found.error == pytest.approx(np.sqrt(np.mean(np.square([0.02, 0.1]))), rel=0.05)
    assert found.floors == pytest.approx(found.errors, rel=0.1)
    assert found.above_noise == 0.0
    assert [found.of(i).error for i in (0, 1)] == found.errors.tolist()
    assert found.of(1).residual == pytest.approx(found.misfit[:, 1])
    weighed = found.prepared.outputs.stacked(found.misfit)
    assert found.residual == pytest.approx(weighed)
    shares = np.stack([view.residual / view.size for view in found.views])
    assert np.sqrt(np.mean(shares**2)) == pytest.approx(found.error)


def test_what_stands_above_the_noise_of_one_sensor_is_seen() -> None:
    left = noisy((0.02, 0.02))
    left[:, 1] += 0.2 * np.sin(0.5 * np.arange(len(left)))
    found = predicted(left, shaker=np.random.default_rng(6).standard_normal(len(left)))
    assert found.of(0).noise.alone
    assert found.of(1).noise.source == noise.WHITE
    assert found.above_noise == pytest.approx(np.sqrt(0.2**2 / 2.0 / 2.0), rel=0.1)


def test_noise_of_any_colour_shows_between_the_periods_of_each_sensor() -> None:
    steps = noisy((0.01, 0.01))
    coloured = np.stack([np.convolve(x, 0.9 ** np.arange(60.0), "same") for x in steps.T], axis=1)
    alike = predicted(coloured)
    assert alike.of(1).noise.source == noise.SCATTER
    assert alike.floors == pytest.approx(alike.errors, rel=0.3)
    other = predicted(coloured, shaker=np.random.default_rng(6).standard_normal(len(steps)))
    assert other.of(1).noise.source == noise.WHITE, "the force of two periods is not the same"
    assert other.floor < 0.5 * other.error


def test_what_lies_below_the_cut_off_is_not_judged() -> None:
    left = noisy((0.01, 0.01))
    left += 0.3 * np.sin(2.0 * np.pi * 0.05 * DT * np.arange(len(left)))[:, None]
    assert predicted(left).error > 0.2
    above = predicted(left, low=0.5)
    assert above.error < 0.03
    assert np.sqrt(np.mean(above.residual**2)) == pytest.approx(above.error, rel=0.05)


def test_no_history_is_kept_that_follows_from_the_prediction() -> None:
    """Of a long record every candidate would keep it."""
    found = predicted(noisy((0.02, 0.1)))
    assert found.measured.shape == found.predicted.shape  # which the record keeps
    tracemalloc.start()
    assert found.error > 0.0
    assert len(found.residual) == found.predicted.size
    assert np.all(found.views[0].residual == found.views[0].difference)
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert kept < found.predicted.nbytes / 2


def test_the_run_along_what_was_fitted_is_not_kept(systems: dict[str, Model], records: dict[str, Record]) -> None:
    prepared = prepare_record(records["linear"])
    found = predict(fit_model(systems["linear"], prepared), prepared)
    assert found.predicted.base is None
    assert len(found.predicted) < len(records["linear"])
