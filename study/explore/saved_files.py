"""What Save writes: the model file with its comments, the history, the pictures, and the session as one page."""

from study.compare import history
from study.compare.comparison_pictures import pictures
from study.compare.comparison_report import as_json, document, tables
from study.compare.history_picture import files as history_pictures
from study.diagnose.diagnosis_files import files as diagnosis_files
from study.equations import model_file
from study.explore.saved import saved
from study.explore.session import Session

PAGE = "explore.html"


def files(session: Session, name: str, text: str, values: bool = False) -> dict[str, bytes]:
    """Contents by file name, of a session whose model came from a file of this name and text: its comments stay.

    With ``values`` the model file gives what was fitted, and a fit of it holds that; otherwise what the session holds.
    """
    now, steps = session.now, session.steps
    model = now.model.with_values(now.values) if values else now.model
    stem = name.rpartition(".")[0] or name
    contents = {
        name: model_file.revised(text, name, model).encode(),
        history.name_for(name): history.as_bytes(steps),
        "comparison.json": as_json(document([now.comparison])),
        **{f"{table}.csv": content for table, content in tables([now.comparison]).items()},
        PAGE: saved(session),
    }
    contents |= pictures(now.comparison) | history_pictures(steps, stem)
    if now.diagnosis is not None:
        contents |= diagnosis_files(now.diagnosis, now.said, now.unneeded or ())
    return contents
