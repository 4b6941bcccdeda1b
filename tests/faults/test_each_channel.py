"""Faults of a structure: each is found in the channel that has it, corrected, and the effect beside it is found."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.diagnose.confirmed_faults import diagnose_accounted
from study.diagnose.verdict import MISSING, diagnose
from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.faults.fault import ALL_SENSORS, FAULTS, FaultSettings, settings_of
from study.faults.imposed import impose, shifted
from study.records.excitation import Excitation, force
from study.support.errors import StudyError
from study.way_in.compare_records import compare_records

COUNTED = {"spikes": 0.02, "drop_outs": 0.02, "clipping": 1e-9, "converter_steps": 1e-6}  # error as a share
FAR = 3.7  # standard errors
NOISE = 0.01  # mean square
FIRST, SECOND = "first displacement", "second displacement"
JOINT = "cubic_stiffness[first-second]"


@pytest.fixture(scope="module")
def truth():
    return read_model(Path(__file__).parents[2] / "models" / "structures" / "two_masses.yaml")


@pytest.fixture(scope="module")
def clean(truth):
    """Both displacements with noise."""
    drive = force(Excitation(level=0.3, cutoff=8.0), 4096, 0.02, 1)
    quiet, rng = simulate(truth, {"shaker": drive}, 0.02, Integrator("rk4", 8)), np.random.default_rng(5)
    kept = {s: x for s, x in quiet.motions.items() if s.motion == "displacement"}
    return quiet.with_motions({s: x + np.sqrt(NOISE) * np.std(x) * rng.standard_normal(4096) for s, x in kept.items()})


@pytest.fixture(scope="module")
def fuller(truth):
    """The right model, no coefficient known."""
    return truth.with_values(dict.fromkeys(truth.values, None))


@pytest.fixture(scope="module")
def believed(fuller):
    """The same without the hardening joint."""
    return fuller.without_term(JOINT)


def far_off(comparison, truth):
    """The largest distance of a coefficient from the truth in standard errors."""
    return max(abs(c.value - truth.values[c.key]) / c.error for c in comparison.coefficients)


@pytest.mark.parametrize("fault", [f for f in FAULTS if f != "force_noise"])  # of a channel that moves
def test_a_fault_is_found_in_its_channel_and_the_coefficients_are_right(fault, clean, fuller, truth):
    faulty, known = impose(clean, SECOND, fault, np.random.default_rng(11))
    result = compare_records([faulty], fuller)
    (found,) = result.faults
    assert (found.fault, found.channel, found.unit) == (fault, SECOND, known["unit"])
    assert abs(found.value - known["value"]) <= COUNTED.get(fault, 0.0) * abs(known["value"]) + FAR * found.error
    assert found.corrected == (fault != "converter_steps")
    assert far_off(result.comparison, truth) < FAR


def test_no_fault_is_found_without_one_whether_the_model_lacks_an_effect_or_not(clean, fuller, believed):
    assert compare_records([clean], fuller).faults == ()
    assert compare_records([clean], believed).faults == ()


@pytest.mark.parametrize("early", [2.0, -2.0])
def test_a_structure_that_is_read_early_or_late_has_the_delay_corrected(early, clean, fuller, truth):
    moved = clean.with_channels({str(s): shifted(clean[s], -early) for s in clean.sensors})
    result = compare_records([moved], fuller)
    (found,) = result.faults
    assert (found.fault, found.channel, found.unit) == ("delay", ALL_SENSORS, "samples")
    assert abs(found.value + early) < FAR * found.error
    assert "The motion of all sensors is read" in found.says
    assert far_off(result.comparison, truth) < FAR


@pytest.mark.parametrize("fault", ["delay", "spikes", "drop_outs", "hum"])
def test_the_effect_beside_a_fault_is_found_where_it_is(fault, clean, believed):
    faulty, _ = impose(clean, FIRST, fault, np.random.default_rng(3))
    result = compare_records([faulty], believed)
    assert [(f.fault, f.channel) for f in result.faults] == [(fault, FIRST)]
    diagnosis = diagnose(result.comparison)
    assert (diagnosis.verdict, diagnosis.candidates[0].name) == (MISSING, JOINT)


def test_lost_samples_of_a_sensor_are_lost_of_that_sensor_alone(clean, fuller):
    faulty, _ = impose(clean, SECOND, "drop_outs", np.random.default_rng(11))
    prepared = compare_records([faulty], fuller).comparison.prepared
    assert prepared.lost.shape == (len(clean), 2)
    gone = prepared.lost[:, 1]
    assert not np.any(prepared.lost[:, 0])
    assert np.any(gone)
    left = prepared.known(np.ones(2 * len(clean)), (0, len(clean))).reshape(-1, 2)
    assert np.all(left[:, 0] == 1.0)
    assert np.array_equal(left[:, 1] == 0.0, gone)


def test_a_force_among_several_is_read_late(truth, fuller):
    both = replace(truth, forces=(*truth.forces, ("second shaker", "second")))
    drives = {
        name: force(Excitation(level=0.3, cutoff=8.0), 4096, 0.02, seed) for seed, (name, _) in enumerate(both.forces)
    }
    quiet, rng = simulate(both, drives, 0.02, Integrator("rk4", 8)), np.random.default_rng(5)
    kept = {s: x for s, x in quiet.motions.items() if s.motion == "displacement"}
    record = quiet.with_motions({s: x + 0.03 * np.std(x) * rng.standard_normal(4096) for s, x in kept.items()})
    late = record.with_channels({"second shaker": shifted(record["second shaker"], 1.5)})
    (found,) = compare_records([late], replace(fuller, forces=both.forces)).faults
    assert (found.fault, found.channel) == ("delay", "second shaker")
    assert abs(found.value - 1.5) < FAR * found.error


@pytest.mark.parametrize("noisy", ["shaker", "second shaker", None])
def test_noise_on_a_force_is_that_of_the_force_which_has_it(noisy, truth):
    linear = truth.without_term(JOINT)
    both = replace(linear, forces=(*linear.forces, ("second shaker", "second")))
    drives = {
        name: force(Excitation(level=0.3, cutoff=8.0), 4096, 0.02, seed) for seed, (name, _) in enumerate(both.forces)
    }
    quiet, rng = simulate(both, drives, 0.02, Integrator("rk4", 8)), np.random.default_rng(5)
    kept = {s: x for s, x in quiet.motions.items() if s.motion == "displacement"}
    record = quiet.with_motions({s: x + 0.005 * np.std(x) * rng.standard_normal(4096) for s, x in kept.items()})
    size = 0.02 * float(np.std(drives["shaker"]))
    if noisy is not None:
        record = record.with_channels({noisy: record[noisy] + size * rng.standard_normal(4096)})
    found = compare_records([record], both.with_values(dict.fromkeys(both.values))).faults
    assert [(fault.fault, fault.channel) for fault in found] == ([] if noisy is None else [("force_noise", noisy)])
    for fault in found:
        assert abs(fault.value - size) < FAR * fault.error
        assert fault.error < 0.2 * size
        assert f"lies on the {noisy}" in fault.says


@pytest.mark.long
def test_noise_on_a_force_is_said_beside_the_effect_that_hid_it(truth, believed):
    drive, rng = force(Excitation(level=0.6, cutoff=8.0), 4096, 0.02, 1), np.random.default_rng(5)
    quiet = simulate(truth, {"shaker": drive}, 0.02, Integrator("rk4", 8))
    kept = {s: x for s, x in quiet.motions.items() if s.motion == "displacement"}
    record = quiet.with_motions({s: x + 0.003 * np.std(x) * rng.standard_normal(4096) for s, x in kept.items()})
    size = 0.01 * float(np.std(drive))
    noisy = record.with_channels({"shaker": drive + size * rng.standard_normal(4096)})
    accounted = compare_records([noisy], believed)
    assert accounted.faults == ()  # most of what is left depends on the motion
    found = diagnose_accounted(accounted)
    assert found.diagnosis.answer.name == JOINT
    (fault,) = found.faults
    assert (fault.fault, fault.channel) == ("force_noise", "shaker")
    assert fault.value == pytest.approx(size, rel=0.25)


def test_values_that_are_known_are_those_of_channels(clean, fuller, truth):
    moved = clean.with_channels({SECOND: shifted(clean[SECOND], 1.0), FIRST: clean[FIRST] + 1e-3})
    held = settings_of({"delay": {SECOND: 1.0}, "offset": {FIRST: 1e-3}})
    result = compare_records([moved], fuller, settings=held)
    assert {(f.fault, f.channel, f.value) for f in result.faults} == {("delay", SECOND, 1.0), ("offset", FIRST, 1e-3)}
    assert all("as given; corrected" in f.says for f in result.faults)
    assert far_off(result.comparison, truth) < FAR
    with pytest.raises(StudyError, match="holds offset of 'third displacement'; expected one of first displacement"):
        compare_records([clean], fuller, settings=FaultSettings({"offset": {"third displacement": 1.0}}))
    with pytest.raises(StudyError, match=r"'offset: \{first displacement: 1\}'"):
        compare_records([clean], fuller, settings=FaultSettings({"offset": 1.0}))


def test_one_sensor_of_a_structure_shows_its_faults(clean, believed):
    only = clean.with_motions({s: x for s, x in clean.motions.items() if str(s) == FIRST})
    late, _ = impose(only, FIRST, "spikes", np.random.default_rng(3))
    assert [(f.fault, f.channel) for f in compare_records([late], believed).faults] == [("spikes", FIRST)]
