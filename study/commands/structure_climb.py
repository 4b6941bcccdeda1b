"""A climb of a structure: diagnose, add what is missing where it is missing, and again."""

import argparse
from pathlib import Path
from typing import Any

from study.commands.structures import prepared_structures
from study.compare import history
from study.compare.history_picture import files as history_pictures
from study.equations.model import Model, free
from study.equations.model_file import format_model
from study.structure import structure_report
from study.structure.structure_comparison import compare_structure, history_step
from study.structure.structure_verdict import MISSING, added_term, diagnose_structure
from study.support.file_sets import write_files
from study.support.files import replace_file


def structure_climb(arguments: argparse.Namespace, model: Model, steps: int, folder: Path) -> list[dict[str, Any]]:
    """Begin with a structure and add the first candidate of each diagnosis, at most ``steps``.

    The folder gets ``climb/`` with the structure reached, ``history.json`` and the history's picture. There is no page
    to step through it.
    """
    (prepared,) = prepared_structures(arguments, model)
    comparison = compare_structure(model, prepared)
    done = [history_step(comparison)]
    for _ in range(steps):
        diagnosis = diagnose_structure(comparison)
        print(f"{structure_report.table(diagnosis)}\n\n{structure_report.in_words(diagnosis)}\n", flush=True)
        first = diagnosis.candidates[0] if diagnosis.candidates else None
        if diagnosis.verdict != MISSING or first is None:
            break
        comparison = added_term(comparison, free(first.entry.term, first.entry.place))
        done.append(history_step(comparison, first.name))
    write_files(folder, {"history.json": history.as_bytes(done)} | history_pictures(done, model.name))
    work = folder / "climb"
    work.mkdir(parents=True, exist_ok=True)
    replace_file(work / arguments.model.name, format_model(comparison.model).encode())
    print(history.table(done))
    return done
