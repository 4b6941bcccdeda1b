"""``study plan``: which test would decide between effects that are tied, or tells a value closely."""

import argparse
import re

from study.commands.command import Command, finite_number, progress, say_left_out
from study.commands.record_arguments import (
    accounted_together,
    add_record_arguments,
    inputs_of,
    out_folder,
    read_records,
)

PRECISION = re.compile(r"(?P<key>[^=\s]+)\s*=\s*(?P<share>[0-9.eE+-]+)\s*%")


def _arguments(parser: argparse.ArgumentParser) -> None:
    add_record_arguments(parser)
    limits = parser.add_argument_group("limits of the test (default: what this record reached)")
    limits.add_argument(
        "--max-force", type=finite_number(above=0.0), metavar="VALUE",
        help="largest force, in the unit of the record; of a moving base its largest acceleration in m/s^2 "
        "(mm/s^2 for motions in mm)",
    )  # fmt: skip
    limits.add_argument(
        "--max-displacement", type=finite_number(above=0.0), metavar="VALUE", help="largest displacement anywhere"
    )
    limits.add_argument("--max-length", type=finite_number(above=0.0), metavar="SECONDS", help="longest test")
    parser.add_argument(
        "--sensor", action="append", default=[], metavar="NAME",
        help="a sensor that could be added, as 'floor2 acceleration' (default: any)",
    )  # fmt: skip
    parser.add_argument(
        "--precision", type=_precision, metavar="KEY=PERCENT",
        help="ask for the test that determines a value closely enough: k3=5%% for a 95 %% interval of k3 within 5 %%",
    )  # fmt: skip
    parser.add_argument("--without", action="append", default=[], metavar="TERM", help="do not try this effect")


def _precision(text: str) -> tuple[str, float]:
    """``k3=5%`` as a key and a share."""
    found = PRECISION.fullmatch(text.strip())
    try:
        share = 0.01 * float(found["share"]) if found else 0.0
    except ValueError:
        share = 0.0
    if found is None or not 0.0 < share < 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no value and width such as k3=5% (above 0, below 100 %)")
    return found["key"], share


def _run(arguments: argparse.Namespace) -> None:
    from study.diagnose.confirmed_faults import diagnose_accounted
    from study.diagnose.next_test import next_test, tied_rows
    from study.diagnose.next_test_report import deciding_plan, precise_plan
    from study.diagnose.precision import precise_test
    from study.diagnose.separation import limits_asked, rivals_of
    from study.equations import terms
    from study.equations.model_file import read_model
    from study.records.record import MOTIONS, Sensor
    from study.support.errors import expect
    from study.support.extras import undrawn
    from study.support.files import write_files

    folder, model = out_folder(arguments), read_model(arguments.model)
    for name in arguments.without:
        terms.get(name)
    motions = [str(Sensor(coordinate, motion)) for coordinate in model.coordinates for motion in MOTIONS]
    for name in arguments.sensor:  # at once, not once all is diagnosed
        expect(name in motions, f"--sensor {name!r} is no motion of the model; expected one of {', '.join(motions)}")
    records = read_records(arguments, model)
    asked = arguments.max_force, arguments.max_displacement, arguments.max_length
    with progress(" steps", name=records[0].name) as step:
        accounted = accounted_together(arguments, model, records, arguments.records[0], progress=step)
        diagnosis = diagnose_accounted(
            accounted,
            without=tuple(arguments.without),
            progress=lambda done, of, what: step(f"diagnosing, {what}", max(of - done, 0)),
        ).diagnosis
        if arguments.precision:
            fit = (diagnosis.answer or diagnosis.comparison).fit
            step("comparing tests")
            key, wanted = arguments.precision
            words, files = precise_plan(precise_test(fit, diagnosis.comparison.prepared, key, wanted, asked))
        else:
            rivals = rivals_of(tied_rows(diagnosis), diagnosis.comparison.prepared)
            limits = limits_asked(rivals.fits, rivals.present, *asked)
            words, files = deciding_plan(next_test(rivals, limits, sensors=arguments.sensor, progress=step))
    write_files(folder, files, inputs_of(arguments))
    print(f"{words}\n\n{folder}: {', '.join(name for name in files if not name.endswith('.svg'))}")
    say_left_out("" if arguments.precision else undrawn())


COMMAND = Command(
    "plan", "which test would decide between effects that are tied",
    "study plan rig.csv --model rig.yaml --max-force 40 --max-displacement 0.02 --max-length 120\n"
    "  study plan rig.csv --model rig.yaml --precision k3=5% --max-force 40  # which test tells k3 to 5 %?\n"
    "  study plan frame.csv --model frame.yaml --max-force 200  # a structure: which sensor, too",
    _arguments, _run,
)  # fmt: skip
