"""Records of any kind of test compared with a model: what the test is decides how it is laid out and fitted.

A model without inertia makes it a component test, no force a free decay, a measured base one on a moving base, and a
model without a spring one that drifts. All take the same road from there on. Command line, notebook, page and trials
all come in here.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from study.compare.by_estimator import FREE_RUN
from study.compare.comparison import Comparison, compare
from study.compare.prediction import Prediction
from study.equations.common_factor import on_moving_ground, per_unit_mass
from study.equations.equations_of_motion import has_spring
from study.equations.laid_variations import with_laid_variations
from study.equations.linear_part import check_held_masses
from study.equations.model import Model
from study.faults.accounting import Accounted, accounted
from study.faults.fault import FaultSettings
from study.identify.time_domain.stretch_states import is_smooth
from study.records.driven_by_motion import on_a_moving_base, relative_to_base, with_forces_by_coordinate
from study.records.prepared import Prepared
from study.records.readers.remarks import LEAVING_OUT
from study.records.record import FORCE, Record
from study.records.record_layout import KindOfTest, Layout, apart, laid_out, runs_on
from study.records.sampling_rate import low_passed
from study.support.errors import StudyError, expect
from study.support.numbers import enumerated

Made = TypeVar("Made")
ANEW = 1.5  # periods of a structure's decay in a stretch: a longer run is lost where several effects are missing (docs)


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
        If the records, or the model and such a test, do not go together; of a structure, if nothing measures a
        coordinate or ties it to another, or its masses are not positive definite together.
    """
    one_mass = len(model.coordinates) == 1 and not (model.modal or model.prescribed)
    expect(
        layout.near is None or one_mass,
        "--near chooses the mode of a single mass alone; of a structure start values (held: false) choose the modes, "
        "and --up-to leaves out those above",
    )
    model, records, said = driven_alike(records, model, absolute)
    if layout.highest is not None:
        below = [low_passed(record, layout.highest) for record in records]
        records, said = [record for record, _ in below], (*said, below[0][1])
    if model.prescribed and model.named:
        records = [with_forces_by_coordinate(record, model.forces) for record in records]
    drifts = not (model.prescribed or model.modal or has_spring(model))
    anew = ANEW if len(model.coordinates) > 1 else 0.0
    varies = any(entry.term.variation for entry in model.terms)  # along all of the record
    prepared = laid_out(records, layout, KindOfTest(model.prescribed, drifts, model.modal is not None, anew, varies))
    model = with_laid_variations(model, prepared)
    lacks = _unseen(model, prepared)
    noticed = [remark for remark in _remarked(records) if not (layout.use and LEAVING_OUT in remark)]
    prepared = replace(prepared, near=layout.near or 0.0, notes=(*said, *noticed, *prepared.notes, *lacks))
    return per_unit_mass(model, prepared) if prepared.free else (model, prepared)


def _remarked(records: Sequence[Record]) -> list[str]:
    """What was noticed of the records: of all of them once, else with the names of those that it is said of."""
    of: dict[str, list[str]] = {}
    for record in records:
        for remark in record.remarks:
            of.setdefault(remark, []).append(record.name)
    return [said if len(names) == len(records) else f"in {enumerated(names)}: {said}" for said, names in of.items()]


def _unseen(model: Model, prepared: Prepared) -> tuple[str, ...]:
    """What to say of coordinates without a sensor.

    Raises
    ------
    StudyError
        If nothing ties one of them to another, or the masses that are given leave no positive definite mass matrix.
    """
    if not model.named:
        return ()
    if model.inertial:  # modes are nobody's lumped masses, and a component has none
        check_held_masses(model)
    blind = [coordinate for coordinate in model.coordinates if coordinate not in prepared.coordinates]
    for name in blind:
        expect(
            any(name in t.place.moving and len(t.place.moving) > 1 for t in model.terms),
            f"nothing measures the coordinate {name!r} and nothing ties it to another; expected a column {name!r}, or "
            "a term between it and a coordinate that is measured",
        )
    lacks = f"no sensor is at {' and '.join(blind)}: the free run has its motion, the reverse system lacks it"
    if prepared.response == FORCE:
        lacks = f"no force was measured at {' and '.join(blind)}: those of the others alone are compared"
    return (lacks,) if blind else ()


def driven_alike(
    records: Sequence[Record], model: Model, absolute: bool = False
) -> tuple[Model, list[Record], tuple[str, ...]]:
    """Records on a moving base with the force of that, the model with the mass it takes as known, and what to say.

    All other records are as they were. Raises as :func:`made_ready`.
    """
    based = [model.modal is None and on_a_moving_base(record) for record in records]
    bare = (
        "--absolute is for a moving base under a model that is not modal; expected a column base_acceleration, no force"
    )
    expect(any(based) or not (absolute and model.named), bare)
    if any(based):
        same = all(based) or not model.named
        expect(same, "a base moves in some of these records and a force acts in others; expected one of both")
        turning = ", ".join(sorted(records[0].rotations))
        expect(
            not turning, f"the base moves and {turning} turns; expected coordinates that all move along with the base"
        )
        model = on_moving_ground(model)
    mass = next((model.values[s] for t in model.terms if t.term.name == "inertia" for s in t.symbols), None)
    mass = None if mass == 1.0 and len(model.coordinates) == 1 else mass
    moved = [relative_to_base(r, mass, absolute) if b else (r, ()) for r, b in zip(records, based, strict=True)]
    return model, [record for record, _ in moved], tuple(note for _, said in moved for note in said)


def compare_records(
    records: Sequence[Record],
    model: Model,
    layout: Layout | None = None,
    settings: FaultSettings | None = None,
    *,
    absolute: bool = False,
    estimator: str = FREE_RUN,
    progress: Callable[[str], None] | None = None,
) -> Accounted:
    """The comparison of a model with records of a test, faults of the measurement accounted for.

    Where the free run of the model loses the motion on its way through the parts of a decay, it begins anew in each, or
    every few periods.

    Parameters
    ----------
    records, model, layout, absolute
        As for :func:`made_ready`.
    settings : FaultSettings, optional
        What the user says of the instruments; by default every fault is looked for.
    estimator, progress
        As for :func:`study.compare.comparison.compare`.

    Raises
    ------
    StudyError
        If the records, or the model and such a test, do not go together, or the model cannot be fitted.
    """
    layout, settings = layout or Layout(), settings or FaultSettings()
    layout = replace(layout, as_sampled=layout.as_sampled or settings.as_sampled)
    model, prepared = made_ready(records, model, layout, absolute)

    def found_in(prepared: Prepared) -> Accounted:
        return accounted(
            model, prepared, held=settings.held, switched_off=settings.switched_off, estimator=estimator,
            progress=progress, as_sampled=layout.as_sampled,
        )  # fmt: skip

    return as_far_as_it_follows(model, prepared, found_in, lambda found: found.comparison.prediction)


def as_far_as_it_follows(
    model: Model, prepared: Prepared, made: Callable[[Prepared], Made], predicted: Callable[[Made], Prediction]
) -> Made:  # fmt: skip
    """What is made of a record along motions as long as a model follows them; ``predicted`` says how it does.

    Of a decay motions run on through its parts; where the model loses its way they begin anew in each, at last every
    few periods.
    """
    found = made(prepared)
    if runs_on(prepared) and (model.states or not model.prescribed):  # what has no state loses no motion
        anew = apart(prepared)
        while has_lost_its_way(predicted(found)) and (shorter := next(anew, None)) is not None:
            found = made(shorter)
    return found


LOST_ITS_WAY = 0.3  # of the rms response: a free run through several blocks that misses so much has lost the motion


def has_lost_its_way(prediction: Prediction) -> bool:
    """Whether a free run has lost the motion: it misses much, and what it leaves looks like a motion, not as noise."""
    return prediction.error > LOST_ITS_WAY and is_smooth(prediction.residual, len(prediction.views))


def running_on(comparison: Comparison) -> Comparison:
    """The comparison along motions that run on for as long as its model follows them.

    That is how the model is compared by itself: what its predecessor lost is no reason to begin anew.
    """
    for longer in _longer(comparison.prepared):
        try:
            whole = compare(comparison.model, longer)
        except StudyError:
            continue
        if not has_lost_its_way(whole.prediction):
            return whole
    return comparison


def _longer(prepared: Prepared) -> list[Prepared]:
    """The same record with motions that run on for longer, the longest first."""
    longer = prepared.running_on
    return [] if longer is None else [*_longer(longer), longer]
