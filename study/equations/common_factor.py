"""What a free decay cannot tell: the common factor of all coefficients."""

from dataclasses import replace

from study.equations.model import Model
from study.records.prepared import FORCE, Prepared

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
