"""A climb of a structure: diagnose, add what is missing where it is missing, and again."""

import argparse
from pathlib import Path
from typing import Any

from study.commands.record_arguments import accounted_together, read_records
from study.compare import history
from study.compare.history_picture import history_files as history_pictures
from study.diagnose.diagnosis_files import diagnosis_files
from study.diagnose.diagnosis_report import candidate_table
from study.diagnose.verdict import MISSING
from study.equations.model import Model
from study.equations.model_file import WANTED
from study.explore import placed_session as sessions
from study.explore.placed_page import structure_files
from study.explore.saved_files import PAGE
from study.support.files import read_text, write_files

SAVED = "climb.html"  # the whole climb as one page


def structure_climb(arguments: argparse.Namespace, model: Model, steps: int, folder: Path) -> list[dict[str, Any]]:
    """Begin with a structure and add the first candidate of each diagnosis, at most ``steps``.

    The folder gets ``climb/`` with the structure reached, its comparison, pictures and a folder for each diagnosis,
    ``climb.html`` with all of it to step through, ``history.json`` and the history's picture.
    """
    work, text = folder / "climb", read_text(arguments.model, WANTED)
    (record,) = read_records(arguments, model)
    session = sessions.begin_placed(accounted_together(arguments, model, [record], arguments.records[0]).comparison)
    for number in range(steps + 1):
        stage = sessions.examined(session)
        session, diagnosis = sessions.with_stage(session, stage), stage.diagnosis
        assert diagnosis is not None, "a stage that was examined has a diagnosis"
        write_files(work / f"step_{number}", diagnosis_files(diagnosis, stage.said, stage.unneeded))
        print(f"{candidate_table(diagnosis)}\n\n{stage.said}\n", flush=True)
        if diagnosis.verdict != MISSING or number == steps:
            break
        session = sessions.with_placed(session, diagnosis.candidates[0].name)
    saved = structure_files(session, arguments.model.name, text)
    write_files(folder, {SAVED: saved.pop(PAGE), "history.json": history.as_bytes(session.steps)})
    write_files(folder, history_pictures(session.steps, model.name))
    write_files(work, saved)
    print(history.history_table(session.steps))
    return session.steps
