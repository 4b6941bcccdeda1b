"""What a term at a place would explain, by the reverse system of all coordinates.

With the linear part Z of the fitted structure, its nonlinear forces N and the measured motion x, what the equations
leave is ``B F - Z x - N(x)``. Any force that is missing, and any change of a coefficient, is a known history times an
unknown amount, and linear least squares find the amounts, however much the model lacks. Everything is passed through
Z^-1 to the sensors first, where noise is what it was on the motion (the equations of a place and of its other end are
one regression: action equals reaction). The motion is that of the free run with what the sensors show above their
noise; where a sensor is missing it is the free run's. The best points start fits in free run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import rfftfreq

from study.equations.free_run import prepare
from study.equations.linear_part import LINEAR, linear_keys, patterns, transfer
from study.equations.model import Model, ModelTerm
from study.equations.place import Place
from study.equations.term import Term
from study.identify.frequency_domain.inputs import input_history, placed_inputs
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, linearise
from study.identify.time_domain.shape_search import MODULATION, values_to_try
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import StretchTransforms, stretch_transforms
from study.structure.missing_forces import corrected_motion, relative_record
from study.structure.placed_lines import placed_modulation_lines, placed_residual_lines
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares

TRIED, KEPT = 15, 40  # free runs of a fit that tries a start, and of one that is kept
NEAR = 0.01  # standard errors: as near a minimum as the fit of a search has to come
CUTOFF = 1e-8  # of the largest singular value
STARTS = 3  # points of the search that start a fit


@dataclass(frozen=True, eq=False)
class PlacedBaseline:
    """A fitted structure and what it leaves on the fitting part; n samples, s sensors, c coordinates.

    Attributes
    ----------
    fit : FreeRunFit
        The fit.
    prepared : Prepared
        The record, with as much to fit as a search uses.
    motion : array, shape (3, n, c)
        Displacement, velocity and acceleration of all coordinates.
    paths : complex array, shape (lines, s, c)
        From a force on each coordinate to each sensor, on the lines of ``transforms``.
    transforms : StretchTransforms
        Of the stretches of the fitting part.
    columns : array, shape (n s, keys + states)
        What a unit of each key, and of the initial state, adds to the sensors, weighted as the residual, sensors of one
        time side by side.
    basis : array, shape (n s, p)
        Orthonormal basis of these.
    violated : array, shape (n s,)
        What the equations leave, passed to the sensors.
    residual : array, shape (n s,)
        The same less what the model's own coefficients could do.
    """

    fit: FreeRunFit
    prepared: Prepared
    motion: Floats
    paths: Complexes
    transforms: StretchTransforms
    columns: Floats
    basis: Floats
    violated: Floats
    residual: Floats

    def passed(self, place: Place, forces: Sequence[Complexes]) -> Floats:
        """What forces at a place, given by their lines, add to the sensors, shape (n s, forces)."""
        e = np.array(place.direction(self.fit.model.coordinates))
        return weighted_as(self.fit, self.transforms.passed(-(self.paths @ e), forces))

    def added(self, place: Place, forces: Sequence[Complexes]) -> Floats:
        """The same less what the model's own coefficients could do."""
        columns = self.passed(place, forces)
        return columns - self.basis @ (self.basis.T @ columns)

    def lines(self, values: Floats) -> Complexes:
        """Transform of forces along the fitting part, samples along the first axis, shape (stretches, lines, ...)."""
        return self.transforms.lines(values)

    @property
    def by_sensor(self) -> Floats:
        """What is left, shape (n, s)."""
        return self.residual.reshape(self.fit.samples, -1)

    def modulation(self, u: Floats, place: Place) -> Floats:
        """:func:`placed_modulation_lines` of a place with the relative displacement u."""
        e, fit, paths = np.array(place.direction(self.fit.model.coordinates)), self.fit, self.paths[::2]
        if len(self.transforms.runs) > 1:
            paths = transfer(fit.model, self.prepared.sensors, self.prepared.dt, len(u))
        return placed_modulation_lines(u, (paths @ e) * np.array(fit.outputs.weights), self.by_sensor)

    def dated(self, record: Record) -> Record:
        """A relative motion with the time at which it was."""
        return replace(record, start=self.prepared.record.start + self.fit.first * self.prepared.dt)

    @property
    def omega(self) -> Complexes:
        """``j 2 pi f`` of the lines."""
        return np.asarray(2j * np.pi * rfftfreq(self.transforms.size, self.prepared.dt), dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class PlacedStart:
    """A point of the search: shape parameters, coefficients there, and the share of the residual explained."""

    term: Term
    place: Place
    parameters: tuple[float, ...]
    coefficients: tuple[float, ...]
    share: float


def placed_baseline(fit: FreeRunFit, prepared: Prepared) -> PlacedBaseline:
    """Prepare a fitted structure for the search."""
    model = fit.model
    wanted = tuple(Sensor(c, m) for m in MOTIONS for c in model.coordinates)
    run = prepare(model, prepared.record, sensors=wanted, steps_per_sample=fit.steps_per_sample, span=fit.span)
    free = run.respond({}, fit.initial)[0]
    motion = corrected_motion(free, fit.misfit, prepared, model.coordinates, fit.span)
    own = stretch_transforms(prepared.record.runs(fit.span))  # of one stretch every other line is one of the record
    paths = transfer(model, prepared.sensors, prepared.dt, own.size)
    left = fit.whitened(fit.residual)
    bare = PlacedBaseline(fit, prepared, motion, paths, own, free, free, left, left)
    columns = fit.whitened(linearise(fit, prepared))  # right for the initial state and for shape parameters
    for i, column in _own_columns(bare).items():
        columns[:, i] = column
    scale = np.linalg.norm(columns, axis=0)
    basis = np.linalg.qr(columns / np.where(scale > 0.0, scale, 1.0))[0]
    violated = left - _drifted(bare, free)
    residual = violated - basis @ (basis.T @ violated)
    return replace(bare, columns=columns, basis=basis, violated=violated, residual=residual)


def weighted_as(fit: FreeRunFit, values: Floats) -> Floats:
    """Values at the sensors, shape (n, s, ...), stacked and weighted as the residual of a fit was."""
    return fit.whitened(fit.outputs.stacked(values))


def _own_columns(base: PlacedBaseline) -> dict[int, Floats]:
    """What a unit of each estimated coefficient of the model adds along the motion, by the number of its key."""
    fit, model = base.fit, base.fit.model
    found: dict[int, Floats] = {}
    own, orders = patterns(model), linear_keys(model)
    for key in orders:
        if key in fit.keys:
            force = base.lines(base.motion[orders[key]] @ own[key])
            motion = base.transforms.back(-np.einsum("fsc,kfc->kfs", base.paths, force))
            found[fit.keys.index(key)] = weighted_as(fit, motion)
    for entry in model.terms:
        if not set(entry.symbols) & set(fit.keys) or entry.symbols[0] in orders:
            continue
        record = base.dated(relative_record(entry.place, model, base.motion, base.prepared.dt))
        columns = base.passed(entry.place, unit_lines(entry, record, base))
        found |= {fit.keys.index(k): columns[:, i] for i, k in enumerate(entry.symbols) if k in fit.keys}
    return found


def _drifted(base: PlacedBaseline, free: Floats) -> Floats:
    """By how much the model's nonlinear forces along the measured motion differ from those along its free run."""
    model = base.fit.model
    total = np.zeros_like(base.residual)
    run = free.reshape(len(free), len(MOTIONS), -1).transpose(1, 0, 2)
    for entry in model.terms:
        if entry.term.name in LINEAR:
            continue
        there, here = (
            base.passed(
                entry.place,
                unit_lines(entry, base.dated(relative_record(entry.place, model, m, base.prepared.dt)), base),
            )
            for m in (base.motion, run)
        )
        total += (there - here) @ np.array([c or 0.0 for c in entry.coefficients])
    return total


def placed_starts(term: Term, place: Place, base: PlacedBaseline, given: ModelTerm | None = None) -> list[PlacedStart]:
    """Points of the search over a term's shape parameters, best first; ``given`` are those that are known."""
    model = base.fit.model
    record = base.dated(relative_record(place, model, base.motion, base.prepared.dt))
    known = given.parameters if given is not None else (None,) * len(term.parameters)
    found = [
        _try(term, place, point, record, base) for point in _grid(term, place, record["displacement"], base, known)
    ]
    return sorted((p for p in found if p is not None), key=lambda p: -p.share)


def _try(
    term: Term, place: Place, point: tuple[float, ...], record: Record, base: PlacedBaseline
) -> PlacedStart | None:
    entry = ModelTerm(term, (0.0,) * len(term.components), point)
    try:
        forces = unit_lines(entry, record, base)
    except StudyError:
        return None
    added = base.added(place, forces)
    if not np.all(np.isfinite(added)) or not np.any(added):
        return None
    amounts = least_squares(added, base.residual, CUTOFF)
    power = float(base.residual @ base.residual)
    share = 1.0 - float(np.sum((base.residual - added @ amounts) ** 2)) / power if power > 0.0 else 0.0
    return PlacedStart(term, place, point, tuple(amounts.tolist()), share)


def unit_lines(entry: ModelTerm, record: Record, base: PlacedBaseline) -> list[Complexes]:
    """Lines of the force of each component with a unit coefficient along a motion."""
    by_symbol: dict[str, Complexes] = {}
    for item in placed_inputs(entry):
        values = base.lines(record["displacement"] if item.shape == "u" else input_history(item, record))
        for part in item.parts:
            by_symbol[part.symbol] = values * part.factor * base.omega**part.order
    return [by_symbol[symbol] for symbol in entry.term.symbols]


def _grid(
    term: Term, place: Place, u: Floats, base: PlacedBaseline, known: Sequence[float | None]
) -> list[tuple[float, ...]]:
    def lines(kind: str, shifts: Floats) -> Floats:
        found = base.modulation(u, place) if kind == MODULATION else placed_residual_lines(base.by_sensor)
        return np.add.outer(found, shifts).ravel() / (len(u) * base.prepared.dt)

    points: list[tuple[float, ...]] = [()]
    for parameter, value in zip(term.parameters, known, strict=True):
        points = [
            (*point, x)
            for point in points
            for x in ([value] if value is not None else values_to_try(parameter, point, u, base.prepared.dt, lines))
            if np.isfinite(x)
        ]
    return points


def with_placed_term(
    fit: FreeRunFit, entry: ModelTerm, prepared: Prepared, base: PlacedBaseline | None = None,
    points: Sequence[PlacedStart] | None = None,
) -> FreeRunFit:  # fmt: skip
    """The fitted structure with one term more at its place, the best of fits from several starts.

    Raises
    ------
    StudyError
        If none of them has a finite motion.
    """
    base = base or placed_baseline(fit, prepared)
    tried = list(points or placed_starts(entry.term, entry.place, base, entry))[:STARTS]
    given = {key: value for key, value in entry.values.items() if value is not None}
    grown = fit.model.with_term(entry)
    shapes = tuple(key for key in entry.keys[len(entry.symbols) :] if key not in given)
    held = (*fit.held, *given)
    fits: list[FreeRunFit] = []
    for point in tried:
        own = dict(zip(entry.keys, (*point.coefficients, *point.parameters), strict=True)) | given
        begun = [own | _moved(base, entry, point) | given]
        if point is tried[0] or not fits:  # and from where the model stands, which a false step cannot lead astray
            begun.append(own | dict.fromkeys(entry.symbols, 0.0) | given)
        found = [_tried(grown.with_values(start), prepared, (*held, *shapes), fit, TRIED) for start in begun]
        fits += [f for f in found if f is not None]
    if not fits:
        raise StudyError(f"no values of {', '.join(entry.keys)} let {entry.name} follow {prepared.record.name}")
    best = min(fits, key=lambda f: f.cost)
    if shapes or not best.converged:
        best = _tried(best.model, prepared, held, best, KEPT) or best
    return best


def _moved(base: PlacedBaseline, entry: ModelTerm, point: PlacedStart) -> dict[str, float]:
    """Coefficients of the model beside so much of a term, from the reverse system."""
    known = replace(entry, coefficients=point.coefficients, parameters=point.parameters, place=point.place)
    record = relative_record(point.place, base.fit.model, base.motion, base.prepared.dt)
    force = np.sum(
        [c * f for c, f in zip(point.coefficients, unit_lines(known, base.dated(record), base), strict=True)], axis=0
    )
    step = least_squares(base.columns, base.violated - base.passed(point.place, [force])[:, 0], CUTOFF)
    return dict(zip(base.fit.keys, (base.fit.values + step[: len(base.fit.keys)]).tolist(), strict=True))


def grown_states(fit: FreeRunFit, model: Model) -> Floats:
    """The states with which the stretches of a fit begin, for a model with other terms; those of new terms are zero."""
    motions, given = 2 * len(model.coordinates), np.atleast_2d(fit.initial)
    states = np.zeros((len(given), motions + len(model.states)))
    own = {t.name: motions + i for i, t in enumerate(fit.model.states)}
    states[:, :motions] = given[:, :motions]
    for i, entry in enumerate(model.states):
        if entry.name in own:
            states[:, motions + i] = given[:, own[entry.name]]
    return states


def _tried(model: Model, prepared: Prepared, held: Sequence[str], near: FreeRunFit, runs: int) -> FreeRunFit | None:
    try:
        return fit_part(
            model, prepared, held, steps=near.steps_per_sample, initial=grown_states(near, model), max_iterations=runs,
            offset=NEAR, noise=near.noise,
        )  # fmt: skip
    except StudyError:
        return None
