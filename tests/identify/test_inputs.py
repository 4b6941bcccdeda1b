"""From terms to the inputs of the reverse system and their histories."""

from collections.abc import Callable

import numpy as np
import pytest

from study.equations.model import Model, free
from study.equations.terms import custom, get
from study.identify.frequency_domain.inputs import Part, histories, input_history, reverse_inputs
from study.records.record import Record
from study.support.errors import StudyError


@pytest.fixture
def record() -> Record:
    generator = np.random.default_rng(0)
    channels = {c: generator.normal(size=60) for c in ("force", "displacement", "velocity", "acceleration", "wind")}
    return Record(0.02, channels, start=3.0)


def test_terms_with_the_same_shape_are_one_input(systems: dict[str, Model]) -> None:
    """Figure 14 of the combined system: u carries m, c and k, u^3 carries k3 and c3/3."""
    first, second = reverse_inputs(systems["duffing_van_der_pol"])
    assert first.shape == "u"
    assert first.parts == (Part("m", 2, 1.0), Part("c", 1, 1.0), Part("k", 0, 1.0))
    assert second.parts == (Part("k3", 0, 1.0), Part("c3", 1, 1.0 / 3.0))
    assert second.terms == ("cubic_stiffness", "van_der_pol_damping")


def test_responses_are_the_reports(systems: dict[str, Model]) -> None:
    """(4.3), (4.8), (4.9) and (4.10), at 2 Hz."""
    f, w = np.array([2.0]), 4.0 * np.pi
    linear = 355.3 - w**2 + 3.77j * w
    a1, a2 = (
        i.response(f, systems["duffing_van_der_pol"].numbers())[0]
        for i in reverse_inputs(systems["duffing_van_der_pol"])
    )
    assert a1 == pytest.approx(linear)
    assert a2 == pytest.approx(2e7 + 1j * w * 2e6 / 3)
    mathieu = [i.response(f, systems["mathieu"].numbers())[0] for i in reverse_inputs(systems["mathieu"])]
    assert mathieu == pytest.approx([linear, 177.7, 0.0])
    dead = [i.response(f, systems["dead_band"].numbers())[0] for i in reverse_inputs(systems["dead_band"])]
    assert dead == pytest.approx([355.3 - w**2 + 1.89j * w, -355.3])


def test_same_shape_with_other_parameters_is_another_input(make_model: Callable[..., Model]) -> None:
    terms = {"inertia": {"m": 1.0}, "dead_band": {"kg": 1.0, "dead_band.u_g": 0.5}}
    one = reverse_inputs(make_model("one", terms))[1]
    terms["dead_band"]["dead_band.u_g"] = 0.7
    assert one != reverse_inputs(make_model("other", terms))[1]


def test_an_unknown_shape_parameter_is_named(systems: dict[str, Model]) -> None:
    model = systems["linear"].with_term(get("dead_band"))
    with pytest.raises(StudyError, match="dead_band has no value for u_g"):
        reverse_inputs(model)


def test_unknown_coefficients_do_not_matter(systems: dict[str, Model]) -> None:
    unknown = dict.fromkeys(systems["duffing"].values)
    assert reverse_inputs(systems["duffing"].with_values(unknown)) == reverse_inputs(systems["duffing"])


@pytest.mark.parametrize(
    ("name", "parameters", "expected"),
    [
        ("cubic_stiffness", {}, lambda r: r["displacement"] ** 3),
        ("quadratic_damping", {}, lambda r: r["velocity"] * np.abs(r["velocity"])),
        ("coulomb_friction", {}, lambda r: np.sign(r["velocity"])),
        ("dead_band", {"u_g": 0.5}, lambda r: np.clip(r["displacement"], -0.5, 0.5)),
        ("one_sided_contact", {"gap": 0.3}, lambda r: np.maximum(r["displacement"] - 0.3, 0.0)),
        ("periodic_stiffness", {"f_m": 1.7}, lambda r: r["displacement"] * np.cos(2 * np.pi * 1.7 * r.time)),
        ("constant_force", {}, lambda r: np.ones(len(r))),
        ("harmonic_force", {"f": 2.2}, lambda r: np.cos(2 * np.pi * 2.2 * r.time)),
    ],
)
def test_histories_agree_with_numpy(
    name: str, parameters: dict[str, float], expected: Callable[[Record], np.ndarray],
    systems: dict[str, Model], record: Record,
) -> None:  # fmt: skip
    """Time counts from the record's own start, 3 s."""
    model = systems["linear"].with_term(get(name)).with_values({f"{name}.{p}": v for p, v in parameters.items()})
    first, second = histories(reverse_inputs(model)[:2], record)
    np.testing.assert_array_equal(first, record["displacement"])
    np.testing.assert_allclose(second, expected(record), rtol=1e-12, atol=1e-14)


def test_a_users_term_reads_an_extra_channel(systems: dict[str, Model], record: Record) -> None:
    model = systems["linear"].with_term(custom("gust", "wind*abs(v) + pi"))
    history = histories(reverse_inputs(model), record)[1]
    np.testing.assert_allclose(history, record["wind"] * np.abs(record["velocity"]) + np.pi, rtol=1e-14)


@pytest.mark.parametrize(("formula", "channel"), [("rain*u", "rain"), ("v*v", "velocity")])
def test_a_missing_channel_is_named(formula: str, channel: str, systems: dict[str, Model]) -> None:
    model = systems["linear"].with_term(custom("mine", formula))
    bare = Record(0.02, {"force": np.zeros(9), "displacement": np.zeros(9)}, name="rig")
    with pytest.raises(StudyError, match=f"'{channel}', which rig lacks"):
        histories(reverse_inputs(model), bare)


@pytest.mark.parametrize("formula", ["log(u)", "1/(u - u)", "exp(exp(20*abs(u)))"])
def test_a_formula_without_a_finite_value_is_refused(formula: str, systems: dict[str, Model], record: Record) -> None:
    model = systems["linear"].with_term(custom("mine", formula))
    with pytest.raises(StudyError, match=r"no finite value at t = \d"):
        histories(reverse_inputs(model), record)


def test_a_state_that_overflows_is_refused(systems: dict[str, Model], record: Record) -> None:
    wild = {"hysteresis.beta": -5000.0, "hysteresis.gamma": 0.0}
    model = systems["linear"].with_term(get("hysteresis")).with_values(wild)
    with pytest.raises(StudyError, match="no finite value"):
        histories(reverse_inputs(model), record)


def test_a_memory_that_is_short_beside_the_sampling_is_integrated_all_the_same():
    """Dahl's element is exact in displacement: z = (s - (s - beta z0) exp(-beta |u - u0|)) / beta, s the direction.

    With beta |v| dt = 12 the first steps that are tried are unstable.
    """
    dt, beta = 0.01, 24.0
    t = dt * np.arange(750)
    u, v = -10.0 * np.cos(5.0 * t), 50.0 * np.sin(5.0 * t)
    model = Model("dahl", (free(get("hysteresis")),)).with_values({"hysteresis.beta": beta, "hysteresis.gamma": 0.0})
    (item,) = reverse_inputs(model)
    found = input_history(item, Record(dt, {"force": 0.0 * u, "displacement": u, "velocity": v}))
    exact = np.zeros_like(u)
    for i in range(1, len(u)):
        direction, way = np.sign(u[i] - u[i - 1]), abs(u[i] - u[i - 1])
        exact[i] = (direction - (direction - beta * exact[i - 1]) * np.exp(-beta * way)) / beta
    assert np.sqrt(np.mean((found - exact) ** 2)) < 0.02 / beta
