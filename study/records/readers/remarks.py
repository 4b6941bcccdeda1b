"""What a reader notices of a record that can be used all the same: units nobody gave, a wrong sign, junk, rest."""

from collections.abc import Collection

import numpy as np

from study.records.readers.checks import suspect_sign
from study.records.record import Record
from study.support.arrays import Floats
from study.support.numbers import enumerated

LEAVING_OUT = "--use "  # the option that follows such a remark


def on_units(record: Record, known: Collection[str]) -> tuple[str, ...]:
    """That forces and motions without a unit are taken as SI."""
    bare = [c for c in (*record.forces, *map(str, record.sensors)) if c not in known and np.any(record[c])]
    if not bare:
        return ()
    are, like = "have no unit and are" if len(bare) > 1 else "has no unit and is", bare[-1].replace(" ", ".")
    taken = list(dict.fromkeys(record.unit(c) for c in bare))
    return (f"{enumerated(bare)} {are} taken in {enumerated(taken)} (--unit {like}=UNIT says otherwise)",)


def on_samples(record: Record) -> tuple[str, ...]:
    """What its numbers say against it."""
    sensors = [str(sensor) for sensor in record.sensors]
    driven = not record.unforced
    alone = driven and len(record.forces) == len(record.coordinates) == 1
    sign = suspect_sign(record) if alone and sensors else None
    said = list[str]()
    far = {channel: _junk(record[channel]) for channel in sensors}
    begin = max(far.values(), default=0)
    if begin:
        where = enumerated([channel for channel, samples in far.items() if samples])
        one = f"the first sample of {where} lies"
        said.append(f"{one if begin == 1 else f'samples 0 to {begin - 1} of {where} lie'} far outside all others")
    # lesser junk may follow, in the hundredth of the record in which that was looked for
    after = max(begin, len(record) // 100) if begin else 0
    still = after + _rest([record[channel][after:] for channel in (*record.forces, *sensors)]) if driven else begin
    if still - after > len(record) // 10:  # a shorter rest is hardly worth a word
        said.append(f"the first {still * record.dt:.3g} s are at rest")
        begin = still
    at = record.start + begin * record.dt
    left_out = f"{' and '.join(said)}: that says nothing about the motion ({LEAVING_OUT}{at:.6g}: starts after it)"
    return tuple(filter(None, (sign, left_out if said else None)))


def _junk(values: Floats, outside: float = 5.0) -> int:
    """Up to which of the first samples some lie far outside of all that come later; 0 where none do."""
    ends = max(len(values) // 100, 1)  # the first hundredth of the record
    away = np.abs(values - np.median(values))
    beyond = np.flatnonzero(away[:ends] > outside * float(np.max(away[ends:])))
    last = int(beyond[-1]) + 1 if len(beyond) else 0
    jumps = last and away[last] < away[last - 1] / outside  # a motion that dies away does not end from one to the next
    return last if jumps else 0


def _rest(channels: list[Floats], still: float = 0.02) -> int:
    """Samples for which all channels scatter by less than ``still`` of their liveliest slice, from the beginning on."""
    size = max(len(channels[0]) // 100, 2)
    count = len(channels[0]) // size
    blocks = np.stack([x[: count * size].reshape(count, size) for x in channels])
    scatter = np.std(blocks, axis=2)
    lively = np.any(scatter > still * np.max(scatter, axis=1, keepdims=True), axis=0)
    return int(np.argmax(lively)) * size
