"""Every effect of the library, one row each: forward, reverse, derivative and unit.

A new term needs one row in ``ROWS``; ``test_every_term_has_a_row`` says so when it is missing.
"""

import ast
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from study.equations import formulas, kernels
from study.equations.equations_of_motion import Equations
from study.equations.graph import Graph
from study.equations.model import Model, free
from study.equations.possible_effects import candidate_entries
from study.equations.simulate import Integrator, simulate
from study.equations.term import Component, Term
from study.equations.terms import LIBRARY, custom, get
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.records.excitation import Excitation, force
from study.records.record import Record
from study.support.errors import StudyError

PERIOD = 10.24  # seconds; the frequencies below are whole multiples of 1/PERIOD, so that time-varying terms close too
F_M, F_H = 10 / PERIOD, 21 / PERIOD
SMOOTH, KINK, JUMP = 1e-6, 1e-3, 2e-2  # a shape's lines fall off at once, with f^-2 or f^-3, with 1/f
Force = Callable[[SimpleNamespace], np.ndarray]  # of u, v, t and the state z


@dataclass(frozen=True)
class Row:
    """Values of a term, its force by NumPy for these, its units, and how well it can be seen through aliasing."""

    values: dict[str, float]
    force: Force
    units: tuple[str, ...]
    tolerance: float = SMOOTH


ROWS: dict[str, Row] = {
    "inertia": Row({"m": 1.0}, lambda s: 0.0 * s.u, ("kg",)),
    "linear_damping": Row({"c": 3.77}, lambda s: 3.77 * s.v, ("N s/m",)),
    "linear_stiffness": Row({"k": 355.3}, lambda s: 355.3 * s.u, ("N/m",)),
    "quadratic_stiffness": Row({"k2": 3e3}, lambda s: 3e3 * s.u**2, ("N/m^2",)),
    "signed_quadratic_stiffness": Row({"k2s": 3e4}, lambda s: 3e4 * s.u * np.abs(s.u), ("N/m^2",), KINK),
    "cubic_stiffness": Row({"k3": 2e7}, lambda s: 2e7 * s.u**3, ("N/m^3",)),
    "quintic_stiffness": Row({"k5": 1e12}, lambda s: 1e12 * s.u**5, ("N/m^5",)),
    "van_der_pol_damping": Row({"c3": 2e6}, lambda s: 2e6 * s.u**2 * s.v, ("N s/m^3",)),
    "displacement_damping": Row({"cu": 2e3}, lambda s: 2e3 * np.abs(s.u) * s.v, ("N s/m^2",), KINK),
    "quadratic_damping": Row({"c2": 80.0}, lambda s: 80.0 * s.v * np.abs(s.v), ("N s^2/m^2",), KINK),
    "cubic_damping": Row({"cv3": 900.0}, lambda s: 900.0 * s.v**3, ("N s^3/m^3",)),
    "coulomb_friction": Row({"fc": 0.1}, lambda s: 0.1 * np.sign(s.v), ("N",), JUMP),
    "dead_band": Row(
        {"kg": -355.3, "dead_band.u_g": 0.0025},
        lambda s: -355.3 * np.where(np.abs(s.u) <= 0.0025, s.u, 0.0025 * np.sign(s.u)),
        ("N/m",), KINK,
    ),
    "bilinear_stiffness": Row({"kb": 200.0}, lambda s: 200.0 * np.where(s.u > 0, s.u, 0.0), ("N/m",), KINK),
    "one_sided_contact": Row(
        {"kc": 500.0, "one_sided_contact.gap": 0.001},
        lambda s: 500.0 * np.where(s.u > 0.001, s.u - 0.001, 0.0),
        ("N/m",), KINK,
    ),
    "periodic_stiffness": Row(
        {"km_cos": 100.0, "km_sin": -60.0, "periodic_stiffness.f_m": F_M},
        lambda s: (100.0 * np.cos(2 * np.pi * F_M * s.t) - 60.0 * np.sin(2 * np.pi * F_M * s.t)) * s.u,
        ("N/m", "N/m"),
    ),
    "relaxation": Row({"kr": 200.0, "relaxation.tau": 0.1}, lambda s: 200.0 * s.z, ("N/m",)),
    "hysteresis": Row(
        {"kz": 200.0, "hysteresis.beta": 300.0, "hysteresis.gamma": 100.0},
        lambda s: 200.0 * s.z,
        ("N/m",), KINK,
    ),
    "constant_force": Row({"f0": 0.3}, lambda s: 0.3 + 0.0 * s.u, ("N",)),
    "harmonic_force": Row(
        {"fh_cos": 0.4, "fh_sin": 0.2, "harmonic_force.f": F_H},
        lambda s: 0.4 * np.cos(2 * np.pi * F_H * s.t) + 0.2 * np.sin(2 * np.pi * F_H * s.t),
        ("N", "N"),
    ),
    "stribeck_friction": Row(
        {"fs": 0.1, "stribeck_friction.v_s": 0.05},
        lambda s: 0.1 * np.exp(-((s.v / 0.05) ** 2)) * np.sign(s.v),
        ("N",), JUMP,
    ),
    "load_dependent_friction": Row({"fu": 40.0}, lambda s: 40.0 * np.abs(s.u) * np.sign(s.v), ("N/m",), JUMP),
    "directional_damping": Row({"cd": 1.5}, lambda s: 1.5 * np.abs(s.v), ("N s/m",), KINK),
    "directional_quadratic_damping": Row({"cd2": 30.0}, lambda s: 30.0 * s.v**2, ("N s^2/m^2",)),
    "pendulum_stiffness": Row({"kp": 90.0}, lambda s: 90.0 * np.sin(s.u), ("N",)),
    "cogging": Row(
        {"fp_cos": 0.1, "fp_sin": -0.2, "cogging.pitch": 0.004},
        lambda s: 0.1 * np.cos(2 * np.pi * s.u / 0.004) - 0.2 * np.sin(2 * np.pi * s.u / 0.004),
        ("N", "N"),
    ),
}  # fmt: skip
MEMORY = {"relaxation", "hysteresis"}
LINEAR = ("inertia", "linear_damping", "linear_stiffness")


def model_with(name: str) -> Model:
    """The linear system and one term."""
    terms = tuple(free(get(n)).with_values(ROWS[n].values) for n in dict.fromkeys((*LINEAR, name)))
    return Model(name, terms)


def evaluated(model: Model, columns: dict[str, np.ndarray]) -> np.ndarray:
    """Acceleration and state derivatives of a model at given points, by the compiled kernel."""
    made, inputs = Equations(model), {"u": "u:", "v": "v:", "force": "drive:force"}
    program = made.graph.program(made.slopes).with_inputs(model.numbers())
    return kernels.evaluate(program, {inputs.get(c, c): x for c, x in columns.items()}, len(columns["u"]))


def test_every_term_has_a_row() -> None:
    assert set(ROWS) == set(LIBRARY)


@pytest.mark.parametrize("name", LIBRARY)
def test_forward_force_agrees_with_an_independent_formula(name: str) -> None:
    model = model_with(name)
    generator = np.random.default_rng(7)
    u, v = generator.normal(0, 0.003, 200), generator.normal(0, 0.05, 200)
    t, z, applied = generator.uniform(0, 20, 200), generator.normal(0, 0.002, 200), generator.normal(0, 1, 200)
    columns = {"u": u, "v": v, "t": t, "force": applied} | ({f"z:{name}": z} if name in MEMORY else {})
    out = evaluated(model, columns)
    extra = ROWS[name].force(SimpleNamespace(u=u, v=v, t=t, z=z)) if name not in LINEAR else 0.0
    np.testing.assert_allclose(out[:, 0], applied - 3.77 * v - 355.3 * u - extra, rtol=1e-12, atol=1e-13)
    if name == "relaxation":
        np.testing.assert_allclose(out[:, 1], v - z / 0.1, rtol=1e-13)
    if name == "hysteresis":
        np.testing.assert_allclose(out[:, 1], v - 300.0 * np.abs(v) * z - 100.0 * v * np.abs(z), rtol=1e-12)


def test_a_differentiated_shape_goes_by_the_whole_chain_rule() -> None:
    """d/dt of u cos(t) z through u, t and the state z: 2 (v cos(t) z - u sin(t) z + u cos(t) dz/dt)."""
    term = Term("odd_one", (Component("q", "u*cos(t)*z", 1, 2.0),), "", "", "", state="v - 3*z")
    model = Model("odd", (free(get("inertia")), free(term))).with_values({"m": 4.0, "q": 5.0})
    u, v, t, z, applied = np.random.default_rng(1).normal(size=(5, 50))
    out = evaluated(model, {"u": u, "v": v, "t": t, "z:odd_one": z, "force": applied})
    rate = v - 3 * z
    total = 10.0 * (v * np.cos(t) * z - u * np.sin(t) * z + u * np.cos(t) * rate)
    np.testing.assert_allclose(out[:, 0], (applied - total) / 4.0, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(out[:, 1], rate, rtol=1e-13)


@pytest.mark.parametrize("name", LIBRARY)
def test_reverse_inputs_reproduce_the_force(name: str) -> None:
    """In a periodic steady state ``F(f) = sum A_j(f) X_j(f)`` line by line, with nothing estimated.

    Only aliasing of what a shape makes above the Nyquist frequency is left, hence the three tolerances.
    """
    dt, periods = 0.005, 3
    per = round(PERIOD / dt)
    applied = force(Excitation(periods=periods), periods * per, dt, seed=3) * 2.0
    model = model_with(name)
    record = simulate(model, applied, dt, Integrator("rk4", 8))
    frequency = np.fft.rfftfreq(per, dt)
    band = (frequency > 0.2) & (frequency < 12.5)
    inputs = reverse_inputs(model)
    lines = np.array([np.fft.rfft(h[-per:]) for h in histories(inputs, record)])  # the last period
    values = {k: v for k, v in model.values.items() if v is not None}
    total = sum(i.response(frequency, values) * x for i, x in zip(inputs, lines, strict=True))
    expected = np.fft.rfft(record["force"][-per:])
    error = np.linalg.norm((total - expected)[band]) / np.linalg.norm(expected[band])
    assert error < ROWS[name].tolerance
    without = sum(
        i.response(frequency, {**values, **dict.fromkeys(get(name).symbols, 0.0)}) * x
        for i, x in zip(inputs, lines, strict=True)
    )
    if name != "constant_force":  # its line is at zero frequency, out of the band
        assert np.linalg.norm((without - expected)[band]) > 10.0 * np.linalg.norm((total - expected)[band])


@pytest.mark.parametrize("name", LIBRARY)
def test_derivatives_of_shapes_are_exact(name: str, value_of: Callable[..., np.ndarray]) -> None:
    """Against central differences, at points that no kink lies within the step of."""
    term = get(name)
    columns = {"u": np.array([0.31, -0.47, 0.83, -1.2]), "v": np.array([0.7, -0.2, -0.9, 1.1])}
    columns |= {"t": np.array([0.1, 0.5, 1.3, 2.2]), "z": np.array([0.4, -0.6, 0.2, -0.3])}
    columns |= {p.name: np.full(4, 0.6) for p in term.parameters}
    for text in [c.shape for c in term.components] + ([term.state] if term.state else []):
        for wrt in columns:
            graph = Graph()
            known = {n: graph.input(n) for n in columns}
            slope = graph.derivative(formulas.add_formula(graph, text, known), known[wrt])
            out = kernels.evaluate(graph.program([slope]), columns, 4)
            h = 1e-6
            above, below = {**columns, wrt: columns[wrt] + h}, {**columns, wrt: columns[wrt] - h}
            difference = (value_of(text, **above) - value_of(text, **below)) / (2 * h)
            np.testing.assert_allclose(out[:, 0], difference, rtol=1e-6, atol=1e-8, err_msg=f"d({text})/d{wrt}")


@pytest.mark.parametrize("name", LIBRARY)
def test_units(name: str) -> None:
    term = get(name)
    assert tuple(term.unit(s, "N", "m") for s in term.symbols) == ROWS[name].units
    assert tuple(term.unit(s, "kN", "mm") for s in term.symbols) == tuple(
        u.replace("kg", "N s^2/m").replace("N", "kN").replace("m", "mm") for u in ROWS[name].units
    )


@pytest.mark.parametrize("name", LIBRARY)
def test_words(name: str) -> None:
    term = get(name)
    assert term.name == name
    assert term.meaning
    assert term.cause
    assert term.formula
    assert all(p.meaning for p in term.parameters)


def test_symbols_are_unique() -> None:
    symbols = [s for term in LIBRARY.values() for s in term.symbols]
    assert len(symbols) == len(set(symbols))


def test_unknown_term_names_the_nearest() -> None:
    with pytest.raises(StudyError, match="did you mean 'cubic_stiffness'"):
        get("cubic_stifness")
    with pytest.raises(StudyError, match="`study terms` lists those that are known"):
        get("qqqq")


@pytest.mark.parametrize("name", ["inertia", "2nd", "a b", "a-b", "", "größe", "x\n"])
def test_a_users_term_needs_a_name_of_its_own(name: str) -> None:
    with pytest.raises(StudyError, match="name"):
        custom(name, "u**2")


def test_a_users_term_is_a_term_like_any_other() -> None:
    term = custom("bracket", "u*abs(u) + 0.1*v**3")
    assert term.symbols == ("q_bracket",)
    assert term.unit("q_bracket", "N", "m") == "N per unit of the formula"
    assert custom("drag", "v*abs(v)").unit("q_drag", "N", "m") == "N s^2/m^2"


@pytest.mark.parametrize("name", LIBRARY)
def test_values_of_the_rows_are_physical(name: str) -> None:
    assert get(name).physical(ROWS[name].values) == ""
    assert get(name).physical(dict.fromkeys(get(name).keys)) == "", "what is not known is not judged"


UNPHYSICAL: tuple[tuple[str, dict[str, float], str], ...] = (
    ("inertia", {"m": 0.0}, "m is 0; a mass is positive"),
    ("linear_damping", {"c": -0.1}, "c is -0.1; damping takes energy out, so it is zero or more"),
    ("quadratic_damping", {"c2": -3.0}, "c2 is -3; damping takes energy out, so it is zero or more"),
    ("cubic_damping", {"cv3": -1e-9}, "cv3 is -1e-09; damping takes energy out, so it is zero or more"),
    ("coulomb_friction", {"fc": -1.0}, "fc is -1; friction takes energy out, so it is zero or more"),
    ("dead_band", {"dead_band.u_g": 0.0}, "u_g is 0; the half width of the dead band is above zero"),
    ("one_sided_contact", {"kc": 0.0, "one_sided_contact.gap": -1.0}, "kc is 0; the stiffness of a stop is positive"),
    ("periodic_stiffness", {"periodic_stiffness.f_m": -2.0}, "f_m is -2; the frequency of the stiffness is above zero"),
    ("relaxation", {"kr": -1.0, "relaxation.tau": 1.0}, "kr is -1; the stiffness of a Maxwell element is positive"),
    ("relaxation", {"kr": 1.0, "relaxation.tau": 0.0}, "tau is 0; the relaxation time is above zero"),
    ("hysteresis", {"kz": 0.0}, "kz is 0; the stiffness of a Bouc-Wen element is positive"),
    (
        "hysteresis",
        {"kz": 1.0, "hysteresis.beta": 1.0, "hysteresis.gamma": -1.5},
        "beta is 1 and gamma is -1.5; the loops of joints and wire ropes seldom have |gamma| above beta",
    ),
    (
        "hysteresis",
        {"hysteresis.beta": -1.0},
        "beta is -1; a Bouc-Wen element takes energy out, so beta is zero or more",
    ),
    ("harmonic_force", {"harmonic_force.f": 0.0}, "f is 0; the frequency of the force is above zero"),
    (
        "stribeck_friction",
        {"fs": -0.1, "stribeck_friction.v_s": 1.0},
        "fs is -0.1; friction that falls as the velocity grows takes energy out, so it is zero or more",
    ),
    ("load_dependent_friction", {"fu": -2.0}, "fu is -2; friction takes energy out, so it is zero or more"),
    ("cogging", {"cogging.pitch": 0.0}, "pitch is 0; the distance after which the force repeats itself is above zero"),
)


@pytest.mark.parametrize(("name", "values", "said"), UNPHYSICAL)
def test_what_is_not_physical_is_said_in_a_sentence(name: str, values: dict[str, float], said: str) -> None:
    assert get(name).physical(values) == said
    assert get(name).physical({**values, "q_other": -1.0}) == said


@pytest.mark.parametrize(("beta", "gamma"), [(0.5, 0.0), (0.5, 0.4), (0.5, -0.4), (0.8, -1.1), (0.0, -0.6), (0.8, 1.1)])
def test_a_bouc_wen_element_takes_energy_out_whatever_gamma_is(beta: float, gamma: float) -> None:
    """By SciPy's integration along a motion from rest: at no time has it given more than it took."""
    assert least_energy_taken(beta, gamma) > -1e-6
    assert get("hysteresis").physical(bouc_wen(beta, gamma), seldom=False) == ""
    assert bool(get("hysteresis").physical(bouc_wen(beta, gamma))) == (abs(gamma) > beta)


@pytest.mark.parametrize("gamma", [0.0, 0.3, -0.6])
def test_with_beta_below_zero_it_gives_energy(gamma: float) -> None:
    assert least_energy_taken(-0.3, gamma) < -1e-2
    assert "energy" in get("hysteresis").physical(bouc_wen(-0.3, gamma), seldom=False)


def bouc_wen(beta: float, gamma: float) -> dict[str, float]:
    return {"kz": 1.0, "hysteresis.beta": beta, "hysteresis.gamma": gamma}


def least_energy_taken(beta: float, gamma: float) -> float:
    """Over the times of a motion with two frequencies, in the element's own units."""

    def rates(t: float, state: np.ndarray) -> list[float]:
        v = 0.9 * np.cos(t) + 0.5 * np.cos(2.7 * t + 1.0)
        return [v - beta * abs(v) * state[0] - gamma * v * abs(state[0]), state[0] * v]

    run = solve_ivp(rates, (0.0, 60.0), [0.0, 0.0], rtol=1e-9, atol=1e-11, max_step=0.05)
    return float(np.min(run.y[1]))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("linear_damping", {"c": 0.0}),
        ("cubic_stiffness", {"k3": -2e6}),
        ("linear_stiffness", {"k": -10.0}),
        ("van_der_pol_damping", {"c3": -1.0}),
        ("dead_band", {"kg": -355.3, "dead_band.u_g": 1e-9}),
        ("one_sided_contact", {"kc": 1.0, "one_sided_contact.gap": -0.1}),
        ("hysteresis", {"kz": 1.0, "hysteresis.beta": 1.0, "hysteresis.gamma": -1.0}),
        ("constant_force", {"f0": -1.0}),
        ("directional_damping", {"cd": -1.0}),
        ("directional_quadratic_damping", {"cd2": -1.0}),
        ("pendulum_stiffness", {"kp": -1.0}),
    ],
)
def test_softening_self_excitation_and_a_preload_are_physical(name: str, values: dict[str, float]) -> None:
    assert get(name).physical(values) == ""


def test_a_fit_keeps_the_mass_and_what_has_no_sign_above_zero() -> None:
    kept = [key for term in LIBRARY.values() for key in term.positive]
    shapes = "dead_band.u_g periodic_stiffness.f_m relaxation.tau harmonic_force.f stribeck_friction.v_s cogging.pitch"
    assert kept == ["m", *shapes.split()]
    assert custom("own", "u**2").positive == ()


def test_what_acts_on_an_angle_is_asked_for_where_one_was_measured() -> None:
    model = model_with("linear_stiffness")
    asked = {turning: [e.term.name for e in candidate_entries(model, turning=turning)] for turning in ((), ("",))}
    assert "pendulum_stiffness" not in asked[()]
    assert set(asked[("",)]) == {*asked[()], "pendulum_stiffness"} == set(LIBRARY) - set(LINEAR)
    record = Record(0.1, {"force": np.zeros(4), "displacement": np.zeros(4)}, {"force": "N m", "displacement": "rad"})
    assert record.rotations == {""}
    assert not replace(record, units={**record.units, "displacement": "mm"}).rotations


def test_only_a_steady_force_moves_the_place_of_rest() -> None:
    assert [term.name for term in LIBRARY.values() if term.steady] == ["constant_force"]


def test_no_other_module_asks_for_a_term_by_its_name() -> None:
    """All about a term stands in its entry; left out are the oscillator's own, and the report's systems."""
    study = Path(formulas.__file__).parents[1]
    asked = {
        f"{path.name}:{node.lineno}"
        for path in study.rglob("*.py")
        if path.name != "terms.py" and "reproduction" not in path.parts
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Compare | ast.MatchValue)
        for leaf in ast.walk(node)
        if isinstance(leaf, ast.Constant) and leaf.value in set(LIBRARY) - set(LINEAR)
    }
    assert not asked


@pytest.mark.parametrize(
    ("heading", "force", "quantities"),
    [
        ("friction(vs)", "tanh(v/vs)", ["velocity"]),
        ("stop(gap)", "max(u - gap, 0)", ["length"]),
        ("stribeck(a, vs)", "sgn(v)*(1 + a*exp(-abs(v)/vs))", ["number", "velocity"]),
        ("pull(f)", "u*cos(2*pi*f*t)", ["frequency"]),
        ("soft(b)", "u/(1 + b*abs(u))", ["1/length"]),
        ("fading(tau)", "v*exp(-t/tau)", ["time"]),
        ("pendulum(a)", "sin(u - a)", ["length"]),  # an angle
    ],
)
def test_a_parameter_of_an_own_formula_is_what_its_dimension_says(
    heading: str, force: str, quantities: list[str]
) -> None:
    term = custom(heading, force)
    assert term.heading == heading
    assert [p.quantity for p in term.parameters] == quantities


@pytest.mark.parametrize(
    ("heading", "force", "why"),
    [
        ("s(k)", "k*sin(u)", "only scales"),
        ("s(k)", "u/k", "only scales"),
        ("s(k)", "sin(u)", "lacks its parameter"),
        ("s(u)", "sin(u)", "means something else"),
        ("s(k, k)", "tanh(u/k)", "twice"),
        ("s(a", "tanh(u/a)", "no name of a term"),
        ("s(a)", "u + v*abs(v) + a", "does not tell what a is"),
    ],
)
def test_a_parameter_that_says_nothing_is_refused(heading: str, force: str, why: str) -> None:
    with pytest.raises(StudyError, match=why):
        custom(heading, force)
