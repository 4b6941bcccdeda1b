"""Poles of a linear system from the lines of its inputs and outputs, by a subspace.

McKelvey, Akcay and Ljung (IEEE Transactions on Automatic Control 41, 1996), for any lines; with nonlinear forces among
the inputs, Noel and Kerschen (Mechanical Systems and Signal Processing 40, 2013). Lines on the imaginary axis are
mapped to the unit circle by the bilinear transformation, which takes a rational function to one of the same order.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from study.support.arrays import Complexes, Floats, Ints


@dataclass(frozen=True, eq=False)
class Observability:
    """What the lines say of a system's order: a subspace and its weights."""

    basis: Floats  # left singular vectors, shape (blocks outputs, blocks outputs)
    singular: Floats  # how much of the outputs each direction holds, shape (blocks outputs,)
    outputs: int  # how many
    period: float  # T of the bilinear transformation ``s = 2/T (z - 1)/(z + 1)``, in seconds

    def poles(self, order: int) -> Complexes:
        """Eigenvalues in rad/s of the system of this order, reflected to the left where they are unstable."""
        left = self.basis[:, :order]
        shifted = np.linalg.lstsq(left[: -self.outputs], left[self.outputs :], rcond=None)[0]
        z = np.asarray(np.linalg.eigvals(shifted), dtype=np.complex128)
        s = 2.0 / self.period * (z - 1.0) / (z + 1.0)
        return np.asarray(-np.abs(s.real) + 1j * s.imag, dtype=np.complex128)


def observability(omega: Floats, inputs: Complexes, outputs: Complexes, blocks: int, stretch: Ints) -> Observability:
    """The extended observability matrix's column space.

    Parameters
    ----------
    omega : array, shape (lines,)
        Angular frequency in rad/s.
    inputs, outputs : complex array, shape (lines, inputs) and (lines, outputs)
        Spectra; each output is scaled to unit power.
    blocks : int
        Block rows: more than the order of the system.
    stretch : int array, shape (lines,)
        Of which stretch each line is: one that is cut has a transient of its own.
    """
    period = 2.0 / float(np.sqrt(np.min(omega) * np.max(omega)))
    turn = np.exp(2j * np.arctan(omega * period / 2.0))
    transient = (stretch[:, None] == np.unique(stretch)) * np.sqrt(np.mean(np.abs(inputs[:, :1]) ** 2))
    driven = _unit(np.concatenate([inputs, transient * turn[:, None]], axis=1))
    rows = [_stack(driven, turn, blocks), _stack(_unit(outputs), turn, blocks)]
    data = np.concatenate(rows)
    real = np.concatenate([data.real, data.imag], axis=1)
    triangle = np.asarray(np.linalg.qr(real.T)[1], dtype=np.float64).T
    first = len(rows[0])
    basis, singular, _ = np.linalg.svd(triangle[first:, first:])
    return Observability(basis, singular, outputs.shape[1], period)


def _unit(values: Complexes) -> Complexes:
    size = np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    return values / np.where(size > 0.0, size, 1.0)


def _stack(values: Complexes, turn: Complexes, blocks: int) -> Complexes:
    """Block rows ``z^p values``, shape (blocks channels, lines)."""
    powers: Sequence[Complexes] = [turn**p for p in range(blocks)]
    return np.concatenate([(values * power[:, None]).T for power in powers])
