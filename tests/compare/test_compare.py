"""Comparison of a model with records: true errors, where they lie, and sentences that the numbers bear."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from study.compare import along_time, bands, force_map, growth, noise
from study.compare.across_levels import levels
from study.compare.comparison import Comparison, across, compare
from study.compare.comparison_report import as_json, document, summary, tables
from study.compare.comparison_sentences import says, says_of_all
from study.compare.fitted_coefficients import Coefficient
from study.compare.prediction import Judged
from study.equations.model import Model, ModelTerm, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.records.excitation import Excitation, force
from study.records.plan import Plan, make_plan
from study.records.record import Record
from study.support.errors import StudyError
from study.trials import make_trial

Floats = NDArray[np.float64]
LINEAR = ("inertia", "linear_damping", "linear_stiffness")
VALUES = {"m": 1.0, "c": 3.77, "k": 355.3}
DT = 0.02


def model(*more: str, **values: float) -> Model:
    """A linear oscillator and some terms; what is not given is to be fitted."""
    return Model("believed", tuple(free(get(n)).with_values(values) for n in (*LINEAR, *more)))


@cache
def trial(hidden: str, seed: int, noise_share: float) -> Comparison:
    made = make_trial(seed, hidden=[hidden] if hidden else [], noise=noise_share)
    return compare(made.believed, made.record)


def drive(seed: int = 1, samples: int = 8192, level: float = 1.0) -> Floats:
    return force(Excitation(level=level), samples, DT, seed)


def measured(truth: Model, history: Floats, share: float = 0.05, seed: int = 3) -> Record:
    """A record of force and displacement with white noise of this share of its rms."""
    record = simulate(truth, history, DT, Integrator("rk4", 4))
    u = record["displacement"]
    noisy = u + share * np.std(u) * np.random.default_rng(seed).standard_normal(len(u))
    return Record(DT, {"force": history, "displacement": noisy}, name=f"seed_{seed}")


# ---- nothing hidden


@pytest.mark.parametrize("seed", [31, 32])
@pytest.mark.parametrize("share", [0.01, 0.1])
def test_where_nothing_is_missing_the_error_is_the_noise_and_it_says_so(seed: int, share: float) -> None:
    found = trial("", seed, share)
    spread = 4.0 * found.noise.error / found.judged.size
    assert found.response_error == pytest.approx(found.noise_floor, abs=spread)
    assert found.structure == 0.0
    assert "that is noise" in says(found)
    assert found.growths is None


def test_the_noise_floor_is_the_noise_that_was_added() -> None:
    found = compare(model(), measured(model(**VALUES), drive(), share=0.2))
    assert found.noise_floor == pytest.approx(0.2 / np.sqrt(1.04), rel=0.03)


def test_without_noise_and_without_a_hidden_effect_nothing_is_called_missing() -> None:
    record = simulate(model(**VALUES), drive(), DT, Integrator("rk4", 8))
    found = compare(model(), Record(DT, {"force": record["force"], "displacement": record["displacement"]}))
    assert found.response_error < 1e-3
    assert found.force.total < 0.01
    assert "unexplained lies" not in says(found)


# ---- something hidden


@pytest.mark.parametrize(
    ("hidden", "of", "parity", "power", "words"),
    [
        ("quadratic_damping", "velocity", "odd", 2.0, "square of velocity and is odd"),
        ("cubic_damping", "velocity", "odd", 3.0, "velocity and is odd"),
        ("cubic_stiffness", "displacement", "odd", 3.0, "displacement and is odd"),
        ("quadratic_stiffness", "displacement", "even", 2.0, "square of displacement and is even"),
        ("van_der_pol_damping", "damping by displacement", "odd", 2.0, "damping force that grows with the square"),
    ],
)
@pytest.mark.parametrize("seed", [41, 42])
def test_the_missing_force_is_described(
    hidden: str, of: str, parity: str, power: float, words: str, seed: int
) -> None:  # fmt: skip
    found = trial(hidden, seed, 0.0)
    assert found.growths is not None
    best = found.growths.ways[0]
    assert (best.of, best.parity) == (of, parity)
    assert best.power == pytest.approx(power, abs=0.3)
    assert words in says(found)


@pytest.mark.parametrize("hidden", ["quadratic_damping", "cubic_stiffness"])
@pytest.mark.parametrize("seed", [44, 45])
def test_with_noise_the_quantity_and_the_parity_stay_right(hidden: str, seed: int) -> None:
    found = trial(hidden, seed, 0.01)
    assert found.growths is not None
    best = found.growths.ways[0]
    assert (best.of, best.parity) == (("velocity" if "damping" in hidden else "displacement"), "odd")
    assert best.power == pytest.approx(2.0 if "damping" in hidden else 3.0, abs=0.6)
    assert found.response_error > found.noise_floor + 4.0 * found.noise.error / found.judged.size


@pytest.mark.parametrize("hidden", ["relaxation", "periodic_stiffness", "harmonic_force"])
def test_what_is_no_function_of_the_motion_is_not_called_one(hidden: str) -> None:
    assert "no power of displacement or velocity accounts for it" in says(trial(hidden, 4, 0.01))


def test_the_true_model_is_as_good_as_the_noise_after_the_effect_is_added() -> None:
    made = make_trial(5, hidden=["quadratic_damping"], noise=0.01)
    before = compare(made.believed, made.record)
    after = compare(made.believed.with_term(get("quadratic_damping")), made.record)
    assert after.noise.alone
    assert after.response_error < 0.7 * before.response_error
    assert after.force.total < before.force.total


def test_a_shape_parameter_left_out_is_estimated() -> None:
    entry = free(get("dead_band")).with_values({"kg": -300.0, "dead_band.u_g": 0.0025})
    truth = model(m=1.0, c=8.0, k=355.3).with_term(entry)
    found = compare(model("dead_band"), measured(truth, drive(), 0.01))
    assert found.found.model.values["dead_band.u_g"] == pytest.approx(0.0025, rel=0.05)
    assert next(c for c in found.coefficients if c.key == "dead_band.u_g").unit == "m"


# ---- what is fitted and what is judged


def test_coefficients_lie_in_their_intervals() -> None:
    inside = 0
    for seed in range(12):
        found = compare(model(), measured(model(**VALUES), drive(seed, 4096), seed=seed))
        for c in found.coefficients:
            assert c.interval is not None
            inside += c.interval[0] <= VALUES[c.key] <= c.interval[1]
    assert inside >= 29  # of 36, at 95 %: fewer than that once in two thousand times


def test_held_values_are_held_and_marked() -> None:
    record = measured(model(**VALUES), drive())
    found = compare(model(k=400.0), record)
    held = {c.key: c for c in found.coefficients}["k"]
    assert held.held
    assert held.value == 400.0
    assert held.interval is None
    assert found.found.keys == ("m", "c")
    assert "held" in summary([found])
    assert found.response_error > 1.5 * compare(model(), record).response_error


def test_a_stiffness_held_at_a_wrong_value_shows_as_proportional_to_displacement() -> None:
    found = compare(model(k=400.0, m=1.0), measured(model(**VALUES), drive(), 0.01))
    assert "grows in proportion to displacement and is odd" in says(found)


def test_the_judged_part_has_no_influence_on_the_fit() -> None:
    record = measured(model("cubic_stiffness", **VALUES, k3=2e7), drive())
    first = compare(model(), record)
    spoilt = record["displacement"].copy()
    spoilt[4096:] *= 1.5
    second = compare(model(), record.with_channels({"displacement": spoilt}))
    np.testing.assert_allclose(second.found.values, first.found.values, rtol=1e-12)
    assert second.response_error != first.response_error


def test_ranges_apart_from_each_other_are_judged_from_a_state_of_their_own() -> None:
    record = measured(model(**VALUES), drive(), 0.05)
    found = compare(model(), record, make_plan(record, (5000, 8000), (100, 3000)))
    assert found.response_error == pytest.approx(0.05, rel=0.1)
    assert len(found.judged.measured) == 2900


# ---- units


SCALES = [(1e-3, 1e3, "kN", "mm"), (1.0, 1.0, "V", "V"), (0.2248089, 39.37008, "lbf", "in")]


@pytest.mark.parametrize(("per_force", "per_length", "force_unit", "length_unit"), SCALES)
def test_units_change_neither_errors_nor_sentences(
    per_force: float, per_length: float, force_unit: str, length_unit: str
) -> None:
    record = measured(model("quadratic_damping", **VALUES, c2=400.0), drive(), 0.02)
    units = {"force": force_unit, "displacement": length_unit}
    scaled = Record(
        DT, {"force": record["force"] * per_force, "displacement": record["displacement"] * per_length}, units
    )
    one, other = compare(model(), record), compare(model(), replace(scaled, name=record.name))
    assert other.response_error == pytest.approx(one.response_error, rel=1e-6)
    assert other.force.total == pytest.approx(one.force.total, rel=1e-6)
    assert other.noise_floor == pytest.approx(one.noise_floor, rel=1e-6)
    assert says(other) == says(one)
    assert {c.key: c.unit for c in other.coefficients}["k"] == f"{force_unit}/{length_unit}"


# ---- several records


def test_the_right_models_coefficients_do_not_move_with_the_level_and_a_wrong_ones_do() -> None:
    truth = model("cubic_stiffness", **VALUES, k3=2e7)
    records = [measured(truth, drive(s, level=level), 0.02, s) for s, level in ((5, 0.3), (6, 1.0), (7, 3.0))]
    wrong, right = (across([compare(believed, r) for r in records]) for believed in (model(), model("cubic_stiffness")))
    assert next(level for level in wrong if level.key == "k").moves
    assert not any(level.moves for level in right)
    found = [compare(model(), r) for r in reversed(records)]
    assert "k by" in says_of_all(found, across(found))
    assert list(across(found)[0].force) == sorted(across(found)[0].force)


def test_records_in_different_units_are_not_held_against_each_other() -> None:
    record = measured(model(**VALUES), drive(), 0.05)
    other = replace(record, units={"force": "kN", "displacement": "m"}, name="other")
    with pytest.raises(StudyError, match="the same unit"):
        across([compare(model(), record), compare(model(), other)])


def test_levels_weigh_by_their_errors() -> None:
    def at(value: float, error: float | None) -> list[Coefficient]:
        return [Coefficient("k", "linear_stiffness", value, error, "N/m")]

    assert not levels([1.0, 2.0], [at(100.0, 1.0), at(102.0, 1.0)])[0].moves
    assert levels([1.0, 2.0], [at(100.0, 0.1), at(102.0, 0.1)])[0].moves
    assert not levels([1.0, 2.0], [at(100.0, 1e-9), at(100.01, 1e-9)])[0].moves  # below any numerical error
    assert levels([1.0, 2.0], [at(1.0, None), at(1.0, None)]) == ()


# ---- periods


def test_scatter_between_periods_is_the_noise_whatever_its_spectrum_and_the_model() -> None:
    one = drive(9, 2048)
    truth = model("cubic_stiffness", **VALUES, k3=2e7)
    record = simulate(truth, np.tile(one, 5), DT, Integrator("rk4", 4))
    u = record["displacement"]
    rng = np.random.default_rng(8)
    coloured = np.convolve(rng.standard_normal(len(u) + 4), np.ones(5) / np.sqrt(5.0), "valid")
    noisy = u + 0.05 * np.std(u) * coloured
    periodic = Record(DT, {"force": np.tile(one, 5), "displacement": noisy}, period=2048)
    found = compare(model(), periodic, Plan("displacement", (0, 6144), (6144, 10240)))
    assert found.noise.source == noise.SCATTER
    assert found.noise_floor == pytest.approx(0.05, rel=0.1)
    true = compare(model("cubic_stiffness"), periodic, Plan("displacement", (0, 6144), (6144, 10240)))
    assert true.noise.alone
    assert "scatter between periods" in says(true)
    wrong = replace(periodic, period=1900)  # not its period: the force does not repeat
    assert compare(model(), wrong).noise.source == noise.WHITE


# ---- frequency, time, amplitude


def test_the_narrowest_band_that_holds_most() -> None:
    power = np.zeros(101)
    power[20:24] = [1.0, 3.0, 4.0, 1.0]
    power[60] = 1.0
    band = bands.narrowest("response", np.arange(101) * 0.5, power)
    assert band is not None
    assert (band.low, band.high) == (10.25, 11.25)
    assert band.share == pytest.approx(0.7)
    assert bands.narrowest("response", np.arange(101) * 0.5, np.zeros(101)) is None


def judged(residual: Floats, response: Floats) -> Judged:
    motion = np.stack([response - residual] * 3)
    return Judged(DT * np.arange(len(residual)), motion, 0, response, 0.0, DT, 0.0)


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


def test_the_missing_force_is_the_hidden_one() -> None:
    truth = model("quadratic_damping", **VALUES, c2=400.0)
    record = simulate(truth, drive(), DT, Integrator("rk4", 8))
    held = model(**VALUES)
    found = compare(held, Record(DT, {"force": record["force"], "displacement": record["displacement"]}))
    v = record["velocity"][4096:][200:-200]
    lacking = found.missing_force.force[200:-200]
    true = 400.0 * v * np.abs(v)
    assert np.std(lacking - true) < 0.1 * np.std(true)
    assert found.growths is not None
    assert found.growths.ways[0].coefficient > 0.0


def test_powers_are_interpolated_between_those_tried() -> None:
    powers = np.array([1.0, 1.5, 2.0])
    power, gain = growth._top(powers, 4.0 - (powers - 1.6) ** 2)
    assert (power, gain) == (pytest.approx(1.6), pytest.approx(4.0))


# ---- acceleration


def test_force_and_acceleration_alone_leave_the_band_below_the_cutoff_out() -> None:
    truth = model("cubic_stiffness", **VALUES, k3=2e7)
    record = simulate(truth, drive(), DT, Integrator("rk4", 4))
    drifting = record["acceleration"] + 0.2 * np.std(record["acceleration"]) * np.sin(2e-2 * record.time)
    found = compare(
        model("cubic_stiffness"), Record(DT, {"force": record["force"], "acceleration": drifting}), cutoff=0.5
    )
    assert found.judged.low == 0.5
    assert found.response_error < 0.02  # the drift is 14 %
    assert all(b.low >= 0.4 for b in found.bands)
    assert not found.force.band[found.force.frequency < 0.5].any()


# ---- documents


def test_the_document_has_the_fields_of_the_issue_and_is_plain_json() -> None:
    import json

    found = trial("quadratic_damping", 41, 0.0)
    content = json.loads(as_json(document([found])))
    assert set(content) >= {"model", "error", "noise_floor", "coefficients", "where", "says"}
    assert content["error"]["response"] == found.response_error
    assert content["error"]["force"] == found.force.total
    assert set(content["where"]) == {"frequency", "amplitude", "time", "level"}
    assert content["where"]["frequency"][0]["of"] == "response"
    assert content["where"]["amplitude"][0]["of"] == "velocity"
    assert len(content["where"]["time"]) == along_time.STRETCHES
    for row in content["coefficients"]:
        assert row["interval"][0] < row["value"] < row["interval"][1]


def test_tables_name_their_record_and_hold_no_text_of_numpy() -> None:
    found = trial("quadratic_damping", 41, 0.0)
    made = tables([found, found], across([found, found]))
    for name, content in made.items():
        head, *rows = content.decode().splitlines()
        assert "record" in head.split(","), name
        assert rows, name
        assert "np." not in content.decode()


def test_a_fit_that_did_not_arrive_says_so() -> None:
    found = trial("quadratic_damping", 41, 0.0)
    stopped = replace(found, found=replace(found.found, converged=False, message="still falling"))
    assert "did not arrive at a minimum (still falling)" in says(stopped)


def test_models_that_cannot_run_are_refused_in_one_sentence() -> None:
    record = measured(model(**VALUES), drive(), 0.05)
    with pytest.raises(StudyError, match="no inertia"):
        compare(Model("bare", (free(get("linear_damping")), free(get("linear_stiffness")))), record)
    unstable = Model(
        "runaway", tuple(ModelTerm(get(n), (v,), ()) for n, v in zip(LINEAR, (1.0, -50.0, 355.0), strict=True))
    )
    with pytest.raises(StudyError):
        compare(unstable, record)
