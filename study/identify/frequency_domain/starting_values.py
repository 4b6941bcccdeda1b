"""Starting values for a free run: the best linear approximation, and the reverse system's coefficients.

The best linear approximation ``H(f) = G_Fy / G_FF`` is not biased by noise on the response, but covers linear terms
alone. The reverse system (the report's estimate) gives every coefficient at once and is biased by noise; but it has
no local minima, in which a fit from a linear model ends where the system is far from linear.
"""

from dataclasses import replace

import numpy as np

from study.equations.model import Model, free
from study.equations.terms import get
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.decay_start import along_the_motion, decay_start, drift_start, scaled
from study.identify.frequency_domain.inputs import histories, reverse_inputs, without_inertia
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS
from study.records.spectra import Segments, cross_spectra, cross_spectra_within
from study.support.errors import StudyError
from study.support.least_squares import least_squares

LINEAR_ORDERS = {"k": 0, "c": 1, "m": 2}
FAINT = 1e-3  # share of the strongest line's force below which a line is leakage
SHORT = 512  # samples below which coherence may be missing because the record is short
CHANCE = 0.01  # probability that noise alone reaches the coherence of a line that the linear start uses
LONGEST, SHORTEST, PARTS = 1024, 64, 12  # samples in a segment, at most and at least, and its share of the record


def linear_start(model: Model, prepared: Prepared) -> dict[str, float]:
    """Mass, damping and stiffness of the best linear approximation; zero for everything else."""
    if prepared.response == FORCE:
        linear = [key for key in LINEAR_ORDERS if key in model.values]
        return dict.fromkeys(model.values, 0.0) | along_the_motion(_with_shapes(model), prepared, linear)
    if prepared.free:
        return decay_start(model, prepared)
    record, response = prepared.record, prepared.response
    part = record.part(*prepared.plan.fit)
    length = min(LONGEST, 2 ** int(np.log2(max(len(part) // 8, 16))))
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
    keep = (coherence > by_chance) & (g[:, 0, 0].real > FAINT * np.max(g[:, 0, 0].real))
    if np.count_nonzero(keep) < 4 and "k" not in model.values and part.joints:
        return drift_start(model, prepared)
    if np.count_nonzero(keep) < 4:
        if len(part) < SHORT:
            raise StudyError(
                f"the part to fit of {record.name!r} has {len(part)} samples, too few to see what force and {response} "
                f"have in common; fit a longer part, {SHORT} samples or more"
            )
        raise StudyError(f"force and {response} of {record.name!r} have nothing in common at any frequency")
    omega = 2j * np.pi * f[keep]
    receptance = g[keep, 0, 1] / g[keep, 0, 0] / omega ** MOTIONS.index(response)
    weight = np.abs(receptance) * np.sqrt(coherence[keep] / (1.0 - coherence[keep]))
    wanted = [key for key in LINEAR_ORDERS if key in model.values]
    design = np.stack([omega ** LINEAR_ORDERS[key] for key in wanted], axis=1) * weight[:, None]
    target = weight / receptance
    solution = least_squares(np.concatenate([design.real, design.imag]), np.concatenate([target.real, target.imag]))
    start = dict.fromkeys(model.values, 0.0) | dict(zip(wanted, solution.tolist(), strict=True))
    if start["m"] <= 0.0:
        start["m"] = float(np.linalg.norm(target)) / float(np.linalg.norm(omega**2 * weight))
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
    estimate = coefficients.fit(conditioned.analyse(matrix), inputs, band, cut.line_inflation())
    if not np.all(np.isfinite(estimate.values)) or not (prepared.free or estimate["m"] > 0.0):
        raise StudyError(f"the reverse system of {model.name!r} and {part.name!r} has no solution")
    found = dict(zip(estimate.symbols, estimate.values.tolist(), strict=True))
    return scaled({"m": 1.0} | found, model) if prepared.free else found


def _with_shapes(model: Model) -> Model:
    """The model without terms whose shape parameters are not known: their forces count as zero."""
    return replace(model, terms=tuple(t for t in model.terms if None not in t.parameters))
