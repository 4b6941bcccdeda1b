"""``study drop``: take an effect out of a model, fit again, and see the error before and after."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands import structures
from study.commands.command import Command
from study.commands.record_arguments import out_folder
from study.commands.revision import add_revision_arguments, revise

if TYPE_CHECKING:
    from study.equations.model import Model


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML); the term is taken out of it")
    parser.add_argument("term", help="an effect of the model")
    add_revision_arguments(parser, "where the term is")


def _run(arguments: argparse.Namespace) -> None:
    from study.diagnose.dropping import check_can_go, compared_without
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
        text = text_without(arguments.model, name)
        revise(arguments, model, text, folder, lambda before: compared_without(before, name), dropped=name)


def _placed(arguments: argparse.Namespace, model: "Model") -> str:
    """Name of the term of a structure that is meant: by name and place, or by its name with the place in brackets."""
    from study.diagnose.dropping import term_at
    from study.equations import layout

    where: dict[object, object] = {"at": arguments.at} if arguments.at else {}
    where |= {"between": arguments.between} if arguments.between else {}
    place = layout.place_of_entry(where, arguments.term, model.coordinates) if where else None
    return term_at(model, arguments.term, place)


COMMAND = Command(
    "drop", "take an effect out, fit again: error before and after",
    "study drop rig.yaml hysteresis --data rig.csv\n"
    "  study drop frame.yaml cubic_stiffness --between floor2 floor3 --data frame.csv",
    _arguments, _run,
)  # fmt: skip
