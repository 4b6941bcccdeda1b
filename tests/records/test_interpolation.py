"""Band-limited values between the samples."""

import numpy as np
import pytest

from study.records.excitation import Excitation, force
from study.records.interpolation import BETWEEN_SAMPLES, between_samples, between_samples_kept
from study.support.recent import Recent


@pytest.mark.parametrize("samples", [256, 257])
@pytest.mark.parametrize("factor", [2, 3, 16])
def test_exact_for_a_periodic_band_limited_signal(samples: int, factor: int) -> None:
    generator = np.random.default_rng(0)
    lines = np.arange(0, (samples - 1) // 2 + 1)
    amplitude, phase = generator.normal(size=len(lines)), generator.uniform(0, 2 * np.pi, len(lines))

    def signal(position: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * np.outer(position, lines) / samples + phase
        return np.cos(angle) @ amplitude

    fine = between_samples(signal(np.arange(samples)), factor)
    np.testing.assert_allclose(fine, signal(np.arange(factor * (samples - 1) + 1) / factor), atol=1e-11)


def test_the_reports_force_is_interpolated_exactly() -> None:
    """The same lines on a grid eight times as fine are the same force."""
    coarse = force(Excitation(), 1024, 0.02, seed=3)
    spectrum = np.fft.rfft(coarse)
    exact = np.fft.irfft(spectrum, 8 * 1024) * 8
    np.testing.assert_allclose(between_samples(coarse, 8), exact[: 8 * 1023 + 1], atol=1e-12)


@pytest.mark.parametrize("factor", [1, 2, 7])
@pytest.mark.parametrize("kind", ["closing", "open", "short", "constant"])
def test_samples_themselves_are_kept(factor: int, kind: str) -> None:
    x = {
        "closing": force(Excitation(), 500, 0.02, seed=1),
        "open": np.linspace(0.0, 3.0, 500) ** 2,
        "short": np.array([0.0, 1.0]),
        "constant": np.full(50, 2.5),
    }[kind]
    fine = between_samples(x, factor)
    assert len(fine) == factor * (len(x) - 1) + 1
    np.testing.assert_allclose(fine[::factor], x, atol=1e-12)


@pytest.mark.parametrize("room", [0, 1 << 20])
@pytest.mark.parametrize("reading", BETWEEN_SAMPLES)
def test_a_span_is_what_the_whole_record_has_there(reading: str, room: int) -> None:
    """Kept or not: where there is no room for the whole, only the span is made."""
    kept = Recent(room)
    for x in (force(Excitation(), 500, 0.02, seed=1), np.linspace(0.0, 3.0, 500) ** 2):
        whole = between_samples(x, 6, reading)
        for first, last in ((0, 500), (0, 250), (250, 500), (100, 102)):
            there = whole[6 * first : 6 * (last - 1) + 1]
            np.testing.assert_array_equal(between_samples(x, 6, reading, (first, last)), there)
            np.testing.assert_array_equal(between_samples_kept(kept, x, 6, reading, (first, last)), there)
    assert kept.size == (8 * (500 + 6 * 2) if room == 0 else 2 * 8 * 500 * 7)


@pytest.mark.parametrize("cycles", [10.3, 40.7, 77.7])
def test_small_error_inside_a_record_that_does_not_close(cycles: float) -> None:
    """Of a ramp and a sine of a broken number of cycles; the ends are left out, the inside is not."""
    samples, factor = 2048, 8

    def signal(position: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * cycles * position / samples + 0.3) + 5.0 * position / samples

    fine = between_samples(signal(np.arange(samples)), factor)
    error = np.abs(fine - signal(np.arange(len(fine)) / factor))
    assert error[factor * 100 : -factor * 100].max() < 1e-6
    assert error.max() < 5e-3


def test_beats_straight_lines_near_the_nyquist_frequency() -> None:
    samples, factor = 1000, 8
    grid = np.arange(factor * (samples - 1) + 1) / factor
    exact = np.sin(2 * np.pi * 0.4 * grid)
    x = exact[::factor]
    inside = slice(100 * factor, -100 * factor)
    ours = np.abs(between_samples(x, factor) - exact)[inside].max()
    lines = np.abs(np.interp(grid, np.arange(samples), x) - exact)[inside].max()
    assert ours < 0.01 * lines


def test_a_part_of_a_random_record_is_interpolated_well_inside() -> None:
    """Its ends differ by no more than neighbours may, yet it does not close: a wrapped jump would ring throughout."""
    worst = []
    for seed in range(20):
        whole = force(Excitation(), 4096, 0.02, seed=seed)
        exact = 8.0 * np.fft.irfft(np.fft.rfft(whole), 8 * 4096)
        part = slice(500 + seed, 2500 + 3 * seed)
        fine = between_samples(whole[part], 8)
        error = np.abs(fine - exact[8 * part.start : 8 * (part.stop - 1) + 1]) / np.std(whole)
        worst.append((error.max(), error[400:-400].max()))
    assert np.mean(worst, axis=0)[0] < 0.1
    assert np.mean(worst, axis=0)[1] < 2e-4


def test_every_seed_of_the_reports_force_is_taken_as_periodic() -> None:
    for seed in range(300):
        coarse = force(Excitation(), 512, 0.02, seed=seed)
        exact = 2.0 * np.fft.irfft(np.fft.rfft(coarse), 2 * 512)
        np.testing.assert_allclose(between_samples(coarse, 2), exact[: 2 * 511 + 1], atol=1e-12)
