"""Forces: level, spectrum, band, periods, seeds; and what is refused."""

import numpy as np
import pytest

from study.records.excitation import Excitation, displacement_noise, force, theoretical_autospectrum
from study.records.spectra import Segments, autospectrum
from study.support.errors import StudyError

DT, N = 0.02, 8192
KINDS = {
    "raw": Excitation(),
    "filtered": Excitation(reading="filtered", level=2.0),
    "waves": Excitation("pierson_moskowitz", level=0.7, peak_frequency=2.0),
    "multisine": Excitation("random_phase_multisine", level=3.0, start_frequency=0.5, stop_frequency=10.0),
    "odd": Excitation("random_phase_multisine", start_frequency=0.5, stop_frequency=10.0, odd_only=True, periods=2),
    "sweep": Excitation("swept_sine", start_frequency=1.0, stop_frequency=10.0),
    "falling": Excitation("swept_sine", start_frequency=10.0, stop_frequency=1.0, sweep="logarithmic"),
    "band": Excitation("gaussian_band", level=0.4, start_frequency=0.5, stop_frequency=10.0),
    "blows": Excitation("blows", level=0.3, blows=64),
    "steps": Excitation("stepped_sine", start_frequency=1.0, stop_frequency=10.0, steps=64),
}
RANDOM = ("raw", "filtered", "waves", "band")
SAME_FOR_ALL = ("swept_sine", "stepped_sine")


@pytest.mark.parametrize("name", KINDS)
def test_same_seed_same_bytes_and_another_seed_another_force(name: str) -> None:
    settings = KINDS[name]
    assert force(settings, N, DT, 3).tobytes() == force(settings, N, DT, 3).tobytes()
    if settings.kind not in SAME_FOR_ALL:
        other = force(settings, N, DT, 4)
        assert abs(np.corrcoef(force(settings, N, DT, 3), other)[0, 1]) < 6.0 / np.sqrt(2 * 12.5 * N * DT / 10)


@pytest.mark.parametrize("name", KINDS)
def test_mean_square_agrees_with_the_level(name: str) -> None:
    settings = KINDS[name]
    squares = np.array([np.mean(force(settings, N, DT, seed) ** 2) for seed in range(40)])
    expected = settings.level * (0.5 if name == "raw" else 1.0)
    if name == "waves":  # all but exp(-5/4 (f_p/f)^4) of it lies below the cut-off
        expected *= np.exp(-1.25 * (2.0 / 12.5) ** 4)
    standard_error = np.std(squares) / np.sqrt(len(squares) - 1)
    allowed = 4.0 * standard_error if name in RANDOM else 2e-3 * expected
    assert abs(np.mean(squares) - expected) < allowed + 1e-12


@pytest.mark.parametrize("name", ["multisine", "odd"])
def test_a_multisine_has_its_level_exactly(name: str) -> None:
    assert np.mean(force(KINDS[name], N, DT, 9) ** 2) == pytest.approx(KINDS[name].level, rel=1e-12)


@pytest.mark.parametrize("name", KINDS)
def test_autospectrum_agrees_with_theory(name: str) -> None:
    """Band averages of the Welch estimate against the theoretical density, within four standard errors."""
    settings, samples, cut = KINDS[name], 8 * N, Segments(512)
    estimates = []
    for seed in range(4):
        frequency, density = autospectrum(force(settings, samples, DT, seed), DT, cut)
        estimates.append(density)
    theory = theoretical_autospectrum(settings, frequency, samples, DT)
    for low, high in ((2.0, 3.0), (4.0, 6.0), (6.0, 9.0)):
        band = (frequency >= low) & (frequency < high)
        ratio = np.mean(estimates, axis=0)[band].sum() / theory[band].sum()
        independent = 4 * cut.effective_averages(samples) * band.sum() / cut.line_inflation()
        assert ratio == pytest.approx(1.0, abs=4.0 / np.sqrt(independent) + 5e-3)


@pytest.mark.parametrize("name", KINDS)
def test_theoretical_density_integrates_to_the_mean_square(name: str) -> None:
    settings = KINDS[name]
    frequency = np.linspace(0.0, 25.0, 500_001)
    total = np.trapezoid(theoretical_autospectrum(settings, frequency, N, DT), frequency)
    expected = settings.level * (0.5 if name == "raw" else 1.0)
    assert total == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", RANDOM)
@pytest.mark.parametrize("samples", [1000, 1001, N])
def test_nothing_above_the_cutoff(name: str, samples: int) -> None:
    lines = np.abs(np.fft.rfft(force(KINDS[name], samples, DT, 5)))
    above = np.fft.rfftfreq(samples, DT) > 12.5 * (1 + 1e-9)
    assert lines[above].max() < 1e-12 * lines.max()
    assert lines[~above].max() > 0.0


def test_low_pass_leaves_the_lines_below_untouched() -> None:
    """The low-passed force is the white one minus its upper lines: no ripple, no delay."""
    white = np.fft.rfft(force(Excitation(cutoff=25.0), N, DT, 5))
    passed = np.fft.rfft(force(Excitation(cutoff=12.5), N, DT, 5))
    keep = np.fft.rfftfreq(N, DT) <= 12.5
    np.testing.assert_allclose(passed[keep], white[keep], atol=1e-10)


def test_a_stepped_sine_holds_each_of_its_frequencies_in_whole_cycles() -> None:
    x = force(Excitation("stepped_sine", start_frequency=1.0, stop_frequency=10.0, steps=4), N, DT, 0)
    for part, wanted in zip(x.reshape(4, -1), np.linspace(1.0, 10.0, 4), strict=True):
        lines = np.abs(np.fft.rfft(part))
        assert np.fft.rfftfreq(len(part), DT)[np.argmax(lines)] == pytest.approx(wanted, abs=0.5 / (len(part) * DT))
        assert np.sort(lines)[-2] < 1e-9 * lines.max()


def test_blows_are_as_many_as_are_asked_for_and_push_one_way() -> None:
    x = force(Excitation("blows", blows=8), N, DT, 3)
    assert np.sum((x[1:] > 0.0) & (x[:-1] == 0.0)) == 8
    assert x.min() == 0.0
    with pytest.raises(StudyError, match="do not fit"):
        force(Excitation("blows", blows=600), N, DT, 3)


@pytest.mark.parametrize("samples", [1000, 1001])
@pytest.mark.parametrize("cutoff", [12.5, 25.0])
def test_filtered_reading_holds_in_expectation_whatever_the_length(samples: int, cutoff: float) -> None:
    squares = [np.mean(force(Excitation(reading="filtered", cutoff=cutoff), samples, DT, s) ** 2) for s in range(400)]
    assert np.mean(squares) == pytest.approx(1.0, abs=4.0 * np.std(squares) / 20.0)


def test_gaussian_force_is_gaussian() -> None:
    x = force(Excitation(), 64 * N, DT, 2)
    x = x / np.std(x)
    independent = len(x) / 2
    assert abs(np.mean(x**3)) < 5.0 * np.sqrt(15.0 / independent)
    assert abs(np.mean(x**4) - 3.0) < 5.0 * np.sqrt(96.0 / independent)


def test_odd_multisine_has_odd_lines_of_its_period_only() -> None:
    x = force(KINDS["odd"], N, DT, 1)
    lines = np.flatnonzero(np.abs(np.fft.rfft(x[: N // 2])) > 1e-6)
    assert np.all(lines % 2 == 1)
    assert lines[0] >= 0.5 * N / 2 * DT
    assert lines[-1] <= 10.0 * N / 2 * DT
    np.testing.assert_array_equal(x[: N // 2], x[N // 2 :])


@pytest.mark.parametrize("name", ["sweep", "falling"])
def test_sweep_goes_from_the_first_to_the_last_frequency(name: str) -> None:
    settings = KINDS[name]
    x = force(settings, N, DT, 0)
    crossings = np.flatnonzero(np.diff(np.signbit(x))) * DT
    local = 0.5 / np.diff(crossings)  # half a period between two zero crossings
    assert np.mean(local[:2]) == pytest.approx(settings.start_frequency, rel=0.1)
    assert np.mean(local[-20:]) == pytest.approx(settings.stop_frequency, rel=0.1)
    middle = np.argmin(np.abs(crossings - N * DT / 2))
    halfway = np.sqrt(10.0) if settings.sweep == "logarithmic" else 5.5
    assert np.mean(local[middle - 10 : middle + 10]) == pytest.approx(halfway, rel=0.05)


def test_noise_has_its_mean_square_and_shares_nothing_with_the_force() -> None:
    displacement = 1e-3 * force(Excitation(), N, DT, 11) + 5e-4
    ratios = [np.mean(displacement_noise(displacement, 0.1, s) ** 2) / np.mean(displacement**2) for s in range(50)]
    assert np.mean(ratios) == pytest.approx(0.1, rel=4.0 * np.sqrt(2.0 / (50 * N)))
    white = force(Excitation(cutoff=25.0), N, DT, 11)
    noise = displacement_noise(displacement, 0.1, 11)
    assert abs(np.corrcoef(white, noise)[0, 1]) < 5.0 / np.sqrt(N)
    assert noise.tobytes() == displacement_noise(displacement, 0.1, 11).tobytes()
    assert not displacement_noise(displacement, 0.0, 11).any()


def test_noise_is_white() -> None:
    _, density = autospectrum(displacement_noise(np.ones(64 * N), 1.0, 3), DT)
    halves = density[1:128].mean() / density[128:255].mean()
    assert halves == pytest.approx(1.0, abs=0.02)
    assert density[1:255].mean() == pytest.approx(2 * DT, rel=0.02)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"kind": "pink"}, "pink"),
        ({"reading": "half"}, "half"),
        ({"sweep": "cubic"}, "cubic"),
        ({"level": -1.0}, "-1"),
        ({"level": float("nan")}, "nan"),
        ({"level": float("inf")}, "inf"),
        ({"cutoff": 0.0}, "cutoff"),
        ({"cutoff": float("nan")}, "cutoff"),
        ({"peak_frequency": -2.0}, "-2"),
        ({"periods": 0}, "periods"),
        ({"kind": "swept_sine", "start_frequency": 3.0, "stop_frequency": 3.0}, "3"),
        ({"kind": "random_phase_multisine", "start_frequency": 5.0, "stop_frequency": 3.0}, "5"),
    ],
)
def test_bad_settings_are_named(settings: dict[str, object], named: str) -> None:
    with pytest.raises(StudyError, match=named):
        Excitation(**settings)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("settings", "samples", "dt", "seed", "named"),
    [
        (Excitation(cutoff=26.0), 100, DT, 0, "26 Hz"),
        (Excitation("swept_sine", start_frequency=40.0), 100, DT, 0, "40 Hz"),
        (Excitation(), 1, DT, 0, "1 samples"),
        (Excitation(periods=3), 100, DT, 0, "3 whole periods"),
        (Excitation(), 100, 0.0, 0, "0 s"),
        (Excitation(), 100, float("nan"), 0, "nan s"),
        (Excitation(), 100, DT, -1, "seed is -1"),
        (Excitation("random_phase_multisine", start_frequency=1.01, stop_frequency=1.02), 100, DT, 0, "1.01"),
    ],
)
def test_bad_use_is_named(settings: Excitation, samples: int, dt: float, seed: int, named: str) -> None:
    with pytest.raises(StudyError, match=named):
        force(settings, samples, dt, seed)


@pytest.mark.parametrize("fraction", [-0.1, float("nan"), float("inf")])
def test_bad_noise_is_named(fraction: float) -> None:
    with pytest.raises(StudyError, match="noise fraction"):
        displacement_noise(np.ones(10), fraction, 0)
