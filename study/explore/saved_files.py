"""What Save writes: the model file with its comments, the history, the pictures, and the session as one page."""

from collections.abc import Mapping, Sequence
from typing import Any

from study.compare import history
from study.compare.comparison_report import as_json, comparison_document, tables
from study.diagnose.diagnosis_files import diagnosis_files
from study.equations import model_file
from study.explore.saved import saved
from study.explore.session import Session, Stage
from study.support.extras import undrawn

PAGE = "explore.html"


def files(
    session: Session, name: str, text: str, values: bool = False, drawn: Mapping[str, bytes] | None = None
) -> dict[str, bytes]:
    """Contents by file name, of a session whose model came from a file of this name and text: its comments stay.

    With ``values`` the model file gives what was fitted, and a fit of it holds that; otherwise what the session holds.
    ``drawn`` is what :func:`of_stage` gives of the present model, where that is known.
    """
    now = session.now
    model = now.model.with_values(now.values) if values else now.model
    for one in session.several.separate:  # terms that tell the records of this session apart belong to it alone
        for term in [t.name for t in model.terms if set(t.symbols) & set(one.differences)]:
            model = model.without_term(term)
    shown = of_stage(now, by_level=not session.several.separate) if drawn is None else drawn
    steps = session.steps
    return {
        name: model_file.revised(text, name, model).encode(),
        history.name_for(name): history.as_bytes(steps),
        **_history_picture(steps, name.rpartition(".")[0] or name),
        PAGE: saved(session),
        **shown,
    }


def of_stage(now: Stage, by_level: bool = True) -> dict[str, bytes]:
    """Tables of one model, and pictures if they can be drawn, on each of its records and, if ``by_level``, by level."""
    each = now.on_each or (now.comparison,)
    levels = now.by_record.levels if now.by_record is not None and by_level else ()
    contents = {
        "comparison.json": as_json(comparison_document(each, levels)),
        **{f"{table}.csv": content for table, content in tables(each, levels).items()},
    }
    if now.diagnosis is not None:
        contents |= diagnosis_files(now.diagnosis, now.said, now.unneeded or ())
    if undrawn():
        return contents
    from study.compare.comparison_pictures import comparison_pictures, level_pictures

    for comparison in each:
        prefix = f"{comparison.record.name}_" if len(each) > 1 else ""
        contents |= {prefix + name: content for name, content in comparison_pictures(comparison).items()}
    return contents | level_pictures(levels, now.comparison.record.force_and_length[0])


def _history_picture(steps: Sequence[dict[str, Any]], name: str) -> dict[str, bytes]:
    if undrawn():
        return {}
    from study.compare.history_picture import history_files

    return history_files(steps, name)
