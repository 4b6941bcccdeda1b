import tracemalloc

import numpy as np
import pytest
from scipy.signal import lfilter

from study.support.autoregression import autoregression, whitened


def coloured(seed, n=8192, poles=(1.0, -1.2, 0.5)):
    return lfilter([1.0], poles, np.random.default_rng(seed).standard_normal(n))


def test_the_coefficients_of_an_autoregressive_noise_are_found():
    found = np.array([autoregression(coloured(seed)) for seed in range(20)])
    scatter = np.std(found, axis=0, ddof=1)[1:] / np.sqrt(len(found))
    assert np.all(np.abs(np.mean(found, axis=0)[1:] - [-1.2, 0.5]) < 4.0 * scatter + 0.002)


def test_white_noise_has_no_coefficients():
    rng = np.random.default_rng(1)
    orders = [len(autoregression(rng.standard_normal(4096))) - 1 for _ in range(200)]
    assert np.mean(np.array(orders) > 0) < 0.05


@pytest.mark.parametrize("power", [0.0, 1.0, 2.0])
def test_what_is_filtered_is_white_whatever_its_colour(power):
    rng = np.random.default_rng(3)
    spectrum = np.fft.rfft(rng.standard_normal(16384))
    spectrum[1:] /= np.arange(1, len(spectrum)) ** (power / 2.0)
    noise = np.fft.irfft(spectrum)
    white = whitened(noise, autoregression(noise))[64:]
    power_of_lines = np.abs(np.fft.rfft(white)) ** 2
    bands = [np.mean(band) for band in np.array_split(power_of_lines[8:], 8)]
    assert max(bands) < 1.4 * min(bands)


def test_columns_are_filtered_as_one_is():
    columns = np.random.default_rng(5).standard_normal((50, 3))
    filter_ = np.array([1.0, -0.4, 0.1])
    each = np.column_stack([whitened(column, filter_) for column in columns.T])
    assert np.allclose(whitened(columns, filter_), each)
    assert np.allclose(whitened(np.full(20, 2.0), filter_), 2.0 * 0.7)


@pytest.mark.parametrize("order", [0, 1, 7])
def test_a_few_samples_at_a_time_are_all_of_them(order):
    values, coefficients = np.random.default_rng(6).standard_normal((200, 2)), np.arange(1.0, order + 2.0)
    whole = whitened(values, coefficients)
    assert np.array_equal(whitened(values, coefficients, at_a_time=16), whole)


def test_a_long_record_is_filtered_without_copies_of_it():
    values = np.ones((400_000, 4))
    tracemalloc.start()
    whitened(values, np.ones(8))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.5 * values.nbytes  # the result is one
