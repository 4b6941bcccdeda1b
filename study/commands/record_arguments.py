"""Arguments that every command on measured records takes, and what becomes of them."""

import argparse
import math
import re
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study.commands.command import finite_number, whole_number
from study.records import MOTIONS
from study.support.errors import StudyError, expect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from study.compare.each_record import Separate
    from study.compare.history import Step
    from study.equations.model import Model
    from study.faults.accounting import Accounted
    from study.records.readers import ReadOptions
    from study.records.record import Record
    from study.records.record_layout import Layout

RANGE = re.compile(r"([0-9]{0,15}):([0-9]{0,15})")
RESULTS = Path("results")
ALTERNATE = "every-other-block"
GIVEN = ("dt", "fs", "period", "accept_saturated", "accept_swapped", "free", "as_sampled")  # of ``ReadOptions``
DIGITS = 10  # of the number of a column; more are a name
Span = tuple[int, int | None]


def add_record_arguments(
    parser: argparse.ArgumentParser, nargs: str | int = "+", out: str = "folder for results"
) -> None:
    """Records and a model, how to read them, what to fit and what to judge, and where results go."""
    parser.add_argument("records", type=Path, nargs=nargs, metavar="RECORD", help="CSV, MATLAB, HDF5, UFF or Parquet")
    add_reading_arguments(parser)
    parser.add_argument(
        "--model",
        type=Path,
        required=True,
        help="model file (YAML); values in it are held, except those with held: false",
    )
    add_out_argument(parser, out)


def add_each_record_argument(parser: argparse.ArgumentParser) -> None:
    """Coefficients that are to differ between records that are fitted together."""
    parser.add_argument(
        "--each-record", action="append", default=[], metavar="TERM",
        help="a term or coefficient that may differ between the records; one fit shares all others",
    )  # fmt: skip


def add_out_argument(parser: argparse.ArgumentParser, out: str = "folder for results") -> None:
    """Where results go."""
    parser.add_argument("--out", type=Path, help=f"{out} (default results/RECORD)")


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """How to read records, what to fit and what to judge."""
    reading = parser.add_argument_group("reading (all but --absolute also in RECORD.record.yaml beside the file)")
    reading.add_argument(
        "--column", action="append", default=[], metavar="ROLE=NAME",
        help="column of force, displacement, velocity, acceleration, time, or of a further channel; by name or number",
    )  # fmt: skip
    reading.add_argument("--unit", action="append", default=[], metavar="ROLE=UNIT", help="such as force=kN")
    reading.add_argument(
        "--scale", action="append", default=[], metavar="ROLE=FACTOR",
        help="multiply a column: -1 for a force of the wrong sign; --unit is then the unit of the result",
    )  # fmt: skip
    rate = reading.add_mutually_exclusive_group()
    rate.add_argument("--fs", type=finite_number(above=0.0), help="sampling rate in Hz, if there is no column of times")
    rate.add_argument("--dt", type=finite_number(above=0.0), help="sampling interval in s, instead of --fs")
    reading.add_argument(
        "--group", action="append", default=[],
        help="folder, structure or cell of an HDF5 or MATLAB file; give it again for each further record",
    )  # fmt: skip
    reading.add_argument("--period", type=whole_number(2, 2**40), help="samples in a period of a periodic excitation")
    reading.add_argument("--accept-saturated", action="store_true", help="accept a channel that stays at its limit")
    reading.add_argument(
        "--accept-swapped", action="store_true", help="accept force and response as named, though they seem exchanged"
    )
    reading.add_argument(
        "--absolute", action="store_true", help="on a moving base (column base_acceleration): the response is absolute"
    )  # fmt: skip
    reading.add_argument(
        "--as-sampled", action="store_true",
        help="do not thin a finely sampled record (decays, components, axes and parts chosen by --use never are)",
    )  # fmt: skip
    reading.add_argument(
        "--free", action="store_true", help="a free decay: no force acts, and a column of it is ignored"
    )
    reading.add_argument(
        "--no-measurement",
        action="store_true",
        help="do not look for faults of the measurement: drift, delay, spikes ...",
    )
    judging = parser.add_argument_group("fitting and judging")
    judging.add_argument("--fit", type=span, metavar="A:B", help="samples to fit, A to B - 1 (default: the first half)")
    judging.add_argument(
        "--judge", type=judged_samples, metavar="A:B",
        help=f"samples to judge (default: the second half), or '{ALTERNATE}': the default of free decays, "
        "components, several stretches, and sweeps whose halves differ in frequency",
    )  # fmt: skip
    judging.add_argument(
        "--use", action="append", type=time_span, default=[], metavar="S:T",
        help="use only the record from S to T seconds; several such stretches are fitted and judged together",
    )  # fmt: skip
    judging.add_argument("--response", choices=MOTIONS, help="the measured motion that free runs are compared with")
    judging.add_argument(
        "--cutoff", type=finite_number(above=0.0), metavar="HZ",
        help="integrate measured accelerations above this frequency and judge nothing below (default: from the record)",
    )  # fmt: skip
    judging.add_argument(
        "--horizon", type=finite_number(above=0.0), metavar="S",
        help="for a mass without a spring, whose motion drifts: fit and judge it in pieces of S seconds (default: some "
        "periods of its motion)",
    )  # fmt: skip

    judging.add_argument(
        "--near", type=finite_number(above=0.0), metavar="HZ",
        help="start the fit of a single mass at the mode near this frequency, where the record shows several",
    )  # fmt: skip

    judging.add_argument(
        "--up-to", type=finite_number(above=0.0), metavar="HZ",
        help="use only what lies below this frequency, where the record shows modes that the model lacks: force and "
        "motion fade out up to twice it",
    )  # fmt: skip


def span(text: str) -> Span:
    """``40650:127400`` as first sample and the one after the last; an end left out is that of the record."""
    ends = RANGE.fullmatch(text.strip())
    if ends is None:
        raise argparse.ArgumentTypeError(f"{text!r} is no range of samples such as 0:4096")
    first, last = (int(end) if end else None for end in ends.groups())
    if last is not None and last <= (first or 0):
        raise argparse.ArgumentTypeError(f"{text!r} ends before it begins; expected a range such as 0:4096")
    return first or 0, last


def judged_samples(text: str) -> Span | str:
    """Samples to judge, or the name of a way to choose them."""
    return ALTERNATE if text.strip() == ALTERNATE else span(text)


def time_span(text: str) -> tuple[float, float | None]:
    """``2.0:9.5`` as two times in seconds; an end left out is that of the record."""
    begin, separator, end = text.strip().partition(":")
    try:
        found = float(begin or "-inf"), float(end) if end else None
    except ValueError:
        separator, found = "", (0.0, None)
    if not separator or not begin or not all(x is None or math.isfinite(x) for x in found):
        raise argparse.ArgumentTypeError(f"{text!r} is no range of times in seconds such as 2.0:9.5")
    if found[1] is not None and found[1] <= found[0]:
        raise argparse.ArgumentTypeError(f"{text!r} ends before it begins; expected a range such as 2.0:9.5")
    return found


def given_options(arguments: argparse.Namespace, group: str | None = None) -> "ReadOptions":
    """What the user says about the files; of several groups, the one that is to be read."""
    from study.records.readers import ReadOptions, assignments

    columns, groups = assignments(arguments.column, "--column"), arguments.group
    return ReadOptions(
        {role: int(name) if name.isdecimal() and len(name) < DIGITS else name for role, name in columns.items()},
        assignments(arguments.unit, "--unit"),
        scale=_factors(arguments.scale),
        group=group if group is not None or not groups else groups[0],
        **{name: getattr(arguments, name) for name in GIVEN},
    )


def _factors(texts: "Sequence[str]") -> dict[str, float]:
    """What ``--scale`` gives, as numbers."""
    from study.records.readers import assignments

    factors: dict[str, float] = {}
    for role, text in assignments(texts, "--scale").items():
        try:
            factors[role] = float(text)
        except ValueError:
            raise StudyError(f"--scale {role}={text} is no number; expected a factor such as {role}=-1") from None
    return factors


def read_records(arguments: argparse.Namespace, model: "Model") -> list["Record"]:
    """The records, each with a name of its own: one for each file, or for each group of each."""
    from study.compare.comparison import distinct
    from study.records.readers import read_record

    groups: list[str | None] = list(arguments.group) or [None]
    for group in (g for g in groups if groups.count(g) > 1):
        raise StudyError(f"--group {group} is given twice; expected each group once")
    chosen = [(path, given_options(arguments, group)) for path in arguments.records for group in groups]
    return list(distinct([read_record(path, options, model.roles) for path, options in chosen]))


def sources(arguments: argparse.Namespace) -> list[Path]:
    """The file of each record that :func:`read_records` gives."""
    return [path for path in arguments.records for _ in range(max(len(arguments.group), 1))]


def layout_of(arguments: argparse.Namespace, record: "Record") -> "Layout":
    """What the user says of the parts to use, to fit and to judge."""
    from study.records.record_layout import Layout

    alternate = arguments.judge == ALTERNATE
    fit, judge = _within(arguments.fit, record), None if alternate else _within(arguments.judge, record)
    return Layout(
        tuple(arguments.use),
        fit,
        judge,
        alternate,
        arguments.response,
        arguments.cutoff,
        arguments.near,
        arguments.up_to,
        arguments.as_sampled,
        arguments.horizon,
    )


def accounted_together(
    arguments: argparse.Namespace, model: "Model", records: "Sequence[Record]", path: Path, **options: Any
) -> "Accounted":
    """The comparison of a model with records that are made ready and corrected for faults of the measurement.

    One model is fitted to all of them. ``options`` are the estimator and progress of
    :func:`study.way_in.compare_records.compare_records`.
    """
    from study.faults.fault import settings_asked
    from study.way_in.compare_records import compare_records

    with naming(path, arguments.model):
        settings = settings_asked(path, False if arguments.no_measurement else None)
        layout = layout_of(arguments, records[0])
        return compare_records(records, model, layout, settings, absolute=arguments.absolute, **options)


def separated_records(
    arguments: argparse.Namespace, model: "Model", records: "list[Record]"
) -> "tuple[Model, list[Record], tuple[Separate, ...]]":
    """The model and the records with what ``--each-record`` asks for; as they are where it asks for nothing."""
    if not arguments.each_record:
        return model, records, ()
    from study.compare.each_record import separated

    return separated(model, records, arguments.each_record)


@contextmanager
def naming(record: Path, model: Path) -> Generator[None, None, None]:
    """Begin a sentence that names neither file with the one that it is about: a formula's with the model's."""
    try:
        yield
    except StudyError as error:
        said = str(error)
        if str(record) in said or str(model) in said:
            raise
        of_model = any(word in said for word in ("formula", "expression", "the model holds"))
        raise StudyError(f"{model if of_model else record}: {said}") from None


def _within(given: Span | None, record: "Record") -> tuple[int, int] | None:
    return None if given is None else (given[0], len(record) if given[1] is None else given[1])


def out_folder(arguments: argparse.Namespace) -> Path:
    """Where results go, seen to be writable: ``--out``, or ``results/`` and the stem of the first record."""
    from study.support.files import check_folder

    first: Path = arguments.records[0]
    folder: Path = arguments.out if arguments.out is not None else RESULTS / (first.stem or "record")
    expect(
        folder.is_dir() or folder != arguments.out or folder.suffix not in (".yaml", ".csv", ".json", ".html", ".pdf"),
        f"--out {folder}: this is the name of a file, and results go into a folder; expected such as {folder.stem}",
    )
    check_folder(folder)
    return folder


def inputs_of(arguments: argparse.Namespace) -> list[Path]:
    """What a command reads, which nothing may be written over: records, what stands beside them, and the model."""
    from study.compare.history import path_of
    from study.records.readers.options import options_beside

    model: Path = arguments.model
    return [*arguments.records, *(options_beside(path) for path in arguments.records), model, path_of(model)]


def written_together(
    arguments: argparse.Namespace, text: str, steps: "list[Step]", comparison: bytes, folder: Path
) -> None:
    """Write the model's new text, its history and the comparison, all or none; the model must be locked."""
    from study.compare import history
    from study.support.files import keep, made, replace_together

    results = {folder / "comparison.json": comparison}
    keep(inputs_of(arguments), results)
    model: Path = arguments.model
    changed = {model: text.encode(), history.path_of(model): history.as_bytes(steps)}
    with made(folder):
        replace_together(model, changed, results)
