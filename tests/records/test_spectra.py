"""Cross-spectral matrices: conventions, averages, chunks."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy import signal

from study.records import spectra
from study.records.spectra import Segments, autospectrum, cross_spectra, cross_spectra_in_pieces
from study.support.errors import StudyError

DT = 0.02


@pytest.fixture(scope="module")
def channels() -> list[np.ndarray]:
    generator = np.random.default_rng(5)
    white = generator.normal(size=(2, 3003))
    delayed = np.roll(white[0], 3) + 0.3 * white[1] + 0.2
    return [white[0], 1e-8 * white[1], 1e6 * delayed]


@pytest.mark.parametrize("window", ["hann", "boxcar", "hamming", ("tukey", 0.3)])
@pytest.mark.parametrize("length", [256, 255])
@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75])
def test_agrees_with_scipy(channels: list[np.ndarray], window: str, length: int, overlap: float) -> None:
    cut = Segments(length, overlap, window)
    np.testing.assert_allclose(cut.taper(), signal.get_window(window, length), rtol=0.0, atol=1e-15)
    matrix = cross_spectra(channels, DT, cut)
    for i, x in enumerate(channels):
        for j, y in enumerate(channels):
            frequency, expected = signal.csd(
                x, y, 1 / DT, window=cut.taper(), nperseg=length, noverlap=length - cut.hop,
                detrend=False, scaling="density",
            )  # fmt: skip
            np.testing.assert_allclose(matrix.frequency, frequency)
            scale = np.sqrt(np.mean(x**2) * np.mean(y**2)) * DT
            np.testing.assert_allclose(matrix.density[:, i, j], expected, rtol=1e-10, atol=1e-14 * scale)


def test_the_first_index_is_conjugated() -> None:
    """y = x delayed by tau has G_xy = G_xx exp(-j 2 pi f tau)."""
    x = np.random.default_rng(0).normal(size=100_000)
    matrix = cross_spectra([x, np.roll(x, 2)], DT)
    ratio = matrix.density[:, 0, 1] / matrix.density[:, 0, 0]
    expected = np.exp(-2j * np.pi * matrix.frequency * 2 * DT)
    np.testing.assert_allclose(ratio[1:-1], expected[1:-1], atol=0.05)


def test_matrix_is_hermitian_and_autospectra_are_not_negative(channels: list[np.ndarray]) -> None:
    density = cross_spectra(channels, DT).density
    size = np.sqrt(np.einsum("fii,fjj->fij", density, density).real)
    mirrored = density.conj().transpose(0, 2, 1)
    np.testing.assert_array_equal(np.triu(density, 1), np.triu(mirrored, 1))  # each product is made once
    assert np.max(np.abs(density - mirrored) / size) < 1e-14
    eigenvalues = np.linalg.eigvalsh(density / np.sqrt(np.einsum("fii,fjj->fij", density, density)).real)
    assert eigenvalues.min() > -1e-12


@pytest.mark.parametrize("length", [512, 511])
def test_parseval(length: int) -> None:
    """The one-sided density of a windowed segment integrates to its weighted mean square, exactly."""
    x = np.random.default_rng(1).normal(size=length) + 0.7
    cut = Segments(length)
    frequency, density = autospectrum(x, DT, cut)
    taper = cut.taper()
    expected = np.sum((taper * x) ** 2) / np.sum(taper**2)
    assert np.sum(density) * (frequency[1] - frequency[0]) == pytest.approx(expected, rel=1e-12)


def test_one_sided_density_of_white_noise() -> None:
    """Variance 1 at 0.02 s is 0.04 per hertz (FINDINGS 1), half of that at zero and at the Nyquist frequency."""
    x = np.random.default_rng(2).normal(size=400_000)
    _, density = autospectrum(x, DT, Segments(16))
    averages = Segments(16).effective_averages(len(x))
    np.testing.assert_allclose(density[2:-2], 0.04, rtol=5 / np.sqrt(averages))
    _, raw = autospectrum(x, DT, Segments(16, 0.0, "boxcar"))
    np.testing.assert_allclose(raw[[0, -1]], 0.02, rtol=5 * np.sqrt(2.0 / (len(x) / 16)))


def test_a_sine_has_its_mean_square() -> None:
    t = np.arange(5120) * DT
    frequency, density = autospectrum(3.0 * np.sin(2 * np.pi * 5.0 * t), DT)
    near = np.abs(frequency - 5.0) < 0.6
    assert np.sum(density[near]) * (frequency[1] - frequency[0]) == pytest.approx(4.5, rel=1e-3)


@pytest.mark.parametrize("chunk", [1, 3, 7, 1000])
def test_chunks_do_not_matter(channels: list[np.ndarray], chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    cut = Segments(128)
    whole = cross_spectra(channels, DT, cut).density
    monkeypatch.setattr(spectra, "CHUNK", chunk)
    np.testing.assert_allclose(cross_spectra(channels, DT, cut).density, whole, rtol=1e-9, atol=1e-30)


@pytest.mark.parametrize("cuts", [(1500,), (40, 41, 1000), (2990,), tuple(range(100, 3000, 100))])
@pytest.mark.parametrize("settings", [(128, 0.5), (255, 0.7), (100, 0.0)])
def test_a_record_in_pieces_is_the_whole_record(
    channels: list[np.ndarray], cuts: tuple[int, ...], settings: tuple[int, float]
) -> None:
    cut = Segments(*settings)
    pieces = zip(*(np.split(channel, cuts) for channel in channels), strict=True)
    matrix, whole = cross_spectra_in_pieces(pieces, DT, cut), cross_spectra(channels, DT, cut)
    size = np.sqrt(np.einsum("fii,fjj->fij", whole.density, whole.density).real)
    np.testing.assert_allclose(matrix.density / size, whole.density / size, rtol=0.0, atol=1e-13)
    assert matrix.averages == whole.averages


@pytest.mark.parametrize(
    ("pieces", "named"),
    [
        ([], "0 samples, fewer than the segment length 512"),
        ([[np.zeros(200)], [np.zeros(300)]], "500 samples, fewer than the segment length 512"),
        ([[np.zeros(600)] * 2, [np.zeros(600)] * 3], "3 channels; the pieces before it have 2"),
        ([[np.zeros(600)] * 2, [np.zeros(600), np.zeros(599)]], r"\[600, 599\]"),
    ],
)
def test_bad_pieces_are_named(pieces: Sequence[Sequence[np.ndarray]], named: str) -> None:
    with pytest.raises(StudyError, match=named):
        cross_spectra_in_pieces(pieces, DT)


def test_same_bytes_twice(channels: list[np.ndarray]) -> None:
    assert cross_spectra(channels, DT).density.tobytes() == cross_spectra(channels, DT).density.tobytes()


@pytest.mark.parametrize("settings", [("hann", 0.5), ("hann", 0.75), ("hann", 0.0), ("boxcar", 0.5), ("hamming", 0.6)])
def test_effective_averages_agree_with_scatter(settings: tuple[str, float]) -> None:
    """The variance of an autospectral estimate of white noise is G^2 over the effective averages."""
    window, overlap = settings
    cut, samples, runs = Segments(32, overlap, window), 32 * 12, 4000
    noise = np.random.default_rng(3).normal(size=(runs, samples))
    density = np.array([autospectrum(x, 1.0, cut)[1] for x in noise])[:, 3:-3:4]
    measured = np.mean(density, axis=0) ** 2 / np.var(density, axis=0)
    lines = density.shape[1]
    assert np.mean(measured) == pytest.approx(cut.effective_averages(samples), rel=4.0 * np.sqrt(3.0 / (runs * lines)))


@pytest.mark.parametrize("settings", [("hann", 0.5), ("hann", 0.0), ("boxcar", 0.0), ("hann", 0.75)])
def test_line_inflation_agrees_with_scatter(settings: tuple[str, float]) -> None:
    """Variance of the sum over neighbouring lines of a cross-spectrum of unrelated channels, over their variances."""
    window, overlap = settings
    cut, samples, runs, lines = Segments(64, overlap, window), 64 * 8, 6000, 24
    noise = np.random.default_rng(4).normal(size=(2, runs, samples))
    cross = np.array(
        [cross_spectra([x, y], 1.0, cut).density[4 : 4 + lines, 0, 1] for x, y in zip(*noise, strict=True)]
    )
    single = np.mean(np.abs(cross) ** 2)
    # Pairs of lines within the band, taper by taper: a finite band holds (1 - l/lines) of each lag.
    lags = [np.mean(cross[:, : lines - lag].conj() * cross[:, lag:]).real / single for lag in range(8)]
    measured = lags[0] + 2.0 * sum(lags[1:])
    assert measured == pytest.approx(cut.line_inflation(), abs=0.06)


@pytest.mark.parametrize("settings", [("hann", 0.5), ("hann", 0.7), ("boxcar", 0.5), ("hamming", 0.0)])
def test_line_inflation_is_the_sum_over_all_pairs_of_lines_and_segments(settings: tuple[str, float]) -> None:
    """Correlation of line f of a segment with line f + l of one k hops later, summed by brute force."""
    window, overlap = settings
    cut = Segments(64, overlap, window)
    taper, t = cut.taper(), np.arange(64)
    total = np.zeros(64)
    for k in range(-64, 65):
        shifted = np.array([taper[i + k * cut.hop] if 0 <= i + k * cut.hop < 64 else 0.0 for i in t])
        total += np.abs(np.exp(-2j * np.pi * np.outer(t, t) / 64) @ (taper * shifted)) ** 2
    assert cut.line_inflation() == pytest.approx(total.sum() / total[0], rel=1e-12)


def test_band_keeps_its_lines(channels: list[np.ndarray]) -> None:
    matrix = cross_spectra(channels, DT)
    part = matrix.band(0.3, 10.0)
    assert part.frequency[0] >= 0.3
    assert part.frequency[-1] <= 10.0
    assert len(part.density) == len(part.frequency) == np.sum((matrix.frequency >= 0.3) & (matrix.frequency <= 10.0))
    assert part.averages == matrix.averages


@pytest.mark.parametrize("settings", [(3, 0.5), (512, 1.0), (512, -0.1), (512, float("nan"))])
def test_bad_segments_are_named(settings: tuple[int, float]) -> None:
    with pytest.raises(StudyError, match=r"segment length|overlap"):
        Segments(*settings)


@pytest.mark.parametrize(
    ("lengths", "named"),
    [((100, 100), "100 samples, fewer than the segment length 512"), ((600, 601), r"\[600, 601\]")],
)
def test_bad_records_are_named(lengths: Sequence[int], named: str) -> None:
    with pytest.raises(StudyError, match=named):
        cross_spectra([np.zeros(n) for n in lengths], DT)


def test_an_unknown_window_is_a_study_error() -> None:
    with pytest.raises(StudyError, match=r"hanning2"):
        Segments(512, 0.5, "hanning2")
