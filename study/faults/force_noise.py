"""Noise on the measured force: what is left is shaped as the structure shapes a force, and owes nothing to the motion."""

from study.faults.fault import Fault
from study.faults.leftover import Leftover


def force_noise(left: Leftover, asked: int) -> Fault | None:
    """Noise on the force; None where the residual is no more than noise on the response."""
    return None
