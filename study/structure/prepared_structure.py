"""A record of a structure made ready once: which sensors are fitted, which part is fitted and which is judged."""

from collections.abc import Sequence
from dataclasses import replace

from study.equations.linear_part import check_held_masses
from study.equations.model import Model
from study.records.completion import NEAR_END
from study.records.plan import Span, compared_sensors, make_plan
from study.records.prepared import Prepared, prepare_record
from study.records.record import Record
from study.records.record_layout import KindOfTest, Layout, laid_out
from study.records.sampling_rate import without_spare_samples
from study.support.errors import StudyError

PERIODS = 1.5  # of a decay in a block: over more a wrong stiffness takes it out of step (docs/structures.md)


def prepare_structure(
    record: Record, model: Model, fit: Span | None = None, judge: Span | None = None, cutoff: float | None = None
) -> Prepared:  # fmt: skip
    """The parts of a record that are named, or its halves, whatever kind of test it is.

    Raises as :func:`structure_ready`.
    """
    return _made(prepare_record(record, make_plan(record, fit, judge), cutoff), record, model)


def structure_ready(record: Record, model: Model, layout: Layout) -> Prepared:
    """A record laid out for a structure: a decay in stretches that begin anew, a thinned one where it is oversampled.

    Raises
    ------
    StudyError
        As :func:`study.records.record_layout.laid_out`, or if nothing measures a coordinate and nothing ties it to
        another, or the masses that are given leave no positive definite mass matrix.
    """
    prepared = laid_out([record], layout, KindOfTest(unbroken=model.modal is not None, anew=PERIODS))
    return _made(prepared if layout.as_sampled else without_spare_samples(prepared), record, model)


def _made(prepared: Prepared, record: Record, model: Model) -> Prepared:
    if not model.modal:  # whose masses nobody lumps
        check_held_masses(model)
    sensors = prepared.sensors or compared_sensors(record)
    seen = {sensor.coordinate for sensor in sensors}
    blind = [coordinate for coordinate in model.coordinates if coordinate not in seen]
    _check_tied(model, blind)
    lacks = f"no sensor is at {' and '.join(blind)}: the free run has its motion, the reverse system lacks it"
    notes = (*prepared.notes, *([lacks] if blind else []))
    ends = NEAR_END if prepared.every > 1 and not prepared.record.stretches else 0  # which a filter leaves unsure
    (first, split), (other, last) = prepared.plan.fit, prepared.plan.judge
    inner = len(prepared.record) - ends
    fit, judge = (max(first, ends), min(split, inner)), (max(other, ends), min(last, inner))
    return replace(prepared, plan=replace(prepared.plan, fit=fit, judge=judge), sensors=sensors, notes=notes)


def _check_tied(model: Model, blind: Sequence[str]) -> None:
    """Refuse a coordinate that nothing measures and nothing ties to what is measured."""
    for name in blind:
        ties = [t for t in model.terms if name in t.place.moving and len(t.place.moving) > 1]
        if not ties:
            raise StudyError(
                f"nothing measures the coordinate {name!r} and nothing ties it to another; expected a column "
                f"{name!r}, or a term between it and a coordinate that is measured"
            )
