"""A model as other programs take it: what drives, states, values and outputs, each with its unit.

Names are those of the project: ``k3[floor2-floor3]``, ``floor1 velocity``. A language that takes letters and digits
alone gets :func:`identifiers`.
"""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, fields, replace

from study.equations.coefficient_units import coefficient_unit, parameter_units
from study.equations.equations_of_motion import Equations
from study.equations.graph import Op
from study.equations.model import Model
from study.equations.motion_program import jumping_signs
from study.records.record import FORCE, MOTIONS, OF_THE_GROUND, SI_UNITS, Record, Sensor
from study.support.errors import StudyError, expect

# Of a model and its terms, what is exported: what they may learn to hold one day is refused until it is.
EXPORTED = {"name", "terms", "coordinates", "forces", "modal", "term", "coefficients", "parameters", "place"}


@dataclass(frozen=True)
class Quantity:
    """Something with a name, a unit and a meaning."""

    name: str
    unit: str
    meaning: str
    value: float = 0.0  # of a parameter; where a state starts


@dataclass(frozen=True, eq=False)
class Exported:
    """A model that is exported, its equations, and all that is named in it."""

    model: Model
    equations: Equations
    inputs: tuple[Quantity, ...]  # in the order of ``equations.drive``
    states: tuple[Quantity, ...]  # in the order of ``equations.states``
    parameters: tuple[Quantity, ...]  # in the order of ``model.values``
    sensors: tuple[Sensor, ...]  # what is given out: motions, and the forces that prescribed ones take
    outputs: tuple[Quantity, ...]  # the same

    @property
    def output_nodes(self) -> list[int]:
        """Of each output, in its order."""
        return [
            self.equations.reaction(s.coordinate) if s.motion == FORCE
            else self.equations.at(s.coordinate, MOTIONS.index(s.motion))
            for s in self.sensors
        ]  # fmt: skip

    @property
    def sticks(self) -> tuple[str, ...]:
        """Names of the terms whose force jumps with a velocity: dry friction, which may stick."""
        signs = set(jumping_signs(self.equations))
        graph, found = self.equations.graph, list[str]()
        for entry in self.model.terms:
            forces, _ = self.equations.unit_forces(entry)
            if signs & set(graph.needed([node for _, node in forces])):
                found.append(entry.name)
        return tuple(found)


def exported(model: Model, record: Record | None = None) -> Exported:
    """A model all of whose values are known, ready to be written.

    Units are those of the ``record`` that it was fitted to, in which its values are; N, m and s if there is none. A
    ``StudyError`` names what is not known.
    """
    known = model.with_values({**model.values, **model.starts})  # what a fit saved is its start, and known here
    model = replace(known, terms=tuple(replace(entry, starts=()) for entry in known.terms))
    open_keys = [key for key, value in model.values.items() if value is None]
    expect(
        not open_keys,
        f"model {model.name!r} gives no value for {', '.join(open_keys)}; expected all, or the record to fit them to",
    )
    for part in (model, *model.terms):
        told = [f.name for f in fields(part) if f.name not in EXPORTED and getattr(part, f.name)]
        expect(not told, f"{part.name} has {', '.join(told)}, which no export can say yet; expected a model without")
    if record is None:
        units = SI_UNITS | {OF_THE_GROUND: SI_UNITS["acceleration"]}
        record = Record(1.0, {}, units, coordinates=model.coordinates, forces=tuple(dict(model.forces)))
    driven = () if model.modal else tuple(c for c in model.coordinates if c not in model.inertial)
    sensors = (
        *(Sensor(c, m) for m in MOTIONS for c in model.coordinates if c not in driven),
        *(Sensor(c, FORCE) for c in driven),
    )
    made = Equations(model, accelerated=len(driven) < len(model.coordinates))
    inputs = [Quantity(name, record.unit(name), _of_input(made, name)) for name in made.drive]
    _, length = record.force_and_length
    if model.modal:  # a modal coordinate of unit modal mass: displacement by root of mass
        modes = range(1, model.modal.count + 1)
        states = [Quantity(f"{x}[{r}]", "", f"{what} of mode {r}") for x, what in _MODAL for r in modes]
    else:
        moving = [Sensor(c, m) for m in MOTIONS[:2] for c in made.free]
        states = [Quantity(str(s), record.unit(s), str(s)) for s in moving]
    states += [Quantity(f"z[{t.name}]", length, f"own state of {t.name}") for t in model.states]
    outputs = [_output(sensor, record) for sensor in sensors]
    parameters = _parameters(model, record, model.numbers())
    return Exported(model, made, tuple(inputs), tuple(states), parameters, sensors, tuple(outputs))


_MODAL = (("q", "modal coordinate"), ("w", "its velocity"))


def _of_input(made: Equations, name: str) -> str:
    if name == OF_THE_GROUND:
        return "acceleration of the ground, on which motions are relative to it"
    if name in dict(made.model.forces):
        where = dict(made.model.forces)[name]
        return f"force on {where}" if where else "force"
    return "channel of a term" if name in made.model.channels else "motion that is prescribed"


def _output(sensor: Sensor, record: Record) -> Quantity:
    if sensor.motion == FORCE:
        of = f" of {sensor.coordinate}" if sensor.coordinate else ""
        return Quantity(str(sensor), record.force_and_length[0], f"force that the prescribed motion{of} takes")
    return Quantity(str(sensor), record.unit(sensor), str(sensor))


def _parameters(model: Model, record: Record, values: dict[str, float]) -> tuple[Quantity, ...]:
    found: dict[str, Quantity] = {}
    for entry in model.terms:
        for key in entry.symbols:
            unit = coefficient_unit(entry, key, record)
            found[key] = Quantity(key, unit, f"{entry.name}: {entry.term.meaning}", values[key])
        own = parameter_units(entry, record)
        for p in entry.term.parameters:
            key = f"{entry.name}.{p.name}"
            found[key] = Quantity(key, own[p.name], f"{entry.name}: {p.meaning}", values[key])
    if model.modal:
        for key in model.modal.keys:
            unit = "rad^2/s^2" if key in model.modal.stiffness else "1/s" if key in model.modal.damping else ""
            found[key] = Quantity(key, unit, "of the modes", values[key])
    return tuple(found[key] for key in model.values)


def identifiers(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Names of letters, digits and underscores, no two of them alike, and none of those that are taken."""
    used, found = set(taken), dict[str, str]()
    for name in names:
        plain = re.sub(r"[^0-9A-Za-z]+", "_", name).strip("_") or "x"
        plain = f"x_{plain}" if plain[0].isdigit() else plain
        made, number = plain, 2
        while made in used:
            made, number = f"{plain}_{number}", number + 1
        used.add(made)
        found[name] = made
    return found


def refuse_sticking(made: Exported, way: str) -> None:
    """Refuse dry friction where nothing can hold it."""
    if made.sticks:
        raise StudyError(
            f"{', '.join(made.sticks)} of {made.model.name!r} sticks and lets go, which {way} cannot say; expected "
            "'--to fmu', which stops where it does"
        )


def named_nodes(made: Exported, taken: Collection[str]) -> dict[int, str]:
    """The name of each node that is neither an input nor a number, in a language of letters and digits."""
    graph, equations, found = made.equations.graph, made.equations, dict[int, str]()
    for entry in made.model.terms:
        if entry.term.name == "inertia":
            continue
        for order, letter in enumerate("uv"):
            found.setdefault(equations.along(entry.place, order), f"{letter}[{entry.place.label}]")
        forces, rate = equations.unit_forces(entry)
        if rate is not None:
            found.setdefault(rate, f"rate[{entry.name}]")
        for key, unit in forces:
            name = entry.name if len(forces) == 1 else f"{entry.name}[{key}]"
            found.setdefault(graph.mul(equations.values[key], unit), name)
    plain = {node: name for node, name in found.items() if graph.nodes[node][0] not in (Op.INPUT, Op.CONST)}
    made_up = identifiers(plain.values(), taken)
    return {node: made_up[name] for node, name in plain.items()}
