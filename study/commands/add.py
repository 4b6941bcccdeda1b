"""``study add``: add an effect to a model, fit again, and see the error before and after."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import Command
from study.commands.record_arguments import ALTERNATE, out_folder
from study.commands.revision import add_revision_arguments, revise

if TYPE_CHECKING:
    from study.equations.model import Model, ModelTerm
    from study.equations.terms import Term


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML); the term is added to it")
    parser.add_argument("term", help="an effect of the library, or a name for your own with --force")
    parser.add_argument("--force", metavar="FORMULA", help="formula of your own effect, such as 'u*abs(u)'")
    parser.add_argument(
        "--varies-with", metavar="WHAT", help="its coefficient changes with 'time', or with a channel of the record"
    )
    parser.add_argument(
        "--shape", choices=("curve", "line", "step"), default="curve", help="how (default: %(default)s)"
    )
    parser.add_argument(
        "--only", choices=("v > 0", "v < 0", "u > 0", "u < 0"), default="", help="for one side of the motion only"
    )
    parser.add_argument("--anyway", action="store_true", help="add it even where it raises the error")
    add_revision_arguments(parser, "two coordinates, or 'ground' and one")


def _run(arguments: argparse.Namespace) -> None:
    from study.diagnose.adding import added
    from study.equations import terms
    from study.equations.model_file import read_model, text_with
    from study.equations.variation import Variation, varying
    from study.support.files import locked

    folder = out_folder(arguments)
    term = terms.get(arguments.term) if arguments.force is None else terms.custom(arguments.term, arguments.force)
    if arguments.varies_with:
        term = varying(Variation(term, arguments.varies_with, arguments.shape, side=arguments.only))
        if not (arguments.fit or arguments.judge):  # each part has to see all of what it varies with
            arguments.judge = ALTERNATE
    _entry(arguments, read_model(arguments.model), term)
    with locked(arguments.model):  # another run may have changed it meanwhile
        model = read_model(arguments.model)
        entry = _entry(arguments, model, term)
        text = text_with(arguments.model, entry)
        revise(arguments, model, text, folder, lambda before: added(before, entry), added=entry.name)


def _entry(arguments: argparse.Namespace, model: "Model", term: "Term") -> "ModelTerm":
    """The term at its place, which the model has not; refused where the model cannot have it there."""
    from study.equations import layout
    from study.equations.model import free
    from study.equations.redundancy import repeated_force
    from study.equations.variation_entry import refuse_loose_changes
    from study.support.errors import at, expect

    with at(arguments.model):
        where: dict[object, object] = {"at": arguments.at} if arguments.at else {}
        where |= {"between": arguments.between} if arguments.between else {}
        entry = free(term, layout.place_of_entry(where, term.name, model.coordinates))
        sentence = f"{entry.name} is in the model already; expected another effect, each can be added once"
        expect(entry.name not in model, sentence)
        if model.named:
            layout.check(model.with_term(entry))
        else:
            fault = repeated_force(model.with_term(entry))
            expect(fault is None, f"{fault}")
        refuse_loose_changes(model.with_term(entry))
    return entry


COMMAND = Command(
    "add", "add an effect, fit again: error before and after",
    "study add rig.yaml quadratic_damping --data rig.csv\n"
    "  study add rig.yaml bracket --force \"u*abs(u)\" --data rig.csv\n"
    "  study add rig.yaml linear_stiffness --varies-with time --data rig.csv  # a smooth curve along the record\n"
    "  study add frame.yaml one_sided_contact --between floor2 floor3 --data frame.csv",
    _arguments, _run,
)  # fmt: skip
