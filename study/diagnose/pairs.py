"""Two effects that explain together what none does alone.

Which pairs are worth a free run is asked of the reverse system, where all terms are linear inputs: with the
cross products of every candidate's spectrum at hand, a pair is one small system of equations.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft, rfftfreq
from scipy.signal import get_window

from study import fitting
from study.diagnose.candidates import SHORT, THREADS
from study.diagnose.ranking import Ranked
from study.diagnose.search import Baseline
from study.errors import StudyError
from study.fitting import FAINT, Plan
from study.inputs import history, reverse_inputs
from study.linear import least_squares
from study.model import Model
from study.motion import complete
from study.output_error import FreeRunFit
from study.record import Record

Floats = NDArray[np.float64]
TRIED = 20  # pairs that are fitted in free run, the best of the reverse system
SAME = 1e-4  # of the unexplained power: pairs that differ by less leave as little


@dataclass(frozen=True)
class Pair:
    """Two candidates fitted together.

    Attributes
    ----------
    names : pair of str
        The one that explains more alone comes first.
    found : FreeRunFit
        The model with both.
    residual : array, shape (samples to judge,)
        Held-out residual.
    """

    names: tuple[str, str]
    found: FreeRunFit
    residual: Floats


def best_pair(
    rows: Sequence[Ranked], base: Baseline, record: Record, how: Plan, held: tuple[str, ...]
) -> Pair | None:  # fmt: skip
    """The pair that leaves least of the held-out response, of those the reverse system puts first.

    Parameters
    ----------
    rows : sequence of Ranked
        The candidates, best first, with their shape parameters.
    base : Baseline
        The fitted model without them.
    record, how
        The record and which parts of it are fitted and judged.
    held : tuple of str
        Keys that keep the model's value.
    """
    order = {row.name: i for i, row in enumerate(rows)}

    def one(start: tuple[Model, str, str]) -> Pair | None:
        model, *names = start
        first, second = sorted(names, key=lambda name: order[name])
        values = {key: v for key, v in model.values.items() if v is not None}
        try:
            found = fitting.fit(model, record, how, held, values, SHORT)
            return Pair((first, second), found, fitting.held_out_residual(found, record, how))
        except StudyError:
            return None

    with ThreadPoolExecutor(THREADS) as pool:
        fits = [pair for pair in pool.map(one, _promising(rows, base, record, how, held)) if pair is not None]
    return _simplest(fits, float(base.found.residual @ base.found.residual) * _ratio(how)) if fits else None


def _ratio(how: Plan) -> float:
    """Samples to judge over samples to fit."""
    return (how.judge[1] - how.judge[0]) / (how.fit[1] - how.fit[0])


def _simplest(fits: list[Pair], before: float) -> Pair:
    """Of the pairs that leave practically as little as the best, the one with the fewest unknowns, then the best."""
    power = {pair.names: float(pair.residual @ pair.residual) for pair in fits}
    enough = min(power.values()) + (SAME * before)
    return min((p for p in fits if power[p.names] <= enough), key=lambda p: (len(p.found.keys), power[p.names]))


def _promising(
    rows: Sequence[Ranked], base: Baseline, record: Record, how: Plan, held: tuple[str, ...]
) -> list[tuple[Model, str, str]]:
    """Models with two candidates more, coefficients from the reverse system, best first."""
    known = base.found.model
    entries = {r.name: next(t for t in r.found.model.terms if t.name == r.name) for r in rows}
    everything = known
    for entry in entries.values():
        everything = everything.with_term(entry)
    try:
        columns, target = _spectra(everything, base, record, how)
    except StudyError:
        return []
    own = [key for key in known.values if key in columns]
    fixed = [key for key in own if key in held]
    target = target - sum((float(known.values[k] or 0.0) * columns[k] for k in fixed), np.zeros(len(target)))
    free = [key for key in own if key not in held]
    found: list[tuple[float, Model, str, str]] = []
    for one, other in combinations([n for n, e in entries.items() if set(e.term.symbols) <= set(columns)], 2):
        keys = [*free, *entries[one].term.symbols, *entries[other].term.symbols]
        design = np.stack([columns[k] for k in keys], axis=1)
        amounts = least_squares(design, target)
        left = float(np.sum((target - design @ amounts) ** 2))
        model = known.with_term(entries[one]).with_term(entries[other])
        found.append((left, model.with_values(dict(zip(keys, amounts.tolist(), strict=True))), one, other))
    found.sort(key=lambda f: f[0])
    return [(model, one, other) for _, model, one, other in found[:TRIED]]


def _spectra(model: Model, base: Baseline, record: Record, how: Plan) -> tuple[dict[str, Floats], Floats]:
    """Spectra of each coefficient's unit force, and of the measured force, as the response would show them.

    Real and imaginary parts of the lines that the force drives, one array a key. Weighted with the linear
    receptance, so that noise on the response weighs as it does in a free run.
    """
    completed = complete(record.part(*how.fit))
    part = completed.record.part(completed.edge, len(completed.record) - completed.edge)
    taper = get_window("hann", len(part))
    frequency = np.asarray(rfftfreq(len(part), part.dt))
    force = np.asarray(rfft(taper * part["force"]))
    loud = np.abs(force) ** 2 > FAINT * np.max(np.abs(force) ** 2)
    keep = (frequency >= completed.band[0]) & (frequency <= frequency[loud][-1])
    omega = 2j * np.pi * frequency[keep]
    weight = base.transfer(np.where(omega == 0.0, omega[-1] / len(omega), omega))
    columns: dict[str, Floats] = {}
    for item in reverse_inputs(model):
        spectrum = np.asarray(rfft(taper * history(item, part)))[keep] * weight
        for k, power in zip(item.parts, item.powers(frequency[keep]).T, strict=True):
            columns[k.symbol] = _parts(spectrum * power)
    return columns, _parts(force[keep] * weight)


def _parts(values: NDArray[np.complex128]) -> Floats:
    return np.concatenate([values.real, values.imag])
