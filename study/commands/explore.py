"""``study explore``: the four steps on a page in the browser."""

import argparse
from typing import TYPE_CHECKING, Any

from study.commands import structures
from study.commands.command import Command, progress, whole
from study.commands.record_arguments import (
    accounted_for,
    add_record_arguments,
    inputs_of,
    out_folder,
    read_records,
    refuse_groups,
)

if TYPE_CHECKING:
    from study.equations.model import Model
    from study.explore.session import Session


def _arguments(parser: argparse.ArgumentParser) -> None:
    add_record_arguments(parser, nargs=1, out="folder that Save writes to")
    parser.add_argument("--port", type=whole(0, 65535), help="of the page; 0 for any (default 5006 if free)")
    parser.add_argument("--no-browser", action="store_true", help="say the address and open nothing")


def _run(arguments: argparse.Namespace) -> None:
    from study.equations.model_file import WANTED, parse_model
    from study.support.extras import needed

    refuse_groups(arguments)
    needed("bokeh", "'study explore'", "explore")
    from study.compare import history
    from study.explore.desk import Desk
    from study.explore.live import AloneScene
    from study.explore.server import serve
    from study.support.file_sets import keep
    from study.support.files import read_text

    folder = out_folder(arguments)
    keep([arguments.model], [folder / arguments.model.name])
    text, steps = read_text(arguments.model, WANTED), history.read(arguments.model)
    model = parse_model(text, arguments.model)
    place = arguments.model, text, folder, inputs_of(arguments)
    desk: Desk[Any]
    if model.coordinates:
        from study.explore.placed_page import PLACED, PlacedScene

        desk, scene = Desk(structures.session(arguments, model, steps), *place, deeds=PLACED), PlacedScene
    else:
        desk, scene = Desk(_session(arguments, model, steps), *place), AloneScene
    try:
        serve(desk, arguments.port, lambda address: _ready(address, not arguments.no_browser), scene)
    except KeyboardInterrupt:
        print("\nended; what was not saved is gone")


def _session(arguments: argparse.Namespace, model: "Model", steps: "list[dict[str, Any]]") -> "Session":
    """A session of one coordinate with the model as it stands."""
    from study.compare.comparison import STEPS
    from study.explore import session as sessions

    (record,) = read_records(arguments)
    with progress("step", STEPS) as step:
        accounted = accounted_for(arguments, model, record, arguments.records[0], progress=step)
        return sessions.begin_with(accounted.comparison, earlier=steps)


def _ready(address: str, browser: bool) -> None:
    print(f"{address} shows the session; Ctrl-C ends it", flush=True)
    if browser:
        import webbrowser

        webbrowser.open(address)


COMMAND = Command(
    "explore", "the four steps on a page in the browser",
    "study explore rig.csv --model rig.yaml\n  study explore rig.csv --model rig.yaml --port 5100 --no-browser",
    _arguments, _run,
)  # fmt: skip
