"""Figures: what they draw is what they were given, in looks that hold in grey, with room for every word."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser

from study.equations.terms import LIBRARY
from study.figures import coherence, curves, frequency_response, labels, styles
from study.records.record import SI_UNITS
from study.reproduction import study_figures
from study.reproduction.preliminary import Pattern, histogram
from study.support.errors import StudyError

ROOT = Path(__file__).parents[2]
SHEET = ROOT / "study" / "figures" / "study.mplstyle"
FREQUENCY = np.arange(0.0, 12.5, 0.1)
OMEGA = 2j * np.pi * FREQUENCY
LINEAR = OMEGA**2 + 3.77 * OMEGA + 355.3
SYSTEMS = {
    "duffing": [("u", LINEAR), ("u**3", 2e7 + 0 * OMEGA)],
    "duffing_van_der_pol": [("u", LINEAR), ("u**3", 2e7 + 2e6 / 3.0 * OMEGA)],
    "mathieu": [("u", LINEAR), ("u*cos(2*pi*f_m*t)", 177.7 + 0 * OMEGA), ("u*sin(2*pi*f_m*t)", 0 * OMEGA)],
    "plain": [("u", LINEAR)],
}
COLUMNS = ("frequency", "estimator", "input", "shape", "real", "imag", "standard_error", "exact_real", "exact_imag")


@pytest.fixture(autouse=True)
def _sheet():
    with style.context(SHEET):
        yield


def response_table(system, spread=0.05, exact=True, estimators=("siso", "miso")):
    rng = np.random.default_rng(8)
    frames = []
    for name in estimators:
        for j, (shape, true) in enumerate(SYSTEMS[system][: 1 if name == "siso" else None]):
            error = spread * np.maximum(np.abs(true), 50.0)
            values = true + error * (rng.standard_normal((2, len(true))).T @ [1.0, 1j]) / np.sqrt(2.0)
            known = true if exact else np.full_like(true, np.nan)
            columns = (FREQUENCY, name, j + 1, shape, values.real, values.imag, error, known.real, known.imag)
            frames.append(pd.DataFrame(dict(zip(COLUMNS, columns, strict=True))))
    return pd.concat(frames)


def coherence_table(system):
    count = len(SYSTEMS[system])
    frames = [
        pd.DataFrame({"frequency": FREQUENCY, "estimator": "miso", "input": j + 1, "shape": shape,
                      "terms": "linear_damping + van_der_pol_damping", "cumulative": (j + 1) / count})
        for j, (shape, _) in enumerate(SYSTEMS[system])
    ]  # fmt: skip
    return pd.concat(frames)


def one(system="duffing", number=1, **kwargs):
    return curves.input_responses(response_table(system, **kwargs), 10.0)[number - 1]


def axes():
    return Figure().subplots()


# ---- words


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("u**3", "$u^{3}$"),
        ("u*cos(2*pi*f_m*t)", r"$u\,\mathrm{cos}(2\,\pi\,f_{m}\,t)$"),
        ("u*abs(u)", r"$u\,|u|$"),
        ("max(u - gap, 0)", r"$\mathrm{max}(u - \mathrm{gap},\,0)$"),
        ("(u + v)*-v", r"$(u + v)\,-v$"),
        ("(u + 1)**2/(2*v)", r"$(u + 1)^{2}/(2\,v)$"),
        ("u - (v - 1)", "$u - (v - 1)$"),
    ],
)
def test_formula_reads_as_it_is_meant(text, expected):
    assert labels.formula(text) == expected


@pytest.mark.parametrize("shape", sorted({c.shape for t in LIBRARY.values() for c in t.components}))
def test_every_shape_of_the_library_can_be_set_and_has_a_unit(shape):
    MathTextParser("agg").parse(labels.formula(shape))
    assert labels.response_unit(shape).startswith("N")


@pytest.mark.parametrize(
    ("shape", "unit"),
    [("u", "N/m"), ("u**3", "N/m^3"), ("v*abs(v)", "N s^2/m^2"), ("max(u - gap, 0)", "N/m"), ("sgn(v)", "N"),
     ("u*cos(2*pi*f_m*t)", "N/m"), ("max(min(u, u_g), -u_g)", "N/m"), ("u + v", "N per unit of the formula")],
)  # fmt: skip
def test_unit_of_a_frequency_response_function(shape, unit):
    assert labels.response_unit(shape) == unit


def test_scaled_units():
    assert labels.prefixed("m", 0.004) == (1e-3, "mm")
    assert labels.prefixed("m", 2.0) == (1.0, "m")
    assert labels.prefixed("V", 0.004) == (1.0, "V")
    assert labels.prefixed("m", 0.0) == (1.0, "m")
    assert labels.power_of_ten(2.5e7) == (1e6, "10^6 ")
    assert labels.power_of_ten(355.0) == (1.0, "")
    assert labels.power_of_ten(0.0) == (1.0, "")
    assert labels.quantity(0.00664, "m") == "6.64 mm"
    assert labels.term_names("van_der_pol_damping + coulomb friction") == "Van der Pol damping + Coulomb friction"
    assert labels.term_names("one_sided_contact") == "one-sided contact"


# ---- looks


def test_no_two_estimators_look_alike_in_grey():
    looks = [*styles.ESTIMATOR_LOOKS.values(), styles.look("something_new")]
    assert len({str(look.dash) for look in looks}) == len(looks)
    assert styles.look("something_new").label == "something new"
    assert styles.legend_place("miso") < styles.legend_place("siso") < styles.legend_place("something_new")


def test_figures_need_no_pyplot():
    code = (
        "import sys, study.figures.frequency_response, study.figures.page; sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# ---- curves


def test_responses_are_sorted_by_input_and_estimator_and_leave_out_zero_frequency():
    first, second = curves.input_responses(response_table("duffing"), 10.0)
    assert [c.estimator for c in first.curves] == ["miso", "siso"]
    assert [c.estimator for c in second.curves] == ["miso"]
    assert (first.number, second.shape) == (1, "u**3")
    assert first.frequency[0] == pytest.approx(0.1)
    assert first.frequency[-1] == pytest.approx(10.0)
    np.testing.assert_allclose(first.exact, LINEAR[1:101])
    assert one(exact=False).exact is None
    chosen = curves.input_responses(response_table("duffing"), 10.0, ["siso"])
    assert [[c.estimator for c in item.curves] for item in chosen] == [["siso"]]


def test_the_band_holds_95_percent_of_real_parts_and_of_magnitudes():
    rng = np.random.default_rng(11)
    noise = (rng.standard_normal((2, 200_000)).T @ [1.0, 1j]) * 3.0 / np.sqrt(2.0)
    curve = curves.ResponseCurve("miso", np.ones(len(noise)), 400.0 + noise, np.full(len(noise), 3.0))
    assert np.mean(np.abs(curve.values.real - 400.0) < curve.half_width) == pytest.approx(0.95, abs=0.003)
    assert np.mean(np.abs(np.abs(curve.values) - 400.0) < curve.half_width) == pytest.approx(0.95, abs=0.003)


def test_coherences_of_an_estimator_that_is_not_there():
    with pytest.raises(StudyError, match="nothing of the estimator 'other'; expected one of miso"):
        curves.coherences(coherence_table("duffing"), 10.0, "other")


# ---- axes


def drawn(panel):
    return {line.get_label(): line for line in panel.lines}


def test_magnitude_draws_each_estimate_in_its_look():
    item = one()
    lines = drawn(frequency_response.magnitude_panel(axes(), item, "N/m"))
    assert list(lines) == ["MI/SO", "SI/SO", "exact"]
    np.testing.assert_allclose(lines["MI/SO"].get_ydata(), np.abs(item.curves[0].values))
    np.testing.assert_allclose(lines["exact"].get_ydata(), np.abs(LINEAR[1:101]))
    assert lines["MI/SO"].get_linestyle() == "-"
    assert lines["SI/SO"].get_linestyle() == "--"
    assert lines["exact"].get_linewidth() < lines["SI/SO"].get_linewidth() < lines["MI/SO"].get_linewidth()


def test_magnitude_without_an_exact_function_is_that_of_a_measured_record():
    assert list(drawn(frequency_response.magnitude_panel(axes(), one(exact=False), "N/m"))) == ["MI/SO", "SI/SO"]


def test_magnitude_band_is_about_the_curve():
    panel, item = axes(), one(spread=0.1)
    frequency_response.magnitude_panel(panel, item, "N/m")
    edges = panel.collections[0].get_paths()[0].vertices
    at = np.isclose(edges[:, 0], item.frequency[50])
    size, half = abs(item.curves[0].values[50]), item.curves[0].half_width[50]
    assert edges[at, 1].min() == pytest.approx(size - half)
    assert edges[at, 1].max() == pytest.approx(size + half)


@pytest.mark.parametrize(("angle", "shown"), [(179.0, 179.0), (-179.0, 181.0), (-10.0, -10.0), (0.0, 0.0)])
def test_phase_does_not_wrap_at_180_degrees(angle, shown):
    frequency = np.array([1.0, 2.0])
    curve = curves.ResponseCurve("miso", frequency, np.full(2, np.exp(1j * np.radians(angle))), np.zeros(2))
    item = curves.InputResponse(1, "u", (curve,), frequency, None)
    np.testing.assert_allclose(drawn(frequency_response.phase_panel(axes(), item))["MI/SO"].get_ydata(), shown)


def test_phase_leaves_a_gap_where_it_wraps():
    frequency = np.arange(1.0, 4.0)
    curve = curves.ResponseCurve("miso", frequency, np.exp(1j * np.radians([-80.0, -100.0, -100.0])), np.zeros(3))
    item = curves.InputResponse(1, "u", (curve,), frequency, None)
    np.testing.assert_allclose(
        drawn(frequency_response.phase_panel(axes(), item))["MI/SO"].get_ydata(), [-80.0, np.nan, 260.0]
    )


def test_real_and_imaginary_part_share_a_scale_and_carry_their_power_of_ten():
    real, imaginary, item = axes(), axes(), one(number=2)
    frequency_response.real_and_imaginary(real, imaginary, item, "N/m^3", frequency_response.common_span([item]))
    np.testing.assert_allclose(drawn(real)["exact"].get_ydata(), 20.0)
    np.testing.assert_allclose(drawn(imaginary)["MI/SO"].get_ydata(), item.curves[0].values.imag / 1e6)
    assert real.get_ylabel() == "Re $A_2$ (10$^{6}$ N/m$^{3}$)"
    assert np.diff(real.get_ylim()) == pytest.approx(np.diff(imaginary.get_ylim()))
    assert real.get_ylim()[0] < 0.0 < 20.0 < real.get_ylim()[1]


def test_imaginary_part_of_a_damping_term_is_logarithmic_and_marks_wrong_signs():
    table = response_table("duffing_van_der_pol")
    line = (table["input"] == 2) & np.isclose(table["frequency"], 5.0)
    table.loc[line, "imag"] *= -1.0
    item = curves.input_responses(table, 10.0)[1]
    real, imaginary = axes(), axes()
    frequency_response.real_and_imaginary(real, imaginary, item, "N/m^3", frequency_response.common_span([item]))
    assert (real.get_yscale(), imaginary.get_yscale()) == ("linear", "log")
    crosses = drawn(imaginary)["opposite sign"]
    wrong = np.sign(item.curves[0].values.imag) < 0.0
    np.testing.assert_allclose(crosses.get_xdata(), item.frequency[wrong])
    assert np.any(np.isclose(crosses.get_xdata(), 5.0))
    np.testing.assert_allclose(drawn(imaginary)["exact"].get_ydata(), np.abs(item.exact.imag))


def test_a_curve_has_a_gap_where_its_band_is_taller_than_the_panel():
    frequency, error = np.arange(1.0, 11.0), np.full(10, 0.1)
    error[6] = 100.0
    curve = curves.ResponseCurve("miso", frequency, np.full(10, 2.0 + 1.0j), error)
    item = curves.InputResponse(2, "u**3", (curve,), frequency, np.full(10, 2.0 + 1.0j))
    real, imaginary = Figure().subplots(2)
    frequency_response.real_and_imaginary(real, imaginary, item, "N/m^3", frequency_response.common_span([item]))
    for axes in (real, imaginary):
        drawn = axes.get_lines()[0].get_ydata()
        assert list(np.flatnonzero(np.isnan(drawn))) == [6]


def test_real_part_that_is_zero_is_seen_to_be_small_beside_the_function():
    table = response_table("duffing_van_der_pol")
    table[["real", "exact_real"]] -= 2e7 * (table["input"] == 2).to_numpy()[:, None]
    item = curves.input_responses(table, 10.0)[1]
    assert frequency_response.common_span([item]) >= 1.5 * np.median(np.abs(item.exact))


def test_one_scale_for_inputs_of_one_unit():
    second, third = curves.input_responses(response_table("mathieu"), 10.0)[1:]
    assert frequency_response.common_span([second, third]) > 2.0 * frequency_response.common_span([third])


def test_cumulative_coherence_names_what_each_curve_adds():
    shares = curves.coherences(coherence_table("mathieu"), 10.0)
    lines = drawn(coherence.cumulative_panel(axes(), shares))
    first, second, _ = lines
    assert first.startswith("$u$: linear damping + Van der Pol")
    assert second.startswith(r"+ $u\,\mathrm{cos}")
    *others, last = lines.values()
    np.testing.assert_allclose(last.get_ydata(), 1.0)
    assert last.get_linestyle() == "-"
    assert all(line.get_linestyle() != "-" for line in others)


def test_histogram_is_in_the_unit_of_its_axis():
    counts = histogram(0.002 * np.random.default_rng(1).standard_normal(4000))
    panel = study_figures.histogram_panel(axes(), counts, "displacement", "m")
    assert panel.get_xlabel() == "displacement (mm)"
    bars = panel.patches[0].get_data()
    assert np.sum(bars.values * np.diff(bars.edges)) == pytest.approx(1.0)
    assert drawn(panel)["Gaussian of the same variance"].get_ydata().max() == pytest.approx(
        1.0 / (counts.deviation * 1e3 * np.sqrt(2.0 * np.pi)), rel=1e-3
    )
    assert "-0.00" not in panel.get_title("left")


def test_patterns_share_their_scales():
    left, right = axes(), axes()
    grid = np.linspace(-1.0, 1.0, 9)
    study_figures.pattern_panels(left, right, Pattern(0.01 * grid, grid), Pattern(0.02 * grid, 3.0 * grid), SI_UNITS)
    assert left.get_xlim() == right.get_xlim()
    assert left.get_ylim() == right.get_ylim()
    assert left.get_ylim()[1] > 3.0
    np.testing.assert_allclose(drawn(right)["random excitation"].get_xdata(), 20.0 * grid)
