"""Run the notebooks of docs/notebooks in this process and keep what they show: ``make notebooks``.

No kernel is needed: every code cell is Python, run in one namespace; what its last line gives is shown as a notebook
would, and so is every figure that pyplot holds at its end.
"""

import ast
import base64
import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any

from study.support.files import replace_file
from study.support.workflow_step import one_sentence

DPI = 80


def run(path: Path, kept: bool = False) -> tuple[dict[str, Any], dict[str, Any]]:
    """The notebook with the outputs of this run, and the namespace in which it ended.

    Outputs are only made if they are to be ``kept``: pictures take most of the time.
    """
    import matplotlib

    matplotlib.use("Agg")
    notebook = json.loads(path.read_text(encoding="utf-8"))
    namespace: dict[str, Any] = {"__name__": "__main__"}
    number = 0
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            number += 1
            where = f"{path.name}, cell {number}"
            outputs = executed("".join(cell["source"]), where, namespace, kept)
            cell["outputs"], cell["execution_count"] = (outputs if kept else []), number
    return notebook, namespace


def executed(source: str, where: str, namespace: dict[str, Any], kept: bool) -> list[dict[str, Any]]:
    """Outputs of one cell, as a notebook file holds them."""
    from matplotlib import pyplot

    tree = ast.parse(source, where)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, where, "exec"), namespace)
        value = eval(compile(ast.Expression(last.value), where, "eval"), namespace) if last is not None else None
    outputs: list[dict[str, Any]] = []
    if printed.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": lines(printed.getvalue())})
    if value is not None and not pyplot.get_fignums():  # of a picture its axes say nothing more
        outputs.append({"output_type": "execute_result", "execution_count": None, "metadata": {}, "data": shown(value)})
    for figure in [pyplot.figure(n) for n in pyplot.get_fignums()] if kept else []:
        target = io.BytesIO()
        figure.savefig(target, format="png", dpi=DPI, metadata={"Software": None})
        picture = base64.b64encode(target.getvalue()).decode()
        outputs.append({"output_type": "display_data", "metadata": {}, "data": {"image/png": picture}})
    pyplot.close("all")
    return outputs


def shown(value: Any) -> dict[str, list[str]]:
    """A value as text and, if it has one, as HTML."""
    html = getattr(value, "_repr_html_", None)
    text = {"text/plain": lines(repr(value))}
    return {**text, "text/html": lines(html())} if html is not None else text


def lines(text: str) -> list[str]:
    """A text as notebook files hold it."""
    return text.splitlines(keepends=True)


if __name__ == "__main__":
    with one_sentence():
        for name in sys.argv[1:]:
            made, _ = run(Path(name), kept=True)
            replace_file(Path(name), (json.dumps(made, indent=1, ensure_ascii=False) + "\n").encode())
