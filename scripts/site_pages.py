"""Pages of the documentation site that are made when it is built: the notebooks, and the reference of every term.

MkDocs calls these as hooks (``hooks:`` in mkdocs.yml); ``make docs`` builds the site.
"""

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from study.equations.model import Model, ModelTerm
from study.equations.term import Term
from study.equations.terms import LIBRARY
from study.figures.labels import SHAPE_UNITS
from study.identify.frequency_domain.inputs import input_history, reverse_inputs
from study.records.record import Record
from study.support.arrays import Floats

CYCLES, SAMPLES = 4, 800  # of a harmonic motion, and samples a cycle
# For an amplitude of 1 m at 1 Hz.
TYPICAL = {"length": 0.4, "1/length": 1.0, "time": 0.15, "frequency": 0.5, "velocity": 1.0}
OUTSIDE = ("CONTRIBUTING.md", "CITATION.cff", "README.md")  # of the folder of the site: their names alone are shown


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are made, and leave out what is no page."""
    from mkdocs.structure.files import File

    docs = Path(config["docs_dir"])
    for path in sorted((docs / "notebooks").glob("*.ipynb")):
        text, pictures = notebook(json.loads(path.read_text(encoding="utf-8")), path.stem)
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=text))
        for name, data in pictures.items():
            files.append(File.generated(config, f"notebooks/{name}", content=data))
    files.append(File.generated(config, "reference/terms.md", content=terms_page()))
    for term in LIBRARY.values():
        files.append(File.generated(config, f"reference/{term.name}.png", content=picture(term)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:  # noqa: ARG001
    """Links that lead out of the folder become plain words; those to notebooks lead to their pages."""
    for name in OUTSIDE:
        markdown = markdown.replace(f"[{name}](../{name})", f"`{name}`")
    return markdown.replace(".ipynb)", ".md)")


def notebook(content: dict[str, Any], stem: str) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and its pictures by file name."""
    parts: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in content["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                name = f"{stem}_{len(pictures)}.png"
                pictures[name] = base64.b64decode(data["image/png"])
                parts.append(f"![what the cell above draws]({name})")
            elif "text/html" in data:
                parts.append("".join(data["text/html"]))
            else:
                parts.append("```\n" + "".join(output.get("text", data.get("text/plain", []))) + "\n```")
    return "\n\n".join(parts) + "\n", pictures


def terms_page() -> str:
    """Every term: formula, units, picture of its force, meaning, and where it is found."""
    head = (
        "# Terms\n\nEvery effect that a model may hold, and that a diagnosis tries. The pictures show the force with "
        "unit coefficients under a harmonic motion, over displacement and over velocity.\n"
    )
    return head + "\n".join(_section(term) for term in LIBRARY.values())


def _section(term: Term) -> str:
    rows = [f"| `{s}` | coefficient | {term.unit(s, 'N', 'm')} |" for s in term.symbols]
    rows += [f"| `{p.name}` | {p.meaning} | {SHAPE_UNITS[p.quantity]} |" for p in term.parameters]
    table = "| symbol | what | SI unit |\n|---|---|---|\n" + "\n".join(rows)
    return (
        f"\n## {term.name}\n\n`{term.formula}`: {term.meaning}. Found in: {term.cause}.\n\n"
        f"![force of {term.name} over displacement and velocity]({term.name}.png)\n\n{table}\n"
    )


def force_of(term: Term) -> tuple[Floats, Floats, Floats]:
    """Displacement, velocity and the term's force over the last cycle of u = cos(2 pi t), with unit coefficients."""
    dt = 1.0 / SAMPLES
    t = np.arange(CYCLES * SAMPLES) * dt
    u, rate = np.cos(2.0 * np.pi * t), 2.0 * np.pi
    motion = {"displacement": u, "velocity": -rate * np.sin(rate * t), "acceleration": -(rate**2) * u, "force": u}
    entry = ModelTerm(term, (1.0,) * len(term.components), tuple(TYPICAL[p.quantity] for p in term.parameters))
    total = np.zeros_like(u)
    for item in reverse_inputs(Model(term.name, (entry,))):
        shape = input_history(item, Record(dt, motion))
        for part in item.parts:
            values = shape
            for _order in range(part.order):
                values = np.gradient(values, dt)
            total = total + part.factor * values
    last = slice((CYCLES - 2) * SAMPLES, (CYCLES - 1) * SAMPLES)
    return u[last], motion["velocity"][last], total[last]


def picture(term: Term) -> bytes:
    """The force of a term as a PNG."""
    from matplotlib.figure import Figure

    from study.figures.styles import in_style

    u, v, force = force_of(term)
    with in_style():
        figure = Figure(figsize=(6.0, 1.9), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, at, label in ((left, u, "displacement"), (right, v / np.max(np.abs(v)), "velocity")):
            axes.plot(at, force, linewidth=1.6)
            axes.set(xlabel=f"{label}, relative to its largest", xlim=(-1.1, 1.1))
        left.set_ylabel("force")
        target = io.BytesIO()
        figure.savefig(target, format="png", dpi=90, metadata={"Software": None})
    return target.getvalue()
