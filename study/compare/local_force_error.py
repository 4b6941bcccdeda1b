"""The error of the force by local polynomials: what leakage adds to 1 - multiple coherence is not in it.

The record is transformed once; in bands side by side, every A_j(f) and the transient of the record's ends are
polynomials. What they leave of the force, over the force, is the unexplained share; with one input after the
other it gives the cumulative coherences (Pintelon and Schoukens, System Identification, 2012, chapter 7).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from study.compare.force_error import ForceError, from_noise, judged_equation, lines_to_judge
from study.compare.prediction import SensorPrediction
from study.equations.model import Model
from study.identify.frequency_domain.inputs import Input
from study.identify.frequency_domain.local_polynomial import (
    SPARE_LINES,
    Lines,
    LocalPolynomial,
    noise_variance,
    transform,
    transients,
)
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError

DEGREE = 2


def local_force_error(model: Model, view: SensorPrediction) -> ForceError | None:
    """Judge the equation of a sensor's coordinate, as ``study.compare.force_error.force_error`` does.

    The first entry of every array stands for the lines below the first band, of which nothing is said.

    Raises
    ------
    StudyError
        If the judging part is too short for two bands.
    """
    prepared, noise = view.prepared, view.noise
    record = prepared.record.part(*prepared.inner(prepared.plan.judge))
    equation = judged_equation(model, view, record, (0, len(record)))
    if equation is None:
        return None
    inputs, (*driven, response, acting) = equation.inputs, equation.channels
    lines = transform([*driven, acting], record.dt)
    local = LocalPolynomial(DEGREE, ((DEGREE + 1) * (len(inputs) + 1) + SPARE_LINES) // 2)
    index = _bands(lines, local, record.name)
    frequency = np.concatenate([[0.0], lines.frequency[index[:, local.half_width]]])
    force = _with_zero(_power(lines.output[index]) * lines.density)
    left = [noise_variance(replace(lines, inputs=lines.inputs[: r + 1]), index, local) for r in range(len(inputs))]
    shares = np.array([np.minimum(_over(_with_zero(part * lines.density), force), 1.0) for part in left])
    rest = _rest(model, inputs, lines, index, local)
    motion = np.asarray(rfft(response), dtype=np.complex128)[1 : len(lines.frequency) + 1]
    density = np.interp(frequency, noise.frequency, noise.density)
    return ForceError(
        coordinate=view.sensor.coordinate,
        frequency=frequency,
        force=force,
        unexplained=shares[-1],
        parametric=_over(_with_zero(rest * lines.density), force),
        noise=_over(from_noise(frequency, equation.whole, model, view), force),
        cumulative=np.maximum.accumulate(1.0 - shares, axis=0),
        inputs=inputs,
        band=lines_to_judge(
            frequency, _with_zero(_power(motion[index]) * lines.density), density, force, prepared.band[0]
        ),
    )


def _bands(lines: Lines, local: LocalPolynomial, name: str) -> NDArray[np.int64]:
    """Lines of each band, side by side, their middles at whole multiples of their width."""
    middles = np.arange(local.width, len(lines.frequency) - local.half_width, local.width) - 1
    if len(middles) < 2:
        raise StudyError(
            f"the part of {name} to judge has {lines.samples} samples, too few for two bands of {local.width} lines; "
            "judge more, or take another estimator"
        )
    return middles[:, None] + np.arange(-local.half_width, local.half_width + 1)


def _rest(
    model: Model, inputs: Sequence[Input], lines: Lines, index: NDArray[np.int64], local: LocalPolynomial
) -> Floats:  # fmt: skip
    """Mean square in each band of the force less what the coefficients make of the inputs, and less a transient."""
    values, basis = model.numbers(), transients(local.width, local.degree)
    rest = lines.output.copy()
    for item, x in zip(inputs, lines.inputs, strict=True):
        rest -= item.response(lines.frequency, values) * x
    banded = rest[index]
    return _power(banded - (banded @ basis) @ basis.T) * local.width / (local.width - basis.shape[1])


def _power(values: Complexes) -> Floats:
    return np.mean(np.abs(values) ** 2, axis=1)


def _with_zero(values: Floats) -> Floats:
    return np.concatenate([[0.0], values])


def _over(values: Floats, force: Floats) -> Floats:
    """Share of the force; zero where there is none."""
    return np.where(force > 0.0, values / np.where(force > 0.0, force, 1.0), 0.0)
