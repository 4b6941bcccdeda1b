"""What does an unexplained force depend on, and where: displacement, velocity, both, the past, or time?

Each family is a handful of general shapes of the free run's motion at a place. What a small force of such a shape adds
to the response is exact for functions of the displacement and velocity of a single mass (the free run's sensitivity);
for those of the past and of time, and at the many places of a structure, the force is passed through the linear system.
The first part of the record says how much of each, the second how much of the residual that explains.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from study.equations.linear_part import connections
from study.equations.model import ModelTerm
from study.equations.place import Place
from study.equations.terms import custom
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import judging_run, run_of, with_states
from study.identify.time_domain.settling import continued
from study.identify.time_domain.shape_search import Baseline, baseline, modulation_lines, residual_lines
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Sensor
from study.records.spectra import StretchTransforms
from study.support import statistics
from study.support.arrays import Complexes, Floats
from study.support.cores import side_by_side
from study.support.errors import DivergenceError
from study.support.least_squares import Factored, factored, least_squares
from study.support.numbers import BEYOND_MEASURE
from study.support.statistics import Gain
from study.support.thresholds import ALPHA

HIGHEST_POWER = 7
DEPENDENCE_SAMPLES = 16384  # samples of either part that are looked at


@dataclass(frozen=True)
class FamilyGain:
    """What one family of shapes at one place explains, held out."""

    place: Place
    family: str  # ``displacement``, ``velocity``, ``displacement and velocity``, ``past`` or ``time``
    gain: Gain


@dataclass(frozen=True, eq=False)
class Unexplained:
    """A free run and what it leaves unexplained, on the fitting part and then on the judging part.

    Of n samples, s sensors and c coordinates.
    """

    base: Baseline  # of the fitted model: its paths pass forces, its residual holds the lines
    motion: Floats  # displacement and velocity of the free run, shape (2, n, c)
    residual: Floats  # measured minus predicted response, stacked; shape (n s,)
    own: Floats  # derivatives of the response to the model's own coefficients and initial state; shape (n s, p)
    shapes: dict[str, Floats]  # what functions of a mass's motion add to the response, exact; (n s, shapes)
    split: int  # rows of the fitting part
    transforms: StretchTransforms  # of all samples

    def along(self, place: Place) -> tuple[Floats, Floats]:
        """Relative displacement and velocity at a place, over their standard deviations, each shape (n,)."""
        u, v = self.motion @ np.array(place.direction(self.base.fit.model.coordinates))
        tiny = np.finfo(float).tiny
        return u / max(float(np.std(u)), tiny), v / max(float(np.std(v)), tiny)

    @cached_property
    def paths(self) -> Complexes:
        """Responses of the linear system on the lines of the transforms, as :meth:`Baseline.paths` has them."""
        return self.base.paths(self.transforms.size)

    @cached_property
    def early(self) -> Factored:
        """The model's own coefficients and the residual, of the fitting part."""
        return factored(self.own[: self.split], self.residual[: self.split])

    @cached_property
    def own_amounts(self) -> Floats:
        """What those coefficients take of that residual, shape (p,)."""
        return least_squares(self.own[: self.split], self.residual[: self.split], 1e-6)

    @cached_property
    def beside_own(self) -> Floats:
        """Residual of the judging part beside what those coefficients, fitted to both parts, take of it."""
        return (self.residual - self.own @ least_squares(self.own, self.residual, 1e-6))[self.split :]

    def passed(self, place: Place, forces: Sequence[Floats]) -> Floats:
        """Forces at a place, each shape (n,), passed through the linear system, shape (n s, forces)."""
        if not forces:  # a spectrum without a single line has no times: what is nothing explains nothing
            return np.zeros((len(self.residual), 1))
        path = self.paths @ np.array(place.direction(self.base.fit.model.coordinates))
        columns = self.transforms.passed(path, [self.transforms.lines(force) for force in forces])
        return self.base.prepared.outputs.stacked(columns)


def left_by(fit: FreeRunFit, prepared: Prepared) -> Unexplained:
    """What a fitted model leaves of no more of a record than this looks at."""
    look = prepared.shortened(min(fit.samples, DEPENDENCE_SAMPLES))
    return unexplained(baseline(continued(fit, look), look))


def unexplained(base: Baseline) -> Unexplained:
    """What a fitted model leaves; where its free run does not stay finite to the end, on the fitting part alone."""
    fit, prepared = base.fit, base.prepared
    first, last = prepared.plan.judge
    prepared = replace(prepared, plan=replace(prepared.plan, judge=(first, min(last, first + DEPENDENCE_SAMPLES))))
    motions = tuple(Sensor(c, m) for m in MOTIONS[:2] for c in fit.model.coordinates)
    free = run_of(fit, prepared, sensors=motions).respond({}, fit.initial)[0]
    exact = {} if base.several else _formulas(*np.std(free, axis=0).tolist())
    shaped = _with_shapes(fit, [text for texts in exact.values() for text in texts])
    # Of segments, each initial state matters to its own samples alone; those of stretches are taken out of all columns.
    joined = bool(prepared.record.stretches)
    slopes = None
    with suppress(DivergenceError):
        slopes = with_states(shaped, prepared)
    if slopes is None or not np.all(np.abs(slopes) < BEYOND_MEASURE):  # what shapes add, where the motion is finite
        exact, shaped, slopes = {}, fit, with_states(fit, prepared)
    states = 0 if fit.restarts or joined else slopes.shape[1] - len(shaped.keys)
    rows = [free, fit.residual, _columns(slopes, len(shaped.keys), states, joined)]
    spans = [fit.span]
    try:
        run = judging_run(fit, prepared)
        left = prepared.outputs.stacked(prepared.measured[slice(*prepared.plan.judge)] - run.motions())
        own = _columns(run.derivatives(shaped), len(shaped.keys), states, joined)
        later = [run.motions(motions), prepared.known(left, prepared.plan.judge), own]
    except DivergenceError:
        split = len(fit.residual) // 2
    else:
        rows, split = [np.concatenate(both) for both in zip(rows, later, strict=True)], len(fit.residual)
        spans.append(prepared.plan.judge)
    free, residual, slopes = rows
    keys = len(fit.keys), len(shaped.keys)
    edges = keys[0] + np.cumsum([0, *(len(texts) for texts in exact.values())])
    return Unexplained(
        base, free.reshape(len(free), 2, -1).transpose(1, 0, 2), residual,
        np.hstack([slopes[:, : keys[0]], slopes[:, keys[1] :]]),
        {name: slopes[:, a:b] for name, (a, b) in zip(exact, pairwise(edges), strict=True)},
        split, _transforms(prepared, spans),
    )  # fmt: skip


def _transforms(prepared: Prepared, spans: Sequence[tuple[int, int]]) -> StretchTransforms:
    """Of the stretches of these parts one after the other; a part that runs on from the one before is one with it."""
    if len(spans) > 1 and spans[0][1] == spans[1][0]:
        spans = [(spans[0][0], spans[1][1])]
    lengths = [end - begin for span in spans for begin, end in prepared.record.runs(span)]
    return StretchTransforms(tuple(pairwise(np.cumsum([0, *lengths]).tolist())), next_fast_len(2 * max(lengths)))


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
        entry = ModelTerm(custom(f"general_shape_{i}", text), (0.0,), (), connections(model)[0])
        model, keys = model.with_term(entry), (*keys, *entry.symbols)
    return replace(fit, model=model, keys=keys, values=np.append(fit.values, np.zeros(len(texts))))


def families(left: Unexplained) -> list[FamilyGain]:
    """Held-out share of the residual that each family of shapes at each place explains, the largest first.

    At most one, negative for nothing.
    """
    places = connections(left.base.fit.model)
    every = side_by_side(lambda place: _families_at(place, left, _along_motion(place, left)), places)
    found = [gain for gains in every for gain in gains]
    return sorted(found, key=lambda f: -f.gain.explained)


def explained_by_place(found: Sequence[FamilyGain]) -> dict[frozenset[str], float]:
    """The largest share that any family explains at each place, of those that do so not by chance."""
    shares: dict[frozenset[str], float] = {}
    for item in found:
        if item.gain.p_value * len(found) < ALPHA and item.gain.explained > 0.0:
            shares[item.place.path] = max(shares.get(item.place.path, 0.0), item.gain.explained)
    return shares


def significant_share(left: Unexplained, level: float) -> float:
    """Largest held-out share that shapes of the motion, its past or time explain, and not by chance.

    All families of shapes are asked, and each shape of the motion and its past by itself: one coefficient sees less
    than a whole family may, but what little noise leaves to be seen it sees sooner. ``level`` is of the p value, all
    that was asked accounted for; zero where nothing is significant.
    """

    def asked_at(place: Place) -> list[Gain]:
        along = _along_motion(place, left)
        return [f.gain for f in _families_at(place, left, along)] + _one_by_one(left, np.hstack([*along.values()]))

    gains = [gain for own in side_by_side(asked_at, connections(left.base.fit.model)) for gain in own]
    return max((0.0, *(g.explained for g in gains if g.p_value * len(gains) < level)))


def _along_motion(place: Place, left: Unexplained) -> dict[str, Floats]:
    """What shapes of the motion at a place, and of its past, add to the response, (n s, shapes) each."""
    return {**_shapes(place, left), "past": left.passed(place, _states(place, left))}


def _families_at(place: Place, left: Unexplained, along: Mapping[str, Floats]) -> list[FamilyGain]:
    columns = {**along, "time": left.passed(place, _times(place, left))}
    found = {name: _held_out(left, own) for name, own in columns.items()}
    for name, x in zip(MOTIONS[:2], left.along(place), strict=True):
        detailed = _held_out(left, left.passed(place, _hats(x)))
        found[name] = max(found[name], detailed, key=lambda gain: gain.explained)
    return [FamilyGain(place, name, gain) for name, gain in found.items()]


def _one_by_one(left: Unexplained, columns: Floats) -> list[Gain]:
    """What each column explains by itself beside the model's own (Frisch and Waugh, 1933: one regression for all)."""
    both = np.column_stack([left.residual, columns])
    amounts = least_squares(left.own[: left.split], both[: left.split], 1e-6)
    freed = both - left.own @ amounts
    early, late = freed[: left.split], freed[left.split :]
    power = np.sum(early[:, 1:] ** 2, axis=0)
    each = early[:, 1:].T @ early[:, 0] / np.where(power > 0.0, power, np.inf)
    before, evenly = left.residual[left.split :], left.base.prepared.free
    return [
        statistics.gain_beside(before, a * late[:, i], left.beside_own, evenly=evenly) for i, a in enumerate(each, 1)
    ]


def _shapes(place: Place, left: Unexplained) -> dict[str, Floats]:
    """What functions of displacement, of velocity and of both at a place add to the response, (n s, shapes) each."""
    if left.shapes:
        return dict(left.shapes)
    u, v = left.along(place)
    mixed = [u**a * v**b for a, b in product(range(1, 4), range(1, 4)) if a + b < 6] + [abs(u) * v, abs(v) * u]
    forces = {"displacement": _functions(u), "velocity": _functions(v), "displacement and velocity": mixed}
    return {name: left.passed(place, own) for name, own in forces.items()}


def _functions(x: Floats) -> list[Floats]:
    powers = [x**n for n in range(2, HIGHEST_POWER + 1)]
    return [*powers, np.abs(x), x * np.abs(x), np.sign(x), np.clip(x, -0.5, 0.5), np.clip(x, -1.0, 1.0)]


def _formulas(u: float, v: float) -> dict[str, list[str]]:
    """The same as formulas by family; ``u`` and ``v`` are the standard deviations of the motion."""
    both = [f"u**{a}*v**{b}" for a, b in product(range(1, 4), range(1, 4)) if a + b < 6]
    return {
        "displacement": _formulas_of("u", u),
        "velocity": _formulas_of("v", v),
        "displacement and velocity": [*both, "abs(u)*v", "abs(v)*u"],
    }


def _formulas_of(x: str, size: float) -> list[str]:
    powers = [f"{x}**{n}" for n in range(2, HIGHEST_POWER + 1)]
    limits = [f"max(min({x}, {share * size!r}), {-share * size!r})" for share in (0.5, 1.0)]
    return [*powers, f"abs({x})", f"{x}*abs({x})", f"sgn({x})", *limits]


def _states(place: Place, left: Unexplained) -> list[Floats]:
    """Relaxations of several speeds, of the motion and of where it turned."""
    u, v = left.along(place)
    steps: Floats = np.diff(u, prepend=u[0])
    rate = float(np.std(steps) / np.std(v))  # time step in units of displacement over velocity
    slow = [relaxed(steps, float(np.exp(-rate / tau))) for tau in (0.1, 0.3, 1.0, 3.0, 10.0)]
    return slow + [hysteretic(steps, beta) for beta in (0.5, 1.5, 4.0)]


def _hats(x: Floats) -> list[Floats]:
    """Piecewise linear functions that add up to any function of ``x`` without detail below a step, each shape (n,)."""
    # what lies beyond these quantiles is too rare to tell a detail
    first, last = (float(edge) for edge in np.quantile(x, (0.01, 0.99)))
    knots = np.linspace(first, last, 24)  # of a function of displacement or velocity in detail
    inside = np.clip(x, first, last)
    return [np.clip(1.0 - np.abs(inside - knot) / (knots[1] - knots[0]), 0.0, None) for knot in knots]


def relaxed(steps: Floats, kept: float) -> Floats:
    """The sum of all steps so far, of each of which a share is kept from sample to sample, shape (n,)."""
    size = next_fast_len(2 * len(steps), real=True)
    memory = kept ** np.arange(len(steps))
    return np.asarray(irfft(rfft(steps, size) * rfft(memory, size), size)[: len(steps)], dtype=np.float64)


def hysteretic(steps: Floats, beta: float) -> Floats:
    """A Bouc-Wen state along a motion's steps, no larger than one over ``beta``, shape (n,)."""
    state, z = np.zeros_like(steps), 0.0
    for i, step in enumerate(steps.tolist()):
        z = min(max(z + step - beta * abs(step) * z, -1.0 / beta), 1.0 / beta)
        state[i] = z
    return state


def _times(place: Place, left: Unexplained) -> list[Floats]:
    """What varies with time at a place: its stiffness, or a force, at the lines that stand out of the first part."""
    base, (u, _) = left.base, left.along(place)
    turn = 2.0 * np.pi * np.arange(len(u)) / base.fit.samples
    shapes: list[Floats] = []
    for line in modulation_lines(base.along(place), place, base)[:3]:
        shapes += [u * np.cos(line * turn), u * np.sin(line * turn)]
    for line in residual_lines(base)[:3]:
        shapes += [np.cos(line * turn), np.sin(line * turn)]
    return shapes


def _held_out(left: Unexplained, columns: Floats) -> Gain:
    """What amounts from the fitting part, beside the model's own, explain of the judging part."""
    amounts, keys = left.early.beside(columns[: left.split], 1e-6), left.own.shape[1]
    change = left.own[left.split :] @ (amounts[:keys] - left.own_amounts) + columns[left.split :] @ amounts[keys:]
    evenly = left.base.prepared.free  # of a decay: what a change explains lies in the loud blocks
    return statistics.gain_beside(left.residual[left.split :], change, left.beside_own, evenly=evenly)
