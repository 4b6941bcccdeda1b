"""A model as a function for ``scipy.integrate.solve_ivp``, which needs NumPy alone."""

from collections.abc import Iterable

from study import __version__
from study.export.exported import Exported, Quantity, identifiers, named_nodes, refuse_sticking
from study.export.formula_text import PYTHON, FormulaText

PYTHON_WORDS = (
    "and", "as", "assert", "async", "await", "break", "class", "continue", "def", "del", "elif", "else", "except",
    "finally", "for", "from", "global", "if", "import", "in", "is", "lambda", "nonlocal", "not", "np", "or", "outputs",
    "pass", "raise", "return", "rates", "slopes", "state", "t", "try", "values", "while", "with", "yield",
    "STATES", "VALUES",
)  # fmt: skip


def python_function(made: Exported) -> str:
    """The text of a module with ``slopes(t, state, force)``, ``outputs`` of the same, ``VALUES`` and ``STATES``.

    Dry friction is refused: ``solve_ivp`` would have to stop where it sticks.
    """
    refuse_sticking(made, "a function for solve_ivp")
    names = identifiers([*(q.name for q in (*made.inputs, *made.states, *made.parameters))], PYTHON_WORDS)
    inputs = ", ".join(names[q.name] for q in made.inputs)
    driven = "".join(f", {names[q.name]}" for q in made.inputs)
    arguments = f"args=({inputs},), " if inputs else ""
    start = ", ".join("0.0" for _ in made.states)
    model = made.model
    head = f'''"""{model.name}: its equation of motion, for scipy.integrate.solve_ivp; this file needs NumPy alone.

{_listed("What drives, each a function of the time in s:", made.inputs)}
{_listed("The state:", made.states)}
    from scipy.integrate import solve_ivp
    motion = solve_ivp(slopes, (0.0, 10.0), [{start}], {arguments}rtol=1e-9, atol=1e-12)
    outputs(motion.t, motion.y{driven})

Written by study {__version__}.
"""

import numpy as np

STATES = [{", ".join(f'"{q.name}"' for q in made.states)}]
VALUES = {{
'''
    meanings = [f"{q.unit}; {q.meaning}" if q.unit else q.meaning for q in made.parameters]
    listed = "".join(
        f'    "{q.name}": {q.value!r},  # {meaning}\n' for q, meaning in zip(made.parameters, meanings, strict=True)
    )
    rates = [*made.equations.motion[1], *made.equations.slopes]
    given = f"(t, state{driven}, values=VALUES)"
    body, results = _body(made, rates, names, {})
    slopes = f'    """d/dt of the state at the time t."""\n{body}    return np.array([{", ".join(results)}])\n'
    known = {node: f"rates[{i}]" for i, node in enumerate(rates) if node not in made.equations.states}
    body, results = _body(made, made.output_nodes, names, known)
    call = f"    rates = slopes(t, state{''.join(f', {names[q.name]}' for q in made.inputs)}, values)\n"
    body = call + body if any("rates[" in text for text in (body, *results)) else body
    pairs = "".join(f'        "{q.name}": {text},  # {q.unit}\n' for q, text in zip(made.outputs, results, strict=True))
    outputs = f'    """What is observed at the times t, along the states of ``solve_ivp``, by name."""\n{body}'
    return (
        f"{head}{listed}}}\n\n\ndef slopes{given}:\n{slopes}\n\n"
        f"def outputs{given}:\n{outputs}    return {{\n{pairs}    }}\n"
    )


def _listed(title: str, quantities: Iterable[Quantity]) -> str:
    rows = ""
    for q in quantities:
        named = f"{q.name} [{q.unit}]" if q.unit else q.name
        rows += f"    {named}{'' if q.meaning == q.name else ': ' + q.meaning}\n"
    return f"{title}\n{rows}" if rows else ""


def _body(
    made: Exported, nodes: list[int], names: dict[str, str], computed: dict[int, str]
) -> tuple[str, list[str]]:  # fmt: skip
    """Lines of a function that computes these nodes, and what it returns of each; some are computed already."""
    equations, graph = made.equations, made.equations.graph
    needed = set(graph.needed([node for node in nodes if node not in computed]))
    inner = named_nodes(made, set(names.values()) | set(PYTHON_WORDS))
    drive = [graph.input(f"drive:{name}") for name in equations.drive]
    keys = list(equations.values.values())
    quantities = (*made.inputs, *made.states, *made.parameters)
    known = dict(zip((*drive, *equations.states, *keys), quantities, strict=True))
    called = {node: names[q.name] for node, q in known.items()} | {equations.time: "t"}
    text = FormulaText(graph, PYTHON, {**inner, **called, **computed}, frozenset(called))
    lines = [f"{called[node]} = {called[node]}(t)" for node in drive if node in needed]
    if needed & set(equations.states):
        left = [called[n] if n in needed else "_" for n in equations.states]
        lines.append(f"{', '.join(left)}{',' if len(left) == 1 else ''} = state")
    lines += [f'{called[node]} = values["{known[node].name}"]' for node in keys if node in needed]
    lines += [f"{name} = {formula}" for name, formula in text.lines([n for n in nodes if n not in computed])]
    return "".join(f"    {line}\n" for line in lines), [text[node] for node in nodes]
