"""``study data``: the public records that docs, gallery and notebooks use, and where they are."""

import argparse

from study.commands.command import Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", nargs="?", help="record to look for, and to fetch if it is missing (default: list all)")
    parser.add_argument(
        "--address", default="",
        help="address of the file, or of a folder with the record's files under their names (default: the public one); "
        "checksums are verified",
    )  # fmt: skip


def _run(arguments: argparse.Namespace) -> None:
    from study.records.public_records import data_folder, fetch
    from study.support.errors import expect

    expect(bool(arguments.name) or not arguments.address, "--address is for one record; expected its name before it")
    folder = data_folder()
    if not arguments.name:
        print(listing())
        return
    for path in fetch(arguments.name, folder, arguments.address):
        print(path)
    print(f"\nSTUDY_DATA={folder} tells the study where its records are.")


def listing() -> str:
    """Every record with its licence, its size, whether it is there, and where to get it."""
    from tabulate import tabulate

    from study.records.public_records import RECORDS, data_folder, state_of

    folder, rows = data_folder(), list[list[str]]()
    for name, record in RECORDS.items():
        states = {state_of(folder / name / file.name, file) for file in record.files}
        state = "there" if states == {"there"} else "differs" if "differs" in states else "missing"
        count = f"{len(record.files)} file{'s' if len(record.files) > 1 else ''}, {record.size / 1e6:.1f} MB"
        fetched = f"study data {name}, or " if all(file.address for file in record.files) else ""
        rows.append([name, f"{record.title}: {record.source}", record.licence, count, state, fetched + record.by_hand])
    head = ["record", "what", "licence", "size", "is", "where to get it"]
    table = tabulate(rows, head, tablefmt="simple", maxcolwidths=[None, 34, 22, None, None, 36])
    return f"{table}\n\nRecords are looked for in {folder}, which STUDY_DATA may name; none is part of the project."


COMMAND = Command(
    "data", "the public records that docs and gallery use: list, fetch, verify",
    "study data\n  study data silverbox\n  study data silverbox --address https://example.org/SNLS80mV.mat",
    _arguments, _run,
)  # fmt: skip
