"""Where a record moves: parts that are zero, frozen or over can be neither fitted nor judged."""

import numpy as np

from study.records.record import Record
from study.support.arrays import Floats

MOST = 0.5  # of a part: a channel that rests for longer does not move in it


def rests(values: Floats) -> bool:
    """Whether a channel stays at one value for most of a part, from its beginning or to its end."""
    first, last = moving(values)
    return last - first < (1.0 - MOST) * len(values)


def moving(values: Floats) -> tuple[int, int]:
    """First sample of a channel's motion and the one after the last: what it rests at before and behind is cut off.

    Of the rest behind all: a channel that is over jumps to it, and the sample after the jump shows no motion.
    """
    changes = np.flatnonzero(np.diff(values))
    if not len(changes):
        return 0, 0
    last = int(changes[-1]) + 1
    return int(changes[0]), last if last < len(values) - 1 else len(values)


def halves(record: Record, response: str) -> tuple[tuple[int, int], tuple[int, int]]:
    """The parts to fit and to judge: the halves of the record, or of the stretch of it that moves.

    Of the stretch where one half has no motion, or the first no force: a hammer's blow with a long rest behind it, a
    trigger long before it, chunks of a file that nothing was written to.
    """
    half, motion, force = len(record) // 2, record[response], record["force"]
    first, last = 0, len(record)
    if rests(motion[:half]) or rests(motion[half:]) or not np.ptp(force[:half]) > 0.0:
        start, last = moving(motion)
        first = max(start, moving(force)[0])
    middle = (first + last) // 2
    return (first, middle), (middle, last)
