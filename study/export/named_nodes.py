"""Names for what stands between: relative motions of places, and the force of each term."""

from collections.abc import Collection

from study.equations.graph import Op
from study.export.exported import Exported, identifiers


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
