"""What Save writes: the model file with its comments, the history, the pictures, and the session as one page."""

from study.compare import history
from study.compare.comparison_pictures import level_pictures, pictures
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
    each = now.on_each or (now.comparison,)
    levels = now.by_record.levels if now.by_record is not None and not session.several.separate else ()
    model = now.model.with_values(now.values) if values else now.model
    stem = name.rpartition(".")[0] or name
    contents = {
        name: model_file.revised(text, name, model).encode(),
        history.name_for(name): history.as_bytes(steps),
        "comparison.json": as_json(document(each, levels)),
        **{f"{table}.csv": content for table, content in tables(each, levels).items()},
        PAGE: saved(session),
    }
    for comparison in each:
        prefix = f"{comparison.record.name}_" if len(each) > 1 else ""
        contents |= {prefix + name: content for name, content in pictures(comparison).items()}
    contents |= level_pictures(levels, now.comparison.record.units.get("force", "N"))
    contents |= history_pictures(steps, stem)
    if now.diagnosis is not None:
        contents |= diagnosis_files(now.diagnosis, now.said, now.unneeded or ())
    return contents
