"""Where a model fails: the parts of a comparison that look along frequency, time and amplitude, each by itself."""

import numpy as np
import pytest
from numpy.typing import NDArray

from study.compare import along_time, bands, force_map, growth
from study.compare.prediction import Prediction
from study.records.plan import Plan
from study.records.prepared import Prepared
from study.records.record import Record

Floats = NDArray[np.float64]
DT = 0.02


def test_the_narrowest_band_that_holds_most() -> None:
    power = np.zeros(101)
    power[20:24] = [1.0, 3.0, 4.0, 1.0]
    power[60] = 1.0
    band = bands.narrowest("response", np.arange(101) * 0.5, power)
    assert band is not None
    assert (band.low, band.high) == (10.25, 11.25)
    assert band.share == pytest.approx(0.7)
    assert bands.narrowest("response", np.arange(101) * 0.5, np.zeros(101)) is None


def judged(residual: Floats, response: Floats) -> Prediction:
    """A prediction that leaves this residual of this response."""
    record = Record(DT, {"force": np.zeros_like(response), "displacement": response})
    prepared = Prepared(record, Plan("displacement", (0, 0), (0, len(response))), (0.0, 0.5 / DT), 0)
    return Prediction(prepared, None, (response - residual)[:, None], np.zeros(1))


def test_chance_changes_along_the_record_are_not_reported() -> None:
    rng = np.random.default_rng(12)
    low = 0
    for _ in range(100):
        white = rng.standard_normal((2, 4096 + 8))
        residual, response = (np.convolve(x, np.ones(9), "valid") for x in white)
        low += along_time.along_time(judged(0.1 * residual, response)).p_value < 0.05
    assert low <= 11  # 5 are expected; more than 11 come by chance once in two hundred times


def test_a_change_along_the_record_is_seen_beside_one_of_the_level() -> None:
    rng = np.random.default_rng(13)
    residual, response = rng.standard_normal((2, 6000))
    steady = along_time.along_time(judged(0.1 * residual, response))
    assert steady.p_value > 0.01
    worse = residual * np.where(np.arange(6000) >= 5000, 2.0, 1.0)
    changed = along_time.along_time(judged(0.1 * worse, response))
    assert changed.p_value < 1e-6
    assert max(changed.stretches, key=lambda s: s.ratio) is changed.stretches[-1]
    bursts = np.repeat(np.tile([0.8, 1.25], 24), 125)  # the error follows the level, and that is no change in time
    bursts[5000:] *= 2.0
    follows = along_time.along_time(judged(0.1 * residual * bursts, response * bursts))
    assert follows.p_value > 0.01
    assert not follows.confounded
    assert follows.growth == pytest.approx(1.0, abs=0.1)


def test_where_level_and_time_change_together_they_are_not_told_apart() -> None:
    rng = np.random.default_rng(14)
    ramp = np.linspace(0.05, 1.0, 6000)
    residual, response = rng.standard_normal((2, 6000))
    assert along_time.along_time(judged(residual * ramp**2, response * ramp)).confounded


def test_curves_count_a_stay_once() -> None:
    at = np.repeat(np.tile(np.linspace(-1.0, 1.0, 50), 40), 10)
    rng = np.random.default_rng(15)
    value = np.repeat(rng.standard_normal(2000), 10)
    found = force_map.curve(at, value)
    middle = np.abs(found.at) < 0.5
    true = 1.0 / np.sqrt(2000 / 24)
    assert np.median(found.error[middle]) == pytest.approx(true, rel=0.5)
    assert np.mean(found.mean[middle] ** 2) < (3.0 * true) ** 2


def test_the_map_shows_the_force_where_the_motion_was() -> None:
    turn = np.linspace(0.0, 400.0 * np.pi, 100_000)
    size = 0.2 + 0.8 * np.linspace(0.0, 1.0, len(turn))
    u, v = size * np.cos(turn), -size * np.sin(turn)
    found = force_map.surface(u, v, v * np.abs(v))
    seen = np.isfinite(found.mean)
    middle = 0.5 * (found.velocity[1:] + found.velocity[:-1])
    expected = np.broadcast_to(middle * np.abs(middle), found.mean.shape)
    assert 0.5 < np.mean(seen) < 1.0
    np.testing.assert_allclose(found.mean[seen], expected[seen], atol=0.05)


def test_powers_are_interpolated_between_those_tried() -> None:
    powers = np.array([1.0, 1.5, 2.0])
    power, gain = growth._top(powers, 4.0 - (powers - 1.6) ** 2)
    assert (power, gain) == (pytest.approx(1.6), pytest.approx(4.0))
