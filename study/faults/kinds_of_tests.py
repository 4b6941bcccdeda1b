"""Records of any kind of test compared with a model: what the test is decides how it is laid out and fitted.

A model without inertia makes it a component test, no force a free decay, a measured base one on a moving base, and a
model without a spring one that drifts. All take the same road from there on.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from study.compare.running_on import has_lost_its_way
from study.equations.common_factor import per_unit_mass, with_known_mass
from study.equations.equations_of_motion import has_spring
from study.equations.model import Model
from study.faults.accounting import Accounted, accounted
from study.records.driven_by_motion import on_a_moving_base, relative_to_base
from study.records.prepared import Prepared
from study.records.record import Record
from study.records.record_layout import KindOfTest, Layout, apart, laid_out, runs_on


def made_ready(
    records: Sequence[Record], model: Model, layout: Layout, absolute: bool = False
) -> tuple[Model, Prepared]:  # fmt: skip
    """Records of one structure laid out for a model, and the model with the mass that such a test takes as known.

    Parameters
    ----------
    records : sequence of Record
        To all of which one model is fitted.
    model : Model
        What it gives is held.
    layout : Layout
        What the user says of the parts to use, to fit and to judge.
    absolute : bool
        Whether, on a moving base, the response was measured absolutely.

    Raises
    ------
    StudyError
        If the records, or the model and such a test, do not go together.
    """
    based = [on_a_moving_base(record) for record in records]
    if any(based):
        model = with_known_mass(model)
    mass = None if model.values.get("m") == 1.0 else model.values.get("m")
    moved = [relative_to_base(r, mass, absolute) if b else (r, ()) for r, b in zip(records, based, strict=True)]
    prescribed = "inertia" not in model
    drifts = not prescribed and not has_spring(model)
    prepared = laid_out([record for record, _ in moved], layout, KindOfTest(prescribed, drifts))
    prepared = replace(prepared, notes=(*(note for _, said in moved for note in said), *prepared.notes))
    return per_unit_mass(model, prepared) if prepared.free else (model, prepared)


def accounted_test(
    records: Sequence[Record], model: Model, layout: Layout | None = None, *, absolute: bool = False, **options: Any
) -> Accounted:
    """The comparison of a model with records of a test, faults of the measurement accounted for.

    Where the free run of the model loses the motion on its way through the parts of a decay, it begins anew in each, or
    every few periods. Parameters are those of :func:`made_ready`, ``options`` those of
    :func:`study.faults.accounting.accounted`; it raises as both do.
    """
    layout = layout or Layout()
    model, prepared = made_ready(records, model, layout, absolute)
    options["as_sampled"] = layout.as_sampled
    found = accounted(model, prepared, **options)
    if runs_on(prepared):
        anew = apart(prepared)
        while has_lost_its_way(found.comparison.prediction) and (shorter := next(anew, None)) is not None:
            found = accounted(model, shorter, **options)
    return found
