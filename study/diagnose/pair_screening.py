"""Which pairs of candidates are worth a free run? Two answers, as each is blind where the other sees.

The reverse system, where all terms are linear inputs, knows no side valleys, but noise on the response biases
it. The sensitivities of the fitted model's free run know no noise, but that model lacks both effects. In both
a pair is one small system of equations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft, rfftfreq

from study.diagnose.ranked import Ranked
from study.equations.model import Model, ModelTerm
from study.identify.frequency_domain.inputs import input_history, reverse_inputs, without_inertia
from study.identify.frequency_domain.starting_values import FAINT
from study.identify.time_domain.shape_search import Baseline, sensitivity
from study.support.errors import StudyError
from study.support.least_squares import least_squares

Floats = NDArray[np.float64]
TRIED = 10  # pairs that each of the two answers puts first


@dataclass(frozen=True)
class PairStart:
    """Two candidates and where their fit begins."""

    names: tuple[str, str]  # the two
    model: Model  # the model with both, every value given


def promising_pairs(rows: Sequence[Ranked], base: Baseline) -> list[PairStart]:
    """The best pairs of the reverse system and those of the sensitivities; the same pair may begin at both places.

    ``rows`` are the candidates with their shape parameters.
    """
    entries = {r.name: next(t for t in r.fit.model.terms if t.name == r.name) for r in rows}
    return _of_the_reverse_system(entries, base) + _of_the_sensitivities(entries, base)


def _of_the_reverse_system(entries: Mapping[str, ModelTerm], base: Baseline) -> list[PairStart]:
    """Pairs with coefficients, all of them anew, from the reverse system; best first."""
    known = base.fit.model
    everything = known
    for entry in entries.values():
        everything = everything.with_term(entry)
    try:
        columns, target = _spectra(everything, base)
    except StudyError:
        return []
    own = [key for key in known.values if key in columns]
    fixed = [key for key in own if key not in base.fit.keys]
    target = target - sum((float(known.values[k] or 0.0) * columns[k] for k in fixed), np.zeros(len(target)))
    free = [key for key in own if key in base.fit.keys]
    starts: list[tuple[float, PairStart]] = []
    for one, other in combinations([n for n, e in entries.items() if set(e.symbols) <= set(columns)], 2):
        keys = [*free, *entries[one].symbols, *entries[other].symbols]
        design = np.stack([columns[k] for k in keys], axis=1)
        amounts = least_squares(design, target)
        left = float(np.sum((target - design @ amounts) ** 2))
        model = known.with_term(entries[one]).with_term(entries[other])
        starts.append(
            (left, PairStart((one, other), model.with_values(dict(zip(keys, amounts.tolist(), strict=True)))))
        )
    return _best(starts)


def _of_the_sensitivities(entries: Mapping[str, ModelTerm], base: Baseline) -> list[PairStart]:
    """Pairs with coefficients of zero beside the fitted model; best first."""
    known, residual = base.fit.model, base.fit.residual
    tried = {n: sensitivity(e, tuple(float(p or 0.0) for p in e.parameters), base)
             for n, e in entries.items()}  # fmt: skip
    columns = {name: added for name, added in tried.items() if added is not None}
    starts: list[tuple[float, PairStart]] = []
    for one, other in combinations(columns, 2):
        design = np.hstack([columns[one], columns[other]])
        left = float(np.sum((residual - design @ least_squares(design, residual, 1e-8)) ** 2))
        model = known.with_term(entries[one]).with_term(entries[other])
        zero = dict.fromkeys((*entries[one].symbols, *entries[other].symbols), 0.0)
        starts.append((left, PairStart((one, other), model.with_values(zero))))
    return _best(starts)


def _best(starts: list[tuple[float, PairStart]]) -> list[PairStart]:
    return [start for _, start in sorted(starts, key=lambda f: f[0])[:TRIED]]


def _spectra(model: Model, base: Baseline) -> tuple[dict[str, Floats], Floats]:
    """Spectra of each coefficient's unit force, and of the measured force, as the response would show them.

    Real and imaginary parts of the lines that the force drives, one array a key. Weighted with the linear
    receptance, so that noise on the response weighs as it does in a free run.
    """
    prepared = base.prepared
    part, inputs = prepared.record.part(*prepared.inner(prepared.plan.fit)), reverse_inputs(model)
    if prepared.free:  # its inertia force is what the others have to balance
        mass, inputs = float(model.values["m"] or 1.0), without_inertia(inputs)
        part = part.with_channels({"force": -mass * part["acceleration"]})
    taper = np.hanning(len(part) + 1)[:-1]
    frequency = np.asarray(rfftfreq(len(part), part.dt))
    force = np.asarray(rfft(taper * part["force"]))
    loud = np.abs(force) ** 2 > FAINT * np.max(np.abs(force) ** 2)
    keep = (frequency >= prepared.band[0]) & (frequency <= frequency[loud][-1])
    if not np.any(keep):
        raise StudyError(f"no frequency that the force of {part.name!r} drives is one at which all motions are valid")
    weight = base.paths(len(part))[keep, 0, 0]
    columns: dict[str, Floats] = {}
    for item in inputs:
        spectrum = np.asarray(rfft(taper * input_history(item, part)))[keep] * weight
        for k, power in zip(item.parts, item.powers(frequency[keep]).T, strict=True):
            columns[k.symbol] = _parts(spectrum * power)
    return columns, _parts(force[keep] * weight)


def _parts(values: NDArray[np.complex128]) -> Floats:
    return np.concatenate([values.real, values.imag])
