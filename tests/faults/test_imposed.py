"""Every fault can be put on a record: on one channel alone, by the same draw in the same way, and no other is known."""

import numpy as np
import pytest

from study.faults.fault import FAULTS
from study.faults.imposed import high_passed, impose, shifted
from study.faults.spotted import at_the_limits
from study.support.errors import StudyError
from study.trials.draw import make_trial

RECORD = make_trial(3, (), 0.01, "displacement").record


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_changes_one_channel_and_the_draw_repeats(fault):
    faulty, known = impose(RECORD, "displacement", fault, np.random.default_rng(4))
    again, _ = impose(RECORD, "displacement", fault, np.random.default_rng(4))
    assert known["fault"] == fault
    assert known["channel"] == ("force" if fault == "force_noise" else "displacement")
    for channel in RECORD.channels:
        assert np.array_equal(faulty[channel], again[channel])
        assert np.array_equal(faulty[channel], RECORD[channel]) == (channel != known["channel"])
    changed = np.std(faulty[known["channel"]] - RECORD[known["channel"]]) / np.std(RECORD[known["channel"]])
    assert changed < 1.5
    assert fault == "offset" or changed > 1e-4


def test_an_unknown_fault_is_refused():
    with pytest.raises(StudyError, match="there is no fault 'rust'; expected one of offset, drift"):
        impose(RECORD, "displacement", "rust", np.random.default_rng(0))


def test_a_shift_is_the_motion_at_another_time():
    time = np.arange(2000)
    late = shifted(np.sin(0.37 * time + 0.2), 1.3)
    assert np.allclose(late[100:-100], np.sin(0.37 * (time - 1.3) + 0.2)[100:-100], atol=1e-3)


def test_a_coupling_of_first_order_has_its_gain():
    dt, cutoff = 0.01, 0.5
    time = dt * np.arange(20000)
    passed = high_passed(np.sin(2.0 * np.pi * cutoff * time), cutoff, dt)
    assert np.std(passed[10000:]) == pytest.approx(np.sqrt(0.5) * np.sqrt(0.5), rel=1e-2)


def test_the_largest_value_of_a_repeated_motion_is_no_limit() -> None:
    one = np.random.default_rng(1).standard_normal(500)
    assert at_the_limits(np.tile(one, 8), None) is None
    assert at_the_limits(np.clip(np.tile(one, 8), -2.0, 2.0), None) is not None
