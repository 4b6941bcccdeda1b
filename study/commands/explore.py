"""``study explore``: compare, diagnose, add and save on a page in the browser."""

import argparse
from typing import TYPE_CHECKING

from study.commands.command import Command, progress, whole_number
from study.commands.record_arguments import (
    accounted_together,
    add_each_record_argument,
    add_record_arguments,
    inputs_of,
    out_folder,
    read_records,
    separated_records,
    sources,
)

if TYPE_CHECKING:
    from study.compare.history import Step
    from study.equations.model import Model
    from study.explore.session import Session


def _arguments(parser: argparse.ArgumentParser) -> None:
    add_record_arguments(parser, out="folder that Save writes to")
    add_each_record_argument(parser)
    parser.add_argument("--port", type=whole_number(0, 65535), help="of the page; 0 for any (default 5006 if free)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, open no browser")


def _run(arguments: argparse.Namespace) -> None:
    from study.equations.model_file import MODEL_FILE, parse_model
    from study.support.extras import needed

    needed("bokeh", "'study explore'", "explore")
    from study.compare import history
    from study.explore.desk import Desk
    from study.explore.server import serve
    from study.support.files import keep, read_text

    folder = out_folder(arguments)
    keep([arguments.model], [folder / arguments.model.name])
    text, steps = read_text(arguments.model, MODEL_FILE), history.read_history(arguments.model)
    model = parse_model(text, arguments.model)
    desk = Desk(_begun(arguments, model, steps), arguments.model, text, folder, inputs_of(arguments))
    try:
        serve(desk, arguments.port, lambda address: _ready(address, not arguments.no_browser))
    except KeyboardInterrupt:
        print("\nclosed; anything not saved is lost")


def _begun(arguments: argparse.Namespace, model: "Model", steps: "list[Step]") -> "Session":
    """The session with the model as given, on one record or fitted to several together and to each by itself."""
    from study.compare.comparison import REPORTS
    from study.explore import session as sessions
    from study.explore.session import Several, by_record, of_own
    from study.faults.accounting import Accounted

    records = read_records(arguments, model)
    together, marked, separate = separated_records(arguments, model, records)
    many = len(records) > 1 and not separate
    with progress("step", REPORTS * (1 + len(records) * many)) as step:
        found = accounted_together(arguments, together, marked, arguments.records[0], progress=step)
        own: list[Accounted] = []
        for record, path in zip(records, sources(arguments), strict=True) if many else ():
            own.append(accounted_together(arguments, model, [record], path, progress=step))
    comparisons = [a.comparison for a in own]
    several = Several(tuple(c.prepared for c in comparisons), tuple(records), separate)
    known = of_own(comparisons) if own else by_record(several, found.comparison) if separate else None
    return sessions.begin_with(found, earlier=steps, several=several, known=known)


def _ready(address: str, browser: bool) -> None:
    print(f"{address} shows the session; Ctrl-C ends it", flush=True)
    if browser:
        import webbrowser

        webbrowser.open(address)


COMMAND = Command(
    "explore", "compare, diagnose, add and save on a page in the browser",
    "study explore rig.csv --model rig.yaml\n"
    "  study explore low.csv mid.csv high.csv --model rig.yaml  # one model on all, and each record by itself\n"
    "  study explore rig.csv --model rig.yaml --port 5100 --no-browser",
    _arguments, _run,
)  # fmt: skip
