"""What a term at a place would explain: the residual of a free run against the response that the term would add.

A small force along the motion passes through the linear approximation of the structure to all sensors; what the
model's own coefficients and initial state could do is taken out. The motion is that of the free run with what the
sensors show above their noise, as the reverse system has it, so that the force is near its true one even where the
model lacks much. The best points start fits in free run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from study.equations.model import Model, ModelTerm
from study.equations.place import Place
from study.equations.term import Parameter, Term
from study.identify.frequency_domain.inputs import history
from study.identify.time_domain.shape_search import highest_lines
from study.records.record import MOTIONS, Record
from study.structure.mass_matrix import LINEAR, matrices
from study.structure.missing_forces import corrected_motion, placed_inputs, relative_record
from study.structure.places import transfer
from study.structure.prepared_structure import PreparedStructure
from study.structure.structure_fit import StructureFit, fit_structure, flat, linearise
from study.structure.structure_record import Sensor
from study.structure.structure_run import prepare_run
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares

TRIED, KEPT = 15, 40  # free runs of a fit that tries a start, and of one that is kept
NEAR = 0.01  # standard errors: as near a minimum as the fit of a search has to come
STARTS = 3  # points of the search that start a fit


@dataclass(frozen=True, eq=False)
class PlacedBaseline:
    """A fitted structure and what it leaves on the fitting part; n samples, s sensors, c coordinates.

    Attributes
    ----------
    fit : StructureFit
        The fit.
    prepared : PreparedStructure
        The record, with as much to fit as a search uses.
    jacobian : array, shape (n s, keys + states)
        Derivatives, weighted as the residual, sensors of one time side by side.
    basis : array, shape (n s, p)
        Orthonormal basis of these.
    motion : array, shape (3, n, c)
        Displacement, velocity and acceleration of all coordinates.
    transfer : complex array, shape (lines, s, c)
        From a force on each coordinate to each sensor, on the lines of a transform of ``size`` samples.
    size : int
        With room for the response to die away.
    """

    fit: StructureFit
    prepared: PreparedStructure
    jacobian: Floats
    basis: Floats
    residual: Floats
    motion: Floats
    transfer: Complexes
    size: int

    def added(self, place: Place, forces: Sequence[Complexes]) -> Floats:
        """What forces at a place, given by their lines, add to the sensors and the model cannot, (n s, forces)."""
        e = np.array(place.direction(self.fit.model.coordinates))
        path = -(self.transfer @ e)
        n = len(self.fit.residual)
        columns = np.stack([irfft(path * f[:, None], self.size, axis=0)[:n] for f in forces], axis=2)
        weighted = flat(self.fit, columns)
        return weighted - self.basis @ (self.basis.T @ weighted)

    def lines(self, values: Floats) -> Complexes:
        """Transform of a force along the fitting part."""
        return np.asarray(rfft(values, self.size), dtype=np.complex128)

    @property
    def omega(self) -> Complexes:
        """``j 2 pi f`` of the lines."""
        return np.asarray(2j * np.pi * rfftfreq(self.size, self.prepared.dt), dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class PlacedStart:
    """A point of the search: shape parameters, coefficients there, and the share of the residual explained."""

    term: Term
    place: Place
    parameters: tuple[float, ...]
    coefficients: tuple[float, ...]
    share: float


def placed_baseline(fit: StructureFit, prepared: PreparedStructure) -> PlacedBaseline:
    """Prepare a fitted structure for the search."""
    jacobian = flat(fit, linearise(fit, prepared))
    scale = np.linalg.norm(jacobian, axis=0)
    basis = np.linalg.qr(jacobian / np.where(scale > 0.0, scale, 1.0))[0]
    coordinates = fit.model.coordinates
    wanted = tuple(Sensor(c, m) for m in MOTIONS for c in coordinates)
    run = prepare_run(fit.model, prepared.record, sensors=wanted, steps_per_sample=fit.steps, span=fit.span)
    motion = corrected_motion(run.respond({}, fit.initial)[0].T, fit.residual, prepared, coordinates)
    size = next_fast_len(2 * len(fit.residual), real=True)
    paths = transfer(_approximation(fit, prepared), prepared.sensors, coordinates, prepared.dt, size)
    return PlacedBaseline(fit, prepared, jacobian, basis, flat(fit, fit.residual), motion, paths, size)


def _approximation(fit: StructureFit, prepared: PreparedStructure) -> Floats:
    """Stiffness, damping and mass of the structure, or of the best linear one where it is not linear."""
    from study.structure.structure_start import known_linear

    terms = tuple(t for t in fit.model.terms if t.term.name in LINEAR)
    if len(terms) < len(fit.model.terms):
        held = {key: None for key in fit.keys}
        linear = replace(fit.model, terms=terms).with_values(held)
        try:
            return matrices(linear, known_linear(linear, prepared))
        except (StudyError, np.linalg.LinAlgError):
            pass
    return matrices(fit.model, fit.model.numbers())


def starts(term: Term, place: Place, base: PlacedBaseline, given: ModelTerm | None = None) -> list[PlacedStart]:
    """Points of the search over a term's shape parameters, best first; ``given`` are those that are known."""
    model = base.fit.model
    record = relative_record(place, model, base.motion, base.prepared.dt)
    record = replace(record, start=base.prepared.record.start + base.fit.first * base.prepared.dt)
    known = given.parameters if given is not None else (None,) * len(term.parameters)
    found = [_try(term, place, point, record, base) for point in _grid(term, place, record["displacement"], base, known)]
    return sorted((p for p in found if p is not None), key=lambda p: -p.share)


def _try(term: Term, place: Place, point: tuple[float, ...], record: Record, base: PlacedBaseline) -> PlacedStart | None:
    entry = ModelTerm(term, (0.0,) * len(term.components), point)
    try:
        forces = unit_lines(entry, record, base)
    except StudyError:
        return None
    added = base.added(place, forces)
    if not np.all(np.isfinite(added)) or not np.any(added):
        return None
    amounts = least_squares(added, base.residual, 1e-8)
    power = float(base.residual @ base.residual)
    share = 1.0 - float(np.sum((base.residual - added @ amounts) ** 2)) / power if power > 0.0 else 0.0
    return PlacedStart(term, place, point, tuple(amounts.tolist()), share)


def unit_lines(entry: ModelTerm, record: Record, base: PlacedBaseline) -> list[Complexes]:
    """Lines of the force of each component with a unit coefficient along a motion."""
    by_symbol: dict[str, Complexes] = {}
    for item in placed_inputs(entry):
        values = base.lines(record["displacement"] if item.shape == "u" else history(item, record))
        for part in item.parts:
            by_symbol[part.symbol] = values * part.factor * base.omega**part.order
    return [by_symbol[symbol] for symbol in entry.term.symbols]


def _grid(
    term: Term, place: Place, u: Floats, base: PlacedBaseline, known: Sequence[float | None]
) -> list[tuple[float, ...]]:
    points: list[tuple[float, ...]] = [()]
    for parameter, value in zip(term.parameters, known, strict=True):
        points = [
            (*point, x)
            for point in points
            for x in ([value] if value is not None else _places(parameter, point, u, place, base))
        ]
    return points


def _places(
    parameter: Parameter, point: tuple[float, ...], u: Floats, place: Place, base: PlacedBaseline
) -> list[float]:
    """Values of one shape parameter to try, as ``shape_search`` has them for a single coordinate."""
    places, dt = np.array(parameter.search.places), base.prepared.dt
    match parameter.search.kind:
        case "quantiles of |u|":
            tried = np.quantile(np.abs(u), places)
        case "quantiles of u":
            tried = np.quantile(u, places)
        case "times of the motion":
            tried = places / float(np.std(np.gradient(u, dt)) / np.std(u))
        case "per amplitude":
            tried = places / float(np.std(u))
        case "shares of the one before":
            tried = places * point[-1]
        case "lines of the modulation":
            tried = np.add.outer(_modulation_lines(u, place, base), places).ravel() / (len(u) * dt)
        case "lines of the residual":
            tried = np.add.outer(_residual_lines(base), places).ravel() / (len(u) * dt)
    return [float(x) for x in tried if np.isfinite(x)]


def _windowed(values: Floats) -> Complexes:
    return np.asarray(rfft(values * np.hanning(len(values))), dtype=np.complex128)


def _residual_lines(base: PlacedBaseline) -> Floats:
    """Lines that stand out of the residuals' own spectra."""
    residual = base.residual.reshape(len(base.fit.residual), -1)
    return np.array(highest_lines(np.sum([np.abs(_windowed(x)) ** 2 for x in residual.T], axis=0)))


def _modulation_lines(u: Floats, place: Place, base: PlacedBaseline) -> Floats:
    """Lines at which a stiffness of this place that varies with time would explain most, by a matched filter."""
    n = len(u)
    e = np.array(place.direction(base.fit.model.coordinates))
    path = (base.transfer @ e) / base.fit.noise.deviation
    residual = base.residual.reshape(n, -1)
    matched = irfft(np.sum(np.conj(path) * rfft(residual, base.size, axis=0), axis=1), base.size)[:n]
    numerator = np.abs(_windowed(matched * u)) ** 2
    passband = irfft(np.sum(np.abs(path) ** 2, axis=1), base.size)[: base.size]
    spread = irfft(np.abs(rfft(u, base.size)) ** 2, base.size)
    denominator = np.abs(np.asarray(rfft(passband * spread))[: base.size : base.size // n][: len(numerator)])
    floor = np.resize(denominator, len(numerator))
    return np.array(highest_lines(numerator / np.maximum(floor, 1e-6 * np.max(floor))))


def with_placed_term(
    fit: StructureFit, entry: ModelTerm, prepared: PreparedStructure, base: PlacedBaseline | None = None,
    points: Sequence[PlacedStart] | None = None,
) -> StructureFit:  # fmt: skip
    """The fitted structure with one term more at its place, the best of fits from several starts.

    Raises
    ------
    StudyError
        If none of them has a finite motion.
    """
    assert entry.place is not None, "every term of a structure has a place"
    base = base or placed_baseline(fit, prepared)
    tried = list(points or starts(entry.term, entry.place, base, entry))[:STARTS]
    given = {key: value for key, value in entry.values.items() if value is not None}
    grown = fit.model.with_term(entry)
    shapes = tuple(key for key in entry.keys[len(entry.symbols) :] if key not in given)
    held = (*fit.held, *given)
    fits: list[StructureFit] = []
    for point in tried:
        own = dict(zip(entry.keys, (*point.coefficients, *point.parameters), strict=True)) | given
        for start in (own | _moved(base, entry, point), own | dict.fromkeys(set(entry.symbols) - set(given), 0.0)):
            found = _tried(grown.with_values(start), prepared, (*held, *shapes), fit, TRIED)
            if found is not None:
                fits.append(found)
                break
    if not fits:
        raise StudyError(f"no values of {', '.join(entry.keys)} let {entry.name} follow {prepared.record.name}")
    best = min(fits, key=lambda f: f.cost)
    if shapes or not best.converged:
        best = _tried(best.model, prepared, held, best, KEPT) or best
    return best


def _moved(base: PlacedBaseline, entry: ModelTerm, point: PlacedStart) -> dict[str, float]:
    """Where the model's own coefficients go beside so much of a term, by one step of Gauss and Newton."""
    record = relative_record(point.place, base.fit.model, base.motion, base.prepared.dt)
    record = replace(record, start=base.prepared.record.start + base.fit.first * base.prepared.dt)
    known = ModelTerm(entry.term, point.coefficients, point.parameters)
    e = np.array(point.place.direction(base.fit.model.coordinates))
    force = np.sum([c * f for c, f in zip(point.coefficients, unit_lines(known, record, base), strict=True)], axis=0)
    n = len(base.fit.residual)
    column = irfft(-(base.transfer @ e) * force[:, None], base.size, axis=0)[:n]
    step = least_squares(base.jacobian, base.residual - flat(base.fit, column))
    return dict(zip(base.fit.keys, (base.fit.values + step[: len(base.fit.keys)]).tolist(), strict=True))


def _tried(
    model: Model, prepared: PreparedStructure, held: Sequence[str], near: StructureFit, runs: int
) -> StructureFit | None:
    try:
        return fit_structure(
            model, prepared, held, steps=near.steps, initial=near.initial, max_iterations=runs, offset=NEAR,
            noise=near.noise,
        )  # fmt: skip
    except StudyError:
        return None
