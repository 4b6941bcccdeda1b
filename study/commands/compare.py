"""``study compare``: how good a model is, and where it fails."""

import argparse
from typing import TYPE_CHECKING

from study.commands.command import Command, progress
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
from study.identify.estimators import ESTIMATORS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from study.compare.comparison import Comparison
    from study.compare.fitted_coefficients import Level

NOT_TOGETHER = ("siso", "miso_hand_read")  # estimators that do not find all coefficients of a model, or not together


def _arguments(parser: argparse.ArgumentParser) -> None:
    add_record_arguments(parser)
    add_each_record_argument(parser)
    parser.add_argument(
        "--estimator", choices=[n for n in ESTIMATORS if n not in NOT_TOGETHER], default="output_error",
        help="what finds the coefficients: a fit in free run (default), or in reverse from the frequency response "
        "functions; errors_in_variables is for several periods (--period) with noise on the force as well",
    )  # fmt: skip


def _run(arguments: argparse.Namespace) -> None:
    from study.compare import each_record
    from study.compare.comparison import REPORTS, across_records
    from study.compare.comparison_report import as_json, comparison_document, comparison_summary, tables
    from study.compare.each_record import levels_by_record
    from study.equations.model_file import read_model
    from study.faults.fault import fault_fields
    from study.support.extras import lacking, undrawn
    from study.support.files import write_files

    folder = out_folder(arguments)
    model = read_model(arguments.model)
    records = read_records(arguments, model)
    model, marked, separate = separated_records(arguments, model, records)
    tests = [marked] if separate else [[record] for record in records]
    many, unpaged, unpictured = len(tests) > 1, lacking("bokeh", PAGE, "explore"), undrawn()
    files: dict[str, bytes] = {}
    with progress("step", (REPORTS + 1) * len(tests)) as step:
        accounted = [
            accounted_together(arguments, model, test, path, estimator=arguments.estimator, progress=step)
            for test, path in zip(tests, sources(arguments), strict=not separate)
        ]
        comparisons = [a.comparison for a in accounted]
        for comparison in comparisons:
            step("pictures")
            prefix = f"{comparison.record.name}_" if many else ""
            own = ({} if unpictured else _pictures(comparison)) | ({} if unpaged else _page(comparison))
            files |= {prefix + name: content for name, content in own.items()}
    measurement = [{"record": a.comparison.record.name, **fault_fields(f)} for a in accounted for f in a.faults]
    levels = across_records(comparisons)
    files |= {} if unpictured else _level_pictures(levels, comparisons[0].record.force_and_length[0])
    files |= {f"{name}.csv": content for name, content in tables(comparisons, levels).items()}
    content = comparison_document(comparisons, levels) | {"measurement": measurement}
    said = comparison_summary(comparisons, levels)
    if separate:
        each = levels_by_record(comparisons[0], separate, records)
        content["coefficients_by_record"] = each_record.rows(each, records)
        said = f"{each_record.record_table(each, records)}\n\n{said}"
    files["comparison.json"] = as_json(content)
    write_files(folder, files, inputs_of(arguments))
    print(said)
    pages = [name for name in files if name.endswith(".html")]
    page = "a page for each record" if many and pages else pages[0] if pages else f"no page ({unpaged})"
    count = {kind: sum(name.endswith(kind) for name in files) for kind in (".csv", ".png")}
    pictures = f"no pictures ({unpictured})" if unpictured else f"{count['.png']} pictures (PNG and SVG)"
    print(f"\n{folder}: {page}, comparison.json, {count['.csv']} tables, {pictures}")


def _pictures(comparison: "Comparison") -> dict[str, bytes]:
    from study.compare.comparison_pictures import comparison_pictures

    return comparison_pictures(comparison)


def _level_pictures(levels: "Sequence[Level]", force_unit: str) -> dict[str, bytes]:
    from study.compare.comparison_pictures import level_pictures

    return level_pictures(levels, force_unit)


def _page(comparison: "Comparison") -> dict[str, bytes]:
    from study.explore.saved import of_comparison

    return {PAGE: of_comparison(comparison)}


COMMAND = Command(
    "compare", "how good a model is, and where it fails",
    "study compare rig.csv --model rig.yaml\n"
    "  study compare rig.csv --model rig.yaml --estimator local_polynomial\n"
    "  study compare low.csv high.csv --model rig.yaml --out results/levels\n"
    "  study compare frame.csv --model frame.yaml  # a structure: which equation is violated, and where\n"
    "  study compare SNLS80mV.csv --column force=V1 --column displacement=V2 --unit force=V --unit displacement=V"
    " --fs 610.35 --fit 40650:127400 --judge 100:40575 --model silverbox.yaml",
    _arguments, _run,
)  # fmt: skip
