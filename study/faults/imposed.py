"""A fault of the measurement put on a record without one, of a size that matters."""

from collections.abc import Callable
from typing import Any

import numpy as np

from study.faults.fault import FAULTS, FORCE_NOISE
from study.records.prepared import FORCE
from study.records.record import Record
from study.support.arrays import Floats
from study.support.errors import expect

Imposed = tuple[Floats, float, str]  # the channel with the fault, the fault's value, and its unit
MAINS = (50.0, 60.0, 100.0, 120.0, 150.0, 180.0)  # hertz: mains and what rectifiers and cores make of it
FEWEST_PERIODS = 20  # of hum in a record: slower, as an alias, it would be drift
SLOW = 4  # half periods in a record, at most, of what a drift is made of
EXTENSION = 64  # samples by which a channel is continued before it is moved


def impose(record: Record, response: str, fault: str, rng: np.random.Generator) -> tuple[Record, dict[str, Any]]:
    """A record with one fault on its force or response, of a size drawn from the generator.

    What is known of it is given as the search for faults gives it: ``fault``, ``channel``, ``value`` and ``unit`` are
    what it should find. ``response`` is the measured motion, and ``fault`` one of ``FAULTS``.

    Raises
    ------
    StudyError
        If there is no such fault.
    """
    expect(fault in FAULTS, f"there is no fault {fault!r}; expected one of {', '.join(FAULTS)}")
    channel = FORCE if fault == FORCE_NOISE else response
    faulty, value, unit = _MAKERS[fault](record[channel], record.dt, rng)
    known = {"fault": fault, "channel": channel, "value": value, "unit": unit or record.units.get(channel, "")}
    return record.with_channels({channel: faulty}), known


def _offset(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: the offset."""
    offset = _either(rng) * rng.uniform(0.05, 0.5) * float(np.std(values))
    return values + offset, offset, ""


def _drift(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: rms of the drift about its mean; a sum of the slowest cosines, each as wide as it is slow."""
    x = (np.arange(len(values)) + 0.5) / len(values)
    slow = sum(rng.standard_normal() / k * np.cos(np.pi * k * x) for k in range(1, SLOW + 1))
    size = rng.uniform(0.1, 1.0) * float(np.std(values))
    return values + slow * size / float(np.std(slow)), size, ""


def _hum(values: Floats, dt: float, rng: np.random.Generator) -> Imposed:
    """Value: amplitude; of a frequency of the mains, which shows as its alias where the sampling is slow."""
    low, high = FEWEST_PERIODS / (dt * len(values)), 0.48 / dt
    seen = [f for f in MAINS if low < abs((f * dt + 0.5) % 1.0 - 0.5) / dt < high]
    frequency = float(rng.choice(seen)) if seen else rng.uniform(low, high)
    amplitude = float(np.sqrt(2.0 * rng.uniform(0.02, 0.10)) * np.std(values))
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return values + amplitude * np.cos(2.0 * np.pi * frequency * dt * np.arange(len(values)) + phase), amplitude, ""


def _delay(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: samples by which the channel is read late (early, if negative)."""
    late = _either(rng) * rng.uniform(0.2, 2.0)
    return shifted(values, late), late, "samples"


def _high_pass(values: Floats, dt: float, rng: np.random.Generator) -> Imposed:
    """Value: cut-off in hertz of a coupling of first order, one to ten per cent of the motion's own frequency."""
    rate = float(np.std(np.diff(values)) / np.std(values)) / dt / (2.0 * np.pi)
    cutoff = float(rng.uniform(0.01, 0.1)) * rate
    return high_passed(values, cutoff, dt), cutoff, "Hz"


def _spikes(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: share of the samples; single ones, several rms high."""
    count = max(2, round(rng.uniform(0.001, 0.005) * len(values)))
    at = rng.choice(len(values), count, replace=False)
    faulty = values.copy()
    faulty[at] += rng.choice([-1.0, 1.0], count) * rng.uniform(3.0, 10.0, count) * float(np.std(values))
    return faulty, count / len(values), "1"


def _drop_outs(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: share of the samples; runs of a few that read zero."""
    lost = np.zeros(len(values), dtype=np.bool_)
    wanted = max(3, rng.uniform(0.001, 0.005) * len(values))
    while np.count_nonzero(lost) < wanted:
        first = int(rng.integers(0, len(values) - 10))
        lost[first : first + int(rng.integers(3, 10))] = True
    return np.where(lost, 0.0, values), float(np.mean(lost)), "1"


def _clipping(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: what nothing beyond is shown, on both sides of the mean."""
    level = rng.uniform(1.5, 2.5) * float(np.std(values))
    return np.clip(values, -level, level), level, ""


def _converter_steps(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: the step of a converter of 6 to 9 bits."""
    step = 2.0 * float(np.max(np.abs(values))) / 2.0 ** int(rng.integers(6, 10))
    return step * np.round(values / step), step, ""


def _gain_change(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: change of the gain from the first sample, where it is one, to the last, as a share."""
    change = _either(rng) * rng.uniform(0.05, 0.30)
    return values * (1.0 + change * np.arange(len(values)) / (len(values) - 1)), change, "1"


def _force_noise(values: Floats, _: float, rng: np.random.Generator) -> Imposed:
    """Value: rms of the noise, white or of first order."""
    memory = float(rng.choice([0.0, 0.0, 0.8]))
    size, noise = rng.uniform(0.01, 0.05) * float(np.std(values)), rng.standard_normal(len(values))
    for i in range(1, len(noise) if memory else 0):
        noise[i] += memory * noise[i - 1]
    return values + noise * size / float(np.std(noise)), size, ""


def shifted(values: Floats, late: float) -> Floats:
    """A channel moved by a fraction of a sample, or several, to later times, shape (n,); band-limited.

    The ends are continued by point reflection and faded, so that no jump there rings through the channel.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(values)
    edge = min(EXTENSION, n - 1)
    fade = 0.5 - 0.5 * np.cos(np.pi * np.arange(edge) / edge)
    before = (2.0 * values[0] - values[edge:0:-1]) * fade
    after = (2.0 * values[-1] - values[-2 : -edge - 2 : -1]) * fade[::-1]
    longer = np.concatenate([before, values, after])
    size = next_fast_len(len(longer) + edge, real=True)
    lines = rfft(longer, size)
    turned = lines * np.exp(-2j * np.pi * late / size * np.arange(len(lines)))
    return np.asarray(irfft(turned, size)[edge : edge + n], dtype=np.float64)


def high_passed(values: Floats, cutoff: float, dt: float) -> Floats:
    """A channel behind a coupling of first order with this cut-off in hertz, at rest before it, shape (n,)."""
    from scipy.linalg import solve_banded  # SciPy's signal package takes as long to load as a search for faults

    half = np.pi * cutoff * dt  # bilinear: exact enough far below the sampling rate
    recursion = np.array([[1.0 + half], [half - 1.0]]) * np.ones(len(values))
    return np.asarray(solve_banded((1, 0), recursion, np.diff(values, prepend=0.0)), dtype=np.float64)


def _either(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


_MAKERS: dict[str, Callable[[Floats, float, np.random.Generator], Imposed]] = {
    "offset": _offset, "drift": _drift, "hum": _hum, "delay": _delay, "high_pass": _high_pass, "spikes": _spikes,
    "drop_outs": _drop_outs, "clipping": _clipping, "converter_steps": _converter_steps, "gain_change": _gain_change,
    "force_noise": _force_noise,
}  # fmt: skip
