"""Which test next, of several coordinates: limits at each of them, and a sensor where none is."""

import numpy as np
import pytest

from study.compare.comparison import compare
from study.diagnose.designs import LET_GO
from study.diagnose.next_test import further_sensors, next_test
from study.diagnose.next_test_report import deciding_plan
from study.diagnose.separation import allowed, own_limits, respond, rivals_of
from study.diagnose.verdict import diagnose
from study.equations.terms import LIBRARY
from study.records.prepared import prepare_record
from study.records.record import Sensor
from study.trials import make_trial

TWINS = ("van_der_pol_damping", "displacement_damping")

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def rivals():
    """Two dampers at a place of two masses, of which one alone is measured."""
    trial = make_trial(20_101, ["van_der_pol_damping"], 0.05, "displacement", test="structure", coordinates=2)
    record = trial.record
    shown = record.with_motions({Sensor("mass2", "displacement"): record["mass2 displacement"]})
    comparison = compare(trial.believed, prepare_record(shown))
    found = diagnose(comparison, without=[name for name in LIBRARY if name not in TWINS and name not in trial.believed])
    return rivals_of(found.candidates[:2], comparison.prepared)


def test_limits_hold_at_every_coordinate(rivals):
    limits = own_limits(rivals.fits, rivals.present, 1.5)
    found = allowed(rivals.fits, rivals.present, limits)
    assert LET_GO in {design.kind for design in found}
    for design in found[::5]:
        for fit in rivals.fits:
            moved = respond(fit, design, [Sensor(c, "displacement") for c in ("mass1", "mass2")])[0]
            assert float(np.max(np.abs(moved))) <= limits.displacement


def test_a_sensor_where_none_is_tells_more(rivals):
    sensors = further_sensors(rivals)
    assert Sensor("mass1", "displacement") in sensors
    assert Sensor("mass2", "displacement") not in sensors
    present = rivals.present
    design = present.design(*present.kinds[0], len(present.source) // 2, 1.0)
    outputs, noise = rivals.seen(Sensor("mass1", "displacement"))
    assert [str(s) for s in outputs.sensors] == ["mass2 displacement", "mass1 displacement"]
    assert len(noise) == 2
    both, one = rivals.distances(design, Sensor("mass1", "displacement")), rivals.distances(design, sensors[-1])
    assert both.shape[:2] == one.shape[:2] == (2, 2)
    assert float(np.sum(both[0, 1])) > 0.0


def test_the_plan_of_a_structure_is_written(rivals):
    found = next_test(rivals, own_limits(rivals.fits, rivals.present, 1.5), rehearsals=0)
    printed, files = deciding_plan(found)
    assert "decides between" in printed
    assert files["plan.json"]
