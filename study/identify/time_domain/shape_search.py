"""Starting values for a candidate at a place: at which shape parameters does it explain most?

The residual of the model in free run is compared with the response that a small amount of the candidate
would add (the exact sensitivity at a zero coefficient), less all that the model's own coefficients
could do. Each point takes one free run; the best few points start a fit of everything. A structure has more
places than free runs are cheap for: there the equations of all coordinates are asked (``reverse_search``), and where
its linear part is a sum of modes, which has none, modes that are fitted to the lines of the record (``modal_lines``).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import zip_longest

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq

from study.equations.free_run import needed_steps
from study.equations.kernels import WRITTEN_OUT
from study.equations.linear_part import transfer
from study.equations.model import Model, ModelTerm
from study.equations.motion_program import places_with_friction
from study.equations.place import Place
from study.equations.term import ShapeParameter
from study.identify.frequency_domain.modal_lines import left_of_lines
from study.identify.frequency_domain.starting_values import linear_start, oscillator
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import run_of, with_states
from study.identify.time_domain.reverse_search import EquationsAlongMotion, equations_along_motion
from study.identify.time_domain.told_alone import fit_alone, is_alone, prepared_alone
from study.records.interpolation import between_samples
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Sensor
from study.support.arrays import Complexes, Floats
from study.support.cores import side_by_side
from study.support.errors import StudyError
from study.support.least_squares import least_squares, length_or_one

Point = tuple[ModelTerm, tuple[float, ...]]  # a candidate and values of its shape parameters
SEARCH_PERIODS, SEARCH_SAMPLES = 100.0, 2048  # of the motion that a search for effects uses, at least
SEARCHED = 4096  # samples that a search for open shape parameters looks at, if they show anything
MODULATION, PITCHES = "lines of the modulation", "pitches of the residual"  # of the kinds of spectra that are tried
VARIED = "quantiles of what it varies with"
STARTS = 4  # points of the search that start a fit
CUTOFF = 1e-8  # of the largest singular value
SPREAD = 5  # points that start a fit where the search is blunt, from one end of the range to the other


def searched_stretch(model: Model, prepared: Prepared) -> Prepared:
    """What a search for open shape parameters looks at: everything, where a short stretch shows no linear start.

    A slow sweep that is sampled often may pass none of the structure's own frequencies in it.
    """
    look = prepared.shortened(SEARCHED)
    try:
        linear_start(model, look)
    except StudyError:
        return prepared
    return look


@dataclass(frozen=True, eq=False)
class Baseline:
    """A fitted model and what it leaves unexplained on the fitting part; n samples, s sensors, c coordinates."""

    fit: FreeRunFit
    prepared: Prepared  # with as much to fit as a search uses
    basis: Floats  # orthonormal basis of all that its own coefficients and initial states could change; (n s, p)
    motion: Floats  # displacement, velocity and acceleration of the free run: free of noise; shape (3, n, c)
    linear: dict[str, float]  # coefficients of a mass's best linear approximation, zero for what is not linear
    approximation: dict[str, float]  # m, c and k of its best linear oscillator, whatever the model's terms are

    @property
    def several(self) -> bool:
        """Whether there are several coordinates, and with them places where an effect may sit, or modes."""
        return len(self.fit.model.coordinates) > 1 or self.fit.model.modal is not None

    @property
    def prescribed(self) -> bool:
        """Whether the motion is prescribed, and forces are what is predicted."""
        return self.prepared.response == FORCE

    def along(self, place: Place, order: int = 0) -> Floats:
        """Relative displacement, or a derivative of it, at a place, shape (n,)."""
        return self.motion[order] @ np.array(place.direction(self.fit.model.coordinates))

    def paths(self, size: int) -> Complexes:
        """Frequency response functions from a small force on each coordinate to each sensor, shape (lines, s, c).

        On the lines of a transform of so many samples; a constant goes through as the lowest line does.
        """
        model, sensors = self.fit.model, self.fit.outputs.sensors
        omega = np.asarray(2j * np.pi * rfftfreq(size, self.prepared.dt), dtype=np.complex128)
        if self.prescribed:  # nothing passes through a structure there
            here = np.array([[float(s.coordinate == c) for c in model.coordinates] for s in sensors])
            return np.broadcast_to(here.astype(np.complex128), (len(omega), *here.shape))
        if self.several:
            return transfer(model, sensors, self.prepared.dt, size)
        omega[0] = omega[1]
        own, order = self.approximation, MOTIONS.index(self.prepared.response)
        found = omega**order / (own["m"] * omega**2 + own["c"] * omega + own["k"])
        return np.asarray(found, dtype=np.complex128)[:, None, None]

    @cached_property
    def reverse(self) -> EquationsAlongMotion:
        """What the equations of all coordinates leave along the measured motion."""
        return equations_along_motion(self)

    @cached_property
    def beside_modes(self) -> float:
        """What as many modes as the fit has leave of the lines of the record, beside the terms of the model."""
        return left_of_lines(self.fit.model, self.prepared)


@dataclass(frozen=True)
class Start:
    """A point of the search: shape parameters, coefficients there, and the share of the residual explained."""

    parameters: tuple[float, ...]
    coefficients: tuple[float, ...]
    share: float


@dataclass(frozen=True)
class Screened:
    """An effect at a place, and where fits of it begin; none where that is searched for when it is fitted."""

    entry: ModelTerm
    points: tuple[Start, ...] = ()

    @property
    def share(self) -> float:
        """Of the residual, that it explains at the best of these points; zero without any."""
        return self.points[0].share if self.points else 0.0


def baseline(fit: FreeRunFit, prepared: Prepared) -> Baseline:
    """Prepare a fitted model for the search."""
    jacobian = with_states(fit, prepared)
    basis = np.linalg.qr(jacobian / length_or_one(jacobian))[0]
    motions = tuple(Sensor(c, m) for m in MOTIONS for c in fit.model.coordinates)
    free = run_of(fit, prepared, sensors=motions).respond({}, fit.initial)[0]
    motion = free.reshape(len(free), len(MOTIONS), -1).transpose(1, 0, 2)
    if (len(fit.model.coordinates) > 1 or fit.model.modal) and prepared.response != FORCE:
        return Baseline(fit, prepared, basis, motion, {}, {})
    one = (fit_alone(fit), prepared_alone(prepared)) if is_alone(fit.model) else (fit, prepared)
    return Baseline(fit, prepared, basis, motion, *_linear(*one))


def _linear(fit: FreeRunFit, prepared: Prepared) -> tuple[dict[str, float], dict[str, float]]:
    """Best linear approximation in the model's terms, and as an oscillator; of a stretch at rest what the fit has."""
    if prepared.response == FORCE:
        return linear_start(fit.model, prepared), {}
    try:
        return linear_start(fit.model, prepared), oscillator(prepared)
    except StudyError:
        own = fit.model.numbers()
        slowest = (2.0 * np.pi / (len(fit.residual) * prepared.dt)) ** 2
        approximation = {"m": own["m"], "c": own.get("c", 0.0), "k": own.get("k") or own["m"] * slowest}
        return {key: own[key] if key in approximation else 0.0 for key in own}, approximation


def shape_starts(entry: ModelTerm, base: Baseline) -> list[Start]:
    """The best points of the search over a candidate's shape parameters, best first."""
    return starts_of([entry], base)[0]


def starts_of(entries: Sequence[ModelTerm], base: Baseline) -> list[list[Start]]:
    """The same of each of several candidates.

    A single mass is asked by the sensitivities of its free run, and so is a component, whose run costs little. Where a
    structure has several places a free run for each is too much, and the reverse system is asked.
    """
    if base.several and (base.fit.model.modal or not base.prescribed):
        asked = _along_lines if base.fit.model.modal else _in_reverse
        return list(side_by_side(lambda entry: asked(entry, base), entries, lambda entry: entry.term.effort))
    points = [points_to_try(entry, base.along(entry.place), base) for entry in entries]
    every = [(i, point) for turn in zip_longest(*points) for i, point in enumerate(turn) if point is not None]
    tried: list[list[Start]] = [[] for _ in entries]
    for (i, point), added in zip(every, sensitivities([(entries[i], p) for i, p in every], base), strict=True):
        if added is not None:
            tried[i].append(explained_by(added, base.fit.residual, point))
    return [_best(*both) for both in zip(entries, tried, strict=True)]


def _best(entry: ModelTerm, tried: Sequence[Start]) -> list[Start]:
    """Of the points of the search those that start a fit."""
    best = sorted(tried, key=lambda s: -s.share)
    if not any(p.search.blunt for p in entry.term.parameters):
        return best[:STARTS]
    step = max(1, (len(tried) - 1) // (SPREAD - 1))
    return best[:1] + [point for point in tried[::step] if point is not best[0]]


def _in_reverse(entry: ModelTerm, base: Baseline) -> list[Start]:
    """The points for a candidate beside the equations of all coordinates, by the share that it explains of them."""
    record = base.reverse.record(entry.place)
    points = points_to_try(entry, record["displacement"], base)
    found = [base.reverse.point(entry, parameters, record) for parameters in points]
    return sorted((point for point in found if point is not None), key=lambda s: -s.share)


def _along_lines(entry: ModelTerm, base: Baseline) -> list[Start]:
    """The points for a candidate beside modes, by the share that it explains of what these leave of the lines."""
    model, record = base.fit.model, base.prepared.record
    measured = np.stack([record.motion(c)[0] for c in model.coordinates], axis=1)[slice(*base.prepared.plan.fit)]
    found: list[Start] = []
    for point in points_to_try(entry, measured @ np.array(entry.place.direction(model.coordinates)), base):
        left = left_of_lines(model.with_term(replace(entry, parameters=point)), base.prepared)
        if np.isfinite(left):
            found.append(Start(point, (), 1.0 - left / base.beside_modes))
    return sorted(found, key=lambda s: -s.share)


def sensitivity(entry: ModelTerm, parameters: tuple[float, ...], base: Baseline) -> Floats | None:
    """What small amounts of a candidate add to the response that the model's own coefficients cannot.

    Shape (n s, components). None where the model with it does not run, or nothing is left.
    """
    return sensitivities([(entry, parameters)], base)[0]


def sensitivities(points: Sequence[Point], base: Baseline) -> list[Floats | None]:
    """The same of many candidates and shape parameters, those of different candidates along one free run.

    Each is there with an amount of zero, so that the motion is the model's own whatever stands beside it. Not so where
    one brings dry friction along, at whose reversals steps are cut: that runs by itself.
    """
    model, own = base.fit.model, places_with_friction(base.fit.model)
    entries = {e.name: e for e, _ in points}.values()
    by_itself = {e.name: base.prescribed or places_with_friction(model.with_term(e)) > own for e in entries}
    runs: list[list[int]] = []
    for i, (entry, _) in enumerate(points):
        there = ([points[at][0] for at in run] for run in runs)
        room = (not by_itself[entry.name] and not by_itself[e[0].name] and _has_room(e, entry) for e in there)
        run = next((run for run, free in zip(runs, room, strict=True) if free), None)
        if run is None:
            runs.append([i])
        else:
            run.append(i)
    found = side_by_side(lambda run: _along_one_run([points[i] for i in run], base), runs)
    by_point = dict(pair for run, every in zip(runs, found, strict=True) for pair in zip(run, every, strict=True))
    return [by_point[i] for i in range(len(points))]


def _has_room(there: Sequence[ModelTerm], entry: ModelTerm) -> bool:
    """Whether a run takes one candidate more, another than those that are there."""
    columns = 1 + sum(len(other.symbols) for other in (*there, entry))
    return columns <= WRITTEN_OUT and entry.name not in {other.name for other in there}


def _along_one_run(points: Sequence[Point], base: Baseline) -> list[Floats | None]:
    """Sensitivities along one run; by themselves where all together do not run."""
    prepared, model, steps = base.prepared, base.fit.model, base.fit.steps_per_sample
    symbols = [symbol for entry, _ in points for symbol in entry.symbols]
    for entry, parameters in points:
        model = model.with_term(replace(entry, coefficients=(0.0,) * len(entry.symbols), parameters=parameters))
    if base.prescribed:  # a loop that closes sharply asks for more than any motion would
        steps = max(steps, needed_steps(model, prepared.record, prepared.outputs))
    try:
        run = run_of(replace(base.fit, model=model, steps_per_sample=steps), prepared, symbols)
        _, added = run.respond(dict.fromkeys(symbols, 0.0), base.fit.initial)
    except StudyError:
        return [None] if len(points) == 1 else [sensitivity(*point, base) for point in points]
    added = prepared.known(prepared.outputs.stacked(added), base.fit.span)
    added = added - base.basis @ (base.basis.T @ added)
    parts = np.split(added, np.cumsum([len(entry.symbols) for entry, _ in points])[:-1], axis=1)
    return [part if np.all(np.isfinite(part)) and np.any(part) else None for part in parts]


def explained_by(added: Floats, residual: Floats, parameters: tuple[float, ...]) -> Start:
    """One point: least squares of the residual on what a unit of each of the candidate's coefficients adds."""
    if added.shape[1] == 1:  # as a rule, of thousands of points: no decomposition is needed
        size = float(np.max(np.abs(added)))  # whose square may be no number
        unit = added[:, 0] / size
        amounts: Floats = np.array([float(unit @ residual) / float(unit @ unit) / size])
    else:
        amounts = least_squares(added, residual, CUTOFF)
    power = float(residual @ residual)
    share = 1.0 - float(np.sum((residual - added @ amounts) ** 2)) / power if power > 0.0 else 0.0
    return Start(parameters, tuple(float(a) for a in amounts), share)


def points_to_try(entry: ModelTerm, u: Floats, base: Baseline) -> list[tuple[float, ...]]:
    """Points to try beside what is given: amplitudes from a motion u, times from the resonance, lines of spectra."""

    def lines(kind: str, shifts: Floats) -> Floats:
        if kind == PITCHES:
            return pitches(u, entry.place, base, shifts)
        if kind == VARIED and entry.term.variation is not None:
            return np.quantile(entry.term.variation.values(base.prepared.record)[slice(*base.fit.span)], shifts)
        found = modulation_lines(u, entry.place, base) if kind == MODULATION else residual_lines(base)
        return np.add.outer(np.array(found), shifts).ravel() / (len(u) * base.prepared.dt)

    # a prescribed stroke may be many times the slip that closes a loop
    # per amplitude, of loops that close within a small part of a stroke
    sharp = (15.0, 40.0, 100.0, 250.0) if base.prescribed else ()
    points: list[tuple[float, ...]] = [()]
    for parameter, given in zip(entry.term.parameters, entry.parameters, strict=True):
        points = [
            (*point, x)
            for point in points
            for x in (
                [given] if given is not None else values_to_try(parameter, point, u, base.prepared.dt, lines, sharp)
            )
            if np.isfinite(x)
        ]
    return points


def values_to_try(
    parameter: ShapeParameter, point: tuple[float, ...], u: Floats, dt: float, lines: Callable[[str, Floats], Floats],
    sharp: Sequence[float] = (),
) -> list[float]:  # fmt: skip
    """Values of one shape parameter for a motion u beside those of the parameters before it, ``point``.

    ``lines`` gives, for a kind of spectrum, frequencies in hertz so many lines to either side of those that stand out,
    or pitches; ``sharp`` are further places of what goes with the amplitude.
    """
    places = np.array(parameter.search.places)
    match parameter.search.kind:
        case "quantiles of |u|":
            tried = np.quantile(np.abs(u), places)
        case "quantiles of u":
            tried = np.quantile(u, places)
        case "times of the motion":
            tried = places / float(np.std(np.gradient(u, dt)) / np.std(u))
        case "shares of the velocity":
            tried = places * float(np.std(np.gradient(u, dt)))
        case "per amplitude":
            tried = np.concatenate([places, sharp]) * (1.0 / float(np.std(u)))
        case "shares of the one before":
            tried = places * point[-1]
        case "numbers":
            tried = places
        case kind:
            tried = lines(kind, places)
    return [float(x) for x in tried]


def windowed(values: Floats) -> Complexes:
    """Lines of a history, shape (n,) or (n, ...), under a Hann window."""
    return np.asarray(rfft((values.T * np.hanning(len(values))).T, axis=0), dtype=np.complex128)


def modulation_lines(u: Floats, place: Place, base: Baseline) -> list[float]:
    """Lines at which a stiffness of a place that varies with time would explain most, by a matched filter.

    The response added by ``u cos(2 pi f t)`` is ``H * (u cos)``; its product with the residual, summed, is one line of
    the spectrum of ``u``, shape (n,), times the residuals filtered by H backwards in time.
    """
    n, numerator = len(u), np.abs(windowed(matched(place, base) * u)) ** 2
    passband = np.asarray(irfft(np.sum(np.abs(_path(place, base)) ** 2, axis=1), n), dtype=np.float64)
    spread = np.asarray(irfft(np.abs(np.asarray(rfft(u))) ** 2, n), dtype=np.float64)
    denominator = np.abs(np.asarray(rfft(passband * spread), dtype=np.complex128))
    return highest_lines(numerator / np.maximum(denominator, 1e-6 * np.max(denominator)))


def pitches(u: Floats, place: Place, base: Baseline, shifts: Floats) -> Floats:
    """Pitches at which a force of a place that is periodic in its displacement u, shape (n,), would explain most.

    By a matched filter as of a modulation, but over the displacement: what the residual tells of the force at each
    sample, gathered in bins of where that was, has lines at one over the pitches. That is along the measured motion: a
    model that lacks the force is soon pitches away. At its rms velocity the motion takes one sample for a pitch at
    least.
    """
    if not (base.several or base.prescribed):
        u = base.reverse.record(place)["displacement"]
    span, step = float(np.ptp(u)), float(np.sqrt(np.mean(np.diff(u) ** 2)))
    if not (np.isfinite(span) and 0.0 < step < span):
        return np.zeros(0)
    finer = 4  # points for a sample, and bins for the shortest pitch
    where, told = (between_samples(values, finer) for values in (u, matched(place, base)))
    bins = int(finer * span / step)
    along = np.histogram(where, bins, (float(np.min(u)), float(np.max(u))), weights=told)[0]
    spectrum = np.abs(np.asarray(rfft(along, 2 * bins)))[: 2 * bins // finer] ** 2  # half a line apart
    rounds = np.add.outer(0.5 * np.array(highest_lines(spectrum)), shifts).ravel()
    return span / rounds[rounds > 0.5]


def matched(place: Place, base: Baseline) -> Floats:
    """What the residual tells of a force at a place, shape (n,): filtered by the path to the sensors, backwards."""
    path = _path(place, base)
    spectra = np.asarray(rfft(base.fit.residual.reshape(base.fit.samples, -1), axis=0), dtype=np.complex128)
    return np.asarray(irfft(np.sum(np.conj(path) * spectra, axis=1), base.fit.samples), dtype=np.float64)


def _path(place: Place, base: Baseline) -> Complexes:
    """From a force at a place to each weighted sensor, shape (lines, s)."""
    e, weights = place.direction(base.fit.model.coordinates), base.fit.outputs.weights
    return np.asarray(base.paths(base.fit.samples) @ np.array(e) * np.array(weights), dtype=np.complex128)


def residual_lines(base: Baseline) -> list[float]:
    """Lines that stand out of the residuals' own spectra."""
    left = base.fit.residual.reshape(base.fit.samples, -1)
    return highest_lines(np.sum(np.abs(windowed(left)) ** 2, axis=1))


def highest_lines(spectrum: Floats) -> list[float]:
    """The highest peaks over their surroundings, as line numbers refined by a parabola in the logarithm."""
    n = len(spectrum)
    width = max(8, n // 64)
    padded = np.pad(spectrum, width, mode="reflect")
    blocks = np.lib.stride_tricks.sliding_window_view(padded, 2 * width + 1)
    step = max(1, width // 4)
    centres = np.arange(0, n, step)
    level = np.interp(np.arange(n), centres, np.median(blocks[centres], axis=1))
    height = np.log(np.maximum(spectrum, 1e-300)) - np.log(np.maximum(level, 1e-300))
    inner = np.arange(3, n - 1)
    peaks = inner[(height[inner] >= height[inner - 1]) & (height[inner] > height[inner + 1])]
    # the highest are tried as the frequency of a periodic effect
    best = peaks[np.argsort(-height[peaks])][:6]
    return [float(i) + _top(height[i - 1 : i + 2]) for i in best]


def _top(three: Floats) -> float:
    bend = float(three[0] - 2.0 * three[1] + three[2])
    return 0.5 * float(three[0] - three[2]) / bend if bend < 0.0 else 0.0
