"""Structures of several coordinates in a model file: their coordinates, forces and the places of their terms.

::

    coordinates: [floor1, floor2]
    forces: {shaker: floor1}                                  # measured forces, and where they act
    terms:
      - {term: inertia, at: floor1, value: 5.2}
      - {term: linear_stiffness, between: [ground, floor1]}
      - {term: cubic_stiffness, between: [floor1, floor2]}    # on the second's motion minus the first's
      - {term: inertia, couples: [floor1, floor2]}            # off the diagonal of the mass matrix

With ``linear: modal`` the coordinates are those with sensors, and the terms nonlinear alone: what is linear is a sum of
modes, as many as a record shows. ``linear: measured`` says the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import cast

from study.equations.model import Model, ModelTerm
from study.equations.place import ALONE, GROUND, HERE, Kind, Place
from study.equations.redundancy import repeated_force
from study.equations.terms import LINEAR
from study.support.errors import StudyError, expect
from study.support.yaml_text import as_list, as_mapping, scalar, shown

STRUCTURE_KEYS = ("coordinates", "forces", "linear")
MODAL, ALIAS = "modal", "measured"
PLACES: tuple[Kind, ...] = ("at", "between", "couples")
MOST_COORDINATES = 40
Forces = tuple[tuple[str, str], ...]


def coordinates_and_forces(top: Mapping[object, object]) -> tuple[tuple[str, ...], Forces]:
    """Names of the coordinates, and each force with the coordinate on which it acts."""
    if "coordinates" not in top:
        expect("forces" not in top, "the model has 'forces' and no 'coordinates'; expected both, or neither")
        return (ALONE,), (("force", ALONE),)
    given = as_list(top["coordinates"])
    if not given:
        raise StudyError(f"'coordinates' is {shown(top['coordinates'])}; expected a list such as [floor1, floor2]")
    expect(
        len(given) <= MOST_COORDINATES, f"'coordinates' has {len(given)} entries; at most {MOST_COORDINATES} are read"
    )
    names = tuple(_name(item, "a coordinate") for item in given)
    for name in names:
        expect(names.count(name) == 1, f"'coordinates' lists {name!r} twice; expected each once")
        expect(name != GROUND, f"'coordinates' lists {GROUND!r}, which never moves; expected names of what moves")
    forces = as_mapping(top.get("forces", {}))
    if forces is None:
        raise StudyError(
            f"'forces' is {shown(top['forces'])}; expected where each acts, such as {{shaker: {names[0]}}}"
        )
    found: list[tuple[str, str]] = []
    for key, value in forces.items():
        name = _name(key, "the name of a force")
        found.append((name, _known(value, f"the force {name!r} acts on", names)))
    return names, tuple(found)


def linear_modal(top: Mapping[object, object]) -> bool:
    """Whether the linear part of a model is a sum of modes."""
    if "linear" not in top:
        return False
    given = top["linear"]
    expect(given in (MODAL, ALIAS), f"'linear' is {shown(given)}; expected {MODAL}, or no such key")
    expect("coordinates" in top, "the model has 'linear' and no 'coordinates'; expected both")
    expect(as_mapping(top.get("forces")), "'linear: modal' needs 'forces'; expected such as {shaker: tip}")
    return True


def _name(item: object, what: str) -> str:
    usable = isinstance(item, str) and item.isidentifier() and item.isascii() and len(item) <= 40
    expect(usable, f"{what} is {shown(item)}; expected a name of letters, digits and underscores, such as floor1")
    return cast(str, item)


def _known(value: object, what: str, names: Sequence[str]) -> str:
    """A name out of several; the sentence otherwise says which are there."""
    if not isinstance(value, str) or value not in names:
        near = get_close_matches(str(value), names, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"expected one of {', '.join(names)}"
        raise StudyError(f"{what} {shown(value)}, which is no coordinate of the model; {hint}")
    return value


def place_of_entry(item: Mapping[object, object], term: object, coordinates: Sequence[str]) -> Place:
    """The place in an entry of ``terms``; entries of a model whose coordinate has no name say none."""
    ways = [key for key in PLACES if key in item]
    if tuple(coordinates) == (ALONE,):
        expect(not ways, f"{term} has {''.join(ways[:1])!r}, and the model no 'coordinates'; expected both, or neither")
        return HERE
    like = f"'at: {coordinates[0]}' or 'between: [{GROUND}, {coordinates[0]}]'"
    expect(len(ways) == 1, f"{term} says {' and '.join(ways) or 'not'} where it acts; expected one of {like}")
    kind = cast(Kind, ways[0])
    if kind == "at":
        return Place("at", (_known(item["at"], f"{term} is at", coordinates),))
    return place_of_pair(kind, as_list(item[kind]) or [item[kind]], str(term), coordinates)


def place_of_pair(kind: Kind, given: Sequence[object], term: str, coordinates: Sequence[str]) -> Place:
    """A place between two coordinates of a model, or one of them and the ground."""
    like = f"[{GROUND}, {coordinates[0]}]"
    expect(len(given) == 2, f"{kind!r} of {term} is {shown(list(given))}; expected two, such as {like}")
    choice = coordinates if kind == "couples" else (*coordinates, GROUND)
    verb = "couples" if kind == "couples" else "is between"
    first, second = (_known(end, f"{term} {verb}", choice) for end in given)
    expect(first != second, f"{term} {verb} {first!r} and itself; expected two different ends")
    expect(
        kind != "couples" or term == "inertia",
        f"{term} couples nothing; expected 'at' or 'between', as inertia alone can",
    )
    return Place(kind, (first, second))


def place_fields(place: Place) -> dict[str, str]:
    """A place as fields of an entry in YAML; none where there is no other."""
    if place == HERE:
        return {}
    given = place.plain()[place.kind]
    return {place.kind: scalar(given) if isinstance(given, str) else f"[{', '.join(scalar(end) for end in given)}]"}


def written(model: Model) -> str:
    """Coordinates and forces as lines of a model file; empty for a single mass."""
    if not model.named:
        return ""
    forces = ", ".join(f"{scalar(name)}: {scalar(where)}" for name, where in model.forces)
    linear = f"linear: {MODAL}\n" if model.modal else ""
    return f"coordinates: [{', '.join(scalar(c) for c in model.coordinates)}]\n" + (
        f"forces: {{{forces}}}\n{linear}" if forces else ""
    )


def check(model: Model) -> None:
    """Refuse a structure that no equation of motion holds for, whatever its values.

    Each coordinate has inertia, or none has in a component test, and something that acts on it, and no two terms at one
    place are the same, or such that no record could tell them apart.
    """
    masses, acted = set[str](), {where for _, where in model.forces}
    # By what terms lie between; couplings of inertia are another thing than an inertia between two.
    groups: dict[tuple[frozenset[str], bool], list[ModelTerm]] = {}
    for entry in model.terms:
        groups.setdefault((entry.place.path, entry.place.kind == "couples"), []).append(entry)
        (masses if entry.term.name == "inertia" and entry.place.kind == "at" else acted).update(entry.place.moving)
        if model.modal:
            sentence = "is linear, and 'linear: modal' holds it already; expected nonlinear terms alone"
            expect(entry.term.name not in LINEAR, f"{entry.name} {sentence}")
    component = not (masses or model.modal)
    where = model.coordinates[0]
    expect(
        not component or model.forces or not acted,
        f"no coordinate has inertia; expected {{term: inertia, at: {where}}}, or for a component test, whose motion is "
        f"prescribed, the forces that were measured, such as forces: {{load: {where}}}",
    )
    for name in () if model.modal else model.coordinates:
        sentence = f"the coordinate {name!r} has no inertia; expected {{term: inertia, at: {name}}}"
        expect(component or name in masses, sentence)
        loose = f"nothing ties the coordinate {name!r} to another or drives it"
        expect(name in acted, f"{loose}; expected a term between it and another, or a force")
    for entries in groups.values():
        names, label = [entry.term.name for entry in entries], entries[0].place.label
        for name in names:
            expect(names.count(name) == 1, f"model {model.name!r} lists {name} twice at {label}; expected once")
        fault = repeated_force(Model(model.name, tuple(replace(entry, place=HERE) for entry in entries)))
        expect(fault is None, f"at {label}, {fault}")
