"""A motion may stay finite where its derivatives by the coefficients do not, as along a chaotic one."""

from study.faults import search
from study.faults.correction import fault_columns
from study.faults.fault import OFFSET
from study.faults.leftover import leftover, share
from study.identify.time_domain.part_fit import JudgingRun
from study.support.errors import DivergenceError
from study.trials import make_trial
from study.way_in.compare_records import compare_records


def test_no_fault_is_said_where_the_derivatives_leave_the_range_of_numbers(monkeypatch):
    trial = make_trial(6, (), 1e-4)
    comparison = compare_records([trial.record], trial.believed).comparison
    prepared, channel = comparison.prepared, str(trial.record.sensors[0])

    def beyond(*_):
        raise DivergenceError("the derivatives of the free run leave the range of numbers", 1.0)

    left = leftover(comparison.fit, prepared)
    assert left is not None
    assert share(left, fault_columns(OFFSET, channel, left)) is not None
    monkeypatch.setattr(JudgingRun, "derivatives", beyond)
    left = leftover(comparison.fit, prepared)
    assert left is not None
    assert share(left, fault_columns(OFFSET, channel, left)) is None
    assert search.refined((OFFSET, channel), prepared, (), left) is None
