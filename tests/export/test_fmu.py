"""FMUs run by FMPy, which knows nothing of this project, against the project's own free run."""

import shutil
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from study.equations.free_run import prepare
from study.equations.model import Model
from study.equations.model_file import read_model
from study.equations.place import GROUND
from study.export.exported import exported
from study.export.fmu import fmu
from study.records.excitation import Excitation, force
from study.records.interpolation import between_samples
from study.records.record import MOTIONS, OF_THE_GROUND, Record, Sensor

with warnings.catch_warnings():  # of another project, as it is imported
    warnings.simplefilter("ignore")
    fmpy = pytest.importorskip("fmpy", reason="FMPy comes with the extra 'dev'")
    from fmpy.fmi1 import FMICallException
    from fmpy.fmi2 import FMU2Slave
    from fmpy.validation import validate_fmu

Floats = NDArray[np.float64]
MODELS = Path(__file__).parents[2] / "models"
DT, SAMPLES = 0.000625, 6400
LINEAR = {"inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}


def forced(model: Model) -> Record:
    """A record of forces for a model, each of its own seed."""
    white = Excitation(level=32.0, cutoff=12.5)  # in the band as strong as the report's
    channels = {name: force(white, SAMPLES, DT, seed) for seed, (name, _) in enumerate(model.forces, 3)}
    return Record(DT, channels, coordinates=model.coordinates, forces=tuple(dict(model.forces)))


def written(folder: Path, model: Model, step: float | None = None) -> Path:
    path = folder / f"{model.name.replace(' ', '_')}.fmu"
    path.write_bytes(fmu(exported(model), step))
    return path


def run_by_fmpy(path: Path, record: Record, start: Mapping[str, float] | None = None) -> dict[str, Floats]:
    """Outputs at each sample; between them a force is the parabola of the free run with one step a sample."""
    description = fmpy.read_model_description(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    inputs = [v.name for v in description.modelVariables if v.causality == "input"]
    folder = fmpy.extract(str(path))
    unit = FMU2Slave(
        guid=description.guid, unzipDirectory=folder, instanceName="unit",
        modelIdentifier=description.coSimulation.modelIdentifier,
    )  # fmt: skip
    fine = {name: between_samples(record[name], 2, record.reading(name)) for name in inputs}
    found = np.zeros((len(record), len(outputs)))
    try:
        unit.instantiate()
        unit.setupExperiment(startTime=0.0)
        unit.enterInitializationMode()
        unit.setReal([references[n] for n in start or {}], list((start or {}).values()))
        unit.setReal([references[n] for n in inputs], [fine[n][0] for n in inputs])
        unit.exitInitializationMode()
        at = [references[n] for n in inputs]
        for i in range(len(record)):
            found[i] = unit.getReal([references[n] for n in outputs])
            if i + 1 == len(record):
                break
            rows = np.array([fine[n][2 * i : 2 * i + 3] for n in inputs])
            first = (4.0 * rows[:, 1] - 3.0 * rows[:, 0] - rows[:, 2]) / DT
            second = 4.0 * (rows[:, 0] - 2.0 * rows[:, 1] + rows[:, 2]) / DT**2
            unit.setReal(at, rows[:, 0].tolist())
            for order, slopes in ((1, first), (2, second)):
                unit.setRealInputDerivatives(at, [order] * len(at), slopes.tolist())
            unit.doStep(currentCommunicationPoint=i * DT, communicationStepSize=DT)
        unit.terminate()
    finally:
        unit.freeInstance()
        shutil.rmtree(folder, ignore_errors=True)
    return dict(zip(outputs, found.T, strict=True))


def free_run(model: Model, record: Record, initial: list[float] | None = None) -> dict[str, Floats]:
    sensors = [Sensor(c, m) for m in MOTIONS for c in model.coordinates]
    run = prepare(model, record, sensors=sensors, steps_per_sample=1)
    found = run.respond({}, initial or [0.0] * run.states)[0]
    return {str(sensor): column for sensor, column in zip(sensors, found.T, strict=True)}


def check(found: Mapping[str, Floats], expected: Mapping[str, Floats], within: float) -> None:
    assert set(expected) <= set(found)
    for name, values in expected.items():
        assert np.max(np.abs(values)) > 0.0
        assert np.linalg.norm(found[name] - values) < within * np.linalg.norm(values), name


@pytest.mark.parametrize(
    "name", ["duffing_van_der_pol", "mathieu", "dead_band", "structures/two_masses", "structures/three_masses"]
)
def test_a_unit_moves_as_the_free_run_does(name: str, tmp_path: Path) -> None:
    model = read_model(MODELS / f"{name}.yaml")
    record, path = forced(model), written(tmp_path, model)
    assert validate_fmu(str(path)) == []
    check(run_by_fmpy(path, record), free_run(model, record), 1e-6)


EFFECTS: dict[str, dict[str, dict[str, float]]] = {
    "own_state": {"relaxation": {"kr": 300.0, "relaxation.tau": 0.05}},
    "hysteresis": {"hysteresis": {"kz": 300.0, "hysteresis.beta": 200.0, "hysteresis.gamma": -80.0}},
    "friction": {"coulomb_friction": {"fc": 0.3}},
    "friction_that_falls": {
        "coulomb_friction": {"fc": 0.15},
        "stribeck_friction": {"fs": 0.25, "stribeck_friction.v_s": 0.02},
    },
}


@pytest.mark.parametrize("name", EFFECTS)
def test_states_of_terms_and_friction_that_sticks_go_along(name, tmp_path, make_model):
    model = make_model(name, {**LINEAR, **EFFECTS[name]})
    record = forced(model)
    check(run_by_fmpy(written(tmp_path, model), record), free_run(model, record), 1e-6)


def test_a_moving_ground_and_a_motion_that_is_prescribed_are_inputs(tmp_path):
    two = read_model(MODELS / "structures" / "two_masses.yaml")
    on_ground = replace(two, forces=((OF_THE_GROUND, GROUND),))
    turn = 2.0 * np.pi / (DT * SAMPLES)
    sine = np.sin(5.0 * turn * DT * np.arange(SAMPLES))
    record = Record(DT, {OF_THE_GROUND: sine}, coordinates=two.coordinates, forces=(OF_THE_GROUND,))
    check(run_by_fmpy(written(tmp_path, on_ground), record), free_run(on_ground, record), 1e-6)

    led = replace(two.without_term("inertia[first]"), forces=())
    motion = {
        "first displacement": 0.01 * sine,
        "first velocity": 0.05 * turn * np.cos(5.0 * turn * DT * np.arange(SAMPLES)),
        "first acceleration": -0.25 * turn**2 * sine,
    }
    record = Record(DT, motion, coordinates=two.coordinates, forces=())
    sensors = [Sensor("second", "displacement"), Sensor("second", "acceleration"), Sensor("first", "force")]
    expected = prepare(led, record, sensors=sensors, steps_per_sample=1).respond({}, [0.0, 0.0])[0]
    found = run_by_fmpy(written(tmp_path, led), record)
    check(found, {str(s): column for s, column in zip(sensors, expected.T, strict=True)}, 1e-6)


def test_friction_holds_within_a_unit(tmp_path, make_model):
    model = make_model("friction", {**LINEAR, **EFFECTS["friction"]})
    velocity = run_by_fmpy(written(tmp_path, model), forced(model))["velocity"]
    assert 0.05 < np.mean(velocity == 0.0) < 0.95


def test_a_master_that_holds_its_inputs_sets_where_it_starts_and_other_values(tmp_path, make_model):
    model = make_model("duffing", {**LINEAR, "cubic_stiffness": {"k3": 2.0e7}})
    softer = model.with_values({"k": 200.0})
    record = Record(0.01, {"force": np.zeros(300)})
    expected = prepare(softer, record, steps_per_sample=16).respond({}, [0.004, -0.02])[0][:, 0]
    found = fmpy.simulate_fmu(
        str(written(tmp_path, model)), stop_time=2.99, output_interval=0.01,
        start_values={"displacement": 0.004, "velocity": -0.02, "k": 200.0}, output=["displacement", "acceleration"],
    )  # fmt: skip
    assert np.linalg.norm(found["displacement"] - expected) < 1e-6 * np.linalg.norm(expected)
    assert found["acceleration"][0] == pytest.approx(-(3.77 * -0.02 + 200.0 * 0.004 + 2.0e7 * 0.004**3))


def test_a_unit_that_diverges_says_so(tmp_path, make_model):
    model = make_model("softening", {**LINEAR, "cubic_stiffness": {"k3": -2.0e7}})
    said = []
    with pytest.raises(FMICallException, match="fmi2"):
        fmpy.simulate_fmu(
            str(written(tmp_path, model)), stop_time=10.0, output_interval=0.1, start_values={"displacement": 0.1},
            logger=lambda *words: said.append(words[-1]),
        )  # fmt: skip
    assert any(b"the motion is not finite" in line for line in said)


def test_the_same_model_gives_the_same_bytes_and_another_step_a_unit_of_its_own(make_model):
    made = exported(make_model("rig", LINEAR))
    assert fmu(made) == fmu(made)
    assert fmu(made, 0.001) != fmu(made)


def test_a_unit_is_in_the_units_of_the_record_that_it_was_fitted_to(tmp_path, make_model):
    record = Record(0.01, {"force": np.zeros(8), "displacement": np.zeros(8)}, {"force": "kN", "displacement": "mm"})
    path = tmp_path / "rig.fmu"
    path.write_bytes(fmu(exported(make_model("rig", LINEAR), record)))
    description = fmpy.read_model_description(str(path), validate=True)
    units = {v.name: v.unit for v in description.modelVariables}
    assert units["k"] == "kN/mm"
    bases = {u.name: u.baseUnit for u in description.unitDefinitions}
    stiffness = bases["kN/mm"]
    assert (stiffness.kg, stiffness.s, stiffness.factor) == (1, -2, 1e6)
