"""What ``study add`` and ``study drop`` share: arguments, the fits before and after, what is written and told."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import progress
from study.commands.record_arguments import (
    accounted_together,
    add_out_argument,
    add_reading_arguments,
    read_records,
    sources,
    written_together,
)

if TYPE_CHECKING:
    from study.compare.comparison import Comparison
    from study.diagnose.needless import Needless
    from study.equations.model import Model


def add_revision_arguments(parser: argparse.ArgumentParser, between: str) -> None:
    """Where in a structure the term is, the records, how to read them, and where results go."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--between", nargs=2, metavar="PLACE", help=f"of a structure: {between}")
    where.add_argument("--at", metavar="COORDINATE", help="of a structure: the coordinate that it acts on")
    parser.add_argument(
        "--data", dest="records", type=Path, nargs="+", required=True, metavar="RECORD",
        help="the record to fit the model to, or several",
    )  # fmt: skip
    add_reading_arguments(parser)
    add_out_argument(parser)


def revise(
    arguments: argparse.Namespace, model: "Model", text: str, folder: Path,
    change: "Callable[[Comparison], Comparison]", *, added: str | None = None, dropped: str | None = None,
) -> None:  # fmt: skip
    """Fit the model and the changed one to every record, write model and history, and say what was reached.

    ``text`` is the model file's with the change, which is a term ``added`` or ``dropped``. A term that raises the error
    of each record is not added, unless the arguments say ``anyway``: then nothing is written.
    """
    from study.compare import history
    from study.compare.comparison_report import as_json, comparison_document, comparison_summary, history_step
    from study.diagnose.needless import needless, of_records
    from study.figures.labels import term_names
    from study.support.numbers import percent

    steps, records = history.read_history(arguments.model), read_records(arguments, model)
    before: list[Comparison] = []
    after: list[Comparison] = []
    unneeded: list[tuple[Needless, ...]] = []
    with progress(" fits", 3 * len(records)) as step:
        for record, path in zip(records, sources(arguments), strict=True):
            before.append(accounted_together(arguments, model, [record], path).comparison)
            step("")
            after.append(change(before[-1]))
            step("")
            unneeded.append(needless(after[-1], besides=(added,) if added else ()))
            step("")
    said = of_records([record.name for record in records], unneeded, any_more=added is not None)
    for first, second in zip(before, after, strict=True):
        steps = history.with_step(steps, history_step(first), history_step(second, added, dropped))
    errors = [(percent(b.prediction.error), percent(a.prediction.error)) for b, a in zip(before, after, strict=True)]
    rises = all(a.prediction.error > b.prediction.error for b, a in zip(before, after, strict=True))
    if added and rises and not arguments.anyway and all(b != a for b, a in errors):
        several, name = len(records) > 1, term_names(added)
        each = [f"from {b} to {a}{f' in {r.name}' * several}" for r, (b, a) in zip(records, errors, strict=True)]
        print(comparison_summary(after))
        print(
            f"\n{name[0].upper()}{name[1:]} raises the held-out error, {', '.join(each)}: {arguments.model} is left "
            "as it was, and nothing is written (--anyway adds it all the same)."
        )
        return
    written_together(arguments, text, steps, as_json(comparison_document(after)), folder)
    print(comparison_summary(after))
    print("\n" + history.history_table(steps) + (f"\n\n{said}" if said else ""))
