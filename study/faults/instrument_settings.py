"""What the user says of the instruments: which faults are held at a value, and which are not looked for."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from study.faults.fault import HOLDABLE, NAMES
from study.records.readers.options import options_beside, read_options
from study.support.errors import at, expect


@dataclass(frozen=True)
class FaultSettings:
    """Faults with a value that is known, faults that are not looked for, and whether all samples are used."""

    held: Mapping[str, float] = field(default_factory=dict[str, float])
    switched_off: tuple[str, ...] = ()
    as_sampled: bool = False


NOTHING_ASKED = FaultSettings(switched_off=NAMES)


def settings_asked(record: Path | None, given: Mapping[str, float | None] | bool | None = None) -> FaultSettings:
    """The settings for a record that was read from a file, or for one of none.

    What is ``given`` comes before what stands beside the file: values by name of the fault, or False to look for none.
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


def settings_of(given: Mapping[str, float | None]) -> FaultSettings:
    """Settings from values by name of the fault; None for a fault that is not looked for."""
    for name, value in given.items():
        expect(name in NAMES, f"measurement names {name!r}; expected one of {', '.join(NAMES)}")
        known = value is None or name in HOLDABLE
        expect(known, f"{name} is held at {value}; expected 'off', or a number for one of {', '.join(HOLDABLE)}")
        expect(name != "high_pass" or value is None or value > 0.0, f"high_pass is {value}; expected a cut-off above 0")
        expect(name != "gain_change" or value is None or value > -1.0, f"gain_change is {value}; expected it above -1")
    held = {name: value for name, value in given.items() if value is not None and value != 0.0}
    return FaultSettings(held, tuple(name for name in given if name not in held))
