"""A model as a Modelica class, which needs no library."""

import re

from study import __version__
from study.export.exported import Exported, Quantity, identifiers, named_nodes, refuse_sticking
from study.export.formula_text import MODELICA, FormulaText

MODELICA_WORDS = (
    "algorithm", "and", "annotation", "block", "break", "class", "connect", "connector", "constant", "constrainedby",
    "der", "discrete", "each", "else", "elseif", "elsewhen", "encapsulated", "end", "enumeration", "equation",
    "expandable", "extends", "external", "false", "final", "flow", "for", "function", "if", "import", "impure", "in",
    "initial", "inner", "input", "loop", "model", "not", "operator", "or", "outer", "output", "package", "parameter",
    "partial", "protected", "public", "pure", "record", "redeclare", "replaceable", "return", "stream", "then", "time",
    "true", "type", "when", "while", "within", "abs", "sign", "max", "min", "sin", "cos", "exp", "log", "sqrt", "tanh",
    "Real",
)  # fmt: skip


def modelica_class(made: Exported) -> str:
    """The text of a class: values as parameters, what drives as inputs, motions as outputs.

    Dry friction is refused: the class would need the states of what sticks and what lets go.
    """
    refuse_sticking(made, "this class")
    equations, graph = made.equations, made.equations.graph
    (title,) = identifiers([made.model.name], MODELICA_WORDS).values()
    quantities = (*made.inputs, *made.states, *made.parameters)
    names = identifiers([q.name for q in quantities], (*MODELICA_WORDS, title))
    drive = [graph.input(f"drive:{name}") for name in equations.drive]
    nodes = (*drive, *equations.states, *equations.values.values())
    called = {node: names[q.name] for node, q in zip(nodes, quantities, strict=True)} | {equations.time: "time"}
    inner = named_nodes(made, {*names.values(), *MODELICA_WORDS, title})
    rates = [*equations.motion[1], *equations.slopes]
    of_slopes = {node: f"der({called[s]})" for s, node in zip(equations.states, rates, strict=True)}
    text = FormulaText(graph, MODELICA, {**inner, **called}, frozenset(called))
    outputs = made.output_nodes
    lines = list(text.lines([*rates, *outputs]))
    own = {q.name for q in made.states}
    given = [q for q in made.outputs if q.name not in own]
    taken = {*names.values(), *(name for name, _ in lines), *MODELICA_WORDS, title}
    shown = identifiers([q.name for q in given], taken)
    results = dict(zip([q.name for q in made.outputs], outputs, strict=True))
    as_output = {q.name for q in made.outputs} & own
    declared = [
        *(_declared(q, "parameter Real", names[q.name], f" = {q.value!r}") for q in made.parameters),
        *(_declared(q, "input Real", names[q.name]) for q in made.inputs),
        *(_declared(q, "output Real" if q.name in as_output else "Real", names[q.name], start=True)
          for q in made.states),
        *(_declared(q, "output Real", shown[q.name]) for q in given),
    ]  # fmt: skip
    inside = [f"  Real {name};\n" for name, _ in lines]
    written = [f"  {name} = {formula};\n" for name, formula in lines]
    written += [f"  {left} = {text[node]};\n" for node, left in zip(rates, of_slopes.values(), strict=True)]
    for q in given:
        node = results[q.name]
        derivative = of_slopes.get(node) if node not in called else None
        written.append(f"  {shown[q.name]} = {derivative or text[node]};\n")
    protected = f"protected\n{''.join(inside)}" if inside else ""
    return (
        f'model {title} "{_quoted(made.model.name)}: its equation of motion, written by study {__version__}"\n'
        f"{''.join(declared)}{protected}equation\n{''.join(written)}end {title};\n"
    )


def _declared(q: Quantity, kind: str, name: str, value: str = "", start: bool = False) -> str:
    fields = [f'unit = "{unit_in_modelica(q.unit)}"'] if q.unit and "formula" not in q.unit else []
    fields += ["start = 0.0", "fixed = true"] if start else []
    given = f"({', '.join(fields)})" if fields else ""
    return f'  {kind} {name}{given}{value} "{_quoted(q.meaning)}";\n'


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


def unit_in_modelica(unit: str) -> str:
    """``N s^2/m^2`` as ``N.s2/m2``."""
    return re.sub(r"\s+", ".", unit.replace("^", "").strip())
