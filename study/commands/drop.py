"""``study drop``: take an effect out of a model, fit again, and see the error before and after."""

import argparse
from pathlib import Path

from study.commands.command import Command
from study.commands.record_arguments import out_folder
from study.commands.revision import add_revision_arguments, revise


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML); the term is taken out of it")
    parser.add_argument("term", help="an effect of the model")
    add_revision_arguments(parser, "where the term is")


def _run(arguments: argparse.Namespace) -> None:
    from study.diagnose.dropping import compared_without, term_at
    from study.equations import layout
    from study.equations.model_file import read_model, text_without
    from study.support.errors import at
    from study.support.files import locked

    folder = out_folder(arguments)
    read_model(arguments.model)
    with locked(arguments.model):  # another run may have changed it meanwhile
        model = read_model(arguments.model)
        with at(arguments.model):
            where: dict[object, object] = {"at": arguments.at} if arguments.at else {}
            where |= {"between": arguments.between} if arguments.between else {}
            place = layout.place_of_entry(where, arguments.term, model.coordinates) if where else None
            name = term_at(model, arguments.term, place)
        text = text_without(arguments.model, name)
        revise(arguments, model, text, folder, lambda before: compared_without(before, name), dropped=name)


COMMAND = Command(
    "drop", "take an effect out, fit again: error before and after",
    "study drop rig.yaml hysteresis --data rig.csv\n"
    "  study drop frame.yaml cubic_stiffness --between floor2 floor3 --data frame.csv",
    _arguments, _run,
)  # fmt: skip
