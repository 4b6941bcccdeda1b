"""Records with a hidden effect: the proof, and the practice ground, of ``diagnose``."""

from study.trials.draw import HIDDEN, NOISES, Trial, make_trial
from study.trials.experiment import REPORT_LIKE, WIDE
from study.trials.strength import SHARE, share_of

__all__ = ["HIDDEN", "NOISES", "REPORT_LIKE", "SHARE", "WIDE", "Trial", "make_trial", "share_of"]
