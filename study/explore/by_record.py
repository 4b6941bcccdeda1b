"""Several records in a session: one model is fitted to all, and beside that each has coefficients of its own.

A coefficient that differs from record to record belongs to a model that lacks something.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from study.compare import each_record
from study.compare.comparison import Comparison, across_records, compare
from study.compare.each_record import Separate
from study.compare.fitted_coefficients import Level
from study.records.prepared import Prepared
from study.records.record import Record
from study.support.errors import StudyError


@dataclass(frozen=True)
class Several:
    """What a session needs of its records one by one; empty of one record."""

    apart: tuple[Prepared, ...] = ()  # each made ready by itself
    records: tuple[Record, ...] = ()  # as they were read
    separate: tuple[Separate, ...] = ()  # the coefficients that may differ within the one fit, if any were asked for


@dataclass(frozen=True)
class ByRecord:
    """The coefficients of each record."""

    names: tuple[str, ...] = ()  # of the records, in the order of the levels' entries
    levels: tuple[Level, ...] = ()
    errors: tuple[float, ...] = ()  # of each record's own fit, in the order of the records; none in one fit
    why_not: str = ""  # the sentence on a record to which the model alone cannot be fitted


def of_own(comparisons: Sequence[Comparison]) -> ByRecord:
    """Comparisons of a model with each record, held against each other as ``study compare`` does."""
    levels = across_records(comparisons)
    names = tuple(c.record.name for c in sorted(comparisons, key=lambda c: c.level))
    return ByRecord(names, levels, tuple(c.prediction.error for c in comparisons))


def by_record(several: Several, together: Comparison) -> ByRecord:
    """The same of the model that was fitted to all records together: fitted to each, from where that fit ended.

    Where some of its coefficients were to differ between records, these are what the one fit has found.
    """
    if several.separate:
        names = tuple(record.name for record in several.records)
        levels = each_record.levels_by_record(together, several.separate, several.records)
        return ByRecord(names, levels)
    start = together.fit.model.numbers()
    try:
        return of_own([compare(together.model, prepared, start=start) for prepared in several.apart])
    except StudyError as error:
        return ByRecord(why_not=str(error))


def worst(each: Sequence[Comparison]) -> int:
    """The place of the record of which the model misses most; 0 of one record, which has no comparison of its own."""
    missed = [comparison.prediction.above_noise for comparison in each]
    return missed.index(max(missed)) if missed else 0
