"""When a coefficient stepped: the moment that leaves least, and how far from it others leave as little.

A step that is dated half a period late is an impulse more that the next half period takes back: what a fit leaves has
flat places and, with noise, a minimum in each of them. So neither derivatives nor the covariance that follows from them
tell the moment: moments on either side are tried. Where the step lies between two stretches that
are fitted, all moments there are one to these, and the stretch that is judged tells which of them it was.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from study.equations.variation import STEP_AT, Variation
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, judging_run, linearise, run_of
from study.records.prepared import Prepared
from study.support.errors import StudyError
from study.support.least_squares import length_or_one
from study.support.lowest import lowest

INSIDE = 3.84  # of chi squared with one degree of freedom: the 95 % interval


def dated(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit with each step where the record leaves least; itself where nothing steps."""
    if fit.restarts:
        return fit
    for key, variation in _moments(fit):
        now, (first, last) = fit.model.numbers()[key], _range(variation, prepared)
        # the moment is looked for first as far to either side as a fiftieth of what is covered
        own, about, apart = _left(fit, prepared, key), 0.02 * (last - first), _apart(variation)
        at = lowest(own, [now - about, now, now + about], apart)
        low, high = (at + side * _reach(own, at, side, apart, last - first) for side in (-1.0, 1.0))
        # what the fitted part leaves open is tried at nine moments first
        begins = np.linspace(max(low, first), min(high, last), 9)
        at = lowest(_left(fit, prepared, key, judged=True), begins.tolist(), apart)
        try:
            again = fit_part(
                fit.model.with_values({key: at}), prepared, (*fit.held, key), steps=fit.steps_per_sample,
                initial=np.atleast_2d(fit.initial), noise=fit.noise,
            )  # fmt: skip
        except StudyError:
            continue
        keys = tuple(k for k in again.model.values if k in again.keys or k == key)
        numbers = again.model.numbers()
        fit = replace(again, keys=keys, values=np.array([numbers[k] for k in keys]), elsewhere=fit.elsewhere)
    return fit


def moment_error(fit: FreeRunFit, prepared: Prepared, key: str) -> float:
    """Standard error of a moment: how far all of the record lets it be, with 95 %, over 1.96.

    By the likelihood of moments to the farther side.
    """
    variation = dict(_moments(fit))[key]
    first, last = _range(variation, prepared)
    left, at = _left(fit, prepared, key, judged=True), fit.model.numbers()[key]
    return max(_reach(left, at, side, _apart(variation), last - first) for side in (-1.0, 1.0)) / 1.96


def _reach(left: Callable[[float], float], at: float, side: float, apart: float, most: float) -> float:
    """How far from the best moment, to one side, chi squared lets it be."""
    inside, before, reach, least = 0.0, 0.0, apart, left(at)
    while reach < most:
        worse = max(left(at + side * reach) - least, 0.0)
        if worse > INSIDE:
            low, high = math.sqrt(before), math.sqrt(min(worse, 1e12))
            return inside + (reach - inside) * (math.sqrt(INSIDE) - low) / (high - low)
        inside, before, reach = reach, worse, 1.5 * reach
    return most


def _left(fit: FreeRunFit, prepared: Prepared, key: str, *, judged: bool = False) -> Callable[[float], float]:
    """Chi squared of the model beside a moment, by the noise that the fit leaves, as a function of that.

    All other estimates, and the states that stretches begin with, go along as their sensitivities tell: one free run a
    moment. On what was fitted, and on what is ``judged`` too if asked.
    """
    own, judging = replace(fit, penalty=np.zeros((0, 0))), judging_run(fit, prepared) if judged else None
    columns, keys = fit.whitened(linearise(fit, prepared)), len(fit.keys)
    if judging is not None:
        more = fit.whitened(judging.derivatives(fit))
        columns = np.block(
            [
                [columns, np.zeros((len(columns), more.shape[1] - keys))],
                [more[:, :keys], np.zeros((len(more), columns.shape[1] - keys)), more[:, keys:]],
            ]
        )
    columns = np.delete(columns, fit.keys.index(key), axis=1)
    basis = np.linalg.qr(columns / length_or_one(columns))[0]
    outputs, variance = prepared.outputs, max(fit.cost, np.finfo(float).tiny)
    plan = prepared.plan
    measured = [
        prepared.known(outputs.stacked(outputs.measured(prepared.record, s)), s) for s in (plan.fit, plan.judge)
    ]

    def left(moment: float) -> float:
        there = replace(own, model=fit.model.with_values({key: moment}))
        try:
            motions = [run_of(there, prepared).respond({}, fit.initial)[0]]
            motions += [] if judging is None else [replace(judging, fit=there).motions()]
        except StudyError:
            return math.inf
        spans = (plan.fit, plan.judge)
        parts = [
            fit.whitened(m - prepared.known(outputs.stacked(motion), s))
            for m, motion, s in zip(measured, motions, spans, strict=False)
        ]
        residual = np.concatenate(parts)
        return float(np.sum((residual - basis @ (basis.T @ residual)) ** 2)) / variance

    return left


def _range(variation: Variation, prepared: Prepared) -> tuple[float, float]:
    """What the record covers of that with which a coefficient varies."""
    values = variation.values(prepared.record)
    return float(np.min(values)), float(np.max(values))


def _moments(fit: FreeRunFit) -> list[tuple[str, Variation]]:
    """Keys of the steps' moments that are fitted, and what steps there."""
    found = [(f"{entry.name}.{STEP_AT}", entry.term.variation) for entry in fit.model.terms]
    return [(key, variation) for key, variation in found if variation is not None and key in fit.keys]


def _apart(variation: Variation) -> float:
    return 0.5 * (variation.lasts or 0.0)
