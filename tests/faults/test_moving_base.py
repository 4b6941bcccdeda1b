"""A moving base drives a structure as a force does: faults of its measurement are found in the same way."""

import numpy as np
import pytest

from study.trials import make_trial
from study.way_in.compare_records import compare_records


@pytest.mark.parametrize("late", [0.0, 1.5])
def test_a_delay_of_the_response_to_a_moving_base_is_found_and_none_invented(late: float):
    trial = make_trial(7, (), 1e-4, test="base")
    u = trial.record["displacement"]
    lines = np.fft.rfft(u) * np.exp(-2j * np.pi * np.fft.rfftfreq(len(u)) * late)
    record = trial.record.with_channels({"displacement": np.fft.irfft(lines, len(u))})
    faults = compare_records([record], trial.believed).faults
    assert [f.fault for f in faults] == (["delay"] if late else [])
    assert all(abs(f.value - late) < 4.0 * f.error for f in faults)
