"""What does an unexplained force depend on: displacement, velocity, both, the past, or time?

Each family is a handful of general shapes of the free run's motion. What a small force of such a shape adds to the
response is exact for functions of displacement and velocity (the free run's sensitivity); for those of the past and of
time the force is passed through the linear system. The first part of the record says how much of each, the second
how much of the residual that explains.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from study.compare.leftover_by_place import DEGREE, TAUS, hysteretic, relaxed
from study.equations.model import ModelTerm
from study.equations.terms import custom
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import judging_run, run_of, with_states
from study.identify.time_domain.shape_search import Baseline, modulation_lines, residual_lines
from study.records.outputs import alone
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS
from study.support import statistics
from study.support.errors import DivergenceError
from study.support.least_squares import least_squares
from study.support.statistics import Gain

Floats = NDArray[np.float64]
KNOTS = 24  # of a function of displacement or velocity in detail ...
EDGES = (0.01, 0.99)  # ... between these quantiles: what lies beyond is too rare to tell a detail
LONGEST = 16384  # samples of either part that are looked at


@dataclass(frozen=True)
class Unexplained:
    """A free run and what it leaves unexplained, on the fitting part and then on the judging part."""

    displacement: Floats  # of the free run, over its standard deviation; shape (n,)
    velocity: Floats  # the same
    residual: Floats  # measured minus predicted response; shape (n,)
    own: Floats  # derivatives of the response to the model's own coefficients and initial state; shape (n, p)
    shapes: Mapping[str, Floats]  # what functions of displacement, velocity, both add to the response; (n, shapes)
    split: int  # samples of the fitting part
    base: Baseline  # of the fitted model: its transfer passes other forces, its residual holds the lines


def unexplained(base: Baseline, prepared: Prepared) -> Unexplained:
    """What a fitted model leaves; where its free run does not stay finite to the end, on the fitting part alone."""
    fit, (first, last) = base.fit, prepared.plan.judge
    prepared = replace(prepared, plan=replace(prepared.plan, judge=(first, min(last, first + LONGEST))))
    runs = [run_of(fit, prepared, sensors=alone(name).sensors) for name in MOTIONS[:2]]
    motions = [run.respond({}, fit.initial)[0][:, 0] for run in runs]
    families = _formulas(*(float(np.std(x)) for x in motions))
    shaped = _with_shapes(fit, [text for texts in families.values() for text in texts])
    # Of segments, each initial state matters to its own samples alone; those of stretches are taken out of all columns.
    joined = bool(prepared.record.stretches)
    states = 0 if fit.restarts or joined or prepared.response == FORCE else 2
    rows = [*motions, fit.residual, _columns(with_states(shaped, prepared), len(shaped.keys), states, joined)]
    try:
        run = judging_run(fit, prepared)
        later = [run.motion(name) for name in MOTIONS[:2]]
        later.append(prepared.known(prepared.judged - run.motion(prepared.response), prepared.plan.judge))
        later.append(_columns(run.derivatives(shaped), len(shaped.keys), states, joined))
    except DivergenceError:
        split = len(fit.residual) // 2
    else:
        rows, split = [np.concatenate(both) for both in zip(rows, later, strict=True)], len(fit.residual)
    u, v, residual, slopes = rows
    first, last = len(fit.keys), len(shaped.keys)
    edges = first + np.cumsum([0, *(len(texts) for texts in families.values())])
    return Unexplained(
        displacement=u / np.std(u), velocity=v / np.std(v), residual=residual,
        own=np.hstack([slopes[:, :first], slopes[:, last:]]),
        shapes={name: slopes[:, a:b] for name, (a, b) in zip(families, pairwise(edges), strict=True)},
        split=split, base=base,
    )  # fmt: skip


def _columns(derivatives: Floats, keys: int, states: int, joined: bool) -> Floats:
    """Derivatives by the keys and so many initial states; of stretches, what each one's own state leaves of them."""
    if not joined or derivatives.shape[1] == keys:
        return derivatives[:, : keys + states]
    own = derivatives[:, keys:]
    return derivatives[:, :keys] - own @ np.linalg.lstsq(own, derivatives[:, :keys], rcond=1e-10)[0]


def _with_shapes(fit: FreeRunFit, texts: Sequence[str]) -> FreeRunFit:
    """The same fit of a model that has forces of these shapes as well, all of them zero."""
    model, keys = fit.model, fit.keys
    for i, text in enumerate(texts):
        term = custom(f"general_shape_{i}", text)
        model, keys = model.with_term(ModelTerm(term, (0.0,), ())), (*keys, *term.symbols)
    return replace(fit, model=model, keys=keys, values=np.append(fit.values, np.zeros(len(texts))))


def explained_by(left: Unexplained) -> dict[str, float]:
    """Held-out share of the residual that each family of shapes explains; at most one, negative for nothing."""
    return {name: gain.explained for name, gain in _families(left).items()}


def significant_share(left: Unexplained, level: float) -> float:
    """Largest held-out share that shapes of the motion, its past or time explain, and not by chance.

    All families of shapes are asked, and each shape of the motion and its past by itself: one coefficient sees less
    than a whole family may, but what little noise leaves to be seen it sees sooner. ``level`` is of the p value, all
    that was asked accounted for; zero where nothing is significant.
    """
    columns = np.hstack([*left.shapes.values(), _passed(left, _states(left))])
    gains = [*_families(left).values(), *_one_by_one(left, columns)]
    return max((0.0, *(g.explained for g in gains if g.p_value * len(gains) < level)))


def _families(left: Unexplained) -> dict[str, Gain]:
    families = {**left.shapes, "past": _passed(left, _states(left)), "time": _passed(left, _times(left))}
    found = {name: _held_out(left, columns) for name, columns in families.items()}
    for name, x in (("displacement", left.displacement), ("velocity", left.velocity)):
        detailed = _held_out(left, _passed(left, _hats(x)))
        found[name] = max(found[name], detailed, key=lambda gain: gain.explained)
    return found


def _one_by_one(left: Unexplained, columns: Floats) -> list[Gain]:
    """What each column explains by itself beside the model's own (Frisch and Waugh, 1933: one regression for all)."""
    both = np.column_stack([left.residual, columns])
    amounts = np.column_stack([least_squares(left.own[: left.split], x, 1e-6) for x in both[: left.split].T])
    freed = both - left.own @ amounts
    early, late = freed[: left.split], freed[left.split :]
    power = np.sum(early[:, 1:] ** 2, axis=0)
    each = early[:, 1:].T @ early[:, 0] / np.where(power > 0.0, power, np.inf)
    before, beside_own = left.residual[left.split :], _beside_own(left)
    return [statistics.gain_beside(before, a * late[:, i], beside_own) for i, a in enumerate(each, 1)]


def _formulas(u: float, v: float) -> dict[str, list[str]]:
    """Shapes of a force by family; ``u`` and ``v`` are the standard deviations of the motion."""
    both = [f"u**{a}*v**{b}" for a, b in product(range(1, 4), range(1, 4)) if a + b < 6]
    return {
        "displacement": _functions("u", u),
        "velocity": _functions("v", v),
        "displacement and velocity": [*both, "abs(u)*v", "abs(v)*u"],
    }


def _functions(x: str, size: float) -> list[str]:
    powers = [f"{x}**{n}" for n in range(2, DEGREE + 1)]
    limits = [f"max(min({x}, {share * size!r}), {-share * size!r})" for share in (0.5, 1.0)]
    return [*powers, f"abs({x})", f"{x}*abs({x})", f"sgn({x})", *limits]


def _states(left: Unexplained) -> list[Floats]:
    """Relaxations of several speeds, of the motion and of where it turned."""
    steps: Floats = np.diff(left.displacement, prepend=left.displacement[0])
    rate = float(np.std(steps) / np.std(left.velocity))  # time step in units of displacement over velocity
    slow = [relaxed(steps, float(np.exp(-rate / tau))) for tau in TAUS]
    return slow + [hysteretic(steps, beta) for beta in (0.5, 1.5, 4.0)]


def _hats(x: Floats) -> list[Floats]:
    """Piecewise linear functions that add up to any function of ``x`` without detail below a step, each shape (n,)."""
    first, last = (float(edge) for edge in np.quantile(x, EDGES))
    knots = np.linspace(first, last, KNOTS)
    inside = np.clip(x, first, last)
    return [np.clip(1.0 - np.abs(inside - knot) / (knots[1] - knots[0]), 0.0, None) for knot in knots]


def _times(left: Unexplained) -> list[Floats]:
    turn = 2.0 * np.pi * np.arange(len(left.residual)) / len(left.base.fit.residual)
    shapes: list[Floats] = []
    for line in modulation_lines(left.base)[:3]:
        shapes += [left.displacement * np.cos(line * turn), left.displacement * np.sin(line * turn)]
    for line in residual_lines(left.base)[:3]:
        shapes += [np.cos(line * turn), np.sin(line * turn)]
    return shapes


def _passed(left: Unexplained, shapes: Sequence[Floats]) -> Floats:
    """Forces of these shapes passed through the linear system, shape (n, shapes)."""
    n = len(left.residual)
    if not shapes:  # a spectrum without a single line has no times: what is nothing explains nothing
        return np.zeros((n, 1))
    size = next_fast_len(2 * n)
    omega = np.asarray(2j * np.pi * rfftfreq(size, left.base.dt), dtype=np.complex128)
    omega[0] = omega[1]  # a constant goes through as the lowest line does
    transfer = left.base.transfer(omega)
    return np.column_stack([irfft(transfer * rfft(s, size), size)[:n] for s in shapes])


def _held_out(left: Unexplained, columns: Floats) -> Gain:
    """What amounts from the fitting part, beside the model's own, explain of the judging part."""
    design = np.hstack([left.own, columns])
    early, late = design[: left.split], design[left.split :]
    amounts = least_squares(early, left.residual[: left.split], 1e-6)
    amounts[: left.own.shape[1]] -= least_squares(left.own[: left.split], left.residual[: left.split], 1e-6)
    return statistics.gain_beside(left.residual[left.split :], late @ amounts, _beside_own(left))


def _beside_own(left: Unexplained) -> Floats:
    """Residual of the judging part beside what the model's own coefficients, fitted to both parts, take of it."""
    return (left.residual - left.own @ least_squares(left.own, left.residual, 1e-6))[left.split :]
