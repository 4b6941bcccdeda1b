"""Which test tells a value as closely as is wanted: by the information that it adds to what a record tells.

With J the sensitivities of a fitted model in a test, white, and C the covariance of its coefficients, that of both
together is ``(C^-1 + J' J / 2)^-1``, states at the first sample beside: a half of what is measured is fitted, the
other judged.
"""

from dataclasses import dataclass

import numpy as np

from study.diagnose.designs import Design, Limits, PresentTest, present_test
from study.diagnose.separation import allowed, known_of, limits_asked, respond, root_of_inverse, shorter_designs
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.weighted_fit import noise_left
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import length_or_one


@dataclass(frozen=True, eq=False)
class PreciseTest:
    """A test that tells a value of a model closely; half widths of 95 % intervals are over the value."""

    key: str
    value: float
    wanted: float
    now: float  # half width, by this record alone
    design: Design
    width: float  # half width, by this record and the test
    again: float  # ... and the same test again
    limits: Limits
    asked: int  # how many tests were compared
    present: PresentTest
    fit: FreeRunFit
    prepared: Prepared


def precise_test(
    fit: FreeRunFit, prepared: Prepared, key: str, wanted: float, asked: tuple[float | None, float | None, float | None]
) -> PreciseTest:
    """The cheapest test within limits with which the interval of a value is as narrow as wanted, or the narrowest.

    ``asked`` are the limits of force, displacement and length; where one is None, what the record reached.

    Raises
    ------
    StudyError
        If the value is not fitted, or the limits allow no test.
    """
    model = fit.model.name
    expect(key in fit.keys, f"{key!r} is no fitted value of {model!r}; expected one of {', '.join(fit.keys)}")
    at, present = fit.keys.index(key), present_test(prepared, fit)
    value, covariance = float(fit.values[at]), known_of(fit, prepared)
    expect(value != 0.0, f"{key} is zero in {model!r}; a share of it is no width to ask for")
    known, limits = root_of_inverse(covariance), limits_asked((fit,), present, *asked)
    noise = noise_left(fit.residual, len(prepared.outputs))
    size = float(np.std(prepared.outputs.whitened(fit.residual, noise)))

    def width(design: Design) -> float:
        try:
            _, jacobian = respond(fit, design, prepared.outputs.sensors, differentiate=True)
        except StudyError:
            return np.inf
        columns = prepared.outputs.whitened(prepared.outputs.stacked(jacobian), noise) / size
        rows = np.zeros((len(known) + len(columns), columns.shape[1]))
        rows[: len(known), : known.shape[1]], rows[len(known) :] = known, columns / np.sqrt(2.0)
        return _half_width(rows, at) / abs(value)

    designs = allowed((fit,), present, limits)
    found = sorted(((width(d), d) for d in designs), key=lambda pair: pair[0])
    again = min((w for w, d in found if d.kind == present.kinds[0][0] and d.level == 1.0), default=np.nan)
    good = [pair for pair in found if pair[0] <= wanted]
    shorter = [(width(d), d) for _, one in good[:12] for d in shorter_designs((fit,), present, limits, one)]
    enough = [*good, *(pair for pair in shorter if pair[0] <= wanted)]
    best = min(enough, key=lambda pair: pair[1].effort) if enough else found[0]
    expect(np.isfinite(best[0]), f"no test within the limits tells {key} of {model!r}; expected wider limits")
    now = 1.96 * float(np.sqrt(covariance[at, at])) / abs(value)
    return PreciseTest(
        key, value, wanted, now, best[1], best[0], again, limits, len(found) + len(shorter), present, fit, prepared
    )


def _half_width(rows: Floats, at: int) -> float:
    """Of the 95 % interval of an unknown, from rows of unit variance."""
    scale = length_or_one(rows)
    sizes, directions = np.linalg.svd(rows / scale, full_matrices=False)[1:]
    sizes = np.maximum(sizes, 1e-12 * sizes[0])
    return 1.96 * float(np.linalg.norm(directions[:, at] / sizes) / scale[at])
