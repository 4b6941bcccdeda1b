"""Records with hidden effects: the proof, and the practice ground, of ``diagnose``."""

from study.trials.draw import DRIVEN_MASS, FAMILIES, LIKE_THE_REPORT, NOISES, Trial, make_trial
from study.trials.effects import HIDDEN, SHARE, share_of

__all__ = ["DRIVEN_MASS", "FAMILIES", "HIDDEN", "LIKE_THE_REPORT", "NOISES", "SHARE", "Trial", "make_trial", "share_of"]
