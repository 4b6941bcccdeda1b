"""The pictures of a diagnosis: what candidates explain, and a constant coefficient at one, whatever its sign."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from study.diagnose.constancy import CoefficientCurve
from study.diagnose.diagnosis_pictures import constancy_panels, diagnosis_figures


@pytest.mark.parametrize("coefficient", [-2.0, 2.0])
def test_a_constant_coefficient_is_drawn_at_one(coefficient):
    size = abs(coefficient)  # a curve is followed along the sign of its coefficient, as ``constancy.curves`` does
    curve = CoefficientCurve(np.array([1.0, 2.0]), np.full(2, size, dtype=np.complex128), np.full(2, 0.1 * size))
    effect = SimpleNamespace(coefficient=coefficient, flatness=curve, steadiness=None)
    row = SimpleNamespace(name="van_der_pol_damping", effect=effect)
    axes = Figure().subplots(1, 2)
    constancy_panels(axes[0], axes[1], [row])  # pyright: ignore[reportArgumentType]
    (container,) = axes[0].containers
    assert list(container.lines[0].get_ydata()) == [1.0, 1.0]
    assert container.get_label() == "Van der Pol damping"
    assert axes[0].get_xlabel() == "frequency (Hz)"


@pytest.mark.parametrize("named", [False, True])
def test_a_candidate_that_is_not_determined_reaches_no_label(named):
    told = [("cubic_stiffness", 0.84, 0.02), ("hysteresis", -4.0, 4.1), ("one_sided_contact", -20.0, 24.0)]
    unseen = SimpleNamespace(coefficient=1.0, flatness=None, steadiness=None)
    rows = [
        SimpleNamespace(
            name=name, tied_with=(), gain=SimpleNamespace(explained=share, error=error), response_error=1.23e-15,
            effect=unseen,
        )
        for name, share, error in told
    ]  # fmt: skip
    misses = SimpleNamespace(prediction=SimpleNamespace(error=0.1), model=SimpleNamespace(named=named))
    diagnosis = SimpleNamespace(candidates=rows, comparison=misses, verdict="missing_effect")
    figure = diagnosis_figures(diagnosis, "rig")["candidates"]  # pyright: ignore[reportArgumentType]
    (axes,) = figure.axes
    (_, _, (whiskers,)) = next(c for c in axes.containers if isinstance(c, ErrorbarContainer))
    left, right = axes.get_xlim()
    ends = np.array([segment[:, 0] for segment in whiskers.get_segments()])
    assert ends == pytest.approx(np.array([[82.0, 86.0], [left, 10.0], [left, right]]))
    arrows = {
        line.get_marker(): np.asarray(line.get_ydata()).tolist()
        for line in axes.lines
        if line.get_marker() in ("<", ">")
    }
    assert arrows == {"<": [1, 2], ">": [2]}
    labels = [text.get_window_extent() for text in axes.texts]
    assert len(labels) == 3
    assert min(box.x0 for box in labels) > axes.get_window_extent().x1
    assert max(box.x1 for box in labels) < figure.bbox.x1
