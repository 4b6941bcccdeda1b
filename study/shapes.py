"""Shape parameters that a model leaves open: where a fit of them begins.

The search is that of the diagnosis (``study.diagnose``): the width of a dead band, a gap, a relaxation time
or the frequency of a stiffness are tried where they explain most of what the model without the term leaves.
"""

from dataclasses import replace

from study import fitting
from study.diagnose import candidates, search
from study.errors import StudyError
from study.model import Model
from study.record import Record

SEARCHED = 2048  # samples, at most: a start needs no more, and a chaotic system is lost sooner or later


def shape_keys(model: Model) -> tuple[str, ...]:
    """Keys of the shape parameters that a model gives."""
    keys = [key for entry in model.terms for key in entry.keys[len(entry.coefficients) :]]
    return tuple(key for key in keys if model.values[key] is not None)


def with_starting_shapes(model: Model, record: Record) -> Model:
    """The model with a starting value for each shape parameter that it leaves open.

    Its coefficients, which are not looked at, keep their values.

    Raises
    ------
    StudyError
        If a term's shape parameters cannot be found in the record.
    """
    unknown = tuple(t for t in model.terms if None in t.parameters)
    if not unknown:
        return model
    how = fitting.shortened(fitting.plan(record), SEARCHED)
    known = replace(model, terms=tuple(t for t in model.terms if t not in unknown))
    found = fitting.fit(known, record, how, shape_keys(known))
    for entry in unknown:
        trial = candidates.attempt(entry.term, search.baseline(found, record, how), record, how, shape_keys(known))
        if trial is None:
            names = ", ".join(p.name for p, v in zip(entry.term.parameters, entry.parameters, strict=True) if v is None)
            raise StudyError(f"{record.name!r} does not show {names} of {entry.name}; give it in the model")
        found = trial.found
    values = found.model.values
    return model.with_values({key: values[key] for key, value in model.values.items() if value is None and "." in key})
