"""Simulation: observed order, agreement with SciPy, closed forms, divergence, determinism."""

import re
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from study.equations.model import Model
from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.equations.terms import custom
from study.identify.frequency_domain.coefficients import fit_coefficients
from study.identify.frequency_domain.conditioned import analyse
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.records.excitation import Excitation, force
from study.records.spectra import Segments, cross_spectra
from study.reproduction.cases import make_record
from study.reproduction.config import load_config
from study.support.errors import DivergenceError, StudyError

ROOT = Path(__file__).parents[2]
DT = 0.02
NAMES = ("linear", "duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", "dead_band", "extreme")


def closed_force(t: np.ndarray | float) -> np.ndarray | float:
    """A sum of sines, so that every integrator can be given the force without interpolation error."""
    return (
        1.1 * np.sin(2 * np.pi * 2.0 * t) + 0.7 * np.cos(2 * np.pi * 3.5 * t) + 0.4 * np.sin(2 * np.pi * 0.5 * t + 1.0)
    )


def table_1_slope(name: str) -> Callable[[float, np.ndarray, float], list[float]]:
    """Equations (2.3) to (2.8) by hand: nothing of the study's own in them."""

    def slope(t: float, x: np.ndarray, applied: float) -> list[float]:
        u, v = x
        c, k = {"dead_band": (1.89, 355.3), "extreme": (0.0, 0.0)}.get(name, (3.77, 355.3))
        p = 0.0
        if name in ("duffing", "duffing_van_der_pol", "extreme"):
            p += 2e7 * u**3
        if name in ("van_der_pol", "duffing_van_der_pol", "extreme"):
            p += 2e6 * u**2 * v
        if name == "mathieu":
            p += 177.7 * np.cos(2 * np.pi * t) * u
        if name == "dead_band":
            p -= 355.3 * (u if abs(u) <= 0.0025 else 0.0025 * np.sign(u))
        return [v, applied - c * v - k * u - p]

    return slope


@pytest.mark.parametrize("name", NAMES)
def test_agrees_with_an_adaptive_high_order_integrator(name: str, systems: dict[str, Model]) -> None:
    """SciPy's DOP853 at a tolerance of 1e-12 on equations written by hand, 300 samples of a closed-form force."""
    time = np.arange(300) * DT
    slope = table_1_slope(name)
    reference = solve_ivp(
        lambda t, x: slope(t, x, float(closed_force(t))), (0.0, time[-1]), [0.001, 0.0],
        method="DOP853", t_eval=time, rtol=1e-12, atol=1e-15, max_step=DT,
    )  # fmt: skip
    assert reference.success
    for method in ("rk4", "abm4"):
        # Sampled at DT/8 the sum of sines is interpolated to better than the integration error away from the end.
        fine = np.asarray(closed_force(np.arange(8 * 400) * DT / 8))
        record = simulate(systems[name], fine, DT / 8, Integrator(method, 8), initial=(0.001, 0.0)).channels
        for channel, expected in (("displacement", reference.y[0]), ("velocity", reference.y[1])):
            error = np.abs(record[channel][: 8 * 300 : 8] - expected).max() / np.abs(expected).max()
            assert error < (2e-4 if name == "dead_band" else 2e-6), f"{method} {channel}"


@pytest.mark.parametrize("method", ["rk4", "abm4"])
@pytest.mark.parametrize("name", ["linear", "duffing"])
def test_observed_order_is_four(method: str, name: str, systems: dict[str, Model]) -> None:
    """The error on a force known in closed form falls by 2^4 each time that the step is halved."""
    samples = 256
    t = np.arange(samples) * DT
    lines = np.array([10, 18, 25]) / (samples * DT)  # closes on itself: interpolation is exact
    drive = np.sin(2 * np.pi * np.outer(t, lines)) @ np.array([1.0, 0.6, 0.4])
    exact = simulate(systems[name], drive, DT, Integrator("rk4", 512))["displacement"]
    errors = [
        np.abs(simulate(systems[name], drive, DT, Integrator(method, steps))["displacement"] - exact).max()
        for steps in (16, 32, 64)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 4.0, atol=0.1)


def test_linear_response_agrees_with_the_closed_form(systems: dict[str, Model]) -> None:
    """Free decay from an initial displacement, m = 1, zeta = 0.1."""
    model = systems["linear"]
    record = simulate(model, np.zeros(500), DT, Integrator("rk4", 16), initial=(0.01, 0.02))
    decay, omega = 3.77 / 2, np.sqrt(355.3 - (3.77 / 2) ** 2)
    t = record.time
    exact = np.exp(-decay * t) * (0.01 * np.cos(omega * t) + (0.02 + decay * 0.01) / omega * np.sin(omega * t))
    np.testing.assert_allclose(record["displacement"], exact, atol=1e-9)
    np.testing.assert_allclose(record["acceleration"], -3.77 * record["velocity"] - 355.3 * record["displacement"])


@pytest.mark.parametrize("method", ["rk4", "abm4"])
def test_steady_linear_response_is_the_frequency_response(method: str, systems: dict[str, Model]) -> None:
    """(4.1): after the start-up has died away, U(f) = H(f) F(f) on every line of a periodic force."""
    settings, per = Excitation(periods=3, cutoff=10.0), 1024
    record = simulate(systems["linear"], force(settings, 3 * per, DT, 5), DT, Integrator(method, 32))
    last = record.part(2 * per, 3 * per)
    f = np.fft.rfftfreq(per, DT)
    keep = f <= 10.0
    response = 1.0 / (355.3 - (2 * np.pi * f) ** 2 + 2j * np.pi * f * 3.77)
    got, expected = np.fft.rfft(last["displacement"]), response * np.fft.rfft(last["force"])
    np.testing.assert_allclose(got[keep], expected[keep], atol=1e-5 * np.abs(expected).max())


def test_maxwell_element_agrees_with_its_frequency_response(make_model: Callable[..., Model]) -> None:
    """A state of its own: Z(f) = j w tau / (1 + j w tau) U(f)."""
    terms: Mapping[str, Mapping[str, float]] = {
        "inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3},
        "relaxation": {"kr": 200.0, "relaxation.tau": 0.1},
    }  # fmt: skip
    per = 1024
    drive = force(Excitation(periods=3, cutoff=10.0), 3 * per, DT, 6)
    last = simulate(make_model("maxwell", terms), drive, DT, Integrator("rk4", 16)).part(2 * per, 3 * per)
    omega = 2 * np.pi * np.fft.rfftfreq(per, DT)
    keep = omega < 2 * np.pi * 10.0
    stiffness = 355.3 - omega**2 + 3.77j * omega + 200.0 * 0.1j * omega / (1 + 0.1j * omega)
    expected = np.fft.rfft(last["force"]) / stiffness
    got = np.fft.rfft(last["displacement"])
    np.testing.assert_allclose(got[keep], expected[keep], atol=1e-5 * np.abs(expected).max())


def identified(model: Model, steps: int, seeds: range) -> dict[str, float]:
    """Mean MI/SO estimates over records that the report's integrator made with so many steps a sample."""
    inputs, cut = reverse_inputs(model), Segments()
    found = []
    for seed in seeds:
        record = simulate(model, force(Excitation(), 8192, DT, seed), DT, Integrator("abm4", steps))
        matrix = cross_spectra([*histories(inputs, record), record["force"]], DT, cut)
        found.append(fit_coefficients(analyse(matrix), inputs, (0.3, 10.0), cut.line_inflation()).values)
    values = np.mean(found, axis=0)
    symbols = [p.symbol for item in inputs for p in item.parts]
    return dict(zip(symbols, values, strict=True))


@pytest.mark.parametrize(
    ("steps", "mass", "damping_ratio"), [(1, (1.09, 0.02), (0.083, 0.003)), (8, (1.0, 0.003), (0.1, 0.002))]
)
def test_one_step_a_sample_shifts_mass_and_damping(
    steps: int, mass: tuple[float, float], damping_ratio: tuple[float, float], systems: dict[str, Model]
) -> None:
    """FINDINGS 2: the report's setting identifies as m = 1.09, zeta = 0.083; eight steps as the truth."""
    values = identified(systems["linear"], steps, range(4))
    zeta = values["c"] / (2.0 * np.sqrt(values["k"] * values["m"]))
    assert values["m"] == pytest.approx(mass[0], abs=mass[1])
    assert zeta == pytest.approx(damping_ratio[0], abs=damping_ratio[1])


def test_divergence_names_model_time_and_level(systems: dict[str, Model]) -> None:
    """Van der Pol at a filtered variance of one and one step a sample (FINDINGS 2)."""
    drive = force(Excitation(reading="filtered"), 8192, DT, 1)
    with pytest.raises(DivergenceError, match=r"'van_der_pol' diverged at t = .* mean square (0\.9|1\.0)") as caught:
        simulate(systems["van_der_pol"], drive, DT, Integrator("abm4", 1))
    assert 0.0 < caught.value.time < 8192 * DT
    assert "take more steps per sample than 1, a lower level" in str(caught.value)
    simulate(systems["van_der_pol"], drive, DT, Integrator("abm4", 8))


def test_more_steps_are_advised_only_where_they_may_help(systems: dict[str, Model]) -> None:
    """A softening spring lets go whatever the step."""
    model = systems["duffing"].with_values({"k3": -2.0e6})
    drive = force(Excitation(level=4.0), 2048, DT, 1)
    with pytest.raises(
        DivergenceError, match="at 16 steps per sample it is the system itself that runs away"
    ) as caught:
        simulate(model, drive, DT, Integrator("abm4", 16))
    assert "more steps" not in str(caught.value)


@pytest.mark.parametrize("seed", [1, 2, 3, 1990])
def test_the_example_of_the_first_page_stays_at_the_studys_level(seed: int, tmp_path: Path) -> None:
    """A system that a reader copies from docs/reproduction.md must not run away under the study's excitation."""
    block = re.search(
        r"  ```yaml\n(.*?)  ```", (ROOT / "docs" / "reproduction.md").read_text(encoding="utf-8"), re.DOTALL
    )
    assert block is not None
    (tmp_path / "softening.yaml").write_text(textwrap.dedent(block[1]), encoding="utf-8")
    model = read_model(tmp_path / "softening.yaml")
    study = load_config(ROOT / "config")
    told = study.record_settings("duffing").model_copy(update={"case": model.name, "level": 1.0})
    made = make_record(model, told, seed=seed)
    assert len(made["displacement"]) == 8192
    hold = np.sqrt(model.numbers()["k"] / -model.numbers()["k3"])  # beyond it the cubic spring pushes outwards
    assert np.abs(made["displacement"]).max() < 0.75 * hold, "it stays with a margin for other seeds"


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_no_record_of_nan(bad: float, systems: dict[str, Model]) -> None:
    drive = force(Excitation(), 100, DT, 1)
    drive[50] = bad
    with pytest.raises(StudyError):
        simulate(systems["linear"], drive, DT)


@pytest.mark.parametrize("method", ["rk4", "abm4"])
def test_same_bytes_twice(method: str, systems: dict[str, Model]) -> None:
    drive = force(Excitation(), 1000, DT, 1)
    first, second = (simulate(systems["mathieu"], drive, DT, Integrator(method)) for _ in range(2))
    for channel in first.channels:
        assert first[channel].tobytes() == second[channel].tobytes()


def test_start_shifts_the_clock_of_terms_that_depend_on_time(systems: dict[str, Model]) -> None:
    drive = force(Excitation(), 400, DT, 1)
    whole = simulate(systems["mathieu"], drive, DT)
    period = simulate(systems["mathieu"], drive, DT, start=1.0)  # f_m = 1 Hz
    np.testing.assert_allclose(period["displacement"], whole["displacement"], atol=1e-12)
    half = simulate(systems["mathieu"], drive, DT, start=0.5)
    assert np.abs(half["displacement"] - whole["displacement"]).max() > 0.1 * np.abs(whole["displacement"]).max()


def test_an_extra_channel_drives_a_users_term(systems: dict[str, Model]) -> None:
    """A force fed in as a channel through a term of coefficient -1 does what the force does."""
    drive = force(Excitation(), 400, DT, 2)
    plain = simulate(systems["duffing"], drive, DT)
    model = systems["duffing"].with_term(custom("wind", "wind")).with_values({"q_wind": -1.0})
    fed = simulate(model, np.zeros(400), DT, extra={"wind": drive})
    np.testing.assert_allclose(fed["displacement"], plain["displacement"], atol=1e-14)
    assert fed.extra == ("wind",)


@pytest.mark.parametrize("samples", [1, 2, 3, 5])
@pytest.mark.parametrize("method", ["rk4", "abm4"])
def test_very_short_records(samples: int, method: str, systems: dict[str, Model]) -> None:
    drive = np.ones(samples)
    record = simulate(systems["linear"], drive, DT, Integrator(method, 1))
    assert len(record) == samples
    assert record["acceleration"][0] == pytest.approx(1.0)


def test_interpolated_not_held(systems: dict[str, Model]) -> None:
    """Eight steps between samples see the band-limited force: the same as sampling it eight times as fast."""
    drive = force(Excitation(), 512, DT, 4)
    fine = 8.0 * np.fft.irfft(np.fft.rfft(drive), 8 * 512)
    coarse_run = simulate(systems["duffing"], drive, DT, Integrator("rk4", 16))["displacement"]
    fine_run = simulate(systems["duffing"], fine, DT / 8, Integrator("rk4", 2))["displacement"]
    np.testing.assert_allclose(fine_run[: 8 * 480 : 8], coarse_run[:480], rtol=0, atol=1e-7 * np.abs(coarse_run).max())


@pytest.mark.parametrize(("settings", "named"), [(("euler", 8), "euler"), (("rk4", 0), "0"), (("abm4", -2), "-2")])
def test_bad_integrators_are_named(settings: tuple[str, int], named: str) -> None:
    with pytest.raises(StudyError, match=named):
        Integrator(*settings)


def test_too_many_initial_values_are_refused(systems: dict[str, Model]) -> None:
    with pytest.raises(StudyError, match="initial"):
        simulate(systems["linear"], np.zeros(10), DT, initial=(0.0, 0.0, 0.0))
