"""``study drop``: take an effect out of a model, fit again, and see the error before and after."""

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


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML); the term is taken out of it")
    parser.add_argument("term", help="an effect of the model")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--between", nargs=2, metavar="PLACE", help="of a structure: where the term is")
    where.add_argument("--at", metavar="COORDINATE", help="of a structure: the coordinate that it acts on")
    parser.add_argument("--data", dest="records", type=Path, nargs="+", required=True, metavar="RECORD")
    add_reading_arguments(parser)
    add_out_argument(parser)


def _run(arguments: argparse.Namespace) -> None:
    from study.diagnose.dropping import check_can_go
    from study.equations.model_file import read_model, text_without
    from study.support.errors import at
    from study.support.files import locked

    folder = out_folder(arguments)
    read_model(arguments.model)
    with locked(arguments.model):  # another run may have changed it meanwhile
        model, name = read_model(arguments.model), arguments.term
        if model.named:
            with at(arguments.model):
                name = _placed(arguments, model)
            structures.drop(arguments, model, name, text_without(arguments.model, name))
            return
        with at(arguments.model):
            check_can_go(model, name)
        _dropped(arguments, model, text_without(arguments.model, name), folder)


def _placed(arguments: argparse.Namespace, model: "Model") -> str:
    """Name of the term of a structure that is meant: by name and place, or by its name with the place in brackets."""
    from study.equations import layout
    from study.structure.placed_dropping import term_at

    where: dict[object, object] = {"at": arguments.at} if arguments.at else {}
    where |= {"between": arguments.between} if arguments.between else {}
    place = layout.place_of_entry(where, arguments.term, model.coordinates) if where else None
    return term_at(model, arguments.term, place)


def _dropped(arguments: argparse.Namespace, model: "Model", text: str, folder: Path) -> None:
    """Fit with and without the term, write model and history, and say what was reached."""
    from study.compare import history
    from study.compare.comparison_report import as_json, comparison_document, comparison_summary, history_step
    from study.diagnose.dropping import compared_without
    from study.diagnose.needless import needless, of_records

    steps, name = history.read_history(arguments.model), arguments.term
    records = read_records(arguments)
    pairs: list[tuple[Comparison, Comparison]] = []
    unneeded: list[tuple[Needless, ...]] = []
    with progress(" fits", 3 * len(records)) as step:
        for record, path in zip(records, sources(arguments), strict=True):
            before = accounted_for(arguments, model, record, path).comparison
            step("")
            pairs.append((before, compared_without(before, name)))
            step("")
            unneeded.append(needless(pairs[-1][1]))
            step("")
    said = of_records([record.name for record in records], unneeded)
    for before, after in pairs:
        steps = history.with_step(steps, history_step(before), history_step(after, dropped=name))
    written_together(arguments, text, steps, as_json(comparison_document([after for _, after in pairs])), folder)
    print(comparison_summary([after for _, after in pairs]))
    print("\n" + history.history_table(steps) + (f"\n\n{said}" if said else ""))


COMMAND = Command(
    "drop", "take an effect out, fit again: error before and after",
    "study drop rig.yaml hysteresis --data rig.csv\n"
    "  study drop frame.yaml cubic_stiffness --between floor2 floor3 --data frame.csv",
    _arguments, _run,
)  # fmt: skip
