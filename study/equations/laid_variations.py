"""Coefficients that vary, laid over what a record covers: knots of curves, and how long a step takes."""

from dataclasses import replace

import numpy as np

from study.equations.model import Model, ModelTerm, free
from study.equations.variation import ALONG_TIME, covered, laid
from study.records.prepared import Prepared
from study.records.record import Stretch
from study.records.record_layout import period_of
from study.support.errors import StudyError


def with_laid_variations(model: Model, prepared: Prepared) -> Model:
    """The model with what varies laid over all that the record covers of time or channels.

    Raises
    ------
    StudyError
        If the record lacks a channel, it is constant, or it leaves what the model says it was known for.
    """
    terms = tuple(laid_entry(entry, prepared) for entry in model.terms)
    for entry in terms:
        variation = entry.term.variation
        if variation is not None:
            values = variation.values(prepared.record)
            low, high = (f"{x:.4g}" for x in (np.min(values), np.max(values)))
            if not covered(variation, values):
                raise StudyError(
                    f"{entry.term.name} has knots from {variation.knots[0]:.4g} to {variation.knots[-1]:.4g}, and "
                    f"{variation.along} of {prepared.record.name} goes from {low} to {high}; expected a record within, "
                    "or the entry without knots and changes, to have it fitted anew"
                )
    return replace(model, terms=terms)


def laid_entry(entry: ModelTerm, prepared: Prepared, along_time: int = 12, with_channel: int = 10) -> ModelTerm:
    """A term of a model with what it varies with laid over the record; any other as it is.

    With so many knots at most. In time they are ten periods of the motion apart at least: what changes faster is the
    work of another effect. A step takes a quarter of a period, or a fiftieth of a channel's range.
    """
    variation = entry.term.variation
    if variation is None or not variation.open:
        return entry
    values = variation.values(prepared.record)
    span, period = float(np.ptp(values)), period_in_seconds(prepared)
    count, lasts = with_channel, span / 50.0
    if variation.along == ALONG_TIME:
        count, lasts = int(np.clip(1 + span // (10.0 * period), 2, along_time)), 0.25 * period
    new = free(laid(entry.term, values, count, lasts), entry.place)
    return new.with_values({key: value for key, value in entry.values.items() if key in new.values})


def period_in_seconds(prepared: Prepared) -> float:
    """Period of the slowest of the motions that are compared."""
    whole = Stretch(prepared.record, 0, len(prepared.record))
    return period_of(whole, prepared.outputs.sensors) * prepared.dt
