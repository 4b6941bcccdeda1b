"""A structure with one coordinate told as the single mass that it is, and what a fit of that found told back.

The first guess of a fit asks for mass, damping and stiffness, force and response by name.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from study.equations.model import Model, ModelTerm
from study.equations.place import GROUND, HERE, Place
from study.equations.terms import LINEAR
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.outputs import Outputs
from study.records.prepared import Prepared
from study.records.record import ALONE, FORCE, MOTIONS, Record, Sensor


def is_alone(model: Model) -> bool:
    """Whether a model has one coordinate, and that a name."""
    return model.named and len(model.coordinates) == 1 and model.modal is None


def model_alone(model: Model) -> Model:
    """The model of the single mass, its values in the order of the other's; what has no name, or several, as it is."""
    if not is_alone(model):
        return model
    terms = tuple(entry_alone(entry, model) for entry in model.terms)
    return replace(model, terms=terms, coordinates=(ALONE,), forces=((FORCE, ALONE),))


def entry_alone(entry: ModelTerm, model: Model) -> ModelTerm:
    """A term on the single mass; one that is turned round stays so."""
    turned = entry.place.direction(model.coordinates)[0] < 0.0 and entry.term.name not in LINEAR
    return replace(entry, place=Place("between", (ALONE, GROUND)) if turned else HERE) if is_alone(model) else entry


@lru_cache(maxsize=16)  # a search fits many models to one record, which knows its forces between the samples
def prepared_alone(prepared: Prepared) -> Prepared:
    """The record of a single coordinate without its name."""
    (name,), told = prepared.record.coordinates, dict[int, Record]()
    for stretch in prepared.record.stretches:
        told.setdefault(id(stretch.source), _record_alone(stretch.source, name))
    record = _record_alone(prepared.record, name)
    stretches = tuple(replace(s, source=told[id(s.source)]) for s in record.stretches)
    return replace(prepared, record=replace(record, stretches=stretches), sensors=_alone(prepared.sensors))


def _alone(sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
    return tuple(replace(sensor, coordinate=ALONE) for sensor in sensors)


def _record_alone(record: Record, name: str) -> Record:
    called = {str(Sensor(name, motion)): motion for motion in MOTIONS}
    channels = {called.get(c, c): values for c, values in record.channels.items() if c not in record.forces}
    channels[FORCE] = np.sum([np.zeros(len(record)), *(record[force] for force in record.forces)], axis=0)
    units = {called.get(c, c): unit for c, unit in record.units.items() if c not in record.forces}
    units[FORCE] = next((record.unit(force) for force in record.forces), record.usual_unit(FORCE))
    computed, changed = (frozenset(called.get(c, c) for c in names) for names in (record.computed, record.changed))
    return replace(
        record, channels=channels, units=units, coordinates=(ALONE,), forces=(FORCE,), computed=computed,
        changed=changed | {FORCE} if changed & {*record.forces} else changed,
    )  # fmt: skip


def fit_alone(fit: FreeRunFit) -> FreeRunFit:
    """A fit of a model with one coordinate as that of the single mass."""
    model, outputs = fit.model, replace(fit.outputs, sensors=_alone(fit.outputs.sensors))
    return _told(fit, {entry.name: entry_alone(entry, model) for entry in model.terms}, model_alone(model), outputs)


def told_back(fit: FreeRunFit, model: Model, outputs: Outputs) -> FreeRunFit:
    """A fit of a single mass as that of the model with one coordinate, whose terms it has, or some of them."""
    return _told(fit, {entry_alone(entry, model).name: entry for entry in model.terms}, model, outputs)


def _told(fit: FreeRunFit, entries: Mapping[str, ModelTerm], model: Model, outputs: Outputs) -> FreeRunFit:
    """A fit with other names of its terms."""
    terms = tuple(
        replace(entries[t.name], coefficients=t.coefficients, parameters=t.parameters) for t in fit.model.terms
    )
    told = replace(model, terms=terms)
    named = dict(zip(fit.model.values, told.values, strict=True))
    return replace(
        fit, model=told, keys=tuple(named[key] for key in fit.keys), outputs=outputs,
        undecided=tuple(named[key] for key in fit.undecided),
        elsewhere=tuple(_told(other, entries, model, outputs) for other in fit.elsewhere),
    )  # fmt: skip
