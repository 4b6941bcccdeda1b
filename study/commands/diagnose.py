"""``study diagnose``: which effect is missing from a model."""

import argparse
import math
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import Command, progress, say_left_out
from study.commands.record_arguments import (
    accounted_together,
    add_each_record_argument,
    add_record_arguments,
    inputs_of,
    out_folder,
    read_records,
    separated_records,
    sources,
)
from study.explore import PAGE

if TYPE_CHECKING:
    from study.compare.each_record import Separate
    from study.diagnose.confirmed_faults import Diagnosed
    from study.diagnose.needless import Needless
    from study.equations.model import Model
    from study.equations.terms import Term
    from study.records.record import Record


def add_diagnosis_arguments(parser: argparse.ArgumentParser) -> None:
    """What is asked for beside the effects of the library, and what is not."""
    parser.add_argument(
        "--candidate", action="append", default=[], metavar="NAME=FORMULA",
        help="a candidate of your own; NAME(vs)=tanh(v/vs) has a parameter to be fitted",
    )  # fmt: skip
    parser.add_argument("--without", action="append", default=[], metavar="TERM", help="do not try this effect")
    parser.add_argument("--thorough", action="store_true", help="search to the end, instead of for about a minute")


def _arguments(parser: argparse.ArgumentParser) -> None:
    add_record_arguments(parser)
    add_each_record_argument(parser)
    add_diagnosis_arguments(parser)
    parser.add_argument("--each", action="store_true", help="a verdict for each record, instead of one for all")


def _run(arguments: argparse.Namespace) -> None:
    from study.support.errors import expect
    from study.support.extras import undrawn
    from study.support.files import write_files

    expect(not (arguments.each and arguments.each_record), "--each and --each-record exclude each other; expected one")
    folder = out_folder(arguments)
    model, own, records = asked(arguments)
    files: dict[str, bytes] = {}
    if not arguments.each:  # one verdict on one structure
        files = _diagnosed(model, records, arguments.records[0], arguments, own)
    for record, path in zip(records, sources(arguments), strict=True) if arguments.each else ():
        prefix = f"{record.name}_" if len(records) > 1 else ""
        files |= {prefix + name: data for name, data in _diagnosed(model, [record], path, arguments, own).items()}
    write_files(folder, files, inputs_of(arguments))
    print(f"\n{folder}: {', '.join(name for name in files if not name.endswith('.svg'))}")
    say_left_out(_no_page(), undrawn())


def asked(arguments: argparse.Namespace) -> "tuple[Model, list[Term], list[Record]]":
    """The model, the user's own candidates and the records, what is wrong with them said before the work begins."""
    from study.diagnose.user_candidates import own_candidates
    from study.equations import terms
    from study.equations.model_file import read_model
    from study.faults.fault import settings_beside

    model = read_model(arguments.model)
    own = own_candidates(arguments.candidate, model)
    for name in arguments.without:
        terms.get(name)
    records = read_records(arguments, model)
    for path in arguments.records:
        settings_beside(path)
    return model, own, records


def diagnosed_together(
    arguments: argparse.Namespace, model: "Model", records: "list[Record]", path: Path, own: "list[Term]"
) -> "tuple[Diagnosed, tuple[Separate, ...]]":
    """The diagnosis of one record, or of several together, and the coefficients that may differ between them."""
    from study.compare.comparison import REPORTS
    from study.diagnose.confirmed_faults import diagnose_accounted
    from study.diagnose.user_candidates import check_on
    from study.support import work

    name = ", ".join(record.name for record in records)
    with work.limited_to(math.inf) if arguments.thorough else nullcontext():
        with progress("step", REPORTS, name) as step:
            model, marked, separate = separated_records(arguments, model, records)
            accounted = accounted_together(arguments, model, marked, path, progress=step)
        with progress(" fits", name=name) as step:
            check_on(accounted.comparison.record, own)
            without = tuple(arguments.without)
            found = diagnose_accounted(
                accounted,
                extra=own,
                without=without,
                progress=lambda done, of, what: step(f"{name}, {what}", max(of - done, 0)),
            )  # a set is searched, and a corrected record diagnosed, with counts of their own
    return found, separate


def _diagnosed(
    model: "Model", records: "list[Record]", path: Path, arguments: argparse.Namespace, own: "list[Term]"
) -> dict[str, bytes]:  # fmt: skip
    """Diagnose one record, or several together, print the diagnosis, and give the files' contents."""
    from study.compare import each_record
    from study.compare.each_record import levels_by_record
    from study.diagnose import diagnosis_report
    from study.diagnose.diagnosis_files import (
        diagnosis_files,
        diagnosis_in_words,
        modes_before_and_after,
        unneeded_in_words,
    )
    from study.diagnose.needless import needless
    from study.diagnose.user_candidates import unfitted, unfitted_in_words

    found, separate = diagnosed_together(arguments, model, records, path, own)
    diagnosis, comparison, faults = found.diagnosis, found.accounted.comparison, found.faults
    with progress(" terms"):
        unneeded = needless(comparison)
    untried, words = unfitted(diagnosis, own), diagnosis_in_words(diagnosis)
    name = ", ".join(record.name for record in records)
    print(f"{name}: {diagnosis.verdict.replace('_', ' ')}")
    print(diagnosis_report.candidate_table(diagnosis))
    if table := diagnosis_report.set_table(diagnosis):
        print(f"\n{table}")
    for sentence in unfitted_in_words(untried):
        print(sentence)
    levels = levels_by_record(comparison, separate, records)
    if levels:
        print(f"\nCoefficients of the model as it was given, by record:\n{each_record.record_table(levels, records)}")
    if model.named and not model.prescribed:
        print("\n" + modes_before_and_after(diagnosis))
    print("\n" + words)
    if faults:
        print("\n" + " ".join(fault.says for fault in faults))
    if unneeded:
        print(f"\n{unneeded_in_words(unneeded, diagnosis)} 'study drop' takes a term out.")
    files = diagnosis_files(diagnosis, words, unneeded, faults, untried, each_record.rows(levels, records))
    return files | _page(found, unneeded)


def _no_page() -> str:
    """Why there can be no page, in a sentence; empty where there can."""
    from study.support.extras import lacking

    return lacking("bokeh", PAGE, "explore")


def _page(found: "Diagnosed", unneeded: "tuple[Needless, ...]") -> dict[str, bytes]:
    """What is missing, of a structure place by place, as a page to look at; none without what draws it."""
    if _no_page():
        return {}
    from study.explore.saved import of_diagnosis

    return {PAGE: of_diagnosis(found, unneeded)}


COMMAND = Command(
    "diagnose", "which effect is missing from a model",
    "study diagnose rig.csv --model rig.yaml\n"
    "  study diagnose low.csv mid.csv high.csv --model rig.yaml  # one verdict on all; --each: one on each\n"
    "  study diagnose rig.h5 --group low --group high --each-record linear_damping --model rig.yaml\n"
    "  study diagnose roll.csv --free --model rig.yaml  # a free decay: no force acts\n"
    "  study diagnose blows.csv --use 2.0:9.5 --use 12.0:30.0 --model rig.yaml  # the stretches between blows\n"
    "  study diagnose damper.csv --model damper.yaml  # a component test: the model has no inertia\n"
    "  study diagnose table.csv --absolute --model rig.yaml  # a moving base: its column is base_acceleration\n"
    "  study diagnose axis.csv --model axis.yaml  # no spring: nothing in the model depends on the displacement\n"
    "  study diagnose frame.csv --model frame.yaml  # a structure: the effect and its place\n"
    "  study diagnose sweep.csv --model rig.yaml  # judged in every other block, if its halves differ in frequency\n"
    "  study diagnose rig.csv --model rig.yaml --candidate \"bracket=u*abs(u) + 0.1*v**3\" --without hysteresis",
    _arguments, _run,
)  # fmt: skip
