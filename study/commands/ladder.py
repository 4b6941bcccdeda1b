"""A ladder: a measured record compared with model after model, each with a term more, judged on what was not fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
from pydantic import BeforeValidator

from study.commands.measurements import Measurement
from study.commands.parser import parser
from study.commands.record_arguments import layout_of, read_records
from study.compare.comparison import compared_fit
from study.compare.prediction import Prediction, predict
from study.equations.laid_variations import with_laid_variations
from study.equations.model import Model, ModelTerm, free
from study.equations.model_file import read_model
from study.equations.terms import get
from study.equations.variation import Variation, varying
from study.faults.correction import corrected
from study.faults.fault import Fault, settings_of
from study.faults.leftover import leftover
from study.faults.search import asked_of, refined
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.prepared import Prepared
from study.records.sampling_rate import without_spare_samples
from study.support.config_files import TableRow, Text, read_rows
from study.support.errors import StudyError, at, expect
from study.way_in.compare_records import as_far_as_it_follows, made_ready

Words = Annotated[tuple[str, ...], BeforeValidator(lambda c: c.split() if isinstance(c, str) else c)]
LADDER_COLUMNS = ["record", "title", "step", "added", "error", "rms", "unit", "floor", "published", "note"]


class Ladder(TableRow):
    """A row of ``config/ladders.tsv``."""

    record: Text  # of ``config/measurements.tsv``
    terms: Words  # that are added, one by one; ``TERM:CHANNEL:SIDE`` of one that varies with a channel, on one side
    fit: str  # samples that are fitted, in the words of the command line, where a part of those of the row is enough
    faults: Words  # of the measurement, that are looked for and corrected
    published: Text  # what the literature reaches or knows


def load_ladders(folder: Path, measurements: Mapping[str, Measurement]) -> dict[str, Ladder]:
    """Read ``ladders.tsv`` of a folder; whether the data are there is not asked."""
    found: dict[str, Ladder] = {}
    for where, row in read_rows(folder / "ladders.tsv", Ladder):
        with at(where):
            known = ", ".join(measurements)
            expect(row.record in measurements, f"{row.record!r} is no record of measurements.tsv; known are {known}")
            expect(row.record not in found, "the record stands twice; expected each once")
            for words in row.terms:
                _entry(words)
            settings_of(dict.fromkeys(row.faults))
        found[row.record] = row
    return found


def climbed_ladder(row: Measurement, ladder: Ladder, title: str) -> pd.DataFrame:
    """Errors of every step on the judged samples: relative, in the response's unit, and the noise floor.

    The faults that the ladder names are corrected as the last model has them, for all models alike. Motions are as long
    as the first model that can be fitted follows them. A step whose model cannot be fitted has the reason as its note.
    """
    options = [*row.options, *(("--fit", ladder.fit) if ladder.fit else ())]
    model, entries = read_model(Path(row.model)), [_entry(words) for words in ladder.terms]
    arguments = parser().parse_args(["compare", *row.paths, "--model", row.model, *options])
    records, rows = read_records(arguments, model), list[dict[str, Any]]()
    layout, at_step = layout_of(arguments, records[0]), None
    for step in range(len(entries) + 1):
        about = {"record": row.record, "title": title, "step": step, "added": "", "published": ladder.published}
        if step:
            model, about["added"] = model.with_term(entries[step - 1]), entries[step - 1].name
        try:
            if at_step is None:
                ready, prepared = made_ready(records, model, layout, arguments.absolute)
                prepared = prepared if layout.as_sampled else without_spare_samples(prepared)
                prepared = _corrected(prepared, ladder.faults, reduce(Model.with_term, entries[step:], ready))
                at_step = as_far_as_it_follows(ready, prepared, partial(_fitted, ready), lambda one: one.prediction)
                model = ready
            else:
                at_step = _fitted(model, at_step.prepared, at_step.fit.model)
        except StudyError as error:
            rows.append({**about, "note": str(error)})
            continue
        prediction, units = at_step.prediction, at_step.prepared.record.units
        worst = prediction.worst
        rows.append({
            **about, "error": worst.error, "rms": worst.error * worst.size, "unit": units.get(str(worst.sensor), ""),
            "floor": prediction.floor, "note": "",
        })  # fmt: skip
    return pd.DataFrame(rows, columns=LADDER_COLUMNS)


@dataclass(frozen=True)
class _Step:
    """A model of a ladder, fitted, and its motion along what is judged."""

    prepared: Prepared
    fit: FreeRunFit
    prediction: Prediction


def _fitted(model: Model, prepared: Prepared, below: Model | None = None) -> _Step:
    """A step of a ladder; its fit begins at the model below, with nothing of what was added.

    Where a term was added that has shape parameters of its own, these are searched for as in any fit.
    """
    model = with_laid_variations(model, prepared)
    known = {} if below is None else below.numbers()
    opened = [key for key, value in model.values.items() if value is None]
    if known and not any("." in key and key not in known for key in opened):
        model = model.with_values({key: known.get(key, 0.0) for key in opened}).opened(model.held_keys)
    fit, _ = compared_fit(fit_model(model, prepared), prepared)
    return _Step(prepared, fit, predict(fit, prepared))


def _corrected(prepared: Prepared, faults: Sequence[str], last: Model) -> Prepared:
    """The record without the faults that a ladder names, of the values that they have beside its last model."""
    if not faults:
        return prepared
    left, found = leftover(_fitted(last, prepared).fit, prepared), list[Fault]()
    for asked in asked_of(prepared, faults, {}):
        one = None if left is None else refined(asked, prepared, found, left)
        expect(one is not None, f"{prepared.record.name}: no {' of the '.join(asked)} is found beside the last model")
        if one is not None:
            left, found = one.left, [*found, one.fault]
    return corrected(prepared, found)


def _entry(words: str) -> ModelTerm:
    """``coulomb_friction``, or ``coulomb_friction:band1_force:v<0``: friction that follows a channel while v < 0."""
    name, _, rest = words.partition(":")
    channel, _, side = rest.partition(":")
    side = f"{side[0]} {side[1:2]} {side[2:]}" if side else ""
    return free(varying(Variation(get(name), channel, side=side)) if channel else get(name))


def missing_ladder(row: Measurement, ladder: Ladder, title: str) -> pd.DataFrame:
    """The one row of a record whose file is not there."""
    note = f"{row.paths[0]} is not there"
    told = {"record": row.record, "title": title, "step": 0, "added": "", "published": ladder.published, "note": note}
    return pd.DataFrame([told], columns=LADDER_COLUMNS)
