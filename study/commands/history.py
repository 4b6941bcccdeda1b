"""``study history``: the models tried so far, with their errors and the noise floor."""

import argparse
from pathlib import Path

from study.commands.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML) that 'study add' or 'drop' changed")
    parser.add_argument("--out", type=Path, help="also draw the history and write history.json there")


def _run(arguments: argparse.Namespace) -> None:
    from study.compare import history
    from study.equations.model_file import read_model

    read_model(arguments.model)
    steps = history.read_history(arguments.model)
    if not steps:
        print(f"{arguments.model}: no history yet; 'study add' and 'drop' keep one")
        return
    print(history.history_table(steps))
    if arguments.out is not None:
        from study.support.extras import DRAWING, needed
        from study.support.files import check_folder, write_files

        needed(*DRAWING)
        from study.compare.history_picture import history_files

        check_folder(arguments.out)
        found = history_files(steps, arguments.model.stem) | {"history.json": history.as_bytes(steps)}
        write_files(arguments.out, found, [arguments.model, history.path_of(arguments.model)])


COMMAND = Command(
    "history", "all models so far, with error and noise floor",
    "study history rig.yaml\n  study history rig.yaml --out results/rig", _arguments, _run,
)  # fmt: skip
