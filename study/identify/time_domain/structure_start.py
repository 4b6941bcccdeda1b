"""The first fit of a structure: from its linear terms, whatever else it holds."""

from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from study.equations.equations_of_motion import loose_motions
from study.equations.model import Model
from study.identify.frequency_domain.starting_values import linear_start
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.modal_fit import modal_fit
from study.identify.time_domain.part_fit import fit_part, rough_steps
from study.identify.time_domain.shooting import own_begins
from study.records.prepared import Prepared
from study.support.errors import DivergenceError, expect


def first_fit(model: Model, prepared: Prepared) -> FreeRunFit:
    """Fit all that a structure leaves open; what it gives is held.

    From the linear terms alone, and where that diverges or stays far from the motion, with more damping.

    Raises
    ------
    StudyError
        If no fit begins.
    """
    if model.modal:
        return modal_fit(model, prepared)
    linear = linear_start(model, prepared)
    start = {key: linear[key] for key, value in model.values.items() if value is None}
    fits: list[FreeRunFit] = []
    with suppress(DivergenceError):
        fits.append(_begun(model, prepared, start))
    if not fits or (not fits[0].converged and 2.0 * fits[0].rms ** 2 > prepared.spread**2):
        calm = {key: 4.0 * abs(v) if key.startswith("c[") else v for key, v in start.items()}
        try:
            fits.append(_begun(model, prepared, calm))
        except DivergenceError:
            expect(fits, _endless(model, prepared))
    return min(fits, key=lambda fit: fit.rms)


def _begun(model: Model, prepared: Prepared, start: Mapping[str, float]) -> FreeRunFit:
    """A fit from one start; of a decay from rest where its own states let the motion escape from springs far wrong."""
    steps = rough_steps(model, prepared, start)
    try:
        return fit_part(model, prepared, model.held_keys, start, steps=steps)
    except DivergenceError:
        if not prepared.record.stretches:
            raise
        states = 2 * len(model.coordinates) + len(model.states)
        rest = np.zeros((1 + len(own_begins(prepared.record, prepared.plan.fit)), states))
        return fit_part(model, prepared, model.held_keys, start, steps=steps, initial=rest)


def _endless(model: Model, prepared: Prepared) -> str:
    """Why no fit begins."""
    said = f"{model.name!r} has no finite motion under the forces of {prepared.record.name!r}"
    loose = loose_motions(model)
    if not loose:
        return said
    tied = f"nothing ties it down in {loose} of its {len(model.coordinates)} motions, in which it drifts away"
    return f"{said}: {tied}; expected a term between 'ground' and a coordinate, if the structure stands on something"
