"""What does the missing force grow with, with which power, and is it odd or even?

The missing force is held against ``|x|^p`` and ``|x|^p sgn x`` of the displacement and the velocity, and
against ``|u|^p v``, over a range of powers p, after all that a refit of the model could take over has
been taken out of both, and in the response, where the noise is white. Errors are those of leaving out
one block of time after the other.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from study.compare.missing_force import MissingForce
from study.support.arrays import Floats

POWERS = np.arange(0.0, 6.01, 0.25)
JACKKNIFE_BLOCKS = 24
VISIBLE = 1e-3  # of a shape must be left beside the fitted terms, for it to be tried
NOISE_AT_MOST = 0.98  # of the power
WAYS: dict[tuple[str, str], Callable[[Floats, Floats, float], Floats]] = {
    ("displacement", "odd"): lambda u, _, p: np.sign(u) * np.abs(u) ** p,
    ("displacement", "even"): lambda u, _, p: np.abs(u) ** p,
    ("velocity", "odd"): lambda _, v, p: np.sign(v) * np.abs(v) ** p,
    ("velocity", "even"): lambda _, v, p: np.abs(v) ** p,
    ("damping by displacement", "odd"): lambda u, v, p: np.abs(u) ** p * v,
}


@dataclass(frozen=True)
class Growth:
    """How well a power of one quantity explains the missing force."""

    of: str  # ``displacement``, ``velocity``, or ``damping by displacement``: |u|^p v
    parity: str  # ``odd`` or ``even`` in displacement, velocity, or (damping) velocity
    power: float  # the best power p
    power_error: float  # its standard error
    share: float  # share of what stands above the noise that it explains
    share_error: float  # its standard error
    coefficient: float  # of the shape with the best power, displacement and velocity in their own rms: its sign tells


@dataclass(frozen=True)
class Growths:
    """All ways, best first; ``margins`` by how much the best explains more than each, in standard errors."""

    ways: tuple[Growth, ...]
    margins: tuple[float, ...]


def growths(lacking: MissingForce) -> Growths | None:
    """Hold the missing force against powers of displacement and velocity; None if there is nothing to explain."""
    keep = lacking.inner
    wanted = lacking.weighted(lacking.force)[keep]
    basis = _basis([lacking.weighted(column)[keep] for column in lacking.free.T], len(wanted))
    wanted = wanted - basis @ (basis.T @ wanted)
    power = float(wanted @ wanted)
    if not power > 0.0:
        return None
    noise = min(lacking.noise * len(wanted), NOISE_AT_MOST * power)
    u, v = (x / max(float(np.std(x)), 1e-300) for x in (lacking.displacement, lacking.velocity))
    rows = [_way(name, lacking, u, v, keep, basis, wanted, power - noise) for name in WAYS]
    ranked = sorted((r for r in rows if r is not None), key=lambda r: -r[0].share)
    if not ranked:
        return None
    margins = [_margin(ranked[0][1], row[1]) for row in ranked]
    return Growths(tuple(r[0] for r in ranked), tuple(margins))


def _basis(columns: list[Floats], samples: int) -> Floats:
    """Orthonormal basis of what the fitted coefficients could change, shape (samples, p)."""
    scaled = [c / np.sqrt(np.sum(c**2)) for c in columns if np.any(c != 0.0)]
    if not scaled:
        return np.zeros((samples, 0))
    left, values, _ = np.linalg.svd(np.stack(scaled, axis=1), full_matrices=False)
    return left[:, values > 1e-8 * values[0]]


def _way(
    name: tuple[str, str], lacking: MissingForce, u: Floats, v: Floats, keep: slice, basis: Floats, wanted: Floats,
    explicable: float,
) -> tuple[Growth, Floats] | None:  # fmt: skip
    """One way with its best power, and its shares with each block left out."""
    cross, own, tried = list[Floats](), list[Floats](), list[float]()
    for power in POWERS[1:] if name == ("velocity", "even") else POWERS:  # a constant once is enough
        shape = lacking.weighted(WAYS[name](u, v, float(power)))[keep]
        rest = shape - basis @ (basis.T @ shape)
        if np.sum(rest**2) > VISIBLE**2 * np.sum(shape**2):
            cross.append(_blocks(rest * wanted))
            own.append(_blocks(rest * rest))
            tried.append(float(power))
    if len(tried) < 3:
        return None
    crosses: Floats = np.stack(cross, axis=1)
    owns: Floats = np.stack(own, axis=1)
    powers: Floats = np.array(tried)
    blocks = len(crosses)
    cross_sum, own_sum = np.asarray(np.sum(crosses, axis=0)), np.asarray(np.sum(owns, axis=0))
    power, gain = _top(powers, cross_sum**2 / own_sum)
    amount = float(np.interp(power, powers, cross_sum / own_sum))
    left_out: list[tuple[float, float]] = [
        _top(powers, (cross_sum - crosses[b]) ** 2 / (own_sum - owns[b])) for b in range(blocks)
    ]
    kept = blocks / (blocks - 1.0)
    shares = np.array([g for _, g in left_out]) * kept / explicable
    growth = Growth(
        *name, power, _jackknife(np.array([p for p, _ in left_out])), min(gain / explicable, 1.0),
        _jackknife(shares), amount,
    )  # fmt: skip
    return growth, shares


def _blocks(values: Floats) -> Floats:
    """Sums over blocks of time, shape (blocks,)."""
    size = max(len(values) // JACKKNIFE_BLOCKS, 1)
    count = len(values) // size
    return np.sum(values[: size * count].reshape(count, size), axis=1)


def _top(powers: Floats, gains: Floats) -> tuple[float, float]:
    """Power and gain at the top of a parabola through the best point and its neighbours."""
    i = int(np.argmax(gains))
    if i in (0, len(powers) - 1) or powers[i + 1] - powers[i - 1] > 2.5 * (powers[1] - powers[0]):
        return float(powers[i]), float(gains[i])
    before, here, after = (float(g) for g in gains[i - 1 : i + 2])
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(powers[i]) + shift * float(powers[i + 1] - powers[i]), here - 0.25 * (before - after) * shift


def _jackknife(left_out: Floats) -> float:
    n = len(left_out)
    return float(np.sqrt((n - 1) / n * np.sum((left_out - np.mean(left_out)) ** 2)))


def _margin(best: Floats, other: Floats) -> float:
    """Difference of two shares in standard errors; zero for the best itself."""
    difference = best - other
    spread = _jackknife(difference)
    return float(np.mean(difference)) / spread if spread > 0.0 else 0.0
