"""Units at the places of a structure: of force and length, or of moment and angle where a coordinate turns."""

from study.equations import dimensions
from study.equations.model import ModelTerm
from study.equations.place import GROUND, Place
from study.equations.term import OF_VARIATION, QUANTITIES
from study.equations.variation import ALONG_TIME
from study.records.record import Record


def units_at(place: Place, record: Record) -> tuple[str, str]:
    """Units of force and displacement at a place, those of a completed record."""
    force, length = record.force_and_length
    ends = [end for end in place.ends if end != GROUND]
    if not ends or not record.rotations.issuperset(ends):
        return force, length
    return (force if force.startswith("rad/") else f"{force} {length}"), "rad"  # a moment over the inertia


def coefficient_unit(entry: ModelTerm, symbol: str, record: Record) -> str:
    """Unit of one coefficient of a term at its place; ``kg m^2`` of a moment of inertia, ``kg m`` of a coupled mass."""
    own, (force, length) = symbol.split("[")[0], record.force_and_length
    if entry.term.name == "inertia":
        turning = sum(end in record.rotations for end in entry.place.ends)
        power = 2 if turning == len(entry.place.ends) else 1 if turning else 0
        if (force, length) == ("N", "m"):
            return ("kg", "kg m", "kg m^2")[power]
        if force == ("rad/s^2" if power == 2 else f"{length}/s^2"):
            return ""  # of a decay: a share of itself
        return (f"{force} s^2/{length}", f"{force} s^2", f"{force} {length} s^2")[power]
    return entry.term.unit(own, *units_at(entry.place, record))


def parameter_units(entry: ModelTerm, record: Record) -> dict[str, str]:
    """Units of the shape parameters of a term at its place, by their names."""
    found: dict[str, str] = {}
    for parameter in entry.term.parameters:
        if parameter.quantity == OF_VARIATION and (varied := entry.term.variation) is not None:
            found[parameter.name] = "s" if varied.along == ALONG_TIME else record.unit(varied.along)
            continue
        powers = QUANTITIES[parameter.quantity]
        length = units_at(entry.place, record)[1]
        unit = dimensions.compose("", length, (-powers[0], -powers[1])).strip()
        found[parameter.name] = (
            "Hz" if parameter.quantity == "frequency" else f"1{unit}" if unit.startswith("/") else unit
        )
    return found
