"""Halves of sweeps have other frequencies, those of stationary forces have not; then blocks are judged in turn."""

import numpy as np
import pytest

from study.records.excitation import Excitation, force
from study.records.plan import driven_apart, shared
from study.records.record import SI_UNITS, Record
from study.records.record_layout import Layout, laid_out

STATIONARY = [
    Excitation("gaussian_lowpass", cutoff=6.0), Excitation("pierson_moskowitz", cutoff=6.0, peak_frequency=1.0),
    Excitation("random_phase_multisine", start_frequency=0.3, stop_frequency=6.0),
    Excitation("swept_sine", start_frequency=0.3, stop_frequency=6.0, periods=2),
]  # fmt: skip
SWEEPS = [
    Excitation("swept_sine", start_frequency=0.3, stop_frequency=6.0, sweep="linear"),
    Excitation("swept_sine", start_frequency=6.0, stop_frequency=0.3, sweep="logarithmic"),
]


def record(excitation, seed=1):
    drive = force(excitation, 4096, 0.05, seed)
    return Record(0.05, {"force": drive, "displacement": np.cumsum(drive - np.mean(drive))}, dict(SI_UNITS), "rig")


@pytest.mark.parametrize("excitation", STATIONARY)
@pytest.mark.parametrize("seed", range(5))
def test_stationary_forces_keep_halves(excitation, seed):
    made = record(excitation, seed)
    assert not driven_apart(made, (0, 2048), (2048, 4096))
    assert laid_out([made], Layout()).plan.fit == (0, 2048)


@pytest.mark.parametrize("excitation", SWEEPS)
def test_a_sweep_is_judged_in_every_other_block_and_this_is_said(excitation):
    made = record(excitation)
    assert shared(made, (0, 2048), (2048, 4096)) < 0.2
    chosen = laid_out([made], Layout())
    assert chosen.record.joints
    assert any("same frequencies" in note and "--judge A:B" in note for note in chosen.notes)
    asked = laid_out([made], Layout(alternate=True))
    np.testing.assert_array_equal(chosen.record["force"], asked.record["force"])


def test_dwells_are_like_a_sweep():
    time = 0.05 * np.arange(4096)
    made = record(STATIONARY[0])
    steps = np.sin(2.0 * np.pi * np.repeat(np.linspace(0.5, 4.0, 16), 256) * time)
    assert driven_apart(made.with_channels({"force": steps}), (0, 2048), (2048, 4096))


def test_named_parts_are_not_overruled():
    made = record(SWEEPS[0])
    kept = laid_out([made], Layout(fit=(0, 2048), judge=(2048, 4096)))
    assert kept.plan.fit == (0, 2048)
    assert not kept.record.joints
