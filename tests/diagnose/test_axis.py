"""A mass without a spring drifts in free run; nothing that is asked of it may end in a fault of the program."""

from study.compare.comparison import compare
from study.diagnose.verdict import diagnose
from study.equations.model import Model, free
from study.equations.terms import LIBRARY, get
from study.records.prepared import prepare_record
from tests.axis import axis

TRIED = ("coulomb_friction", "constant_force", "quadratic_damping")


def test_a_positioning_axis_is_compared_and_diagnosed():
    believed = Model("axis", (free(get("inertia")), free(get("linear_damping"))))
    comparison = compare(believed, prepare_record(axis()))
    assert set(comparison.fit.keys) == {"m", "c"}
    diagnosis = diagnose(comparison, without=[name for name in LIBRARY if name not in TRIED])
    assert {row.name for row in diagnosis.candidates} <= set(TRIED)
    assert diagnosis.verdict != "nothing_missing"
