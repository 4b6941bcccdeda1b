"""Starting values for a free run: the best linear approximation, and the reverse system's coefficients.

The best linear approximation ``H(f) = G_Fy / G_FF`` is not biased by noise on the response, but covers linear terms
alone. The reverse system (the report's estimate) gives every coefficient at once and is biased by noise; but it has
no local minima, in which a fit from a linear model ends where the system is far from linear.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model, free
from study.equations.terms import get
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.decay_start import along_the_motion, decay_start, drift_start, with_given_value
from study.identify.frequency_domain.inputs import histories, reverse_inputs, without_inertia
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record
from study.records.spectra import Segments, cross_spectra, cross_spectra_within
from study.support.errors import StudyError
from study.support.least_squares import least_squares

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
LINEAR_ORDERS = {"k": 0, "c": 1, "m": 2}
FAINT = 1e-3  # share of the strongest line's force below which a line is leakage
FEWEST_LINES = 4  # two more than mass, damping and stiffness need
MAIN_LOBE = 5  # lines that a Hann window makes of one frequency, those above FAINT beside its main lobe included
SHORT = 512  # samples below which coherence may be missing because the record is short
CHANCE = 0.01  # probability that noise alone reaches the coherence of a line that the linear start uses
LONGEST, SHORTEST, PARTS = 1024, 64, 12  # samples in a segment, at most and at least, and its share of the record


@dataclass(frozen=True)
class LinearApproximation:
    """Best linear approximation on the lines of the fitting part where force and response have something in common."""

    omega: Complexes  # 2 pi j f, shape (lines,)
    receptance: Complexes  # displacement over force, shape (lines,)
    weight: Floats  # over the standard error of 1 / receptance, to a common factor; shape (lines,)
    neighbours: int  # lines from the first to the last: a window alone makes some of a single frequency

    @property
    def single(self) -> bool:
        """Whether the lines are as few and as near as those that a Hann window makes of one frequency."""
        return self.neighbours <= MAIN_LOBE


def coherent_lines(prepared: Prepared) -> LinearApproximation:
    """The lines by the usual segments; by longer ones where too few lines of those are driven, as in slow records.

    Raises
    ------
    StudyError
        If force and response have nothing in common.
    """
    record, response = prepared.record, prepared.response
    part = record.part(*prepared.plan.fit)
    length = min(LONGEST, 2 ** int(np.log2(max(len(part) // 8, 16))))
    found, _ = _lines(part, response, length)
    if len(found.omega) >= FEWEST_LINES:
        return found
    while len(part) >= SHORT and length < len(part) // 2:
        length = min(2 * length, len(part) // 2)
        found, chance = _lines(part, response, length)
        if len(found.omega) > max(1.0, chance):  # two lines are four equations
            return found
    if len(part) < SHORT:
        raise StudyError(
            f"the part to fit of {record.name!r} has {len(part)} samples, too few to see what force and {response} "
            f"have in common; fit a longer part, {SHORT} samples or more"
        )
    raise StudyError(
        f"force and {response} of {record.name!r} have nothing in common at any frequency; expected a response to this "
        "force (are the columns and the samples of one measurement?)"
    )


def _lines(part: Record, response: str, length: int) -> tuple[LinearApproximation, float]:
    """The lines by segments of a length, and how many of those driven may be coherent by chance."""
    force, motion = (part[name] - np.mean(part[name]) for name in ("force", response))
    if part.joints:
        matrix = cross_spectra_within([force, motion], part.joints, part.dt, Segments(length=length))
    else:
        matrix = cross_spectra([force, motion], part.dt, Segments(length=length))
    g, f = matrix.density[1:-1], matrix.frequency[1:-1]
    power = g[:, 0, 0].real * g[:, 1, 1].real
    coherence = np.abs(g[:, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
    coherence = np.clip(coherence, 0.0, 1.0 - 1e-6)
    by_chance = 1.0 - CHANCE ** (1.0 / max(matrix.averages - 1.0, 1.0))
    driven = g[:, 0, 0].real > FAINT * np.max(g[:, 0, 0].real)
    keep = (coherence > by_chance) & driven
    omega = np.asarray(2j * np.pi * f[keep], dtype=np.complex128)
    receptance = g[keep, 0, 1] / g[keep, 0, 0] / omega ** MOTIONS.index(response)
    weight = np.abs(receptance) * np.sqrt(coherence[keep] / (1.0 - coherence[keep]))
    places = np.flatnonzero(keep)
    neighbours = int(places[-1] - places[0]) + 1 if len(places) else 0
    expected = CHANCE * float(np.count_nonzero(driven))
    return LinearApproximation(omega, receptance, weight, neighbours), expected + 3.0 * float(np.sqrt(expected))


def solved(lines: LinearApproximation, wanted: Sequence[str]) -> tuple[Floats, Floats]:
    """Those of k, c and m that are wanted, and their standard errors from what the lines leave; shapes (wanted,)."""
    design = np.stack([lines.omega ** LINEAR_ORDERS[key] for key in wanted], axis=1) * lines.weight[:, None]
    target = lines.weight / lines.receptance
    columns, goal = np.concatenate([design.real, design.imag]), np.concatenate([target.real, target.imag])
    solution = least_squares(columns, goal)
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > 0.0, length, 1.0)
    inverse = np.linalg.pinv((columns / length).T @ (columns / length))
    variance = float(np.sum((goal - columns @ solution) ** 2)) / max(len(goal) - len(wanted), 1)
    return solution, np.sqrt(np.diag(inverse).clip(0.0) * variance) / length


def linear_start(model: Model, prepared: Prepared) -> dict[str, float]:
    """Mass, damping and stiffness of the best linear approximation; zero for everything else."""
    if prepared.response == FORCE:
        linear = [key for key in LINEAR_ORDERS if key in model.values]
        return dict.fromkeys(model.values, 0.0) | along_the_motion(_with_shapes(model), prepared, linear)
    if prepared.free:
        return decay_start(model, prepared)
    if prepared.record.joints and "k" not in model.values:
        return drift_start(model, prepared)
    lines = coherent_lines(prepared)
    wanted = [key for key in LINEAR_ORDERS if key in model.values]
    solution, _ = solved(lines, wanted)
    start = dict.fromkeys(model.values, 0.0) | dict(zip(wanted, solution.tolist(), strict=True))
    if start["m"] <= 0.0:
        target = lines.weight / lines.receptance
        start["m"] = float(np.linalg.norm(target)) / float(np.linalg.norm(lines.omega**2 * lines.weight))
    return start


def oscillator(prepared: Prepared) -> dict[str, float]:
    """m, c and k of the best linear oscillator, whatever the model's terms are."""
    names = ("linear_damping", "linear_stiffness")
    names = names if prepared.response == FORCE else ("inertia", *names)
    model = Model("linear", tuple(free(get(name)) for name in names))
    try:
        return linear_start(model, prepared)
    except StudyError:
        if not prepared.record.joints:
            raise
    drifting = drift_start(model.without_term("linear_stiffness"), prepared)
    first, last = prepared.plan.fit
    return drifting | {"k": drifting["m"] * (2.0 * np.pi / ((last - first) * prepared.dt)) ** 2}


def reverse_start(model: Model, prepared: Prepared) -> dict[str, float]:
    """Coefficients by reverse MI/SO on the fitting part; those of the model are ignored, its shape parameters used.

    Raises
    ------
    StudyError
        If the part is too short, an input has no power, or the mass comes out negative.
    """
    if prepared.response == FORCE:
        _ = reverse_inputs(model)  # refuses shape parameters that are not known
        return along_the_motion(model, prepared, [s for t in model.terms for s in t.term.symbols])
    part = prepared.record.part(*prepared.inner(prepared.plan.fit))
    inputs = reverse_inputs(model)
    if prepared.free:  # the inertia force takes the place of the measured one
        part = part.with_channels({FORCE: -part["acceleration"]})
        inputs = without_inertia(inputs)
    cut = Segments(length=int(np.clip(2 ** int(np.log2(len(part) / PARTS)), SHORTEST, LONGEST)))
    channels = [*histories(inputs, part), part["force"]]
    if part.joints:
        matrix = cross_spectra_within(channels, part.joints, part.dt, cut)
        cut = matrix.segments
    else:
        matrix = cross_spectra(channels, part.dt, cut)
    force = matrix.density[:, -1, -1].real
    driven = matrix.frequency[(force > FAINT * np.max(force)) & (matrix.frequency > 1.5 / (cut.length * part.dt))]
    if driven.size < len(inputs):
        raise StudyError(f"the force of {part.name!r} drives too few frequencies for {len(inputs)} inputs")
    band = (max(float(driven[0]), prepared.band[0]), min(float(driven[-1]), prepared.band[1]))
    if not np.any((matrix.frequency >= band[0]) & (matrix.frequency <= band[1])):
        raise StudyError(f"no frequency that the force of {part.name!r} drives is one at which all motions are valid")
    estimate = coefficients.fit_coefficients(conditioned.analyse(matrix), inputs, band, cut.line_inflation())
    if not np.all(np.isfinite(estimate.values)) or not (prepared.free or estimate["m"] > 0.0):
        raise StudyError(f"the reverse system of {model.name!r} and {part.name!r} has no solution")
    found = dict(zip(estimate.symbols, estimate.values.tolist(), strict=True))
    return with_given_value({"m": 1.0} | found, model) if prepared.free else found


def _with_shapes(model: Model) -> Model:
    """The model without terms whose shape parameters are not known: their forces count as zero."""
    return replace(model, terms=tuple(t for t in model.terms if None not in t.parameters))
