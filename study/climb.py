"""A climb: diagnose, add what is missing, and again, until nothing is missing that has a name."""

import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from study import cli, ladder
from study.diagnose.verdict import MISSING
from study.errors import StudyError


def run(*words: str) -> None:
    """A command of the command line, within a step of the workflow.

    Raises
    ------
    SystemExit
        With its exit code, if it failed; it has said why.
    """
    code = cli.main(words)
    if code:
        sys.exit(code)


def climb(record: Path, model: Path, options: Sequence[str], steps: int, folder: Path) -> list[ladder.Step]:
    """Begin with a copy of a model and add the first candidate of each diagnosis to it.

    Parameters
    ----------
    record, model : Path
        The measured record, and the model file, which stays as it is.
    options : sequence of str
        How the record is read, fitted and judged, as on the command line.
    steps : int
        Effects to add at most.
    folder : Path
        Gets ``climb/`` (the model as it grows, its ladder and a folder for each diagnosis),
        ``history.json`` and the ladder's picture. What an earlier climb left there is removed.

    Returns
    -------
    list of dict
        The ladder.

    Raises
    ------
    StudyError
        If a file cannot be read or written.
    """
    work = folder / "climb"
    own = work / model.name
    try:
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir(parents=True)
        shutil.copyfile(model, own)
    except OSError as error:
        raise StudyError(f"{own} cannot be written: {error.strerror}; a writable folder is right") from None
    for number in range(steps + 1):
        step = work / f"step_{number}"
        run("diagnose", str(record), "--model", str(own), *options, "--out", str(step))
        found = json.loads((step / "diagnosis.json").read_text(encoding="utf-8"))
        if found["verdict"] != MISSING or number == steps:
            break
        term = found["candidates"][0]["term"]
        run("add", str(own), term, "--data", str(record), *options, "--out", str(step))
    run("history", str(own), "--out", str(folder))
    return ladder.read(own)
