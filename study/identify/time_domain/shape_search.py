"""Starting values for a candidate: at which shape parameters does it explain most?

The residual of the model in free run is compared with the response that a small amount of the candidate
would add (the exact sensitivity at a zero coefficient), less all that the model's own coefficients
could do. Each point takes one free run; the best few points start a fit of everything.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq

from study.equations.free_run import needed_steps
from study.equations.model import Model, ModelTerm
from study.equations.term import ShapeParameter, Term
from study.identify.frequency_domain.starting_values import linear_start, oscillator
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import run_of, with_states
from study.records.outputs import DISPLACEMENT, alone
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares

PERIODS = 100.0  # of the motion that a search for effects uses, at least
SEARCHED = 4096  # samples that a search for open shape parameters looks at, if they show anything
PEAKS = 6  # lines of a spectrum that are tried as the frequency of a periodic effect
SHARP = (15.0, 40.0, 100.0, 250.0)  # per amplitude: loops that close within a small part of a stroke
MODULATION = "lines of the modulation"  # of the two kinds of spectra whose lines are tried
STARTS = 4  # points of the search that start a fit
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


@dataclass(frozen=True)
class Baseline:
    """A fitted model and what it leaves unexplained on the fitting part; n samples.

    Attributes
    ----------
    fit : FreeRunFit
        The fit.
    basis : array, shape (n, p)
        Orthonormal basis of everything its own coefficients and initial state could change.
    displacement : array, shape (n,)
        Displacement of the free run: free of noise.
    linear : dict
        Coefficients of the best linear approximation, zero for what is not linear.
    approximation : dict
        m, c and k of the best linear oscillator, whatever the model's terms are.
    dt : float
        Sampling interval in seconds.
    row : int or None
        Place of the measured response in ``MOTIONS``; None where it is the force of a prescribed motion.
    """

    fit: FreeRunFit
    basis: Floats
    displacement: Floats
    linear: dict[str, float]
    approximation: dict[str, float]
    dt: float
    row: int | None

    def transfer(self, omega: Complexes) -> Complexes:
        """Frequency response function from a small force to the measured response at ``omega = j 2 pi f``."""
        if self.row is None:
            return np.ones_like(omega)
        own = self.approximation
        return np.asarray(omega**self.row / (own["m"] * omega**2 + own["c"] * omega + own["k"]), dtype=np.complex128)


@dataclass(frozen=True)
class Start:
    """A point of the search: shape parameters, coefficients there, and the share of the residual explained."""

    parameters: tuple[float, ...]
    coefficients: tuple[float, ...]
    share: float


def baseline(fit: FreeRunFit, prepared: Prepared) -> Baseline:
    """Prepare a fitted model for the search."""
    jacobian = with_states(fit, prepared)
    scale = np.linalg.norm(jacobian, axis=0)
    basis = np.linalg.qr(jacobian / np.where(scale > 0.0, scale, 1.0))[0]
    displacement = run_of(fit, prepared, sensors=DISPLACEMENT.sensors).respond({}, fit.initial)[0][:, 0]
    linear, approximation = _linear(fit, prepared)
    row = MOTIONS.index(prepared.response) if prepared.response in MOTIONS else None
    return Baseline(fit, basis, displacement, linear, approximation, prepared.dt, row)


def _linear(fit: FreeRunFit, prepared: Prepared) -> tuple[dict[str, float], dict[str, float]]:
    """Best linear approximation in the model's terms, and as an oscillator; of a stretch at rest what the fit has."""
    try:
        return linear_start(fit.model, prepared), oscillator(prepared)
    except StudyError:
        own = fit.model.numbers()
        if prepared.response == FORCE:  # nothing passes through a structure there
            return own, {}
        slowest = (2.0 * np.pi / (len(fit.residual) * prepared.dt)) ** 2
        approximation = {"m": own["m"], "c": own.get("c", 0.0), "k": own.get("k") or own["m"] * slowest}
        return {key: own[key] if key in approximation else 0.0 for key in own}, approximation


def shape_starts(term: Term, base: Baseline, prepared: Prepared) -> list[Start]:
    """The best points of the search over a candidate's shape parameters, best first."""
    points = (_try(term, parameters, base, prepared) for parameters in points_to_try(term, base))
    tried = [point for point in points if point is not None]
    best = sorted(tried, key=lambda s: -s.share)
    if not any(p.search.blunt for p in term.parameters):
        return best[:STARTS]
    step = max(1, (len(tried) - 1) // (SPREAD - 1))
    return best[:1] + [point for point in tried[::step] if point is not best[0]]


def sensitivity(
    term: Term, parameters: tuple[float, ...], base: Baseline, prepared: Prepared
) -> Floats | None:  # fmt: skip
    """What small amounts of a candidate add to the response that the model's own coefficients cannot, (n, components).

    None where the model with it does not run, or nothing is left.
    """
    entry = ModelTerm(term, (0.0,) * len(term.components), parameters)
    model = base.fit.model.with_term(entry)
    steps = base.fit.steps_per_sample
    if prepared.response == FORCE:  # a loop that closes sharply asks for more than any motion would
        steps = max(steps, needed_steps(model, prepared.record, alone(FORCE)))
    try:
        run = run_of(replace(base.fit, model=model, steps_per_sample=steps), prepared, term.symbols)
        _, added = run.respond(dict.fromkeys(term.symbols, 0.0), base.fit.initial)
    except StudyError:
        return None
    added = prepared.known(prepared.outputs.stacked(added), base.fit.span)
    added = added - base.basis @ (base.basis.T @ added)
    return added if np.all(np.isfinite(added)) and np.any(added) else None


def _try(
    term: Term, parameters: tuple[float, ...], base: Baseline, prepared: Prepared
) -> Start | None:  # fmt: skip
    """One point: least squares of the residual on the candidate's sensitivities."""
    added = sensitivity(term, parameters, base, prepared)
    if added is None:
        return None
    residual = base.fit.residual
    amounts = least_squares(added, residual, 1e-8)
    power = float(residual @ residual)
    share = 1.0 - float(np.sum((residual - added @ amounts) ** 2)) / power if power > 0.0 else 0.0
    return Start(parameters, tuple(float(a) for a in amounts), share)


def points_to_try(term: Term, base: Baseline) -> list[tuple[float, ...]]:
    """Points to try: amplitudes from the motion, times from the resonance, frequencies from spectra."""
    points: list[tuple[float, ...]] = [()]
    for parameter in term.parameters:
        points = [(*point, x) for point in points for x in _places(parameter, point, base)]
    return points


def _places(parameter: ShapeParameter, point: tuple[float, ...], base: Baseline) -> list[float]:
    """Values of one shape parameter to try beside those of the parameters before it."""

    def lines(kind: str, shifts: Floats) -> Floats:
        found = modulation_lines(base) if kind == MODULATION else residual_lines(base)
        return _around(found, shifts, base)

    # a prescribed stroke may be many times the slip that closes a loop
    return values_to_try(parameter, point, base.displacement, base.dt, lines, SHARP if base.row is None else ())


def values_to_try(
    parameter: ShapeParameter, point: tuple[float, ...], u: Floats, dt: float, lines: Callable[[str, Floats], Floats],
    sharp: Sequence[float] = (),
) -> list[float]:  # fmt: skip
    """Values of one shape parameter for a motion u beside those of the parameters before it, ``point``.

    ``lines`` gives, for a kind of spectrum, frequencies in hertz so many lines to either side of those that stand out;
    ``sharp`` are further places of what goes with the amplitude.
    """
    places = np.array(parameter.search.places)
    match parameter.search.kind:
        case "quantiles of |u|":
            tried = np.quantile(np.abs(u), places)
        case "quantiles of u":
            tried = np.quantile(u, places)
        case "times of the motion":
            tried = places / float(np.std(np.gradient(u, dt)) / np.std(u))
        case "per amplitude":
            tried = np.concatenate([places, sharp]) * (1.0 / float(np.std(u)))
        case "shares of the one before":
            tried = places * point[-1]
        case kind:
            tried = lines(kind, places)
    return [float(x) for x in tried]


def windowed(values: Floats) -> Complexes:
    """Lines of a history under a Hann window."""
    return np.asarray(rfft(values * np.hanning(len(values))), dtype=np.complex128)


def modulation_lines(base: Baseline) -> list[float]:
    """Lines at which a stiffness that varies with time would explain most, by a matched filter.

    The response added by ``u cos(2 pi f t)`` is ``H * (u cos)``; its product with the residual, summed,
    is one line of the spectrum of ``u`` times the residual filtered by H backwards in time.
    """
    n = len(base.fit.residual)
    receptance = base.transfer(np.asarray(2j * np.pi * rfftfreq(n, base.dt), dtype=np.complex128))
    receptance[0] = receptance[1] if not np.isfinite(receptance[0]) else receptance[0]
    matched = irfft(np.conj(receptance) * rfft(base.fit.residual), n)
    numerator = np.abs(windowed(matched * base.displacement)) ** 2
    passband = irfft(np.abs(receptance) ** 2, n)
    spread = irfft(np.abs(rfft(base.displacement)) ** 2, n)
    denominator = np.abs(rfft(passband * spread))
    return highest_lines(numerator / np.maximum(denominator, 1e-6 * np.max(denominator)))


def residual_lines(base: Baseline) -> list[float]:
    """Lines that stand out of the residual's own spectrum."""
    return highest_lines(np.abs(windowed(base.fit.residual)) ** 2)


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
    best = peaks[np.argsort(-height[peaks])][:PEAKS]
    return [float(i) + _top(height[i - 1 : i + 2]) for i in best]


def _top(three: Floats) -> float:
    bend = float(three[0] - 2.0 * three[1] + three[2])
    return 0.5 * float(three[0] - three[2]) / bend if bend < 0.0 else 0.0


def _around(lines: list[float], shifts: Floats, base: Baseline) -> Floats:
    """Frequencies so many lines to either side of each line, in hertz, shape (lines * shifts,)."""
    resolution = 1.0 / (len(base.fit.residual) * base.dt)
    return np.add.outer(np.array(lines), shifts).ravel() * resolution
