"""What does an unexplained force depend on: displacement, velocity, both, the past, or time?

Each family is a handful of general shapes of the free run's motion, passed through the linear system.
The first part of the record says how much of each, the second how much of the residual that explains.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from study.diagnose.search import Baseline, modulation_lines, residual_lines
from study.linear import least_squares

Floats = NDArray[np.float64]
DEGREE = 7
TAUS = (0.1, 0.3, 1.0, 3.0, 10.0)
FAMILIES = ("displacement", "velocity", "displacement and velocity", "past", "time")


def explained_by(base: Baseline, velocity: Floats, dt: float) -> dict[str, float]:
    """Held-out share of the residual that each family of shapes explains; at most one, negative for nothing.

    Parameters
    ----------
    base : Baseline
        The fitted model and its residual on the fitting part.
    velocity : array, shape (n,)
        Velocity of the free run.
    dt : float
        Sampling interval in seconds.
    """
    u = base.displacement / np.std(base.displacement)
    v = velocity / np.std(velocity)
    families = {
        "displacement": _polynomials(u),
        "velocity": _polynomials(v),
        "displacement and velocity": [u**a * v**b for a, b in product(range(4), range(4)) if 1 < a + b < 6 and a and b]
        + [np.abs(u) * v, np.abs(v) * u],
        "past": _states(u, v),
        "time": _times(base, u),
    }
    linear = [u, v, np.gradient(v)]
    return {name: _share(base, [*linear, *shapes], dt) for name, shapes in families.items()}


def _polynomials(x: Floats) -> list[Floats]:
    top = float(np.max(np.abs(x)))
    even = [x**2, np.abs(x), np.maximum(x, 0.0), np.ones_like(x)]
    return [np.polynomial.chebyshev.Chebyshev.basis(n)(x / top) for n in range(3, DEGREE + 1)] + [
        *even, x * np.abs(x), np.sign(x), np.clip(x, -0.5, 0.5), np.clip(x, -1.0, 1.0)
    ]  # fmt: skip


def _states(u: Floats, v: Floats) -> list[Floats]:
    """Relaxations of several speeds, of the motion and of where it turned."""
    rate = float(np.std(np.diff(u)) / np.std(v))  # time step in units of displacement over velocity
    found: list[Floats] = []
    for tau in TAUS:
        state, total = np.zeros_like(u), 0.0
        fade = float(np.exp(-rate / tau))
        for i in range(1, len(u)):
            total = fade * total + u[i] - u[i - 1]
            state[i] = total
        found.append(state)
    for beta in (0.5, 1.5, 4.0):
        state, z = np.zeros_like(u), 0.0
        for i in range(1, len(u)):
            step = u[i] - u[i - 1]
            z = float(np.clip(z + step - beta * abs(step) * z, -1.0 / beta, 1.0 / beta))
            state[i] = z
        found.append(state)
    return found


def _times(base: Baseline, u: Floats) -> list[Floats]:
    n = len(u)
    turn = 2.0 * np.pi * np.arange(n) / n
    found: list[Floats] = []
    for line in modulation_lines(base)[:3]:
        found += [u * np.cos(line * turn), u * np.sin(line * turn)]
    for line in residual_lines(base)[:3]:
        found += [np.cos(line * turn), np.sin(line * turn)]
    return found


def _share(base: Baseline, shapes: Sequence[Floats], dt: float) -> float:
    residual = base.found.residual
    n = len(residual)
    size = next_fast_len(2 * n)
    omega = np.asarray(2j * np.pi * rfftfreq(size, dt), dtype=np.complex128)
    omega[0] = omega[1]  # a constant goes through as the lowest line does
    transfer = base.transfer(omega)
    columns = np.column_stack([irfft(transfer * rfft(s, size), size)[:n] for s in shapes])
    half = n // 2
    amounts = least_squares(columns[:half], residual[:half], 1e-6)
    rest = residual[half:] - columns[half:] @ amounts
    power = float(residual[half:] @ residual[half:])
    return 1.0 - float(rest @ rest) / power if power > 0.0 else 0.0
