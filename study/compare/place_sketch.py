"""The sketch of a structure, glowing where its model lacks something."""

from study.compare.comparison import Comparison
from study.compare.dependence import explained_by_place
from study.figures.sketch import Sketch, sketch


def sketch_of(comparison: Comparison) -> Sketch:
    """The sketch of a structure.

    A connection glows with the held-out share of what is left that general functions of its own motion explain.
    """
    return sketch(comparison.model, comparison.missing.coordinates, explained_by_place(comparison.leftovers))
