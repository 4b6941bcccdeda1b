"""``study export``: a model as a Python function, an FMU or a Modelica class."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import Command, finite_number
from study.commands.record_arguments import accounted_together, add_reading_arguments, read_records

if TYPE_CHECKING:
    from study.equations.model import Model
    from study.records.record import Record


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML); with --data, what it leaves open is fitted first")
    ways, to = ("python", "fmu", "modelica"), "a function for solve_ivp, an FMU (FMI 2.0), or a Modelica class"
    parser.add_argument("--to", choices=ways, required=True, help=to)
    parser.add_argument(
        "--data", dest="records", type=Path, nargs="+", default=[], metavar="RECORD",
        help="record whose units the values have, and to which open ones are fitted (default: N, m and s)",
    )  # fmt: skip
    parser.add_argument(
        "--step", type=finite_number(above=0.0),
        help="largest internal step of an FMU in s (default: from the fastest oscillation about rest)",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="where to (default MODEL.py, MODEL.fmu or MODEL.mo)")
    add_reading_arguments(parser)


def _run(arguments: argparse.Namespace) -> None:
    from study.equations.model_file import read_model
    from study.export import ways
    from study.records.readers.options import options_beside
    from study.support.errors import at
    from study.support.files import keep, replace_file

    path: Path = arguments.model
    out: Path = arguments.out or Path(path.stem + ways.SUFFIX_OF[arguments.to])
    keep([path, *arguments.records, *(options_beside(record) for record in arguments.records)], [out])
    model, record = read_model(path), None
    if arguments.records:
        model, record = _fitted(arguments, model)
    with at(path):
        content = ways.exported_file(model, arguments.to, record, arguments.step)
    replace_file(out, content)
    print(f"{out}: {model.name} with {', '.join(f'{key} = {value:g}' for key, value in model.numbers().items())}")


def _fitted(arguments: argparse.Namespace, model: "Model") -> "tuple[Model, Record]":
    """The model with what it left open fitted, and the record in the units of its values."""
    found = accounted_together(arguments, model, read_records(arguments, model), arguments.records[0]).comparison
    return found.fit.model, found.record


COMMAND = Command(
    "export", "a model as a function for solve_ivp, an FMU or a Modelica class",
    "study export rig.yaml --to fmu\n"
    "  study export rig.yaml --to python --data rig.csv     # fits what the model leaves open",
    _arguments, _run,
)  # fmt: skip
