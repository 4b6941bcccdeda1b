"""MI/SO against the report's equations, the normal equations, and the scatter of repeated estimates."""

import numpy as np
import pytest

from study.equations.model import Model
from study.identify.frequency_domain.conditioned import MisoResult, analyse
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.records.record import Record
from study.records.spectra import Segments, SpectralMatrix, cross_spectra
from study.support.errors import StudyError

DT = 0.02
CUT = Segments(128)


def three_inputs(samples: int = 20_000, seed: int = 0, noise: float = 0.5) -> list[np.ndarray]:
    """Three inputs correlated with delays between them (complex cross-spectra), an output with noise."""
    w = np.random.default_rng(seed).normal(size=(4, samples))
    x1 = w[0]
    x2 = 0.6 * np.roll(w[0], 2) + 0.8 * w[1]
    x3 = 0.5 * np.roll(w[0], 1) - 0.4 * np.roll(w[1], 3) + 0.7 * w[2]
    y = 2.0 * x1 + 0.7 * np.roll(x2, 1) - 1.3 * (x3 + 0.5 * np.roll(x3, 2)) + noise * w[3]
    return [x1, x2, x3, y]


@pytest.fixture(scope="module")
def matrix() -> SpectralMatrix:
    return cross_spectra(three_inputs(), DT, CUT)


@pytest.fixture(scope="module")
def result(matrix: SpectralMatrix) -> MisoResult:
    return analyse(matrix)


def test_agrees_with_the_normal_equations_line_by_line(matrix: SpectralMatrix, result: MisoResult) -> None:
    for line, density in enumerate(matrix.density):
        direct = np.linalg.solve(density[:-1, :-1], density[:-1, -1])
        np.testing.assert_allclose(result.response[:, line], direct, rtol=1e-11)
        explained = density[:-1, -1].conj() @ direct
        np.testing.assert_allclose(result.multiple[line], explained.real / density[-1, -1].real, rtol=1e-12)


def test_the_reports_equations_written_out(matrix: SpectralMatrix, result: MisoResult) -> None:
    """(4.23) to (4.37), one after the other, with conditioned spectra by their textbook recursion."""
    g = {(a, b): matrix.density[:, i, j] for i, a in enumerate("123y") for j, b in enumerate("123y")}
    g1 = {(a, b): g[a, b] - g["1", b] / g["1", "1"] * g[a, "1"] for a in "23y" for b in "23y"}
    g2 = {(a, b): g1[a, b] - g1["2", b] / g1["2", "2"] * g1[a, "2"] for a in "3y" for b in "3y"}
    l1, l2, l3 = g["1", "y"] / g["1", "1"], g1["2", "y"] / g1["2", "2"], g2["3", "y"] / g2["3", "3"]
    a3 = l3
    a2 = l2 - g1["2", "3"] / g1["2", "2"] * a3
    a1 = l1 - g["1", "2"] / g["1", "1"] * a2 - g["1", "3"] / g["1", "1"] * a3
    np.testing.assert_allclose(result.conditioned, [l1, l2, l3], rtol=1e-10)
    np.testing.assert_allclose(result.response, [a1, a2, a3], rtol=1e-10)
    linear = np.abs(g["1", "y"]) ** 2 / (g["1", "1"] * g["y", "y"]).real
    partial_2 = np.abs(g1["2", "y"]) ** 2 / (g1["2", "2"] * g1["y", "y"]).real
    partial_3 = np.abs(g2["3", "y"]) ** 2 / (g2["3", "3"] * g2["y", "y"]).real
    np.testing.assert_allclose(result.partial, [linear, partial_2, partial_3], rtol=1e-10)
    q2 = (1 - linear) * partial_2
    q3 = (1 - partial_2) * (1 - linear) * partial_3
    np.testing.assert_allclose(result.contribution, [linear, q2, q3], rtol=1e-10)
    np.testing.assert_allclose(result.cumulative, np.cumsum([linear, q2, q3], axis=0), rtol=1e-10)


def test_both_forms_of_the_multiple_coherence(result: MisoResult) -> None:
    """(4.38) = (4.39)."""
    np.testing.assert_allclose(result.multiple, 1 - np.prod(1 - result.partial, axis=0), rtol=1e-12)
    np.testing.assert_allclose(result.multiple, result.contribution.sum(axis=0), rtol=1e-12)


def test_output_noise_spectrum(matrix: SpectralMatrix, result: MisoResult) -> None:
    """(4.44), and the level of the noise that was put in, less the q averages that the fit used up."""
    output = matrix.density[:, -1, -1].real
    np.testing.assert_allclose(result.noise, (1 - result.multiple) * output, rtol=1e-12)
    np.testing.assert_array_equal(result.output, output)
    expected = 2 * DT * 0.25 * (1 - 3 / matrix.averages)
    spread = np.sqrt(CUT.line_inflation() / (60 * matrix.averages))
    assert np.mean(result.noise[2:-2]) == pytest.approx(expected, rel=4 * spread)


def test_conditioned_inputs_are_uncorrelated() -> None:
    """Condition the segments themselves by regression; their cross-spectra vanish and their autospectra are G_jj.r!."""
    channels = three_inputs(4000)
    taper = CUT.taper()
    segments = [np.lib.stride_tricks.sliding_window_view(c, CUT.length)[:: CUT.hop] * taper for c in channels]
    lines = np.array([np.fft.rfft(s) for s in segments])  # channel, segment, line
    conditioned = list[np.ndarray]()
    for x in lines[:3]:
        left = x.copy()
        for z in conditioned:
            left -= (z.conj() * left).sum(axis=0) / (np.abs(z) ** 2).sum(axis=0) * z
        conditioned.append(left)
    result = analyse(cross_spectra(channels, DT, CUT))
    for i, z in enumerate(conditioned):
        for other in conditioned[:i]:
            coherence = np.abs((other.conj() * z).sum(axis=0)) / np.sqrt(
                (np.abs(other) ** 2).sum(0) * (np.abs(z) ** 2).sum(0)
            )
            assert coherence.max() < 1e-12
        direct = (z.conj() * lines[3]).sum(axis=0) / (np.abs(z) ** 2).sum(axis=0)
        np.testing.assert_allclose(result.conditioned[i], direct, rtol=1e-9)
        share = np.abs((z.conj() * lines[3]).sum(0)) ** 2 / ((np.abs(z) ** 2).sum(0) * (np.abs(lines[3]) ** 2).sum(0))
        np.testing.assert_allclose(result.contribution[i], share, rtol=1e-9, atol=1e-14)  # (4.40) to (4.42)


@pytest.mark.parametrize("units", [(1e-8, 1.0, 1e12, 1.0), (1e12, 1e-8, 1e-24, 1e-8), (1.0, 1e12, 1.0, 1e12)])
def test_units_do_not_matter(result: MisoResult, units: tuple[float, ...]) -> None:
    scaled = analyse(cross_spectra([s * c for s, c in zip(units, three_inputs(), strict=True)], DT, CUT))
    gain = units[3] / np.array(units[:3])
    np.testing.assert_allclose(scaled.response / gain[:, None], result.response, rtol=1e-10)
    np.testing.assert_allclose(scaled.conditioned / gain[:, None], result.conditioned, rtol=1e-10)
    for name in ("ordinary", "partial", "contribution", "cumulative"):
        np.testing.assert_allclose(getattr(scaled, name), getattr(result, name), rtol=1e-10)
    np.testing.assert_allclose(scaled.covariance / np.outer(gain, gain), result.covariance, rtol=1e-9)
    np.testing.assert_allclose(scaled.noise / units[3] ** 2, result.noise, rtol=1e-9)


@pytest.mark.parametrize("order", [(1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_order_of_inputs_changes_neither_responses_nor_the_multiple_coherence(
    result: MisoResult, order: tuple[int, ...]
) -> None:
    *inputs, y = three_inputs()
    other = analyse(cross_spectra([*(inputs[i] for i in order), y], DT, CUT))
    np.testing.assert_allclose(other.response, result.response[list(order)], rtol=1e-9)
    np.testing.assert_allclose(other.multiple, result.multiple, rtol=1e-11)
    np.testing.assert_allclose(other.covariance, result.covariance[:, order][:, :, order], rtol=1e-8, atol=1e-12)
    assert np.abs(other.conditioned[0] - result.conditioned[order[0]]).max() > 0.1  # L_j does depend on it


def test_a_collinear_input_brings_nothing_and_breaks_nothing() -> None:
    x1, x2, _, y = three_inputs()
    plain = analyse(cross_spectra([x1, x2, y], DT, CUT))
    doubled = analyse(cross_spectra([x1, x2, 3e-9 * x1 + 2e-9 * x2, y], DT, CUT))
    np.testing.assert_allclose(doubled.multiple, plain.multiple, rtol=1e-10)
    np.testing.assert_allclose(doubled.response[:2], plain.response, rtol=1e-8)
    assert np.all(doubled.contribution[2] == 0.0)
    assert np.all(np.isfinite(doubled.covariance))


@pytest.mark.parametrize("silent", [0, 1])
def test_a_silent_input_brings_nothing_and_breaks_nothing(silent: int) -> None:
    x1, x2, _, y = three_inputs()
    inputs = [x1, x2]
    inputs[silent] = np.zeros_like(x1)
    result = analyse(cross_spectra([*inputs, y], DT, CUT))
    alone = analyse(cross_spectra([inputs[1 - silent], y], DT, CUT))
    np.testing.assert_allclose(result.multiple, alone.multiple, rtol=1e-12)
    assert np.all(result.response[silent] == 0.0)
    assert np.all(np.isfinite(result.covariance))


def test_a_constant_input_counts_at_the_lowest_lines_only() -> None:
    """What a constant has beyond the window's main lobe is rounding; it explains nothing there."""
    x1, x2, _, y = three_inputs()
    plain = analyse(cross_spectra([x1, x2, y], DT, CUT))
    result = analyse(cross_spectra([x1, x2, np.ones_like(x1), y], DT, CUT))
    np.testing.assert_allclose(result.multiple[2:], plain.multiple[2:], rtol=1e-9)
    assert np.all(result.response[2, 2:] == 0.0)
    assert np.all(result.contribution[2, :2] > 0.0)


def test_a_perfect_model_has_a_coherence_of_one_and_no_noise() -> None:
    x1, x2, x3, _ = three_inputs()
    result = analyse(cross_spectra([x1, x2, x3, 2 * x1 - x2 + 5e-7 * x3], DT, CUT))
    np.testing.assert_allclose(result.multiple, 1.0, rtol=1e-12)
    np.testing.assert_allclose(result.response[2], 5e-7, rtol=1e-6)
    assert result.noise.max() < 1e-12 * result.output.max()


def test_too_few_averages_are_named() -> None:
    with pytest.raises(StudyError, match=r"1\.0 effective averages cannot separate 3 inputs"):
        analyse(cross_spectra(three_inputs(128), DT, CUT))


@pytest.fixture(scope="module")
def repeats() -> tuple[np.ndarray, np.ndarray]:
    """Estimates over 600 short records whose output noise is white: A, and its stated covariance."""
    cut, estimates, stated = Segments(32), [], []
    for seed in range(600):
        channels = three_inputs(32 * 12, seed=1000 + seed)
        result = analyse(cross_spectra(channels, 1.0, cut))
        estimates.append(result.response)
        stated.append(result.covariance)
    return np.array(estimates)[:, :, 4:13], np.mean(stated, axis=0)[4:13]


def test_covariance_agrees_with_scatter(repeats: tuple[np.ndarray, np.ndarray]) -> None:
    """Bendat and Piersol's random errors, off-diagonal and complex parts included."""
    estimates, stated = repeats
    error = estimates - estimates.mean(axis=0)
    scatter = np.einsum("rif,rjf->fij", error, error.conj()) / len(error)
    for i in range(3):
        assert np.mean(scatter[:, i, i].real / stated[:, i, i].real) == pytest.approx(1.0, abs=0.06)
    scale = np.sqrt(np.einsum("fii,fjj->fij", stated, stated).real)
    np.testing.assert_allclose((scatter / scale).mean(axis=0), (stated / scale).mean(axis=0), atol=0.06)
    imaginary = np.abs((stated / scale).imag).max()
    assert imaginary > 0.3, "the inputs are delayed against each other, so that conjugation can be seen"
    np.testing.assert_allclose(scatter / scale, stated / scale, atol=0.25)


@pytest.mark.parametrize("name", ["duffing", "duffing_van_der_pol", "mathieu"])
def test_nonlinear_records_obey_the_normal_equations(
    name: str, systems: dict[str, Model], records: dict[str, Record]
) -> None:
    """u^3 stands 1e-5 beside u, its conditioned part lower still: A_j is that of a QR of the scaled segments."""
    inputs, record, cut = reverse_inputs(systems[name]), records[name], Segments()
    channels = [*histories(inputs, record), record["force"]]
    result = analyse(cross_spectra(channels, DT, cut))
    taper = cut.taper()
    lines = np.array([np.fft.rfft(np.lib.stride_tricks.sliding_window_view(c, 512)[::256] * taper) for c in channels])
    for line in range(3, 103, 9):
        x = lines[:-1, :, line].T
        norm = np.linalg.norm(x, axis=0)
        direct = np.linalg.lstsq(x / norm, lines[-1, :, line], rcond=None)[0] / norm
        np.testing.assert_allclose(result.response[:, line], direct, rtol=1e-8)
    exact = np.array([i.response(result.frequency, systems[name].numbers()) for i in inputs])
    band = (result.frequency > 0.5) & (result.frequency < 10.0)
    assert np.median(np.abs(result.response - exact)[:, band] / np.linalg.norm(exact, axis=0).max()) < 0.02
    assert np.median(result.multiple[band]) > 0.999
