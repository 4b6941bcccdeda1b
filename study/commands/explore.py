"""``study explore``: the four steps on a page in the browser."""

import argparse
from pathlib import Path

from study.commands.command import Command, whole
from study.commands.record_arguments import add_reading_arguments, out_folder, prepared_of, read_records

QUIET = 2.0  # seconds of work before progress is shown


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("records", type=Path, nargs=1, metavar="RECORD", help="CSV, MATLAB, HDF5, UFF or Parquet")
    parser.add_argument("--model", type=Path, required=True, help="model file (YAML); what it gives is held")
    parser.add_argument("--out", type=Path, help="folder that Save writes to (default results/RECORD)")
    parser.add_argument("--port", type=whole(0, 65535), help="of the page; 0 for any (default 5006 if free)")
    parser.add_argument("--no-browser", action="store_true", help="say the address and open nothing")
    add_reading_arguments(parser)


def _run(arguments: argparse.Namespace) -> None:
    from study.support.extras import needed

    needed("bokeh", "'study explore'", "explore")
    from tqdm import tqdm

    from study.compare import history
    from study.compare.comparison import STEPS
    from study.equations.model_file import WANTED, parse_model
    from study.explore import session as sessions
    from study.explore.desk import Desk
    from study.explore.server import serve
    from study.support.file_sets import check_folder
    from study.support.files import read_text

    folder = out_folder(arguments)
    check_folder(folder)
    text = read_text(arguments.model, WANTED)
    model = parse_model(text, arguments.model)
    steps = history.read(arguments.model)
    (record,) = read_records(arguments)
    prepared = prepared_of(arguments, record)
    with tqdm(total=STEPS, delay=QUIET, leave=False, unit="step") as bar:

        def told(what: str) -> None:
            bar.set_description(what, refresh=False)
            bar.update()

        session = sessions.begin(model, prepared, earlier=steps, progress=told)
    desk = Desk(session, arguments.model, text, folder)
    try:
        serve(desk, arguments.port, lambda address: _ready(address, not arguments.no_browser))
    except KeyboardInterrupt:
        print("\nended; what was not saved is gone")


def _ready(address: str, browser: bool) -> None:
    import webbrowser

    print(f"{address} shows the session; Ctrl-C ends it", flush=True)
    if browser:
        webbrowser.open(address)


COMMAND = Command(
    "explore", "the four steps on a page in the browser",
    "study explore rig.csv --model rig.yaml\n  study explore rig.csv --model rig.yaml --port 5100 --no-browser",
    _arguments, _run,
)  # fmt: skip
