"""Noise on the measured force: what is left is shaped as the structure shapes a force.

The spectrum of what is left is held against two kinds of noise by Whittle's likelihood, each beside white noise on the
response: noise on the force behind the structure, and noise on the response itself; both white or of first order.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import rfft, rfftfreq

from study.faults.fault import FORCE_NOISE, Fault
from study.faults.leftover import Leftover
from study.identify.time_domain.part_fit import run_of
from study.identify.time_domain.shape_search import baseline
from study.records.prepared import FORCE, Prepared
from study.support.arrays import Floats
from study.support.least_squares import least_squares
from study.support.thresholds import ALPHA, TOLERANCE

MEMORIES = (0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9)  # correlation of neighbouring samples
ROUNDS = 100  # of Fisher's scoring, at most
HALVINGS = 14  # of one step, at most
RUNS = 32  # of a nonlinear model with a little noise on its force
LITTLE = 0.01  # of the force: what measured ones have; where a force switches, less would find no switch moved
LINES = 5  # of a spectrum, over which the mean of these runs is taken
SHRINKING = 1e-3  # to which share of itself an amount may fall in one step
LINEAR = {"m": "inertia", "c": "linear_damping", "k": "linear_stiffness"}


@dataclass(frozen=True)
class _Noise:
    """Noise of one shape beside white noise, and minus the logarithm of its likelihood."""

    amount: float
    error: float
    cost: float


def force_noise(left: Leftover, asked: int) -> Fault | None:
    """Noise on the force; None where noise on the response is as likely, by the ratio of the likelihoods."""
    residual = np.concatenate(left.residual)
    n, prepared = len(residual), left.prepared
    frequency = np.asarray(rfftfreq(n, prepared.dt))[1:-1]
    power = np.abs(np.asarray(rfft(residual)))[1:-1] ** 2 / n
    passed = _passed(left, frequency)
    level = float(np.mean(passed))
    colours = [_first_order(memory, 2.0 * np.pi * frequency * prepared.dt) for memory in MEMORIES]
    on_response = min(_likely(power, colour).cost for colour in colours)
    on_force = [_likely(power, passed / level * colour) for colour in colours]
    best = min(on_force, key=lambda noise: noise.cost)
    if on_response - best.cost < np.log(asked / ALPHA) or best.amount <= (TOLERANCE * left.size) ** 2:
        return None
    value, error = _rms(on_force, level)
    explained = float(best.amount * np.mean(passed / level) / np.mean(residual**2))
    unit = prepared.record.units.get("force", "")
    return Fault(FORCE_NOISE, "force", value, error, unit, min(explained, 1.0))


def _rms(found: list[_Noise], level: float) -> tuple[float, float]:
    """Rms of the noise and its standard error, over all colours by how likely each is."""
    weights = np.exp(-np.array([noise.cost for noise in found]) + min(noise.cost for noise in found))
    weights /= float(np.sum(weights))
    sizes = np.sqrt(np.array([max(noise.amount, 0.0) for noise in found]) / level)
    errors = np.array([noise.error / np.sqrt(max(noise.amount, 1e-300) * level) / 2.0 for noise in found])
    value = float(weights @ sizes)
    return value, float(np.sqrt(weights @ (np.where(weights > 1e-6, errors, 0.0) ** 2 + (sizes - value) ** 2)))


def _passed(left: Leftover, frequency: Floats) -> Floats:
    """Spectrum of the response to white noise of unit mean square on the force, shape (lines,).

    That of a linear model is known. A nonlinear one answers a small force along each motion in another way: there it is
    the mean over runs with a little noise on the force, of some neighbouring lines.
    """
    own = left.fit.model.numbers()
    if all(entry.name in LINEAR.values() for entry in left.fit.model.terms):
        base = baseline(left.fit, left.prepared)
        base = replace(base, approximation={symbol: own.get(symbol, 0.0) for symbol in LINEAR})
        return np.abs(base.transfer(np.asarray(2j * np.pi * frequency, dtype=np.complex128))) ** 2
    rng, record = np.random.default_rng(0), left.prepared.record
    quiet, size = np.concatenate(left.predicted), LITTLE * float(np.std(record[FORCE]))
    power = np.zeros(len(frequency))
    for _ in range(RUNS):
        noisy = record.with_channels({FORCE: record[FORCE] + size * rng.standard_normal(len(record))})
        added = (_response(left, replace(left.prepared, record=noisy)) - quiet) / size
        power += np.abs(np.asarray(rfft(added)))[1:-1] ** 2 / len(added)
    smooth = np.convolve(power, np.ones(LINES), "same") / np.convolve(np.ones(len(power)), np.ones(LINES), "same")
    return smooth / RUNS


def _response(left: Leftover, prepared: Prepared) -> Floats:
    """Response of the fitted model on both parts of a record, shape (n + m,)."""
    fitted = run_of(left.fit, prepared).respond({}, left.fit.initial)[0]
    assert left.prediction.run is not None, "what does not run leaves nothing to look at"
    return np.concatenate([fitted, replace(left.prediction.run, prepared=prepared).motion(prepared.response)])


def _likely(power: Floats, shape: Floats) -> _Noise:
    """The most likely amounts of a shape and of white noise, neither below zero, by Fisher's scoring.

    A step that does not raise the likelihood (Whittle, 1953) is halved.
    """
    columns = np.column_stack([shape, np.ones_like(shape)])
    mean = float(np.mean(power))
    amounts = np.array([0.5 * mean / float(np.mean(shape)), 0.5 * mean])
    cost = _cost(columns @ amounts, power)
    for _ in range(ROUNDS):
        spectrum = columns @ amounts
        step = least_squares(columns / spectrum[:, None], power / spectrum) - amounts
        tried = [np.maximum(amounts + step / 2**k, SHRINKING * amounts) for k in range(HALVINGS)]
        better = next((t for t in tried if _cost(columns @ t, power) < cost), None)
        if better is None:
            break
        amounts, before, cost = better, cost, _cost(columns @ better, power)
        if before - cost < 1e-6:
            break
    spectrum = columns @ amounts
    information = (columns / spectrum[:, None]).T @ (columns / spectrum[:, None])
    return _Noise(float(amounts[0]), float(np.sqrt(np.linalg.pinv(information)[0, 0])), cost)


def _cost(spectrum: Floats, power: Floats) -> float:
    """Twice the negative logarithm of the likelihood of a periodogram, but for a constant."""
    return float(np.sum(np.log(spectrum) + power / spectrum))


def _first_order(memory: float, turn: Floats) -> Floats:
    """Spectrum of noise of unit mean square whose neighbouring samples have this correlation."""
    return (1.0 - memory**2) / (1.0 - 2.0 * memory * np.cos(turn) + memory**2)
