"""``study drop``: take an effect out of a model, fit again, and see the error before and after."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import Command, progress
from study.commands.record_arguments import (
    accounted_for,
    add_out_argument,
    add_reading_arguments,
    out_folder,
    read_records,
)

if TYPE_CHECKING:
    from study.compare.comparison import Comparison
    from study.diagnose.needless import Needless


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML); the term is taken out of it")
    parser.add_argument("term", help="an effect of the model")
    parser.add_argument("--data", dest="records", type=Path, nargs="+", required=True, metavar="RECORD")
    add_reading_arguments(parser)
    add_out_argument(parser)


def _run(arguments: argparse.Namespace) -> None:
    from study.compare import history
    from study.compare.comparison_report import as_json, document, history_step, summary
    from study.diagnose.dropping import check_can_go, dropped
    from study.diagnose.needless import needless, of_records
    from study.equations.model_file import drop_term, read_model, text_without
    from study.support.errors import at
    from study.support.file_sets import write_files

    folder = out_folder(arguments)
    model, name = read_model(arguments.model), arguments.term
    with at(arguments.model):
        check_can_go(model, name)
    text_without(arguments.model, name)  # refuses a layout that it cannot change, before anything is fitted
    steps = history.read(arguments.model)
    records = read_records(arguments)
    pairs: list[tuple[Comparison, Comparison]] = []
    unneeded: list[tuple[Needless, ...]] = []
    with progress(" fits", 3 * len(records)) as step:
        for record, path in zip(records, arguments.records, strict=True):
            before = accounted_for(arguments, model, record, path).comparison
            step("")
            pairs.append((before, dropped(before, name)))
            step("")
            unneeded.append(needless(pairs[-1][1]))
            step("")
    said = of_records([record.name for record in records], unneeded)
    for before, after in pairs:
        steps = history.climbed(steps, history_step(before), history_step(after, dropped=name))
    history.write(arguments.model, steps)
    drop_term(arguments.model, name)
    write_files(folder, {"comparison.json": as_json(document([after for _, after in pairs]))})
    print(summary([after for _, after in pairs]))
    print("\n" + history.table(steps) + (f"\n\n{said}" if said else ""))


COMMAND = Command(
    "drop", "take an effect out, fit again: error before and after",
    "study drop rig.yaml hysteresis --data rig.csv",
    _arguments, _run,
)  # fmt: skip
