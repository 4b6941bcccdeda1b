"""``study report``: a diagnosis on one page, to hand over."""

import argparse

from study.commands.command import Command, progress
from study.commands.diagnose import add_diagnosis_arguments, asked, diagnosed_together
from study.commands.record_arguments import add_each_record_argument, add_record_arguments, inputs_of, out_folder


def _arguments(parser: argparse.ArgumentParser) -> None:
    add_record_arguments(parser)
    add_each_record_argument(parser)
    add_diagnosis_arguments(parser)


def _run(arguments: argparse.Namespace) -> None:
    from study.support.extras import needed
    from study.support.files import write_files

    needed("matplotlib", "'study report'", "pictures")
    from study.diagnose.one_page import one_page
    from study.diagnose.one_page_files import one_page_files

    folder = out_folder(arguments)
    model, own, records = asked(arguments)
    found, _ = diagnosed_together(arguments, model, records, arguments.records[0], own)
    with progress(" pages"):
        content = one_page(found.diagnosis, found.faults)
        files = one_page_files(content)
    write_files(folder, files, inputs_of(arguments))
    print(f"{content.headline}.\n\n{folder}: {', '.join(files)}")


COMMAND = Command(
    "report", "a diagnosis on one page, to hand over: PDF and HTML",
    "study report rig.csv --model rig.yaml\n"
    "  study report low.csv high.csv --model rig.yaml --out handover",
    _arguments, _run,
)  # fmt: skip
