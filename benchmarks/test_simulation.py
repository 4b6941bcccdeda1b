"""Simulation beside SciPy's integrators at equal error; run with `sh benchmarks/peers.sh pytest
benchmarks/test_simulation.py`, whose environment has the compiler of their right-hand side.

Everyone integrates the same Duffing record. A SciPy integrator gets the loosest tolerance with which it is at least as
near to the reference as we are, a compiled right-hand side, and the force between the samples from a table.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force
from study.records.interpolation import between_samples

njit = pytest.importorskip("numba", reason="numba comes with 'sh benchmarks/peers.sh'").njit
DT, SAMPLES, FINE = 0.02, 1024, 64
TOLERANCES = 10.0 ** -np.arange(3.0, 13.0, 0.5)
PEERS = ("DOP853", "RK45", "LSODA", "Radau")
GROUP = "a Duffing record of 1,024 samples at equal error"


@njit
def slope(t, x, table, step):
    """dx/dt; the force by a cubic through the four nearest of its fine samples."""
    place = t / step
    i = min(max(int(place), 1), len(table) - 3)
    s = place - i
    a, b, c, d = table[i - 1], table[i], table[i + 1], table[i + 2]
    drive = b + 0.5 * s * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)))
    return np.array([x[1], drive - 3.77 * x[1] - 355.3 * x[0] - 2e7 * x[0] ** 3])


@cache
def case():
    """Model, force and its fine table."""
    model = read_model(Path(__file__).parent.parent / "models" / "duffing.yaml")
    drive = force(Excitation(), SAMPLES, DT, 1)
    return model, drive, between_samples(drive, FINE)


def by_scipy(method: str, tolerance: float):
    _, _, table = case()
    at = np.arange(SAMPLES) * DT
    return solve_ivp(
        slope, (0.0, at[-1]), [0.0, 0.0], method, at, rtol=tolerance, atol=1e-3 * tolerance, args=(table, DT / FINE)
    ).y[0]


def by_us(integrator: Integrator):
    model, drive, _ = case()
    return simulate(model, drive, DT, integrator)["displacement"]


@cache
def reference():
    return by_scipy("DOP853", 1e-13)


def error(u) -> float:
    """Rms of the difference to the reference over the rms of the reference."""
    return float(np.sqrt(np.mean((u - reference()) ** 2) / np.mean(reference() ** 2)))


@cache
def equal(method: str) -> float:
    """The loosest tolerance that is as exact as the study's own setting."""
    aim = error(by_us(Integrator()))
    return next(float(tolerance) for tolerance in TOLERANCES if error(by_scipy(method, tolerance)) <= aim)


@pytest.mark.benchmark(group=GROUP)
@pytest.mark.parametrize("integrator", [Integrator("abm4", 8), Integrator("rk4", 8)], ids=lambda i: i.method)
def test_ours(benchmark, integrator):
    benchmark.extra_info["error"] = error(by_us(integrator))
    benchmark(by_us, integrator)


@pytest.mark.benchmark(group=GROUP)
@pytest.mark.parametrize("method", PEERS)
def test_scipy(benchmark, method):
    tolerance = equal(method)
    benchmark.extra_info |= {"error": error(by_scipy(method, tolerance)), "tolerance": tolerance}
    benchmark.pedantic(by_scipy, (method, tolerance), rounds=3, warmup_rounds=1)
