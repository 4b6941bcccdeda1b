"""Derivatives and integrals of records that do not close on themselves, against the simulator's own."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.records.completion import complete, consistent, derivative, derivatives, suggest_cutoff
from study.records.record import MOTIONS, Record
from study.support.autoregression import burg
from study.support.errors import StudyError

MODELS = Path(__file__).parents[2] / "models"
DT = 0.02
CASES = tuple(sorted(p.stem for p in MODELS.glob("*.yaml")))
# Responses of these two have no content above 12.5 Hz, so sampling at 50 Hz loses nothing. The corners, cubes and
# switches of the others' have, and what folds back at sampling cannot be told from the rest by any derivative.
BAND_LIMITED = ("linear", "mathieu")


def white(samples: int, seed: int, low: float = 0.0, high: float = 12.5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft(rng.standard_normal(samples))
    frequency = np.fft.rfftfreq(samples, DT)
    spectrum[(frequency > high) | (frequency < low)] = 0.0
    return np.fft.irfft(spectrum, samples)


def simulated(case: str, seed: int = 2) -> Record:
    """A stretch out of a longer response, whose ends do not meet."""
    return simulate(read_model(MODELS / f"{case}.yaml"), white(8192, seed), DT, Integrator("rk4", 8)).part(900, 8000)


def only(record: Record, *channels: str, **units: str) -> Record:
    return Record(record.dt, {c: record[c] for c in ("force", *channels)}, {**record.units, **units}, "rig")


def error(estimate: np.ndarray, truth: np.ndarray, edge: int = 0) -> float:
    inner = slice(edge, len(truth) - edge)
    return float(np.sqrt(np.mean((estimate[inner] - truth[inner]) ** 2) / np.mean(truth**2)))


@pytest.mark.parametrize("case", CASES)
def test_velocity_and_acceleration_from_displacement(case: str) -> None:
    record = simulated(case)
    done = complete(only(record, "displacement"))
    assert done.band == (0.0, 25.0)
    velocity, acceleration = (error(done.record[m], record[m], done.edge) for m in MOTIONS[1:])
    if case in BAND_LIMITED:
        assert velocity < 2e-4
        assert acceleration < 2e-4
    else:
        assert velocity < 5e-3
        assert acceleration < 2e-2
    np.testing.assert_array_equal(done.record["displacement"], record["displacement"])


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("cutoff", [0.3, 1.0])
def test_velocity_and_displacement_from_acceleration(case: str, cutoff: float) -> None:
    record = simulated(case)
    done = complete(only(record, "acceleration"), cutoff)
    assert done.band == (cutoff, 25.0)
    assert done.edge == np.ceil(2.0 / (cutoff * DT))
    for motion, bound in (("velocity", 0.02), ("displacement", 0.1)):
        above = derivative(record[motion], DT, 0, cutoff)  # the truth, without what the cut-off takes
        assert error(done.record[motion], above, done.edge) < (bound if case == "dead_band" else 0.2 * bound)


def test_spectra_agree_within_the_stated_band() -> None:
    from study.records.spectra import cross_spectra

    record = simulated("duffing")
    done = complete(only(record, "acceleration"), 0.5)
    matrix = cross_spectra([record["displacement"], done.record["displacement"]], DT).band(0.7, 10.0)
    gain = matrix.density[:, 0, 1] / matrix.density[:, 0, 0]
    assert np.max(np.abs(gain - 1.0)) < 0.02


@pytest.mark.parametrize("frequency", [0.5, 3.0, 9.7])
@pytest.mark.parametrize("order", [-2, -1, 1, 2])
def test_a_sinusoid_that_does_not_close(frequency: float, order: int) -> None:
    time = DT * np.arange(2003)
    omega = 2.0 * np.pi * frequency
    exact = omega**order * np.cos(omega * time + 0.3 + order * np.pi / 2.0)
    got = derivative(np.cos(omega * time + 0.3), DT, order, 0.2 if order < 0 else 0.0)
    edge = 500 if order < 0 else 8
    assert error(got, exact, edge) < (2e-3 if order < 0 else 1e-5)


def test_offset_and_drift_of_an_accelerometer_do_not_matter() -> None:
    record = simulated("linear")
    clean = complete(only(record, "acceleration"), 0.5)
    drift = 0.2 + 0.3 * np.linspace(0.0, 1.0, len(record)) ** 2
    alone = only(record.with_channels({"acceleration": record["acceleration"] + drift}), "acceleration")
    got = complete(alone, 0.5)
    assert error(got.record["displacement"], clean.record["displacement"], got.edge) < 0.01


@pytest.mark.parametrize(("orders", "cutoff"), [((0, 1, 2), 0.0), ((-1, -2), 0.2), ((1, 2), 0.2)])
def test_several_at_once_are_those_one_by_one(orders: tuple[int, ...], cutoff: float) -> None:
    signal = np.random.default_rng(5).standard_normal(700).cumsum()
    for order, got in zip(orders, derivatives(signal, DT, orders, cutoff), strict=True):
        np.testing.assert_array_equal(got, derivative(signal, DT, order, cutoff))


def test_a_naive_derivative_is_worse_at_the_ends() -> None:
    record = simulated("linear")
    u = record["displacement"]
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(u), DT)
    naive = np.fft.irfft(-(omega**2) * np.fft.rfft(u), len(u))
    ours = derivative(u, DT, 2)
    assert error(ours, record["acceleration"], 8) < 1e-3 * error(naive, record["acceleration"], 8)


def test_displacement_and_acceleration_share_the_velocity() -> None:
    record = simulated("linear", seed=7)
    rng = np.random.default_rng(1)
    noisy = {m: record[m] + 0.02 * np.std(record[m]) * rng.standard_normal(len(record)) for m in MOTIONS}
    both = complete(only(record.with_channels(noisy), "displacement", "acceleration"), 2.0)
    derived = complete(only(record.with_channels(noisy), "displacement"))
    assert both.band == (0.0, 25.0)
    shared = error(both.record["velocity"], record["velocity"], both.edge)
    assert shared < 0.5 * error(derived.record["velocity"], record["velocity"], both.edge)
    assert (
        error(complete(only(record, "displacement", "acceleration")).record["velocity"], record["velocity"], 8) < 1e-3
    )


@pytest.mark.parametrize("measured", [("velocity",), ("displacement", "velocity"), ("velocity", "acceleration")])
def test_every_other_set_of_channels(measured: tuple[str, ...]) -> None:
    record = simulated("linear")
    done = complete(only(record, *measured), 0.5)
    for motion in MOTIONS:
        low = done.band[0]
        truth = derivative(record[motion], DT, 0, low) if motion not in measured and low else record[motion]
        if motion not in measured and motion == "acceleration":
            truth = record[motion]
        assert error(done.record[motion], truth, max(done.edge, 8)) < 0.02
    assert (done.band[0] > 0.0) == ("displacement" not in measured)
    assert len(done.notes) == 3 - len(measured)


def test_complete_leaves_a_complete_record_alone() -> None:
    record = simulated("linear")
    done = complete(record)
    assert done.notes == ()
    assert done.edge == 0
    for channel in record.channels:
        np.testing.assert_array_equal(done.record[channel], record[channel])


# the cut-off


def test_the_suggested_cutoff_follows_the_noise() -> None:
    record = simulated("duffing")
    rng = np.random.default_rng(9)
    suggested: list[float] = []
    for share in (0.0, 0.05, 0.3):
        noise = share * np.std(record["acceleration"]) * rng.standard_normal(len(record))
        dirty = only(record.with_channels({"acceleration": record["acceleration"] + noise}), "acceleration")
        # what is lost below the cut-off and what is noise above it, at the suggested one and at any other
        tried = [float(f) for f in np.geomspace(0.1, 4.0, 20)]
        errors = [error(complete(dirty, f).record["displacement"], record["displacement"], 500) for f in tried]
        done = complete(dirty)
        assert done.band[0] == suggest_cutoff(dirty)
        assert error(done.record["displacement"], record["displacement"], 500) < 0.1 + 1.5 * min(errors)
        suggested.append(done.band[0])
    assert suggested[0] < suggested[1] < suggested[2] < 3.6


@pytest.mark.parametrize("cutoff", [0.0, -1.0, 25.0, 1e9, float("nan")])
def test_impossible_cutoff(cutoff: float) -> None:
    record = only(simulated("linear"), "acceleration")
    with pytest.raises(StudyError, match=r"rig: the cut-off is .*; expected it above 0 and below 25 Hz"):
        complete(record, cutoff)


# units


def test_motions_are_brought_to_one_set_of_units() -> None:
    record = simulated("linear")
    in_g = {"acceleration": record["acceleration"] / 9.80665, "displacement": 1e3 * record["displacement"]}
    mixed = only(
        record.with_channels(in_g), "displacement", "acceleration", displacement="mm", acceleration="g", force="kN"
    )
    done = complete(mixed, 1.0)
    assert [done.record.units[m] for m in MOTIONS] == ["mm", "mm/s", "mm/s^2"]
    assert done.record.units["force"] == "kN"
    np.testing.assert_allclose(done.record["acceleration"], 1e3 * record["acceleration"], rtol=1e-12)
    assert error(done.record["velocity"], 1e3 * record["velocity"], done.edge) < 1e-3
    assert "acceleration is converted from g to mm/s^2" in done.notes


@pytest.mark.parametrize(
    ("units", "right"),
    [
        ({"acceleration": "g"}, ("m", "m/s", "m/s^2")),
        ({"acceleration": "mm/s²"}, ("mm", "mm/s", "mm/s^2")),
        ({"velocity": "in/s", "acceleration": "g"}, ("in", "in/s", "in/s^2")),
        ({"displacement": "mV"}, ("mV", "mV/s", "mV/s^2")),
        ({"acceleration": "V"}, ("V", "V/s", "V/s^2")),
        ({}, ("m", "m/s", "m/s^2")),
    ],
)
def test_units_of_what_is_computed(units: dict[str, str], right: tuple[str, ...]) -> None:
    channels = {m: np.ones(3) for m in units} or {"displacement": np.ones(3)}
    record, _ = consistent(Record(1.0, {"force": np.ones(3), **channels}, units))
    assert tuple(record.units[m] for m in MOTIONS) == right


def test_consistent_numbers_are_not_touched() -> None:
    record = simulated("linear")
    same, says = consistent(record)
    assert says == ()
    assert all(same[c] is record[c] for c in record.channels)


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ({"displacement": "V", "acceleration": "m/s^2"}, "all calibrated, or all in volts"),
        ({"displacement": "banana", "acceleration": "m/s^2"}, "no unit 'banana'"),
        ({"displacement": "s", "acceleration": "m/s^2"}, "'s' is no unit of displacement"),
    ],
)
def test_units_that_cannot_go_together(units: dict[str, str], said: str) -> None:
    with pytest.raises(StudyError, match=said):
        complete(only(simulated("linear"), "displacement", "acceleration", **units))


def test_no_motion_at_all() -> None:
    with pytest.raises(StudyError, match="at least one is needed"):
        complete(Record(1.0, {"force": np.ones(30)}))


# properties


def test_burg_continues_what_can_be_continued() -> None:
    time = np.arange(3000)
    weights = burg(np.sin(0.3 * time) + 0.5 * np.sin(1.1 * time + 1.0), 12)
    nodes = np.roots([1.0, *-weights])
    for omega in (0.3, 1.1):
        assert np.min(np.abs(nodes - np.exp(1j * omega))) < 1e-3
    assert np.max(np.abs(nodes)) < 1.0 + 1e-9


@settings(max_examples=150, deadline=None)
@given(
    samples=st.integers(16, 300), seed=st.integers(0, 2**32 - 1), order=st.sampled_from([-2, -1, 0, 1, 2]),
    scale=st.sampled_from([2.0**-40, 2.0**40]), shape=st.sampled_from(["noise", "ramp", "step", "blow", "constant"]),
)  # fmt: skip
def test_any_signal_gives_finite_numbers_that_scale(
    samples: int, seed: int, order: int, scale: float, shape: str
) -> None:
    rng = np.random.default_rng(seed)
    signal = {
        "noise": rng.standard_normal(samples),
        "ramp": np.arange(samples, dtype=float),
        "step": (np.arange(samples) > samples // 2).astype(float),
        "blow": np.eye(samples)[samples // 3],
        "constant": np.full(samples, 3.0),
    }[shape]
    cutoff = 1.0 if order < 0 else 0.0
    one = derivative(signal, DT, order, cutoff)
    assert one.shape == signal.shape
    assert np.isfinite(one).all()
    np.testing.assert_array_equal(derivative(scale * signal, DT, order, cutoff), scale * one)  # a power of two: exactly
    if shape == "constant" and order:
        assert np.max(np.abs(one)) < 1e-9


def test_same_record_same_bytes() -> None:
    record = only(simulated("van_der_pol"), "acceleration")
    first, second = complete(record, 0.4), complete(record, 0.4)
    assert all(first.record[c].tobytes() == second.record[c].tobytes() for c in MOTIONS)
