"""Arguments that every command on measured records takes, and what becomes of them."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import number, whole
from study.support.errors import StudyError

if TYPE_CHECKING:
    from study.records.plan import Plan
    from study.records.prepared import Prepared
    from study.records.readers import ReadOptions
    from study.records.record import Record

RANGE = re.compile(r"([0-9]{0,15}):([0-9]{0,15})")
MOTIONS = ("displacement", "velocity", "acceleration")
RESULTS = Path("results")
Span = tuple[int, int | None]


def add_record_arguments(parser: argparse.ArgumentParser) -> None:
    """Records, how to read them, what to fit and what to judge."""
    parser.add_argument("records", type=Path, nargs="+", metavar="RECORD", help="CSV, MATLAB, HDF5, UFF or Parquet")
    add_reading_arguments(parser)


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """How to read records, what to fit and what to judge."""
    reading = parser.add_argument_group("reading (or in RECORD.record.yaml beside the file)")
    reading.add_argument(
        "--column", action="append", default=[], metavar="ROLE=NAME",
        help="column of force, displacement, velocity, acceleration, time, or of a further channel; by name or number",
    )  # fmt: skip
    reading.add_argument("--unit", action="append", default=[], metavar="ROLE=UNIT", help="such as force=kN")
    rate = reading.add_mutually_exclusive_group()
    rate.add_argument("--fs", type=number(above=0.0), help="sampling rate in Hz, if there is no column of times")
    rate.add_argument("--dt", type=number(above=0.0), help="sampling interval in s, instead of --fs")
    reading.add_argument("--group", help="folder or structure of an HDF5 or MATLAB file")
    reading.add_argument("--period", type=whole(2, 2**40), help="samples in a period of a periodic excitation")
    reading.add_argument(
        "--accept-saturated", action="store_true", help="take a channel that rests at its extreme for what it is"
    )
    reading.add_argument(
        "--accept-swapped", action="store_true", help="take force and response as named, though they seem exchanged"
    )
    judging = parser.add_argument_group("fitting and judging")
    judging.add_argument("--fit", type=span, metavar="A:B", help="samples to fit, A to B - 1 (default: the first half)")
    judging.add_argument("--judge", type=span, metavar="A:B", help="samples to judge (default: the second half)")
    judging.add_argument("--response", choices=MOTIONS, help="the measured motion that free runs are held against")
    judging.add_argument(
        "--cutoff", type=number(above=0.0), metavar="HZ",
        help="integrate measured accelerations above this frequency and judge nothing below (default: from the record)",
    )  # fmt: skip


def span(text: str) -> Span:
    """``40650:127400`` as first sample and the one after the last; an end left out is that of the record."""
    found = RANGE.fullmatch(text.strip())
    if found is None:
        raise argparse.ArgumentTypeError(f"{text!r} is no range of samples such as 0:4096")
    first, last = (int(part) if part else None for part in found.groups())
    if last is not None and last <= (first or 0):
        raise argparse.ArgumentTypeError(f"{text!r} ends before it begins; a range such as 0:4096 is right")
    return first or 0, last


def read_options(arguments: argparse.Namespace) -> "ReadOptions":
    """What the user says about the files."""
    from study.records.readers import ReadOptions, assignments

    columns = assignments(arguments.column, "--column")
    return ReadOptions(
        columns={role: int(name) if name.isdecimal() else name for role, name in columns.items()},
        units=assignments(arguments.unit, "--unit"),
        dt=arguments.dt,
        fs=arguments.fs,
        group=arguments.group,
        period=arguments.period,
        accept_saturated=arguments.accept_saturated,
        accept_swapped=arguments.accept_swapped,
    )


def read_records(arguments: argparse.Namespace) -> list["Record"]:
    """The records, each with a name of its own.

    Raises
    ------
    StudyError
        If one cannot be read.
    """
    from study.compare.comparison import distinct
    from study.records.readers import read_record

    options = read_options(arguments)
    return list(distinct([read_record(path, options) for path in arguments.records]))


def prepared_of(arguments: argparse.Namespace, record: "Record") -> "Prepared":
    """A record made ready: its motions completed, and what to fit and to judge of it settled.

    Raises
    ------
    StudyError
        If the ranges overlap or leave the record, it lacks the response asked for, or cannot be completed.
    """
    from study.records.prepared import prepare_record

    return prepare_record(record, _plan(arguments, record), arguments.cutoff)


def _plan(arguments: argparse.Namespace, record: "Record") -> "Plan":
    """What to fit and what to judge of a record.

    Raises
    ------
    StudyError
        If the ranges overlap or leave the record, or it lacks the response asked for.
    """
    from study.records.plan import make_plan

    fit, judge = _within(arguments.fit, record), _within(arguments.judge, record)
    if arguments.response is not None and arguments.response not in record:
        have = ", ".join(m for m in MOTIONS if m in record)
        raise StudyError(f"{record.name}: no {arguments.response} was measured; --response {have} is right")
    if fit is None and judge is not None:
        fit = _other(judge, len(record))
    if judge is None and fit is not None:
        judge = _other(fit, len(record))
    try:
        return make_plan(record, fit, judge, arguments.response)
    except StudyError as error:
        raise StudyError(f"{record.name}: {error}") from None


def _within(given: Span | None, record: "Record") -> tuple[int, int] | None:
    return None if given is None else (given[0], len(record) if given[1] is None else given[1])


def _other(given: tuple[int, int], length: int) -> tuple[int, int]:
    """The longer of the parts before and after a range."""
    before, after = (0, given[0]), (given[1], length)
    return before if before[1] - before[0] > after[1] - after[0] else after


def out_folder(arguments: argparse.Namespace) -> Path:
    """Where results go: ``--out``, or ``results/`` and the stem of the first record."""
    if arguments.out is not None:
        return arguments.out
    first: Path = arguments.records[0]
    return RESULTS / (first.stem or "record")
