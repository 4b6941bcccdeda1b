"""A fault of the measurement: what it is, what it says to an engineer, and what the user knows of the instruments."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from study.figures.labels import term_names
from study.records.readers.options import options_beside, read_options
from study.support.arrays import Bools, Floats
from study.support.errors import at, expect
from study.support.thresholds import K

OFFSET, DRIFT, HUM, DELAY, HIGH_PASS = "offset", "drift", "hum", "delay", "high_pass"
SPIKES, DROP_OUTS, CLIPPING = "spikes", "drop_outs", "clipping"
CONVERTER_STEPS, GAIN_CHANGE, FORCE_NOISE = "converter_steps", "gain_change", "force_noise"
FAULTS = (
    OFFSET, DRIFT, HUM, DELAY, HIGH_PASS, SPIKES, DROP_OUTS, CLIPPING, CONVERTER_STEPS, GAIN_CHANGE, FORCE_NOISE,
)  # fmt: skip
HOLDABLE = (OFFSET, DELAY, HIGH_PASS, GAIN_CHANGE)  # faults that one number describes: a user may know it
NAMED_ALONE = (CONVERTER_STEPS, FORCE_NOISE)  # there is nothing that would undo them
Held = Mapping[str, float | Mapping[str, float]]  # values of faults by name, or by name and channel
Given = Mapping[str, float | Mapping[str, float] | None]  # the same; None for a fault that is not looked for
ALL_SENSORS = "motion of all sensors"  # the channel of a delay that all of several sensors have against all forces


@dataclass(frozen=True, eq=False)
class Fault:
    """One fault; n samples of the record."""

    fault: str  # one of ``FAULTS``
    channel: str  # the channel that has it
    value: float  # its size, in ``unit``; what that measures is told where it is put on (study/faults/imposed.py)
    error: float = 0.0  # standard error of that; 0 where it is counted and not estimated, or held by the user
    unit: str = ""
    explained: float = math.nan  # share of the unexplained power of the judging part; nan where that was not asked
    waveform: Floats | None = None  # what is added to the channel, where that is neither a constant nor a filter; (n,)
    lost: Bools | None = None  # samples that say nothing; shape (n,)
    frequency: float = math.nan  # in hertz, of a line; nan of others
    rivals: tuple[str, ...] = ()  # effects that do as much on this record: it is mentioned then, and not corrected
    held: bool = False  # whether the user gave the value

    @property
    def corrected(self) -> bool:
        """Whether the record is corrected for it, or the samples that it spoils are left out."""
        return not self.rivals and self.fault not in NAMED_ALONE

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the value."""
        return self.value - 1.96 * self.error, self.value + 1.96 * self.error

    @property
    def says(self) -> str:
        """The fault in a sentence."""
        return f"{self.note[0].upper()}{self.note[1:]}."

    @property
    def note(self) -> str:
        """The same as a part of a sentence."""
        return f"{_SENTENCES[self.fault](self)}{_what_follows(self)}"


def fault_fields(fault: Fault) -> dict[str, Any]:
    """A fault as ``diagnosis.json`` holds it."""
    return {
        "fault": fault.fault, "channel": fault.channel, "value": fault.value, "interval": list(fault.interval),
        "unit": fault.unit, "explained": fault.explained, "corrected": fault.corrected,
        "rivals": list(fault.rivals), "says": fault.says,
    }  # fmt: skip


def _what_follows(fault: Fault) -> str:
    if fault.rivals:
        effects = " or ".join(map(term_names, fault.rivals))
        if fault.channel == "force":
            return f"; {effects} may be no more than that: look at the instruments first. Nothing is corrected"
        return f"; {effects} would do as much, and this record cannot tell them apart: nothing is corrected"
    if fault.fault in NAMED_ALONE:
        return "; it stays in what is left unexplained"
    if fault.lost is not None:
        return "; these samples are left out in what follows"
    return f"{', as given' if fault.held else ''}; corrected in what follows"


def _amount(fault: Fault, value: float | None = None, error: float | None = None, unit: str | None = None) -> str:
    """Value with the half width of its interval, written to two digits of that."""
    value, error = fault.value if value is None else value, fault.error if error is None else error
    unit = fault.unit if unit is None else unit
    half = 1.96 * error
    if not (half > 0.0 and math.isfinite(half)):
        return f"{value:.4g} {unit}".rstrip()
    digits = 1 - math.floor(math.log10(half))
    if 0 <= digits <= 4:
        return f"{value:.{digits}f} +- {half:.{digits}f} {unit}".rstrip()
    return f"{value:.4g} +- {half:.2g} {unit}".rstrip()


def _delay(f: Fault) -> str:
    late = "late" if f.value >= 0.0 else "early"
    return f"the {f.channel} is read {_amount(f, abs(f.value))} {late}"


def _gain(f: Fault) -> str:
    way = "grows" if f.value >= 0.0 else "falls"
    return (
        f"the gain of the {f.channel} {way} by {_amount(f, 100.0 * abs(f.value), 100.0 * f.error, '%')} "
        "from the first sample to the last"
    )


def _counted(f: Fault) -> str:
    return f"{100.0 * f.value:.2g} % of the samples of the {f.channel}"


_SENTENCES: Mapping[str, Callable[[Fault], str]] = {
    OFFSET: lambda f: f"the {f.channel} has an offset of {_amount(f)}",
    DRIFT: lambda f: f"the {f.channel} drifts by {_amount(f)} (rms)",
    HUM: lambda f: f"a hum of {_amount(f)} at {f.frequency:.5g} Hz lies on the {f.channel}",
    DELAY: _delay,
    HIGH_PASS: lambda f: f"the {f.channel} has passed a high-pass of first order with its cut-off at {_amount(f)}",
    SPIKES: lambda f: f"{_counted(f)} are spikes",
    DROP_OUTS: lambda f: f"{_counted(f)} have dropped out",
    CLIPPING: lambda f: f"the {f.channel} is clipped at {_amount(f)}",
    CONVERTER_STEPS: lambda f: f"the {f.channel} comes in steps of {_amount(f)}",
    GAIN_CHANGE: _gain,
    FORCE_NOISE: lambda f: (
        f"noise of about {_amount(f)} (rms) lies on the {'measured force' if f.channel == 'force' else f.channel}"
    ),
}


@dataclass(frozen=True)
class FaultSettings:
    """Faults with a value that is known, faults that are not looked for, and whether all samples are used."""

    held: Held = field(default_factory=dict[str, float | Mapping[str, float]])
    switched_off: tuple[str, ...] = ()
    as_sampled: bool = False


NOTHING_ASKED = FaultSettings(switched_off=FAULTS)


def settings_asked(record: Path | None, given: Given | bool | None = None) -> FaultSettings:
    """The settings for a record that was read from a file, or for one of none.

    What is ``given`` comes before what stands beside the file: values as ``Given`` has them, or False to look for none.
    Whether all samples are used is told beside the file alone.

    Raises
    ------
    StudyError
        As :func:`settings_beside`, whatever is given.
    """
    beside = FaultSettings() if record is None else settings_beside(record)
    if given is None or given is True:
        return beside
    asked = NOTHING_ASKED if given is False else settings_of(given)
    return replace(asked, as_sampled=beside.as_sampled)


def settings_beside(record: Path) -> FaultSettings:
    """The settings in the file that may stand beside a record, under ``measurement``.

    Raises
    ------
    StudyError
        If it names a fault that is not known, or holds one at a value that one number does not describe.
    """
    path = options_beside(record)
    if not path.is_file():
        return FaultSettings()
    options = read_options(path)
    with at(path):
        asked = settings_of(options.measurement) if options.measurement else FaultSettings()
    asked = NOTHING_ASKED if options.measurement == {} else asked
    return replace(asked, as_sampled=options.as_sampled)


def settings_of(given: Given) -> FaultSettings:
    """Settings from values by name of the fault, or by name and channel; None for a fault that is not looked for."""
    for name in given:
        expect(name in FAULTS, f"measurement names {name!r}; expected one of {', '.join(FAULTS)}")
    every = [(n, v) for n, own in given.items() for v in (own.values() if isinstance(own, Mapping) else (own,))]
    for name, value in every:
        known = value is None or name in HOLDABLE
        expect(known, f"{name} is held at {value}; expected 'off', or a number for one of {', '.join(HOLDABLE)}")
        expect(name != "high_pass" or value is None or value > 0.0, f"high_pass is {value}; expected a cut-off above 0")
        expect(name != "gain_change" or value is None or value > -1.0, f"gain_change is {value}; expected it above -1")
    held = {name: value for name, value in given.items() if value is not None and value != 0.0}
    return FaultSettings(held, tuple(name for name in given if name not in held))


def same(one: Sequence[Fault], other: Sequence[Fault]) -> bool:
    """Whether two searches found the same faults to correct, with values that their errors cannot tell apart."""
    mine, theirs = ({(f.fault, f.channel): f for f in faults if f.corrected} for faults in (one, other))
    return set(mine) == set(theirs) and all(
        abs(f.value - theirs[key].value) <= K * (f.error**2 + theirs[key].error ** 2) ** 0.5 for key, f in mine.items()
    )
