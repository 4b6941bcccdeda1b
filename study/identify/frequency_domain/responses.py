"""What every estimate of frequency response functions has, however it was made."""

from dataclasses import dataclass

from study.support.arrays import Complexes, Floats


@dataclass(frozen=True)
class Responses:
    """Frequency response functions of q inputs with their errors.

    Attributes
    ----------
    frequency : array, shape (lines,)
        In hertz.
    response : complex array, shape (q, lines)
        ``A_j``, frequency response function from input j: output unit per input unit.
    covariance : complex array, shape (lines, q, q)
        Random-error covariance ``E[dA dA^H]`` of the estimates of A.
    noise : array, shape (lines,)
        Autospectral density of what the inputs leave of the output, G_nn.
    """

    frequency: Floats
    response: Complexes
    covariance: Complexes
    noise: Floats
