"""Starting values for a free run from the reverse system: every coefficient at once, linear and nonlinear.

The report's estimate. Noise on the motion biases it, so nothing is concluded from it; but it knows no side
valleys, in which a fit ends that begins from a linear model where the system is far from linear.
"""

import numpy as np

from study.equations.model import Model
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain.held_out import FAINT
from study.records.completion import complete
from study.records.plan import Plan
from study.records.record import Record
from study.records.spectra import Segments, cross_spectra
from study.support.errors import StudyError

LONGEST, SHORTEST, PARTS = 1024, 64, 12  # samples in a segment, and how many of them at least


def reverse_start(model: Model, record: Record, how: Plan) -> dict[str, float]:
    """Coefficients by reverse MI/SO on the fitting part.

    Parameters
    ----------
    model : Model
        Which terms act; shape parameters are given, coefficients are ignored.
    record : Record
        Force and at least one motion; the others are derived.
    how : Plan
        The part to fit.

    Raises
    ------
    StudyError
        If a motion cannot be derived, the part is too short, or an input has no power.
    """
    completed = complete(record.part(*how.fit))
    part = completed.record.part(completed.edge, len(completed.record) - completed.edge)
    inputs = reverse_inputs(model)
    cut = Segments(length=int(np.clip(2 ** int(np.log2(len(part) / PARTS)), SHORTEST, LONGEST)))
    matrix = cross_spectra([*histories(inputs, part), part["force"]], part.dt, cut)
    force = matrix.density[:, -1, -1].real
    driven = matrix.frequency[(force > FAINT * np.max(force)) & (matrix.frequency > 1.5 / (cut.length * part.dt))]
    if driven.size < len(inputs):
        raise StudyError(f"the force of {record.name!r} drives too few frequencies for {len(inputs)} inputs")
    band = (max(float(driven[0]), completed.band[0]), min(float(driven[-1]), completed.band[1]))
    found = coefficients.fit(conditioned.analyse(matrix), inputs, band, cut.line_inflation())
    if not np.all(np.isfinite(found.values)):
        raise StudyError(f"the reverse system of {model.name!r} and {record.name!r} has no solution")
    return dict(zip(found.symbols, found.values.tolist(), strict=True))
