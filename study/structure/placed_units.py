"""Units at the places of a structure: newtons and metres, or newton metres and radians where a coordinate turns."""

from collections.abc import Collection

from study.equations import dimensions
from study.equations.model import ModelTerm
from study.equations.place import GROUND, Place
from study.equations.term import QUANTITIES


def units_at(place: Place, rotations: Collection[str]) -> tuple[str, str]:
    """Units of force and displacement at a place; ``rotations`` are the coordinates that were measured as angles."""
    ends = [end for end in place.ends if end != GROUND]
    return ("N m", "rad") if ends and all(end in rotations for end in ends) else ("N", "m")


def coefficient_unit(entry: ModelTerm, symbol: str, rotations: Collection[str]) -> str:
    """Unit of one coefficient of a term at its place; ``kg m^2`` of a moment of inertia, ``kg m`` of a coupled mass."""
    own = symbol.split("[")[0]
    if entry.term.name == "inertia":
        turning = sum(end in rotations for end in entry.place.ends)
        return "kg m^2" if turning == len(entry.place.ends) else "kg m" if turning else "kg"
    return entry.term.unit(own, *units_at(entry.place, rotations))


def parameter_units(entry: ModelTerm, rotations: Collection[str]) -> dict[str, str]:
    """Units of the shape parameters of a term at its place, by their names."""
    found: dict[str, str] = {}
    for parameter in entry.term.parameters:
        powers = QUANTITIES[parameter.quantity]
        length = units_at(entry.place, rotations)[1]
        unit = dimensions.compose("", length, (-powers[0], -powers[1])).strip()
        found[parameter.name] = "Hz" if parameter.quantity == "frequency" else f"1{unit}" if unit[0] == "/" else unit
    return found
