"""``study add``: add an effect to a model, fit again, and see the error before and after."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands import structures
from study.commands.command import Command, progress
from study.commands.record_arguments import (
    accounted_for,
    add_out_argument,
    add_reading_arguments,
    out_folder,
    read_records,
    sources,
    written_together,
)

if TYPE_CHECKING:
    from study.compare.comparison import Comparison
    from study.diagnose.needless import Needless
    from study.equations.model import Model
    from study.equations.terms import Term


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML); the term is added to it")
    parser.add_argument("term", help="an effect of the library, or a name for your own with --force")
    parser.add_argument("--force", metavar="FORMULA", help="formula of your own effect, such as 'u*abs(u)'")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--between", nargs=2, metavar="PLACE", help="of a structure: two coordinates, or 'ground' and one"
    )
    where.add_argument("--at", metavar="COORDINATE", help="of a structure: the coordinate that it acts on")
    parser.add_argument("--data", dest="records", type=Path, nargs="+", required=True, metavar="RECORD")
    add_reading_arguments(parser)
    add_out_argument(parser)


def _run(arguments: argparse.Namespace) -> None:
    from study.equations.model_file import read_model, text_with
    from study.support.files import locked

    folder = out_folder(arguments)
    first = read_model(arguments.model)
    if first.named:
        structures.add(arguments, first)
        return
    term = _term(arguments)
    _refuse_second(arguments.model, first, term)
    with locked(arguments.model):  # another run may have changed it meanwhile
        model = read_model(arguments.model)
        _refuse_second(arguments.model, model, term)
        _added(arguments, model, term, text_with(arguments.model, term), folder)


def _added(arguments: argparse.Namespace, model: "Model", term: "Term", text: str, folder: Path) -> None:
    """Fit without and with the term, write model and history, and say what was reached."""
    from study.compare import history
    from study.compare.comparison_report import as_json, comparison_document, comparison_summary, history_step
    from study.diagnose.adding import added
    from study.diagnose.needless import needless, of_records

    steps = history.read_history(arguments.model)
    records = read_records(arguments)
    pairs: list[tuple[Comparison, Comparison]] = []
    unneeded: list[tuple[Needless, ...]] = []
    with progress(" fits", 3 * len(records)) as step:
        for record, path in zip(records, sources(arguments), strict=True):
            before = accounted_for(arguments, model, record, path).comparison
            step("")
            pairs.append((before, added(before, term)))
            step("")
            unneeded.append(needless(pairs[-1][1], besides=(term.name,)))
            step("")
    said = of_records([record.name for record in records], unneeded, any_more=True)
    for before, after in pairs:
        steps = history.with_step(steps, history_step(before), history_step(after, term.name))
    written_together(arguments, text, steps, as_json(comparison_document([after for _, after in pairs])), folder)
    print(comparison_summary([after for _, after in pairs]))
    print("\n" + history.history_table(steps) + (f"\n\n{said}" if said else ""))


def _term(arguments: argparse.Namespace) -> "Term":
    from study.equations import terms

    if arguments.force is not None:
        return terms.custom(arguments.term, arguments.force)
    return terms.get(arguments.term)


def _refuse_second(path: Path, model: "Model", term: "Term") -> None:
    from study.equations.redundancy import repeated_force
    from study.support.errors import expect

    expect(
        term.name not in model,
        f"{path}: {term.name} is in the model already; expected another effect, each can be added once",
    )
    fault = repeated_force(model.with_term(term))
    expect(fault is None, f"{path}: {fault}")


COMMAND = Command(
    "add", "add an effect, fit again: error before and after",
    "study add rig.yaml quadratic_damping --data rig.csv\n"
    "  study add rig.yaml bracket --force \"u*abs(u)\" --data rig.csv\n"
    "  study add frame.yaml one_sided_contact --between floor2 floor3 --data frame.csv",
    _arguments, _run,
)  # fmt: skip
