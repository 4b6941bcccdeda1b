"""Texts that a model becomes: run by SciPy, and read by a parser of Modelica that knows nothing of this project."""

import ast
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from study.equations import kernels, model_file, terms
from study.equations.free_run import prepare
from study.equations.linear_part import modes_of
from study.equations.modal_part import ModalPart
from study.equations.model import Model, ModelTerm
from study.equations.motion_program import motion_program
from study.equations.place import GROUND
from study.export.exported import Exported, exported, identifiers
from study.export.fmu import fmu
from study.export.modelica_class import modelica_class, unit_in_modelica
from study.export.python_function import python_function
from study.export.ways import exported_file
from study.records.record import OF_THE_GROUND, Record, Sensor
from study.support.errors import StudyError

Floats = NDArray[np.float64]
Make = Callable[[str, Mapping[str, Mapping[str, float]]], Model]
MODELS = Path(__file__).parents[2] / "models"
LINEAR = {"inertia": {"m": 1.3}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}
EFFECTS = [name for name in terms.LIBRARY if name not in LINEAR]
FRAME = """
name: a frame on the ground
coordinates: [floor1, floor2, hand]
terms:
  - {term: inertia, at: floor1, value: 5.0}
  - {term: inertia, at: floor2, value: 4.0}
  - {term: inertia, at: hand}
  - {term: inertia, couples: [floor1, floor2], value: 0.7}
  - {term: linear_stiffness, between: [ground, floor1], value: 9000.0}
  - {term: linear_stiffness, between: [floor1, floor2], value: 7000.0}
  - {term: quadratic_damping, between: [floor1, floor2], value: 12.0}
  - {term: hysteresis, between: [floor2, hand], value: 300.0, beta: 20.0, gamma: -8.0}
"""


def namespace(text: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    exec(compile(text, "exported.py", "exec"), found)
    return found


def constant(value: float, _: float) -> float:
    """A force that is the same at any time."""
    return value


def valued(make_model: Make, name: str) -> Model:
    """A single mass with an effect, all of its numbers different."""
    term = terms.get(name)
    values = {key: 0.37 + 0.11 * i for i, key in enumerate(term.keys)}
    return make_model(name, {**LINEAR, name: values})


def motions(made: Exported, count: int = 5) -> tuple[Floats, Floats, Floats]:
    """Times, states and what drives, shape (count,), (count, states) and (count, drives)."""
    random = np.random.default_rng(11)
    return (
        random.uniform(0.1, 2.0, count), random.normal(size=(count, len(made.states))),
        random.normal(size=(count, len(made.inputs))),
    )  # fmt: skip


def slopes_of(made: Exported, time: float, state: Floats, drive: Floats) -> Floats:
    """Slopes by the program that a free run integrates."""
    motion = motion_program(made.model, (), (), switching=False)
    names = list(motion.program.inputs)[: 1 + len(motion.drive) + motion.states]
    columns = {n: np.array([x]) for n, x in zip(names, (time, *drive[: len(motion.drive)], *state), strict=True)}
    rows = kernels.evaluate(replace(motion.program, outputs=motion.slots[:, 0].copy()), columns, 1)[0]
    return np.concatenate([state[motion.dofs : 2 * motion.dofs], rows])


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_of_the_library_has_the_slopes_of_a_free_run_or_is_refused(name: str, make_model: Make) -> None:
    made = exported(valued(make_model, name))
    if "sgn(v)" in str(terms.get(name).components):
        assert made.sticks == (name,)
        for write in (python_function, modelica_class):
            with pytest.raises(StudyError, match=f"{name} of '{name}' sticks .* expected '--to fmu'"):
                write(made)
        return
    found = namespace(python_function(made))
    by_modelica = equations_of(modelica_class(made))
    for time, state, drive in zip(*motions(made), strict=True):
        expected = slopes_of(made, time, state, drive)
        forces = [partial(constant, x) for x in drive]
        np.testing.assert_allclose(found["slopes"](time, state, *forces), expected, rtol=1e-12)
        np.testing.assert_allclose(by_modelica(time, state, drive), expected, rtol=1e-12)


def equations_of(text: str) -> Callable[[float, Floats, Floats], Floats]:
    """The derivatives of a class as a parser of Modelica reads it."""
    parser = pytest.importorskip("pymoca.parser", reason="pymoca comes with the extra 'dev'")
    from pymoca import ast as modelica

    tree = parser.parse(text)
    assert tree is not None, "no syntax error"
    model = list(tree.classes.values())[-1]  # behind the types of the language
    symbols = model.symbols

    def modified(symbol: Any, name: str) -> Any:
        own = {a.value.component.name: a.value.modifications[0] for a in symbol.class_modification.arguments}
        return own.get(name)

    inputs = [n for n, s in symbols.items() if "input" in s.prefixes]
    parameters = {n: s for n, s in symbols.items() if "parameter" in s.prefixes}
    functions = {
        "abs": abs, "sign": np.sign, "max": max, "min": min, "sin": np.sin, "cos": np.cos, "exp": np.exp,
        "log": np.log, "sqrt": np.sqrt, "tanh": np.tanh, "+": lambda a, b: a + b, "*": lambda a, b: a * b,
        "/": lambda a, b: a / b, "^": lambda a, b: a**b, ">": lambda a, b: a > b,
    }  # fmt: skip

    def value(node: Any, known: Mapping[str, float]) -> float:
        match node:
            case modelica.Primary():
                return float(node.value)
            case modelica.ComponentRef():
                return known[node.name]
            case modelica.IfExpression():
                return value(node.expressions[0 if value(node.conditions[0], known) else 1], known)
            case modelica.Expression():
                name = str(getattr(node.operator, "name", node.operator))
                operands = [value(o, known) for o in node.operands]
                if name == "-":
                    return -operands[0] if len(operands) == 1 else operands[0] - operands[1]
                return functions[name](*operands)
            case _:
                raise AssertionError(f"{node} is not read")

    def slopes(time: float, state: Floats, drive: Floats) -> Floats:
        given = {n: value(modified(s, "value"), {}) for n, s in parameters.items()}
        known = {"time": time, **given, **dict(zip(inputs, drive, strict=True))}
        order = [n for n, s in symbols.items() if modified(s, "fixed") is not None]
        known |= dict(zip(order, state, strict=True))
        rates: dict[str, float] = {}
        for equation in model.equations:
            left = equation.left
            if isinstance(left, modelica.Expression):
                rates[left.operands[0].name] = value(equation.right, known)
            elif str(getattr(equation.right, "operator", "")) != "der":
                known[left.name] = value(equation.right, known)
        assert list(rates) == order
        return np.array(list(rates.values()))

    return slopes


def a_modal_model(make_frame: Model) -> Model:
    """The same structure by its modes, with a cubic spring."""
    modes = modes_of(make_frame)
    part = ModalPart(make_frame.coordinates).of(2)
    omega = 2.0 * np.pi * modes.frequency
    numbers = {key: float(w**2) for key, w in zip(part.stiffness, omega, strict=False)}
    numbers |= dict.fromkeys(part.damping, 0.3)
    numbers |= {key: float(x) for c, row in zip(part.points, modes.shape.T, strict=True)
                for key, x in zip(part.shape(c), row, strict=False)}  # fmt: skip
    cubic = model_file.parse_model(
        "name: modal\ncoordinates: [first, second]\nforces: {shaker: first}\nlinear: modal\n"
        "terms: [{term: cubic_stiffness, between: [ground, second], value: 3.0e+4}]\n", Path("modal.yaml"),
    )  # fmt: skip
    return Model("modal", cubic.terms, cubic.coordinates, cubic.forces, part.with_values(numbers))


@pytest.mark.parametrize("kind", ["moving ground and a prescribed motion", "modal", "two masses"])
def test_structures_have_the_slopes_of_a_free_run(kind: str) -> None:
    two = model_file.read_model(MODELS / "structures" / "two_masses.yaml")
    models = {
        "moving ground and a prescribed motion": replace(
            model_file.parse_model(FRAME, Path("frame.yaml")).without_term("inertia[hand]"),
            forces=((OF_THE_GROUND, GROUND),),
        ),
        "modal": a_modal_model(two), "two masses": two,
    }  # fmt: skip
    made = exported(models[kind])
    found, by_modelica = namespace(python_function(made)), equations_of(modelica_class(made))
    assert len(fmu(made)) > 0
    for time, state, drive in zip(*motions(made), strict=True):
        expected = slopes_of(made, time, state, drive)
        forces = [partial(constant, x) for x in drive]
        np.testing.assert_allclose(found["slopes"](time, state, *forces), expected, rtol=1e-11)
        np.testing.assert_allclose(by_modelica(time, state, drive), expected, rtol=1e-11)
        assert set(found["outputs"](time, state, *forces)) == {q.name for q in made.outputs}


def test_scipy_runs_the_function_as_the_free_run_goes() -> None:
    model = model_file.read_model(MODELS / "structures" / "two_masses.yaml")
    dt, samples = 0.002, 1000
    time = dt * np.arange(samples)
    record = Record(dt, {"shaker": 2.0 * np.sin(20.0 * time) * np.sin(1.5 * time) ** 2}, coordinates=model.coordinates,
                    forces=("shaker",))  # fmt: skip
    sensors = [Sensor("second", "displacement"), Sensor("first", "acceleration")]
    run = prepare(model, record, sensors=sensors, steps_per_sample=4)
    expected = run.respond({}, np.zeros(4))[0]
    found = namespace(python_function(exported(model)))
    assert found["STATES"] == ["first displacement", "second displacement", "first velocity", "second velocity"]

    def shaker(t: Floats) -> Floats:
        return 2.0 * np.sin(20.0 * t) * np.sin(1.5 * t) ** 2

    motion = solve_ivp(
        found["slopes"], (0.0, time[-1]), np.zeros(4), args=(shaker,), t_eval=time, rtol=1e-10, atol=1e-13
    )
    observed = found["outputs"](motion.t, motion.y, shaker)
    for sensor, column in zip(sensors, expected.T, strict=True):
        assert np.linalg.norm(observed[str(sensor)] - column) < 1e-6 * np.linalg.norm(column), sensor


def test_the_function_needs_numpy_alone(tmp_path: Path) -> None:
    path = tmp_path / "rig.py"
    path.write_bytes(exported_file(model_file.read_model(MODELS / "mathieu.yaml"), "python"))
    imports = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(n) for n in imports] == ["import numpy as np"]
    asked = "import sys, rig; rig.slopes(0.0, [1e-3, 0.0], lambda t: 1.0); print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", asked], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_names_become_identifiers_that_no_language_takes_for_its_own() -> None:
    found = identifiers(["k3[a-b]", "k3[a b]", "der", "2nd"], ["der"])
    assert found == {"k3[a-b]": "k3_a_b", "k3[a b]": "k3_a_b_2", "der": "der_2", "2nd": "x_2nd"}
    assert unit_in_modelica("N s^2/m^2") == "N.s2/m2"


def test_what_is_not_known_is_named(make_model: Make) -> None:
    model = make_model("rig", {**LINEAR, "cubic_stiffness": {}})
    with pytest.raises(StudyError, match="'rig' gives no value for k3; expected all, or the record to fit them to"):
        exported(model)
    known = make_model("rig", LINEAR)
    with pytest.raises(StudyError, match=r"a step of 0\.1 s is given to python; expected one of an FMU alone"):
        exported_file(known, "python", step=0.1)


@dataclass(frozen=True)
class Varying(ModelTerm):
    """A term that holds more than export knows of."""

    along: str = ""


def test_what_a_term_may_learn_to_hold_is_refused(make_model: Make) -> None:
    model = make_model("rig", LINEAR)
    entry = model.terms[-1]
    varying = Varying(entry.term, entry.coefficients, entry.parameters, entry.place, along="temperature")
    with pytest.raises(StudyError, match="linear_stiffness has along, which no export can say yet"):
        exported(replace(model, terms=(*model.terms[:-1], varying)))
    assert exported(replace(model, terms=(*model.terms[:-1], replace(varying, along="")))).parameters
