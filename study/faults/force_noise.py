"""Noise on the measured force: what is left is shaped as the structure shapes a force.

The spectra of what is left of each sensor are held against two kinds of noise by Whittle's likelihood, each beside
white noise on the responses: noise on one of the forces behind the structure, and noise on each response itself; all of
them white or of first order.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq

from study.faults.fault import FORCE_NOISE, Fault
from study.faults.leftover import FittedResidual
from study.identify.time_domain.part_fit import run_of
from study.support.arrays import Floats
from study.support.cores import side_by_side
from study.support.errors import DivergenceError
from study.support.least_squares import least_squares
from study.support.thresholds import ALPHA, TOLERANCE

MEMORIES = (0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9)  # correlation of neighbouring samples
SCORING_ROUNDS = 100  # of Fisher's, at most
HALVINGS = 14  # of one step, at most
NOISY_RUNS = 32  # of the model, with noise on its force
LITTLE = 0.01  # of the force: the noise of the first runs, those that follow have what was found
REPEATS = 5  # of the runs, until size and colour of the noise no longer change
FADED = 0.1  # of a part of a record at either end
INDEPENDENT = (1.0 - 1.25 * FADED) ** 2 / (1.0 - 93.0 / 64.0 * FADED)  # of the lines are independent then
LINES_IN_MEAN = 5  # of a spectrum, over which the mean of these runs is taken
SHRINKING = 1e-3  # to which share of itself an amount may fall in one step


@dataclass(frozen=True)
class _Noise:
    """Noise of one shape beside white noise, and minus the logarithm of its likelihood."""

    amount: float  # mean square of what has passed the shape
    error: float
    cost: float
    power: float  # mean square behind the shape

    @property
    def rms(self) -> float:
        """Root mean square of the noise."""
        return float(np.sqrt(max(self.amount, 0.0)))

    @property
    def error_of_rms(self) -> float:
        """Standard error of that."""
        return self.error / float(np.sqrt(max(self.amount, 1e-300))) / 2.0


def force_noise(left: FittedResidual, forces: Sequence[str], asked: int, repeats: int = REPEATS) -> Fault | None:
    """Noise on one of these forces; None where noise on the responses is as likely, by the ratio of the likelihoods.

    With fewer ``repeats`` its size and colour are those of the first runs.
    """
    each = left.both.reshape(-1, len(left.prepared.outputs))
    power = _periodogram(each)
    turn = 2.0 * np.pi * np.asarray(rfftfreq(len(each)))[1:-1]
    on_responses = sum(
        min(_likely(own[:, None], _first_order(memory, turn)[:, None]).cost for memory in MEMORIES) for own in power.T
    )
    likely = [(name, _on_force(left, name, power, turn, on_responses - np.log(asked / ALPHA) / INDEPENDENT, repeats))
              for name in forces]  # fmt: skip
    name, found = min(likely, key=lambda one: min((noise.cost for noise in one[1]), default=np.inf))
    if not found:
        return None
    # the rms is that of all colours by how likely each is
    costs = INDEPENDENT * np.array([noise.cost for noise in found])
    weights = np.exp(np.min(costs) - costs)
    weights /= float(np.sum(weights))
    sizes, errors = np.array([noise.rms for noise in found]), np.array([noise.error_of_rms for noise in found])
    value = float(weights @ sizes)
    error = float(np.sqrt(weights @ (np.where(weights > 1e-6, errors, 0.0) ** 2 + (sizes - value) ** 2)))
    explained = min(found, key=lambda noise: noise.cost).power / float(np.mean(left.both**2))
    unit = left.prepared.record.units.get(name, "")
    return Fault(FORCE_NOISE, name, value, error, unit, min(explained, 1.0))


def _on_force(
    left: FittedResidual, name: str, power: Floats, turn: Floats, most: float, repeats: int
) -> list[_Noise]:  # fmt: skip
    """Noise on a force by its memory; none where it costs more than ``most``, or shows practically nothing."""
    memory, size, found = 0.0, LITTLE * float(np.std(left.prepared.record[name])), list[_Noise]()
    for _ in range(repeats):
        passed = _passed(left, name, memory, size)
        if passed is None:
            break
        white = passed / _first_order(memory, turn)[:, None]
        found = [_likely(power, white * _first_order(m, turn)[:, None]) for m in MEMORIES]
        best = min(found, key=lambda noise: noise.cost)
        if best.cost > most or best.power <= (TOLERANCE * left.size) ** 2:
            return []
        before, memory, size = (memory, size), MEMORIES[found.index(best)], best.rms
        if memory == before[0] and abs(size - before[1]) < best.error_of_rms:
            break
    return found


def _passed(left: FittedResidual, force: str, memory: float, size: float) -> Floats | None:
    """Spectra of the responses to noise of unit mean square and first order on a force, shape (lines, s).

    The mean over runs with noise of this rms, of some neighbouring lines: a nonlinear structure answers noise of each
    size and colour and along each motion in another way, and a lightly damped one rings beyond the ends of a part. Runs
    that noise lets escape, or does not move at all, are left out; None where these are all.
    """
    rng, record, weights = np.random.default_rng(0), left.prepared.record, np.array(left.prepared.outputs.weights)
    run, quiet = left.run, np.concatenate(left.predicted)
    colour = np.sqrt(_first_order(memory, 2.0 * np.pi * np.asarray(rfftfreq(len(record)))))

    def logarithm(state: Mapping[str, Any]) -> Floats | None:
        own = np.random.default_rng(0)
        own.bit_generator.state = state
        white = own.standard_normal(len(record))
        noise = np.asarray(irfft(np.asarray(rfft(white)) * colour, len(record)))
        noisy = replace(left.prepared, record=record.with_channels({force: record[force] + size * noise}))
        with suppress(DivergenceError):
            fitted = run_of(left.fit, noisy).respond({}, left.fit.initial)[0]
            judged = replace(run, prepared=noisy).motions()
            power = _periodogram(weights * (np.concatenate([fitted, judged]) - quiet) / size)
            return np.log(power) if np.all(power > 0.0) else None
        return None

    drawn = list[Mapping[str, Any]]()  # where the numbers of each run begin: all of them would fill the memory
    for _ in range(NOISY_RUNS):
        drawn.append(rng.bit_generator.state)
        rng.standard_normal(len(record))
    total, count = np.zeros(0), 0
    for found in side_by_side(logarithm, drawn):
        if found is not None:
            total, count = total + found if count else found, count + 1
    if not count:
        return None
    near, whole = np.ones(LINES_IN_MEAN), np.ones(len(total))
    beside = np.convolve(whole, near, "same")
    smooth = [np.convolve(own, near, "same") / beside for own in (total / count).T]
    # of a periodogram that scatters as a chi squared of two degrees of freedom
    return np.exp(np.stack(smooth, axis=1) + np.euler_gamma)


def _periodogram(values: Floats) -> Floats:
    """Mean square by line, shape (lines, s), of values (n, s), ends faded by a split cosine bell (Bloomfield, 1976).

    Without it what rings at a sharp resonance beyond the ends lies on all other lines, and that alike.
    """
    n = len(values)
    edge = max(round(FADED * n), 1)
    bell = np.ones(n)
    bell[:edge] = 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    bell[n - edge :] = bell[edge - 1 :: -1]
    return np.abs(np.asarray(rfft(values * bell[:, None], axis=0)))[1:-1] ** 2 / float(np.sum(bell**2))


def _likely(power: Floats, shape: Floats) -> _Noise:
    """The most likely amount of a shape beside white noise on each sensor, none below zero, by Fisher's scoring.

    Both are (lines, s). A step that does not raise the likelihood (Whittle, 1953) is halved. What passes the structure
    reaches all sensors together, so that s of them tell its amount less well than s records would: the error counts the
    coherence of their spectra, which the likelihood of each by itself leaves out.
    """
    lines, count = power.shape
    level, mean = float(np.mean(shape)), np.asarray(np.mean(power, axis=0), dtype=np.float64)
    own = np.repeat(np.eye(count), lines, axis=0)
    columns, spectra = np.column_stack([shape.T.ravel() / level, own]), power.T.ravel()
    amounts = 0.5 * np.concatenate([[np.mean(mean)], mean])
    cost = _cost(columns @ amounts, spectra)
    for _ in range(SCORING_ROUNDS):
        expected = columns @ amounts
        step = least_squares(columns / expected[:, None], spectra / expected) - amounts
        tried = [np.maximum(amounts + step / 2**k, SHRINKING * amounts) for k in range(HALVINGS)]
        better = next((t for t in tried if _cost(columns @ t, spectra) < cost), None)
        if better is None:
            break
        amounts, before, cost = better, cost, _cost(columns @ better, spectra)
        if before - cost < 1e-6:
            break
    scores = columns / (columns @ amounts)[:, None]
    half = np.asarray(np.linalg.pinv(scores), dtype=np.float64)
    inverse = half @ half.T
    coherent = (scores[:, :1] * amounts[0] * scores).reshape(count, lines, -1)
    between = np.asarray(np.sum(coherent, axis=0), dtype=np.float64)
    together = between.T @ between - np.einsum("ilp,ilq->pq", coherent, coherent)
    variance = inverse + inverse @ together @ inverse  # never below that of spectra that tell of nothing in common
    error = float(np.sqrt(max(variance[0, 0], inverse[0, 0]) / INDEPENDENT))
    return _Noise(float(amounts[0]) / level, error / level, cost, float(amounts[0]))


def _cost(spectrum: Floats, power: Floats) -> float:
    """The negative logarithm of the likelihood of periodograms, each by itself, but for a constant."""
    return float(np.sum(np.log(spectrum) + power / spectrum))


def _first_order(memory: float, turn: Floats) -> Floats:
    """Spectrum of noise of unit mean square whose neighbouring samples have this correlation."""
    return (1.0 - memory**2) / (1.0 - 2.0 * memory * np.cos(turn) + memory**2)
