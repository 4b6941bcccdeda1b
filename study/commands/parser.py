"""The parser of the command line, made of the table of commands.

A new command is one module in ``study/commands`` and one entry in :data:`COMMANDS`.
"""

import argparse
from typing import NoReturn

from study import __doc__ as summary
from study import __version__
from study.commands import (
    add,
    campaign,
    compare,
    data,
    diagnose,
    drop,
    explore,
    export,
    history,
    plan,
    report,
    simulate,
    terms,
    trial,
)
from study.commands.command import Command
from study.support.errors import StudyError

COMMANDS: tuple[Command, ...] = (
    compare.COMMAND, diagnose.COMMAND, plan.COMMAND, report.COMMAND, add.COMMAND, drop.COMMAND, history.COMMAND,
    explore.COMMAND,
    campaign.COMMAND, terms.COMMAND, simulate.COMMAND, export.COMMAND, trial.COMMAND,
    data.COMMAND,
)  # fmt: skip
EXAMPLE = (
    "study compare rig.csv --model rig.yaml      # how good is the model, and where does it fail?\n"
    "  study diagnose rig.csv --model rig.yaml     # which effect is missing from it?\n"
    "  study add rig.yaml cubic_stiffness --data rig.csv"
)


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints are one sentence, like all others, and whose help begins with the example."""

    example = ""

    def format_help(self) -> str:
        """What ``--help`` shows: first what to type."""
        return f"example:\n  {self.example}\n\n{super().format_help()}" if self.example else super().format_help()

    def error(self, message: str) -> NoReturn:
        raise StudyError(f"{message}; see '{self.prog} --help'")


def parser() -> argparse.ArgumentParser:
    """The parser of the command line with every command of the table."""
    root = _Parser(
        "study", description=str(summary).partition("\n")[0],
        epilog="'study COMMAND --help' shows a command's options.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    root.example = EXAMPLE
    root.add_argument("--version", action="version", version=f"study {__version__}")
    commands = root.add_subparsers(title="commands", metavar="COMMAND", required=True, dest="command")
    for command in COMMANDS:
        child = commands.add_parser(
            command.name, help=command.summary, description=command.summary,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        child.example = command.example
        command.arguments(child)
        child.set_defaults(run=command.run)
    return root
