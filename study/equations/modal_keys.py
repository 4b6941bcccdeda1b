"""Names of the numbers of a linear part that is a sum of modes."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ModalKeys:
    """Names of the numbers of a linear part with so many modes; modes count from 1.

    ``q'' + G q' + W q = p`` and ``u = phi^T q``: any structure with symmetric mass, damping and stiffness matrices, of
    which some modes are kept. W is diagonal, the squares of the natural frequencies; G is the symmetric matrix of modal
    damping. By reciprocity a mode is felt and driven at a point alike: a sensor where a force acts makes the
    coefficients of the terms known in newtons.
    """

    points: tuple[str, ...]  # coordinates with a sensor or a force, and the ends of terms
    modes: int  # how many

    @property
    def stiffness(self) -> tuple[str, ...]:
        """Squares of the natural angular frequencies, ``w2[1]``."""
        return tuple(f"w2[{r}]" for r in range(1, self.modes + 1))

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Rows and columns of the damping matrix, counted from zero."""
        return tuple((r, s) for r in range(self.modes) for s in range(r, self.modes))

    @property
    def damping(self) -> tuple[str, ...]:
        """Elements of the modal damping matrix, ``g[1,2]``."""
        return tuple(f"g[{r + 1},{s + 1}]" for r, s in self.pairs)

    @property
    def coupling(self) -> tuple[str, ...]:
        """Those off its diagonal."""
        return tuple(key for (r, s), key in zip(self.pairs, self.damping, strict=True) if r != s)

    def shape(self, point: str) -> tuple[str, ...]:
        """Amplitudes of the modes at a point, ``phi[tip,1]``."""
        return tuple(f"phi[{point},{r}]" for r in range(1, self.modes + 1))

    @property
    def all(self) -> tuple[str, ...]:
        """Every name."""
        return (*self.stiffness, *self.damping, *(key for point in self.points for key in self.shape(point)))
