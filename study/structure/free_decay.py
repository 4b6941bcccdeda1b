"""Where the fit of a structure begins that nothing drives: its linear terms from the motion itself.

``M a + C v + K u = 0`` along the measured motions, with the masses held: without a force nothing else tells their size.
"""

from collections.abc import Mapping

import numpy as np

from study.equations.model import Model
from study.structure.mass_matrix import linear_keys, patterns
from study.structure.prepared_structure import PreparedStructure
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares


def free_decay_start(model: Model, prepared: PreparedStructure, held: Mapping[str, float]) -> dict[str, float]:
    """Linear coefficients that are not held, by least squares along the fitting part.

    Raises
    ------
    StudyError
        If a mass is open, or a coordinate is not measured.
    """
    orders, own = linear_keys(model), patterns(model)
    free = [key for key in orders if key not in held]
    open_masses = ", ".join(key for key in free if orders[key] == 2)
    sentence = f"nothing drives {model.name!r}: its motion says nothing of {open_masses}; expected a value for each"
    expect(not open_masses, sentence)
    lacking = ", ".join(c for c in model.coordinates if c not in prepared.complete)
    if lacking:
        raise StudyError(
            f"nothing drives {model.name!r} and no sensor is at {lacking}; expected one at each coordinate"
        )
    first, last = max(prepared.fit[0], prepared.edge), min(prepared.fit[1], len(prepared.record) - prepared.edge)
    motion = np.stack([prepared.complete[c][:, first:last] for c in model.coordinates], axis=1)  # (3, n, samples)
    weight = 1.0 / np.std(motion[2], axis=1)
    columns = {key: ((own[key] @ motion[orders[key]]) * weight[:, None]).ravel() for key in orders}
    target = -np.sum([held[key] * columns[key] for key in orders if key in held], axis=0)
    amounts = least_squares(np.column_stack([columns[key] for key in free]), target)
    return dict(zip(free, amounts.tolist(), strict=True))
