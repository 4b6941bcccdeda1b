"""What a free decay, or a moving base, cannot tell: the common factor of all coefficients."""

from dataclasses import replace

from study.equations.model import Model
from study.records.prepared import FORCE, Prepared
from study.support.errors import expect

SAID = (
    "no force acts, so that the record fixes the coefficients but for one common factor: all are per unit mass (give "
    "one of them in the model, such as {term: inertia, value: 5.3}, for those of the structure)"
)


def per_unit_mass(model: Model, prepared: Prepared) -> tuple[Model, Prepared]:
    """A model and a record of free decays with a mass of one, unless the model gives a coefficient."""
    symbols = [s for t in model.terms for s in t.term.symbols]
    if "m" not in model.values or any(model.values[s] is not None for s in symbols):
        return model, prepared
    units = {**prepared.record.units, FORCE: f"{prepared.record.units['displacement']}/s^2"}
    record = replace(prepared.record, units=units)
    return model.with_values({"m": 1.0}), replace(prepared, record=record, notes=(*prepared.notes, SAID))


def with_known_mass(model: Model) -> Model:
    """A model on a moving base: with the mass that it gives, or one, as the base acts through the mass alone."""
    if "m" not in model.values or model.values["m"] is not None:
        return model
    symbols = [s for t in model.terms for s in t.term.symbols]
    given = [s for s in symbols if model.values[s] is not None]
    expect(  # the force of the base is in proportion to the mass
        not given,
        f"model {model.name!r} gives {', '.join(given)} and no mass, through which the base acts; expected the inertia "
        "as well, such as {term: inertia, value: 5.3}, or none of them",
    )
    return model.with_values({"m": 1.0})
