"""A fault of the measurement: what it is, how large, and what it says to an engineer."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.support.arrays import Floats

OFFSET, DRIFT, HUM, DELAY, HIGH_PASS = "offset", "drift", "hum", "delay", "high_pass"
SPIKES, DROP_OUTS, CLIPPING = "spikes", "drop_outs", "clipping"
CONVERTER_STEPS, GAIN_CHANGE, FORCE_NOISE = "converter_steps", "gain_change", "force_noise"
NAMES = (
    OFFSET, DRIFT, HUM, DELAY, HIGH_PASS, SPIKES, DROP_OUTS, CLIPPING, CONVERTER_STEPS, GAIN_CHANGE, FORCE_NOISE,
)  # fmt: skip
HOLDABLE = (OFFSET, DELAY, HIGH_PASS, GAIN_CHANGE)  # faults that one number describes: a user may know it
NAMED_ALONE = (CONVERTER_STEPS, FORCE_NOISE)  # there is nothing that would undo them


@dataclass(frozen=True, eq=False)
class Fault:
    """One fault; n samples of the record.

    Attributes
    ----------
    fault : str
        One of ``NAMES``.
    channel : str
        The channel that has it.
    value : float
        Its size, in ``unit``; what that measures is told in ``MEANING``.
    error : float
        Standard error of the value; 0 where it is counted and not estimated, or held by the user.
    unit : str
        Unit of the value.
    explained : float
        Share of the unexplained power that it explains on the judging part; nan where that was not asked.
    waveform : array, shape (n,), optional
        What is added to the channel, where that is neither a constant nor a filter.
    lost : bool array, shape (n,), optional
        Samples that say nothing.
    frequency : float
        In hertz, of a line; nan of others.
    rivals : tuple of str
        Effects of the library that do what it does on this record: it is then mentioned, and not corrected.
    held : bool
        Whether the user gave the value.
    """

    fault: str
    channel: str
    value: float
    error: float = 0.0
    unit: str = ""
    explained: float = math.nan
    waveform: Floats | None = None
    lost: NDArray[np.bool_] | None = None
    frequency: float = math.nan
    rivals: tuple[str, ...] = ()
    held: bool = False

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

    def with_rivals(self, *names: str) -> "Fault":
        """The same as one of several explanations that this record cannot tell apart."""
        return replace(self, rivals=names)


def fault_fields(fault: Fault) -> dict[str, Any]:
    """A fault as ``diagnosis.json`` holds it."""
    return {
        "fault": fault.fault, "channel": fault.channel, "value": fault.value, "interval": list(fault.interval),
        "unit": fault.unit, "explained": fault.explained, "corrected": fault.corrected,
        "rivals": list(fault.rivals), "says": fault.says,
    }  # fmt: skip


def faults_in_words(faults: tuple[Fault, ...]) -> str:
    """All faults in sentences; empty without any."""
    return " ".join(fault.says for fault in faults)


def _what_follows(fault: Fault) -> str:
    if fault.rivals:
        effects = " or ".join(name.replace("_", " ") for name in fault.rivals)
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
    FORCE_NOISE: lambda f: f"noise of about {_amount(f)} (rms) lies on the measured force",
}
MEANING = {
    OFFSET: "what is added to every sample",
    DRIFT: "rms of what is slower than the structure",
    HUM: "amplitude of a line that the structure does not pass on",
    DELAY: "samples by which the response is read after the force",
    HIGH_PASS: "cut-off in hertz of a coupling of first order",
    SPIKES: "share of the samples",
    DROP_OUTS: "share of the samples",
    CLIPPING: "largest value that is shown, away from the middle of the range",
    CONVERTER_STEPS: "distance of neighbouring values",
    GAIN_CHANGE: "change of the gain from the first sample, where it is one, to the last",
    FORCE_NOISE: "rms of the noise up to half the sampling rate",
}
