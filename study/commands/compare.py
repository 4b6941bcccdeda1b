"""``study compare``: how good a model is, and where it fails."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import Command
from study.commands.record_arguments import add_record_arguments, out_folder, prepared_of, read_records
from study.identify.estimators import ESTIMATORS

if TYPE_CHECKING:
    from study.compare.comparison import Comparison

PAGE = "explore.html"
WITHOUT = ("siso", "miso_hand_read")  # estimators that do not find all coefficients of a model, or not together
QUIET = 2.0  # seconds of work before progress is shown


def _arguments(parser: argparse.ArgumentParser) -> None:
    add_record_arguments(parser)
    parser.add_argument("--model", type=Path, required=True, help="model file (YAML); what it gives is held")
    parser.add_argument(
        "--estimator", choices=[n for n in ESTIMATORS if n not in WITHOUT], default="output_error",
        help="what finds the coefficients: a fit in free run (default), or in reverse from the frequency response "
        "functions; errors_in_variables is for several periods (--period) with noise on the force as well",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="folder for results (default results/RECORD)")


def _run(arguments: argparse.Namespace) -> None:
    from tqdm import tqdm

    from study.compare.comparison import STEPS, across, compare
    from study.compare.comparison_pictures import level_pictures, pictures
    from study.compare.comparison_report import as_json, document, summary, tables
    from study.equations.model_file import read_model
    from study.support.extras import lacking
    from study.support.file_sets import check_folder, write_files

    folder = out_folder(arguments)
    check_folder(folder)
    model = read_model(arguments.model)
    records = read_records(arguments)
    prepared = [prepared_of(arguments, record) for record in records]
    many, unpaged = len(records) > 1, lacking("bokeh", PAGE, "explore")
    files: dict[str, bytes] = {}
    with tqdm(total=(STEPS + 1) * len(records), delay=QUIET, leave=False, unit="step") as bar:

        def told(what: str) -> None:
            bar.set_description(what, refresh=False)
            bar.update()

        found = [compare(model, one, estimator=arguments.estimator, progress=told) for one in prepared]
        for one in found:
            told("pictures")
            prefix = f"{one.record.name}_" if many else ""
            files |= {prefix + name: content for name, content in pictures(one).items()}
            if not unpaged:
                files |= _page(one, prefix)
    moving = across(found)
    files |= level_pictures(moving, found[0].record.units.get("force", "N"))
    files |= {f"{name}.csv": content for name, content in tables(found, moving).items()}
    files["comparison.json"] = as_json(document(found, moving))
    write_files(folder, files)
    print(summary(found, moving))
    what = f"{_count(files, '.csv')} tables, {_count(files, '.png')} pictures (PNG and SVG)"
    page = f"no page ({unpaged})" if unpaged else "a page for each record" if many else PAGE
    print(f"\n{folder}: {page}, comparison.json, {what}")


def _page(comparison: "Comparison", prefix: str) -> dict[str, bytes]:
    from study.explore.saved import of_comparison

    return {prefix + PAGE: of_comparison(comparison)}


def _count(files: dict[str, bytes], kind: str) -> int:
    return sum(name.endswith(kind) for name in files)


COMMAND = Command(
    "compare", "how good a model is, and where it fails",
    "study compare rig.csv --model rig.yaml\n"
    "  study compare rig.csv --model rig.yaml --estimator local_polynomial\n"
    "  study compare low.csv high.csv --model rig.yaml --out results/levels\n"
    "  study compare SNLS80mV.csv --column force=V1 --column displacement=V2 --unit force=V --unit displacement=V"
    " --fs 610.35 --fit 40650:127400 --judge 100:40575 --model silverbox.yaml",
    _arguments, _run,
)  # fmt: skip
