"""``study campaign``: a folder of records on one page: which coefficients differ, which verdicts."""

import argparse
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study.commands.command import Command, progress
from study.commands.record_arguments import (
    RESULTS,
    accounted_together,
    add_reading_arguments,
    read_records,
)

if TYPE_CHECKING:
    from study.equations.model import Model

CAMPAIGN_PAGE = "campaign.html"
SOURCE = "made_from.json"
TEXTS = (".csv", ".txt", ".tsv", ".dat", ".asc")


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, help="folder of records of one rig, or of rigs of one kind")
    parser.add_argument(
        "--model",
        type=Path,
        required=True,
        help="model file (YAML); values in it are held, except those with held: false",
    )
    parser.add_argument(
        "--by", choices=("record", "level", "date"), default="record",
        help="order of the records: by name (default), by the level of the response, or by the day in the name, as in "
        "rig_2026-03-01.csv",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="folder for results (default results/FOLDER)")
    add_reading_arguments(parser)


def _run(arguments: argparse.Namespace) -> None:
    from study.compare.campaign import Measured, campaign_blocks, day_of
    from study.equations.model_file import read_model
    from study.support.document import document_page
    from study.support.errors import StudyError, expect
    from study.support.extras import needed
    from study.support.files import check_folder, write_files

    needed("matplotlib", "'study campaign'", "pictures")
    records, folder = _records_in(arguments.folder), arguments.out
    out: Path = folder if folder is not None else RESULTS / (arguments.folder.resolve().name or "campaign")
    check_folder(out)
    model = read_model(arguments.model)
    for path in records if arguments.by == "date" else ():
        expect(day_of(path.stem), f"{path}: its name holds no day; expected one such as rig_2026-03-01.csv")
    found, refused, reused = list[Measured](), dict[str, str](), 0
    with progress(" records", len(records)) as step:
        for number, path in enumerate(records, 1):
            step(f"{path.stem} ({number} of {len(records)})", len(records) - number)
            digest, place = _digest(arguments, path), out / path.stem
            kept = _kept(place, digest)
            try:
                comparison, diagnosis = kept or _found(arguments, model, path, place, digest)
            except StudyError as error:
                refused[path.stem] = str(error)
                continue
            reused += kept is not None
            found.append(Measured(path.stem, model.name, comparison, diagnosis))
    expect(found, f"{arguments.folder}: no record could be used; the first: {next(iter(refused.values()), '')}")
    blocks = campaign_blocks(found, arguments.by, refused)
    write_files(out, {CAMPAIGN_PAGE: document_page(f"{model.name}: {len(found)} records", blocks).encode()})
    _say(blocks)
    again = f", {reused} of them as found before" if reused else ""
    print(f"\n{out / CAMPAIGN_PAGE}: {len(found)} records{again}" + (f", {len(refused)} refused" if refused else ""))


def _records_in(folder: Path) -> list[Path]:
    """The files of a folder that may be records, in the order of their names."""
    from study.records.readers import SUFFIXES
    from study.support.errors import expect

    expect(folder.is_dir(), f"{folder}: this is not a folder; expected one with records, or 'study compare' for a file")
    found = sorted(p for p in folder.iterdir() if p.is_file() and p.suffix.lower() in (*TEXTS, *SUFFIXES))
    expect(found, f"{folder}: there is no record in it; expected files such as rig.csv, rig.mat or rig.h5")
    stems = [path.stem for path in found]
    for path in found:
        expect(stems.count(path.stem) == 1, f"{path}: two records are called {path.stem}; expected a name for each")
    return found


def _digest(arguments: argparse.Namespace, path: Path) -> str:
    """What a result depends on: the record, what stands beside it, the model, the options, this program."""
    from study import __version__
    from study.records.readers.options import options_beside

    given = {k: v for k, v in vars(arguments).items() if k not in ("folder", "model", "out", "by", "run", "command")}
    made = hashlib.sha256(f"{__version__} {sorted(given.items(), key=lambda pair: pair[0])!r}".encode())
    for file in (arguments.model, path, options_beside(path)):
        if file.is_file():
            with file.open("rb") as stream:
                made.update(hashlib.file_digest(stream, "sha256").digest())
    return made.hexdigest()


def _kept(place: Path, digest: str) -> tuple[Mapping[str, Any], Mapping[str, Any]] | None:
    """What an earlier run has found of the same record, and did not leave half done."""
    try:
        read = [json.loads((place / name).read_text()) for name in (SOURCE, "comparison.json", "diagnosis.json")]
    except (OSError, ValueError):
        return None
    return (read[1], read[2]) if read[0] == {"sha256": digest} else None


def _found(
    arguments: argparse.Namespace, model: "Model", path: Path, place: Path, digest: str
) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Compare and diagnose one record; its files stand complete before they count as made."""
    from study.compare.comparison_report import as_json, comparison_document
    from study.diagnose.confirmed_faults import diagnose_accounted
    from study.diagnose.diagnosis_files import diagnosis_files, diagnosis_in_words
    from study.faults.fault import fault_fields
    from study.support.files import write_files

    one = argparse.Namespace(**{**vars(arguments), "records": [path]})
    accounted = accounted_together(one, model, read_records(one, model), path)
    found = diagnose_accounted(accounted)
    faults = [{"record": path.stem, **fault_fields(f)} for f in accounted.faults]
    files = diagnosis_files(found.diagnosis, diagnosis_in_words(found.diagnosis), (), found.faults)
    files["comparison.json"] = as_json(comparison_document([accounted.comparison]) | {"measurement": faults})
    write_files(place, files, [path, arguments.model])
    write_files(place, {SOURCE: as_json({"sha256": digest})})
    return json.loads(files["comparison.json"]), json.loads(files["diagnosis.json"])


def _say(blocks: list[Any]) -> None:
    """The sentences of the page, and its table of verdicts."""
    from tabulate import tabulate

    from study.support.document import Bullets, TableBlock

    (verdicts, *_) = (block for block in blocks if isinstance(block, TableBlock))
    print(tabulate([row[:6] for row in verdicts.rows], verdicts.heading[:6], tablefmt="simple", disable_numparse=True))
    for block in blocks:
        if isinstance(block, Bullets):
            print("\n" + "\n".join(item.replace("**", "") for item in block.items))


COMMAND = Command(
    "campaign", "a folder of records on one page: what differs by more than chance",
    "study campaign measured/ --model rig.yaml\n"
    "  study campaign measured/ --model rig.yaml --by level   # or date, as in rig_2026-03-01.csv",
    _arguments, _run,
)  # fmt: skip
