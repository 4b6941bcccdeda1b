"""The sketch of a structure, glowing where what is missing acts."""

import numpy as np

from study.compare.place_sketch import sketch_of
from study.diagnose.verdict import Diagnosis
from study.figures.sketch import Sketch, sketch


def sketch_of_diagnosis(diagnosis: Diagnosis) -> Sketch:
    """The sketch of a structure, glowing where an effect that is found, or tied with it, explains what is left."""
    comparison = diagnosis.comparison
    if diagnosis.answer is None:
        return sketch_of(comparison)
    shares: dict[frozenset[str], float] = {}
    for row in diagnosis.sets:
        for entry in row.entries:
            shares.setdefault(entry.place.path, float(np.clip(row.gain.explained, 0.0, 1.0)))
    return sketch(comparison.model, comparison.missing.coordinates, shares)
