"""Models: immutable, complete before they run, and solved for the right acceleration."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from study.equations.equations_of_motion import Equations, acceleration_program
from study.equations.formulas import ExpressionError
from study.equations.model import Model, free
from study.equations.model_file import read_model
from study.equations.motion_program import motion_program
from study.equations.simulate import simulate
from study.equations.terms import custom, get
from study.equations.variation import Variation, varying
from study.support.errors import StudyError

MODELS = Path(__file__).parents[2] / "models"


def test_the_same_term_twice_is_refused() -> None:
    with pytest.raises(StudyError, match="'inertia' twice"):
        Model("double", (free(get("inertia")), free(get("inertia"))))


def test_changes_make_new_models(systems: dict[str, Model]) -> None:
    linear = systems["linear"]
    grown = linear.with_term(get("cubic_stiffness"))
    assert "cubic_stiffness" in grown
    assert "cubic_stiffness" not in linear
    assert grown.without_term("cubic_stiffness") == linear
    assert grown.with_values({"k3": 2.0}).values["k3"] == 2.0
    assert grown.values["k3"] is None
    assert linear.with_values({"unknown": 1.0}) == linear


def test_values_are_keyed_by_symbol_and_term(systems: dict[str, Model]) -> None:
    assert systems["dead_band"].values == {"m": 1.0, "c": 1.89, "k": 355.3, "kg": -355.3, "dead_band.u_g": 0.0025}
    assert systems["mathieu"].numbers()["periodic_stiffness.f_m"] == 1.0


def test_missing_values_are_named(systems: dict[str, Model]) -> None:
    grown = systems["linear"].with_term(get("dead_band"))
    with pytest.raises(StudyError, match=r"'linear' gives no value for kg, dead_band.u_g"):
        acceleration_program(grown)


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan")])
def test_a_mass_is_above_zero(systems: dict[str, Model], mass: float) -> None:
    with pytest.raises(StudyError, match="mass"):
        acceleration_program(systems["linear"].with_values({"m": mass}))


def test_a_simulation_needs_inertia() -> None:
    with pytest.raises(StudyError, match="no inertia"):
        simulate(Model("massless", (free(get("linear_stiffness")).with_values({"k": 1.0}),)), np.zeros(9), 0.1)


def test_equation_shows_every_symbol(systems: dict[str, Model]) -> None:
    equation = systems["mathieu"].equation()
    assert all(symbol in equation for symbol in ("m", "c", "k", "km_cos", "km_sin", "= F(t)"))


def test_a_change_stands_in_the_equation_as_a_function_of_what_it_varies_with() -> None:
    curve = varying(Variation(get("linear_damping"), "warmth", knots=(0.0, 1.0, 2.0, 3.0), side="v > 0"))
    equation = Model("rig", (free(get("inertia")), free(get("linear_damping")), free(curve))).equation()
    assert equation == "m [d2u/dt2] + c [v] + Δc(warmth) [v where v > 0] = F(t)"


def test_states_are_those_with_a_memory(make_model: Callable[..., Model]) -> None:
    model = make_model(
        "both",
        {
            "inertia": {"m": 1.0},
            "relaxation": {"kr": 1.0, "relaxation.tau": 1.0},
            "hysteresis": {"kz": 1.0, "hysteresis.beta": 1.0, "hysteresis.gamma": 1.0},
        },
    )
    assert [t.name for t in model.states] == ["relaxation", "hysteresis"]
    made = Equations(model)
    assert len(made.slopes) == 3
    assert len(made.states) == 4


def test_a_users_term_sees_only_its_channels(systems: dict[str, Model]) -> None:
    model = systems["linear"].with_term(custom("wind", "wind**2")).with_values({"q_wind": 1.0})
    with pytest.raises(ExpressionError, match="'wind'"):
        simulate(model, np.zeros(9), 0.1)
    program = acceleration_program(model)
    assert program.registers[program.inputs["q_wind"]] == 1.0


def test_registers_of_the_kernels_stand_first(make_model: Callable[..., Model]) -> None:
    """The integrators write into registers by position; this is the layout they rely on."""
    relaxing = {"inertia": {"m": 2.0}, "relaxation": {"kr": 1.0, "relaxation.tau": 0.5}}
    model = make_model("maxwell", relaxing).with_term(free(custom("wind", "b - a")).with_values({"q_wind": 1.0}))
    program = motion_program(model, (), ()).program
    names = ("t", "drive:force", "drive:a", "drive:b", "u:", "v:", "z:relaxation")
    assert [program.inputs[n] for n in names] == list(range(7))
    assert program.registers[program.inputs["m"]] == 2.0
    assert np.count_nonzero(program.registers[:7]) == 0


@pytest.mark.parametrize(
    "name", ["linear", "duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", "dead_band", "extreme"]
)
def test_model_files_hold_table_1(name: str, systems: dict[str, Model]) -> None:
    """The files that the study runs are the systems that these tests hold against SciPy."""
    read = read_model(MODELS / f"{name}.yaml")
    assert read.name == name
    assert read.values == pytest.approx(systems[name].values)
    assert [t.name for t in read.terms] == [t.name for t in systems[name].terms]
