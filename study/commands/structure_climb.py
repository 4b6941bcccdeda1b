"""A climb of a structure: diagnose, add what is missing where it is missing, and again."""

import argparse
from pathlib import Path
from typing import Any

from study.commands.structures import prepared_structures
from study.compare import history
from study.compare.comparison_report import as_json
from study.compare.history_picture import files as history_pictures
from study.equations.model import Model, free
from study.equations.model_file import format_model
from study.structure import structure_report
from study.structure.structure_comparison import compare_structure, document, history_step
from study.structure.structure_verdict import MISSING, added_term, diagnose_structure
from study.support.file_sets import write_files


def structure_climb(arguments: argparse.Namespace, model: Model, steps: int, folder: Path) -> list[dict[str, Any]]:
    """Begin with a structure and add the first candidate of each diagnosis, at most ``steps``.

    The folder gets ``climb/`` with the structure reached, its comparison and a folder for each diagnosis,
    ``history.json`` and the history's picture. There is no page to step through it.
    """
    work = folder / "climb"
    (prepared,) = prepared_structures(arguments, model)
    comparison = compare_structure(model, prepared)
    done = [history_step(comparison)]
    for number in range(steps + 1):
        diagnosis = diagnose_structure(comparison)
        write_files(work / f"step_{number}", {"diagnosis.json": as_json(structure_report.fields(diagnosis))})
        print(f"{structure_report.table(diagnosis)}\n\n{structure_report.in_words(diagnosis)}\n", flush=True)
        first = diagnosis.candidates[0] if diagnosis.candidates else None
        if diagnosis.verdict != MISSING or first is None or number == steps:
            break
        comparison = added_term(comparison, free(first.entry.term, first.entry.place))
        done.append(history_step(comparison, first.name))
    write_files(folder, {"history.json": history.as_bytes(done)} | history_pictures(done, model.name))
    reached = {arguments.model.name: format_model(comparison.model).encode()}
    write_files(work, reached | {"comparison.json": as_json(document(comparison))})
    print(history.table(done))
    return done
