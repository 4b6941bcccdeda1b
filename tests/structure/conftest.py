"""One record of a frame with a hardening joint, simulated once."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force

FRAME = Path(__file__).parents[2] / "models" / "structures" / "frame.yaml"
NOISE = 0.01  # mean square over that of each motion


@pytest.fixture(scope="session")
def frame():
    return read_model(FRAME)


@pytest.fixture(scope="session")
def quiet_frame(frame):
    """All motions of the frame without noise."""
    drive = force(Excitation(level=400.0, cutoff=12.5), 5000, 0.02, 1)
    return simulate(frame, {"shaker": drive}, 0.02, Integrator("rk4", 8))


@pytest.fixture(scope="session")
def record_of(quiet_frame):
    """Makes a record with sensors of one kind, noise on each, none at some coordinates."""

    def make(motion="displacement", noise=NOISE, without=(), seed=5):
        rng = np.random.default_rng(seed)
        kept = {s: x for s, x in quiet_frame.motions.items() if s.motion == motion and s.coordinate not in without}
        return quiet_frame.with_motions(
            {s: x + np.sqrt(noise) * np.std(x) * rng.standard_normal(len(x)) for s, x in kept.items()}
        )

    return make


@pytest.fixture(scope="session")
def believed(frame):
    """The frame as its owner knows it: without the hardening joint, and no coefficient known."""
    model = frame.without_term("cubic_stiffness[floor2-floor3]")
    return replace(model, name="believed").with_values(dict.fromkeys(model.values, None))
