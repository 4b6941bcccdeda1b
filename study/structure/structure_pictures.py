"""The pictures of a structure's diagnosis, as the bytes of files."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

import numpy as np

from study.compare.place_pictures import modes, sketch_of, structure_figure
from study.diagnose import diagnosis_pages
from study.diagnose.verdict import MISSING
from study.figures import page
from study.figures.sketch import Sketch, sketch
from study.figures.styles import in_style
from study.structure.structure_verdict import StructureDiagnosis


def diagnosis_pictures(diagnosis: StructureDiagnosis) -> dict[str, bytes]:
    """The pictures of a diagnosis besides those of its comparison."""
    comparison = diagnosis.comparison
    sets = [("as given", comparison.modes)]
    sets += [("with the first candidate", diagnosis.modes_after)] if diagnosis.modes_after is not None else []
    with in_style():
        found = {
            "structure": structure_figure(comparison, sketch_of_diagnosis(diagnosis)),
            "modes": modes(comparison, sets),
        }
        if diagnosis.candidates:
            found |= diagnosis_pages.pages(diagnosis, comparison.prepared.record.name)
            found["candidates"].set_size_inches(1.4 * page.WIDTH, found["candidates"].get_figheight())
        return page.image_files(found)


def sketch_of_diagnosis(diagnosis: StructureDiagnosis) -> Sketch:
    """The same, glowing where an effect that is found, or tied with it, explains what is left."""
    comparison = diagnosis.comparison
    if diagnosis.verdict != MISSING:
        return sketch_of(comparison)
    first = diagnosis.candidates[0]
    shares: dict[frozenset[str], float] = {}
    for row in diagnosis.candidates:
        if row.name in (first.name, *first.tied_with):
            shares.setdefault(row.entry.place.path, float(np.clip(row.gain.explained, 0.0, 1.0)))
    return sketch(comparison.model, comparison.missing.coordinates, shares)
