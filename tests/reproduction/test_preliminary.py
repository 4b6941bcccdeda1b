"""Section 3: restoring force, its patterns, the lines of a Mathieu response, histograms."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from study.equations.model import Model
from study.equations.model_file import read_model
from study.equations.simulate import simulate
from study.equations.terms import get
from study.records.excitation import Excitation, force
from study.records.record import Record
from study.records.spectra import Segments, autospectrum
from study.reproduction import preliminary
from study.support.errors import StudyError

MODELS = Path(__file__).parents[2] / "models"
DT = 0.02


def response(model: Model, samples: int = 2048) -> Record:
    return simulate(model, force(Excitation("gaussian_lowpass"), samples, DT, seed=3), DT)


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda p: p.stem)
def test_restoring_force_of_a_record_is_that_of_the_model_which_made_it(path):
    model = read_model(path)
    record = response(model)
    measured = preliminary.restoring_force(record, model.numbers()["m"])
    modelled = preliminary.model_restoring_force(model, record["displacement"], record["velocity"], record.time)
    assert np.ptp(modelled) > 0.1
    np.testing.assert_allclose(measured, modelled, atol=1e-12)


def test_random_pattern_of_the_linear_system_is_stiffness_and_damping_force():
    record = response(read_model(MODELS / "linear.yaml"))
    pattern = preliminary.random_pattern(record, 1.0)
    np.testing.assert_allclose(pattern.force, 355.3 * record["displacement"] + 3.77 * record["velocity"], atol=1e-12)
    assert pattern.displacement is record["displacement"]


def test_harmonic_pattern_of_the_linear_system_is_the_report_s_oval():
    amplitude, frequency = 0.01, 3.0
    pattern = preliminary.harmonic_pattern(read_model(MODELS / "linear.yaml"), amplitude, frequency)
    phase = 2.0 * np.pi * np.arange(len(pattern.force)) / preliminary.POINTS_A_CYCLE
    oval = 355.3 * amplitude * np.sin(phase) + 2.0 * np.pi * frequency * 3.77 * amplitude * np.cos(phase)  # (3.2)
    np.testing.assert_allclose(pattern.force, oval, atol=1e-12)
    assert pattern.force[0] == pytest.approx(2.0 * np.pi * frequency * 3.77 * amplitude)  # its width at u = 0


def test_harmonic_pattern_shows_the_dead_band_as_a_flat():
    pattern = preliminary.harmonic_pattern(read_model(MODELS / "dead_band.yaml").with_values({"c": 0.0}), 0.01, 3.0)
    inside = np.abs(pattern.displacement) <= 0.0025
    assert inside.sum() > 10
    np.testing.assert_allclose(pattern.force[inside], 0.0, atol=1e-12)
    beyond = np.abs(pattern.displacement[~inside]) - 0.0025
    np.testing.assert_allclose(np.abs(pattern.force[~inside]), 355.3 * beyond, atol=1e-12)


def test_mathieu_pattern_closes_after_one_period_of_the_stiffness():
    model = read_model(MODELS / "mathieu.yaml")
    cycles = preliminary.closing_cycles(model, 3.0)
    assert cycles == 3
    once, thrice = (preliminary.harmonic_pattern(model, 0.01, 3.0, n) for n in (1, cycles))
    assert thrice.force[-1] == pytest.approx(thrice.force[0], abs=1e-9)
    loops = thrice.force[:-1].reshape(3, -1)
    assert np.abs(loops[0] - loops[1]).max() > 0.5
    assert len(once.force) == preliminary.POINTS_A_CYCLE + 1
    assert preliminary.closing_cycles(read_model(MODELS / "duffing.yaml"), 3.0) == 1


def test_the_harmonic_motion_beside_a_record_has_its_amplitude_and_the_natural_frequency():
    model = read_model(MODELS / "duffing.yaml")  # its response swings faster than f_n
    record = response(model)
    amplitude, frequency = preliminary.harmonic_beside(model, record)
    assert amplitude == np.abs(record["displacement"]).max()
    assert frequency == preliminary.natural_frequency(model.numbers())
    assert np.std(record["velocity"]) / np.std(record["displacement"]) > 1.1 * 2.0 * np.pi * frequency


@pytest.mark.parametrize(
    ("natural", "modulation", "expected"), [(3.0, 1.0, (2.0, 3.0, 4.0)), (3.0, 5.0, (2.0, 3.0, 8.0))]
)
def test_mathieu_lines_are_those_of_section_3_3(natural, modulation, expected):
    assert tuple(preliminary.mathieu_frequencies(natural, modulation).values()) == pytest.approx(expected)


def test_mathieu_response_is_strong_at_its_lines():
    record = response(read_model(MODELS / "mathieu.yaml").with_values({"c": 0.5, "km_cos": 80.0}), 65_536)
    frequency, density = autospectrum(record["displacement"], DT, Segments(1024))
    peaks = frequency[1:-1][(density[1:-1] > density[:-2]) & (density[1:-1] > density[2:])]
    for line in preliminary.mathieu_frequencies(3.0, 1.0).values():
        assert np.abs(peaks - line).min() < 0.15
        beside = density[(np.abs(frequency - line) > 0.3) & (np.abs(frequency - line) < 0.6)]
        assert density[np.abs(frequency - line) < 0.15].max() > 2.0 * np.median(beside)


def test_natural_frequency_of_table_1():
    assert preliminary.natural_frequency({"m": 1.0, "k": 355.3}) == pytest.approx(3.0, abs=1e-3)


@pytest.mark.parametrize(("kind", "kurtosis"), [("normal", 3.0), ("uniform", 1.8)])
def test_histogram_is_a_density_with_the_moments_of_scipy(kind, kurtosis):
    values = getattr(np.random.default_rng(5), kind)(size=20_000) * 0.002 + 0.01
    counts = preliminary.histogram(values)
    widths = np.diff(counts.edges)
    assert np.sum(counts.density * widths) == pytest.approx(1.0)
    assert np.trapezoid(counts.gaussian, counts.points) == pytest.approx(1.0, abs=0.002)
    assert counts.skewness == pytest.approx(stats.skew(values))
    assert counts.kurtosis == pytest.approx(stats.kurtosis(values, fisher=False))
    assert counts.kurtosis == pytest.approx(kurtosis, abs=0.15)
    assert counts.points[np.argmax(counts.gaussian)] == pytest.approx(np.mean(values), abs=1e-4)


def test_errors_name_what_is_wrong():
    linear = read_model(MODELS / "linear.yaml")
    bare = Record(DT, {"force": np.ones(8)}, name="rig")
    with pytest.raises(StudyError, match="rig has no channel 'acceleration'"):
        preliminary.restoring_force(bare, 1.0)
    moving = bare.with_channels({"acceleration": np.ones(8)})
    with pytest.raises(StudyError, match="rig has no channel 'displacement'"):
        preliminary.random_pattern(moving, 1.0)
    with pytest.raises(StudyError, match="mass is 0"):
        preliminary.restoring_force(moving, 0.0)
    with pytest.raises(StudyError, match="amplitude of the harmonic motion is -1"):
        preliminary.harmonic_pattern(linear, -1.0, 3.0)
    with pytest.raises(StudyError, match="frequency of the harmonic motion is 0"):
        preliminary.harmonic_pattern(linear, 1.0, 0.0)
    with pytest.raises(StudyError, match="hysteresis, which remembers"):
        preliminary.harmonic_pattern(linear.with_term(get("hysteresis")), 1.0, 3.0)
    with pytest.raises(StudyError, match=r"k = 0\.0 give no natural frequency"):
        preliminary.natural_frequency({"m": 1.0, "k": 0.0})
    with pytest.raises(StudyError, match="all 8 values are 1"):
        preliminary.histogram(np.ones(8))
