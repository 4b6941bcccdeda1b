"""A mass without a spring drifts in free run; nothing that is asked of it may end in a fault of the program."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import study as st
from study.compare.comparison import compare
from study.diagnose.verdict import diagnose
from study.equations.model import Model, free
from study.equations.terms import LIBRARY, get
from study.records.prepared import prepare_record
from study.records.readers import read_record
from study.records.record import write_csv
from study.support.errors import StudyError
from tests.axis import axis

TRIED = ("coulomb_friction", "constant_force", "quadratic_damping")


@pytest.mark.long
def test_a_positioning_axis_is_compared_and_diagnosed():
    believed = Model("axis", (free(get("inertia")), free(get("linear_damping"))))
    comparison = compare(believed, prepare_record(axis()))
    assert set(comparison.fit.keys) == {"m", "c"}
    diagnosis = diagnose(comparison, without=[name for name in LIBRARY if name not in TRIED])
    assert {row.name for row in diagnosis.candidates} <= set(TRIED)
    assert diagnosis.verdict != "nothing_missing"


def test_an_axis_that_rests_at_the_end_of_its_way_is_not_called_saturated_and_one_cut_off_there_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name, value in (("MASS", 20.0), ("FRICTION", 5.0), ("OFFSET", -1.0)):
        monkeypatch.setattr(f"tests.axis.{name}", value)
    record = axis(2)
    u = record["displacement"]
    assert np.count_nonzero(u == np.max(u)) > 500
    write_csv(record, tmp_path / "rests.csv")
    assert np.max(np.abs(read_record(tmp_path / "rests.csv")["displacement"] - u)) < 1e-12
    limit = 1e-6 * round(1e6 * 0.7 * float(np.max(u)))
    write_csv(record.with_channels({"displacement": np.minimum(u, limit)}), tmp_path / "cut.csv")
    with pytest.raises(StudyError, match="saturated"):
        read_record(tmp_path / "cut.csv")


def test_a_force_of_the_other_sign_shows_no_mass_and_says_what_would() -> None:
    found = axis()
    turned = replace(found, channels={**found.channels, "force": -found["force"]})
    believed = st.Model("inertia", "linear_damping")
    with pytest.raises(StudyError, match=r"show no mass: their integrals give m = -\d+; expected both positive in the"):
        believed.fit(st.Record.of(turned), measurement=False)
