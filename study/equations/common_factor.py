"""What a free decay, or a moving base, cannot tell: the common factor of all coefficients."""

from dataclasses import replace

import numpy as np

from study.equations.model import Model
from study.equations.place import GROUND
from study.records.prepared import Prepared
from study.records.record import FORCE, MOTIONS, OF_THE_GROUND, Sensor
from study.support.errors import expect

NO_FORCE_ACTS = (
    "no force acts, so that the record fixes the coefficients but for one common factor: all are per unit mass (give "
    "one of them in the model, such as {term: inertia, value: 5.3}, for those of the structure)"
)


def per_unit_mass(model: Model, prepared: Prepared) -> tuple[Model, Prepared]:
    """A model and a record of free decays with a mass of one, unless the model gives a coefficient."""
    symbols, mass = [s for t in model.terms for s in t.symbols], _mass(model)
    if len(model.coordinates) > 1 or mass is None or any(model.values[s] is not None for s in symbols):
        return model, prepared
    record = prepared.record
    forces = list(record.forces) or [FORCE]
    per_mass = f"{record.unit(Sensor(record.coordinates[0], MOTIONS[0]))}/s^2"
    still = {force: np.zeros(len(record)) for force in forces if force not in record}
    record = replace(
        record, channels={**record.channels, **still}, forces=tuple(forces),
        units={**record.units, **dict.fromkeys(forces, per_mass)},
    )  # fmt: skip
    return model.with_values({mass: 1.0}), replace(prepared, record=record, notes=(*prepared.notes, NO_FORCE_ACTS))


def _mass(model: Model) -> str | None:
    """The key of the only mass, or of the first."""
    return next((t.symbols[0] for t in model.terms if t.term.name == "inertia"), None)


def on_moving_ground(model: Model) -> Model:
    """A model on a moving base: with the mass that it gives, or one, as the base acts through the mass alone.

    The ground's acceleration drives several coordinates, whose masses are all given.
    """
    first, *others = model.coordinates
    if others:
        masses = [s for t in model.terms if t.term.name == "inertia" for s in t.symbols]
        open_ones = ", ".join(key for key in masses if model.values[key] is None)
        sentence = f"the base acts through the masses of {model.name!r}, and {open_ones} is open"
        expect(not open_ones, f"{sentence}; expected a value for each inertia")
        return replace(model, forces=((OF_THE_GROUND, GROUND),))
    model = replace(model, forces=((FORCE, first),))
    mass = _mass(model)
    if mass is None or model.values[mass] is not None:
        return model
    symbols = [s for t in model.terms for s in t.symbols]
    given = [s for s in symbols if model.values[s] is not None]
    expect(  # the force of the base is in proportion to the mass
        not given,
        f"model {model.name!r} gives {', '.join(given)} and no mass, through which the base acts; expected the inertia "
        "as well, such as {term: inertia, value: 5.3}, or none of them",
    )
    return model.with_values({mass: 1.0})
