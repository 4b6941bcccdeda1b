"""``study terms``: the library of terms, or one of them in detail."""

import argparse
import shutil
from typing import TYPE_CHECKING

from study.commands.command import Command

if TYPE_CHECKING:
    from study.equations.terms import Term


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", nargs="?", help="a term to show in detail, or a word to search for (default: all)")


def _run(arguments: argparse.Namespace) -> None:
    from study.equations import terms

    found = tuple(terms.LIBRARY.values())
    if arguments.name:
        found = (
            (terms.LIBRARY[arguments.name],) if arguments.name in terms.LIBRARY else terms.find_terms(arguments.name)
        )
    print(details(found[0]) if len(found) == 1 else terms_table(found))


def terms_table(library: "tuple[Term, ...]", width: int | None = None) -> str:
    """The terms as a table, the two columns of prose wrapped so that it fits the width in characters."""
    from tabulate import tabulate

    rows = [[t.name, t.formula, ", ".join(p.name for p in t.parameters), t.meaning, t.cause] for t in library]
    head = ["term", "formula", "shape parameters", "meaning", "common cause"]
    width = width or shutil.get_terminal_size((160, 24)).columns
    fixed = sum(max(len(head[column]) + 2, *(len(row[column]) for row in rows)) + 2 for column in range(3))
    prose = max(24, (width - fixed - 2) // 2)
    text = tabulate(rows, head, tablefmt="simple", maxcolwidths=[None, None, None, prose, prose])
    return (
        f"{text}\n\nu displacement, v velocity, t time. 'study terms NAME' shows one with its coefficients and units."
    )


def details(term: "Term") -> str:
    """One term: formula, physics, coefficients and shape parameters with their SI units, its line in a model."""
    from tabulate import tabulate

    from study.figures.labels import SHAPE_UNITS

    rows = [["coefficient", s, term.unit(s, "N", "m"), _shape(term, s)] for s in term.symbols]
    rows += [["shape parameter", p.name, SHAPE_UNITS[p.quantity], p.meaning] for p in term.parameters]
    listing = tabulate(
        rows, ["", "symbol", "SI unit", "stands before, or is"], tablefmt="simple", disable_numparse=True
    )
    values = ["value"] if len(term.symbols) == 1 else ["amplitude", "phase"]
    given = ", ".join(f"{name}: ..." for name in (*(p.name for p in term.parameters), *values))
    return (
        f"{term.name}: {term.formula}\n  meaning       {term.meaning}\n  common cause  {term.cause}\n\n{listing}\n\n"
        f"In a model file:\n  - {term.name}\n  - {{term: {term.name}, {given}}}"
    )


def _shape(term: "Term", symbol: str) -> str:
    component = next(c for c in term.components if c.symbol == symbol)
    derivative = {0: "", 1: "d/dt ", 2: "d2/dt2 "}[component.order]
    factor = "" if component.factor == 1.0 else f"{component.factor:.6g} "
    return f"{factor}{derivative}{component.shape}"


COMMAND = Command(
    "terms",
    "list the effects a model may hold",
    "study terms\n  study terms cubic_stiffness\n  study terms friction",
    _arguments,
    _run,
)
