"""A climb: diagnose, add what is missing, and again, until nothing is missing that has a name."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from study.commands.parser import parser
from study.commands.record_arguments import accounted_together, read_records
from study.compare import history
from study.compare.history_picture import history_files as history_pictures
from study.diagnose import diagnosis_report
from study.diagnose.diagnosis_files import diagnosis_files
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import Diagnosis
from study.equations.model_file import MODEL_FILE, parse_model
from study.explore import PAGE
from study.explore import session as sessions
from study.explore.saved import files
from study.explore.session import Session
from study.support.files import read_text, write_files

SAVED = "climb.html"  # the whole climb as one page


def climb(
    records: Sequence[Path], model: Path, options: Sequence[str], steps: int, folder: Path
) -> list[history.Step]:  # fmt: skip
    """Begin with a model and add the first candidate of each diagnosis to it, as a user of ``study explore`` would.

    The model file stays as it is. The folder gets ``climb/`` (the model reached, its history and pictures, and a folder
    for each diagnosis), ``climb.html``, ``history.json`` and the history's picture; what an earlier climb left there is
    removed. The options are those of the command line: how the record is read, fitted and judged. At most ``steps``
    effects are added. One model is fitted to all ``records``.

    What the model does not need any more after an addition is taken out again. So that the climb ends, a term that was
    taken out comes back only where the error falls below all that was reached.
    """
    arguments = parser().parse_args(["diagnose", *map(str, records), "--model", str(model), *options])
    text = read_text(model, MODEL_FILE)
    first = parse_model(text, model)
    work = folder / "climb"
    shutil.rmtree(work, ignore_errors=True)
    together = accounted_together(arguments, first, read_records(arguments, first), records[0])
    session = sessions.begin_with(together)
    for number in range(steps + 1):
        session, diagnosis = _diagnosed(session, work / f"step_{number}")
        if diagnosis.answer is None or number == steps or _in_a_circle(session, diagnosis.answer):
            break
        session = _stepped_back(sessions.with_added(session, diagnosis.answer.name))
    saved = files(session, model.name, text)
    write_files(folder, {SAVED: saved.pop(PAGE), "history.json": history.as_bytes(session.steps)})
    write_files(folder, history_pictures(session.steps, model.stem))
    write_files(work, saved)
    print(history.history_table(session.steps))
    return session.steps


def _in_a_circle(session: Session, first: Ranked) -> bool:
    """Whether a candidate was taken out before and would bring no model that is better than all so far."""
    least = min(stage.comparison.prediction.error for stage in session.stages)
    again = bool({stage.dropped for stage in session.stages} & set(first.names)) and first.response_error >= least
    if again:
        print(f"{first.name} was taken out before and brings nothing that was not reached: the climb ends\n")
    return again


def _stepped_back(session: Session) -> Session:
    """The session without what its model does not need any more after an addition."""
    added = (session.now.added or "").split(" + ")
    while True:
        session = sessions.weighed(session)
        found = [n for n in session.now.unneeded or () if n.name not in added]
        if not found:
            return session
        print(found[0].sentence(any_more=True) + "\n")
        session = sessions.dropped(session, found[0].name)


def _diagnosed(session: Session, folder: Path) -> tuple[Session, Diagnosis]:
    """The session with its present model diagnosed, printed and written into a folder; and the diagnosis."""
    now, diagnosis = sessions.examined(session)
    print(f"{now.label}: {diagnosis.verdict.replace('_', ' ')}")
    print(diagnosis_report.candidate_table(diagnosis))
    print(f"\n{now.said}\n", flush=True)
    write_files(folder, diagnosis_files(diagnosis, now.said, now.unneeded or ()))
    return sessions.with_stage(session, now), diagnosis
