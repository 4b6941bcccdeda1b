"""The pictures of a diagnosis: a constant coefficient is drawn at one, whatever its sign."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from study.diagnose.constancy import CoefficientCurve
from study.diagnose.diagnosis_pictures import constancy_panels


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
