"""What drives a free run between the samples of a record: forces, motions that are prescribed, and channels."""

from functools import lru_cache

import numpy as np

from study.records.interpolation import BAND_LIMITED, between_runs, between_samples, runs_of
from study.records.record import Record
from study.support.arrays import Floats, Ints

REMEMBERED = 8  # channels whose values between the samples are cached
FORCE = "force"  # also the response of a model without inertia, whose motion is prescribed
Drive = tuple[Floats, tuple[tuple[int, float], ...], Ints | None]


def along_motions(record: Record, span: tuple[int, int], driving: tuple[str, ...], factor: int) -> Drive:
    """What drives the motions of a span, where these begin and when, and where its samples lie along them.

    The motions begin with the first sample of the span, and anew at each stretch of a record that is strung together.

    Parameters
    ----------
    record : Record
        Has the channels.
    span : pair of int
        First sample, and the one after the last.
    driving : tuple of str
        The channels.
    factor : int
        Intervals into which each sampling interval is divided.

    Returns
    -------
    drive : array, shape (factor (samples - 1) + 1, channels)
    starts : tuple of (int, float)
        Samples at which motions begin, and their times in seconds.
    places : int array, shape (samples,), or None
        Where the samples of the span lie along the motions; None where these are no more than the span.
    """
    if record.stretches:
        return _along_stretches(record, span, driving, factor)
    first, last = span
    part = slice(factor * first, factor * (last - 1) + 1)
    columns = [_between(record[name].tobytes(), factor, _reading(record, name))[part] for name in driving]
    drive = np.column_stack(columns) if columns else np.zeros((factor * (last - first), 0))
    return drive, ((0, record.start + first * record.dt),), None


@lru_cache(maxsize=REMEMBERED)
def _along_stretches(record: Record, span: tuple[int, int], driving: tuple[str, ...], factor: int) -> Drive:
    """As :func:`along_motions`, of a record that is strung together."""
    part = record.part(*span)
    runs, places = runs_of(part)
    starts, begin = list[tuple[int, float]](), 0
    for run in runs:
        starts.append((begin, float(run.source.time[run.first])))
        begin += len(run)
    columns = [between_runs(part, name, factor) for name in driving]
    drive = np.column_stack(columns) if columns else np.zeros((factor * begin, 0))
    drive.flags.writeable = False
    return drive, tuple(starts), places


@lru_cache(maxsize=REMEMBERED)
def _between(values: bytes, factor: int, reading: str) -> Floats:
    """A channel between its samples; a diagnosis makes hundreds of runs under the same force."""
    fine = between_samples(np.frombuffer(values), factor, reading)
    fine.flags.writeable = False
    return fine


def _reading(record: Record, name: str) -> str:
    """How a channel goes on between its samples: a motion is band-limited."""
    return record.between if name in record.forces else BAND_LIMITED
