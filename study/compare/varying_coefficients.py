"""Coefficients that vary, as fitted: each along time or a channel with its 95 % band, its knots and its unknowns."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from study.equations.coefficient_units import coefficient_unit
from study.equations.model import Model, ModelTerm
from study.equations.variation import ALONG_TIME, STEP_AT
from study.figures.labels import term_names
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.smoothness import moved_by_finer_knots, smoothness
from study.identify.time_domain.step_moments import moment_error
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.numbers import percent


@dataclass(frozen=True, eq=False)
class VaryingCoefficient:
    """One coefficient along what it varies with; arrays of shape (n,)."""

    entry: ModelTerm  # the term of its change
    symbol: str  # of the coefficient that changes
    along: str  # ``time``, or the name of a channel
    along_unit: str
    at: Floats  # values of that, over all that the record covers
    value: Floats  # the coefficient there
    error: Floats  # its standard error
    unit: str
    knots: tuple[float, ...]  # none of a step
    unknowns: float  # that its change effectively takes
    step: tuple[float, float] | None  # where it steps, and the standard error of that; None of a curve or a line

    @property
    def change(self) -> float:
        """From its smallest to its largest value, over the mean."""
        return float(np.ptp(self.value) / abs(np.mean(self.value)))


def varying_coefficients(fit: FreeRunFit, covariance: Floats, prepared: Prepared) -> tuple[VaryingCoefficient, ...]:
    """Every coefficient of a fitted model that varies; ``covariance`` is of its keys, shape (keys, keys)."""
    values, place = fit.model.numbers(), {key: i for i, key in enumerate(fit.keys)}
    taken = {one.entry.name: one.unknowns for one in smoothness(fit, prepared)}
    finer, moved = moved_by_finer_knots(fit, prepared) if taken else (fit.model, {})
    found = list[VaryingCoefficient]()
    for entry in fit.model.terms:
        variation = entry.term.variation
        if variation is None:
            continue
        along = variation.values(prepared.record)
        at = np.linspace(float(np.min(along)), float(np.max(along)), 201)
        moment = f"{entry.name}.{STEP_AT}"
        basis = variation.basis(at, values.get(moment, 0.0))
        each = basis.shape[1]
        unit = prepared.record.unit(variation.along) if variation.along != ALONG_TIME else "s"
        for i, symbol in enumerate(variation.of.symbols):
            key = symbol + entry.place.suffix
            own = (key, *entry.symbols[i * each : (i + 1) * each])
            rows = np.hstack([np.ones((len(at), 1)), basis])
            fitted = [j for j, name in enumerate(own) if name in place]
            block = covariance[np.ix_([place[own[j]] for j in fitted], [place[own[j]] for j in fitted])]
            spread = np.einsum("ij,jk,ik->i", rows[:, fitted], block, rows[:, fitted])
            if entry.name in taken and moved:
                spread = spread + _left_out(finer, entry, key, i, moved, at) ** 2
            step = None
            if variation.shape == "step":
                own_error = moment_error(fit, prepared, moment) if moment in place else 0.0
                # how long it takes is assumed: what steps at once may do so anywhere within
                step = values[moment], float(np.hypot(own_error, (variation.lasts or 0.0) / np.sqrt(12.0)))
            found.append(
                VaryingCoefficient(
                    entry, key, variation.along, unit, at, rows @ np.array([values[name] for name in own]),
                    np.sqrt(np.maximum(spread, 0.0)), coefficient_unit(replace(entry, term=variation.of), symbol,
                    prepared.record), variation.knots, taken.get(entry.name, float(len(entry.keys))), step,
                )
            )  # fmt: skip
    return tuple(found)


def _left_out(
    finer: Model, entry: ModelTerm, key: str, component: int, moved: Mapping[str, float], at: Floats
) -> Floats:
    """How far finer knots move one coefficient of a curve, at most, within a knot's distance of each place."""
    new = next(e for e in finer.terms if e.name == entry.name)
    variation = new.term.variation
    if variation is None:
        return np.zeros(len(at))
    each = len(variation.knots) - 1
    own = new.symbols[component * each : (component + 1) * each]
    shift = moved.get(key, 0.0) + variation.basis(at) @ np.array([moved[symbol] for symbol in own])
    return np.asarray(maximum_filter1d(np.abs(shift), 4 * len(at) // each + 1), dtype=np.float64)


def varying_in_words(one: VaryingCoefficient) -> str:
    """What a coefficient does along what it varies with, in a sentence."""
    variation = one.entry.term.variation
    name = term_names(variation.of.name) if variation else one.symbol
    side = f" where {variation.side}" if variation and variation.side else ""
    first, last = (f"{one.value[i]:.4g} +- {1.96 * one.error[i]:.2g}" for i in (0, -1))
    if one.step is not None:
        moment, error = one.step
        where = f"{one.along} {moment:.4g} +- {1.96 * error:.2g} {one.along_unit}".rstrip()
        return f"The {name} ({one.symbol}) steps{side} from {first} to {last} {one.unit} at {where}."
    a, b = sorted((int(np.argmin(one.value)), int(np.argmax(one.value))))
    ends = [f"{one.value[i]:.4g} +- {1.96 * one.error[i]:.2g} {one.unit} at {one.at[i]:.4g}" for i in (a, b)]
    along = f"{one.along.replace('_', ' ')}{f' ({one.along_unit})' if one.along_unit else ''}"
    return (
        f"The {name} ({one.symbol}) varies with {along}{side}, by {percent(one.change)} of its mean: from {ends[0]} to "
        f"{ends[1]}, seen from {one.at[0]:.4g} to {one.at[-1]:.4g}; the curve takes {one.unknowns:.1f} unknowns."
    )


def varying_fields(one: VaryingCoefficient) -> dict[str, object]:
    """The same for a file."""
    step = {} if one.step is None else {"step_at": one.step[0], "step_at_error": one.step[1]}
    return {
        "coefficient": one.symbol, "varies_with": one.along, "unit": one.unit, "along_unit": one.along_unit,
        "at": one.at[::10].tolist(), "value": one.value[::10].tolist(), "error": one.error[::10].tolist(),
        "knots": list(one.knots), "unknowns": one.unknowns, **step,
    }  # fmt: skip
