"""One model fitted to several records at once, with coefficients that may differ from record to record.

The first record's coefficient is the model's own; each other record has a term more, of the same shape, that acts along
that record alone: its coefficient is the difference to the first. The fit, its errors and all that is asked of a model
then hold for shared and separate coefficients alike.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc
from tabulate import tabulate

from study.compare.comparison import Comparison
from study.compare.fitted_coefficients import MOVES, RESOLUTION, Level
from study.compare.unlike_records import CHANNEL
from study.equations.model import Model, ModelTerm, free
from study.equations.term import Component, Term
from study.records.record import Record
from study.support.arrays import Floats
from study.support.errors import StudyError, expect

SLOPES = {"u": "1", "u**3": "3*u**2", "u*abs(u)": "2*abs(u)"}  # d/du of the shapes that the library differentiates


@dataclass(frozen=True)
class Separate:
    """A coefficient of the model, and by record after the first the key of its difference to that of the first."""

    symbol: str
    differences: tuple[str, ...]


def separated(
    model: Model, records: Sequence[Record], names: Sequence[str]
) -> tuple[Model, list[Record], tuple[Separate, ...]]:
    """A model some of whose coefficients may differ between records, and the records with what tells them apart.

    Parameters
    ----------
    model : Model
        With those coefficients open.
    records : sequence of Record
        Two or more, each with a name of its own.
    names : sequence of str
        Of terms or of coefficients.

    Raises
    ------
    StudyError
        If there is one record, or a name is none of the model's, held, or of a term with a memory, a shape parameter or
        a mass.
    """
    expect(
        len(records) > 1,
        f"--each-record {names[0]}: there is one record; expected two or more, between which coefficients may differ",
    )
    found = list(dict.fromkeys(item for name in names for item in _meant(model, name)))
    separate: list[Separate] = []
    for entry, component in found:
        terms = [_difference(entry.term, component, k, r) for k, r in enumerate(records[1:], start=2)]
        added = [free(term, entry.place) for term in terms]
        for one in added:
            model = model.with_term(one)
        separate.append(Separate(_key(entry, component), tuple(one.symbols[0] for one in added)))
    marked = [_marked(record, own, len(records)) for own, record in enumerate(records, start=1)]
    return model, marked, tuple(separate)


def levels_by_record(
    comparison: Comparison, separate: Sequence[Separate], records: Sequence[Record]
) -> tuple[Level, ...]:  # fmt: skip
    """The separate coefficients by record, in the order of the records, each with its standard error.

    The p value is that of the differences being zero together (Wald, 1943), with the covariance of one fit.
    """
    found = comparison.found
    levels = tuple(math.hypot(*(float(np.std(record[f])) for f in record.forces)) for record in records)
    units = {c.key: c.unit for c in comparison.coefficients}
    made: list[Level] = []
    for one in separate:
        place = [found.symbols.index(key) for key in (one.symbol, *one.differences)]
        values = np.asarray(found.values)[place]
        made.append(_level(one.symbol, units[one.symbol], levels, values, found.covariance[np.ix_(place, place)],
                           len(separate)))  # fmt: skip
    return tuple(made)


def rows(levels: Sequence[Level], records: Sequence[Record]) -> list[dict[str, Any]]:
    """The same for files, a row a coefficient."""
    names = [record.name for record in records]
    return [
        {"key": level.key, "unit": level.unit, "records": names, "value": list(level.value),
         "standard_error": list(level.error), "p_value": level.p_value, "differs": level.moves,
         "change": level.change} for level in levels
    ]  # fmt: skip


def record_table(levels: Sequence[Level], records: Sequence[Record]) -> str:
    """The same for people: a row a coefficient, a column a record."""
    heads = ["", *(record.name for record in records), "differs?", "unit"]
    body = [
        [level.key, *(f"{v:.4g} +- {1.96 * e:.2g}" for v, e in zip(level.value, level.error, strict=True)),
         f"{'yes' if level.moves else 'no'} (p = {level.p_value:.1g})", level.unit] for level in levels
    ]  # fmt: skip
    return tabulate(body, heads, tablefmt="simple", disable_numparse=True)


def _level(
    symbol: str, unit: str, force: tuple[float, ...], values: Floats, covariance: Floats, asked: int
) -> Level:  # fmt: skip
    """One coefficient by record: of its value in the first record and the differences to that."""
    sums = np.eye(len(values))
    sums[:, 0] = 1.0
    each = sums @ values
    error = np.sqrt(np.maximum(np.diag(sums @ covariance @ sums.T), 0.0))
    apart = values[1:]
    statistic = float(apart @ np.linalg.pinv(covariance[1:, 1:], hermitian=True) @ apart)
    p_value = float(chdtrc(len(apart), statistic))
    mean = abs(float(np.mean(each)))
    change = float(np.ptp(each)) / mean if mean else 0.0
    return Level(
        symbol, unit, force, tuple(each.tolist()), tuple(error.tolist()), p_value,
        p_value < MOVES / asked and change > RESOLUTION, change,
    )  # fmt: skip


def _meant(model: Model, name: str) -> list[tuple[ModelTerm, Component]]:
    """The coefficients that a name means: those of a term, or the one that is called so."""
    found = [
        (t, c) for t in model.terms for c in t.term.components if name in (t.name, t.term.name, c.symbol, _key(t, c))
    ]  # fmt: skip
    if not found:
        known = ", ".join(f"{t.name} ({', '.join(t.symbols)})" for t in model.terms)
        raise StudyError(f"--each-record {name}: the model has no such term or coefficient; expected one of {known}")
    for entry, component in found:
        plain = not (entry.term.parameters or entry.term.state) and component.order < 2 and _force(component)
        expect(
            plain,
            f"--each-record {name}: {entry.name} has a memory, a shape parameter or a mass; expected a term whose "
            "force is a coefficient times a function of displacement and velocity",
        )
        key = _key(entry, component)
        expect(
            entry.values[key] is None,
            f"--each-record {name}: the model file gives {key}; expected it to be left open",
        )
    return found


def _key(entry: ModelTerm, component: Component) -> str:
    return entry.symbols[entry.term.components.index(component)]


def _force(component: Component) -> str:
    """The force with a unit coefficient as a function of displacement and velocity; empty where it is none."""
    if component.order == 0:
        return component.shape
    slope = SLOPES.get(component.shape)
    return "" if slope is None else f"{component.factor!r}*{slope}*v"


def _difference(term: Term, component: Component, number: int, record: Record) -> Term:
    """The term that acts along one record alone."""
    name = re.sub(r"[^A-Za-z0-9]", "_", record.name)
    component = Component(f"{component.symbol}_{name}", f"({_force(component)})*{CHANNEL.format(number)}")
    return Term(
        f"{term.name}_{name}", (component,), f"{term.formula} along {record.name}",
        f"{term.name} along {record.name}, less that along the first record", "records of different states",
    )  # fmt: skip


def _marked(record: Record, own: int, count: int) -> Record:
    """A record with a channel for each record but the first: one along itself."""
    channels = {CHANNEL.format(k): np.full(len(record), float(k == own)) for k in range(2, count + 1)}
    return replace(record.with_channels(channels), units={**record.units, **dict.fromkeys(channels, "1")})
