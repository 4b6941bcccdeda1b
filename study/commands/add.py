"""``study add``: add an effect to a model, fit again, and see the error before and after."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands import structures
from study.commands.command import Command
from study.commands.record_arguments import out_folder
from study.commands.revision import add_revision_arguments, revise

if TYPE_CHECKING:
    from study.equations.model import Model
    from study.equations.terms import Term


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML); the term is added to it")
    parser.add_argument("term", help="an effect of the library, or a name for your own with --force")
    parser.add_argument("--force", metavar="FORMULA", help="formula of your own effect, such as 'u*abs(u)'")
    add_revision_arguments(parser, "two coordinates, or 'ground' and one")


def _run(arguments: argparse.Namespace) -> None:
    from study.diagnose.adding import added
    from study.equations import terms
    from study.equations.model_file import read_model, text_with
    from study.support.files import locked

    folder = out_folder(arguments)
    first = read_model(arguments.model)
    if first.named:
        structures.add(arguments, first)
        return
    term = terms.get(arguments.term) if arguments.force is None else terms.custom(arguments.term, arguments.force)
    _refuse_second(arguments.model, first, term)
    with locked(arguments.model):  # another run may have changed it meanwhile
        model = read_model(arguments.model)
        _refuse_second(arguments.model, model, term)
        text = text_with(arguments.model, term)
        revise(arguments, model, text, folder, lambda before: added(before, term), added=term.name)


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
