"""Measured records that the workflow analyses: one row a record, in the words of the command line."""

import os
import shlex
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field

from study.commands.parser import parser
from study.equations.model_file import read_model
from study.support.config_files import TableRow, Text, read_rows
from study.support.errors import StudyError, at, expect

VARIABLE = "$STUDY_DATA"  # at the beginning of a path: the folder that this environment variable names
NAME = "up to 64 of a to z, 0 to 9 and _, a letter first"  # targets and folders bear it
TAKEN = ("--out", "--model", "-h", "--help")


def _files(text: object) -> object:
    """One file or several; a name that holds a space stands in quotes."""
    return tuple(_split(text, "paths")) if isinstance(text, str) else text


def _split(text: str, what: str) -> list[str]:
    try:
        return shlex.split(text)
    except ValueError as error:
        raise StudyError(f"{what} {text!r} cannot be split into words: {error}") from None


def _words(text: object) -> object:
    """The words of the options, read once by the command's own parser so that no job has to refuse them."""
    if not isinstance(text, str):
        return text
    words = tuple(_split(text, "options"))
    for word in words:
        expect(word.partition("=")[0] not in TAKEN, f"options name {word}, which the workflow gives; leave it out")
    with at("options"):
        parser().parse_args(["compare", "record", "--model", "model", *words])
    return words


Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*\Z", max_length=64, description=NAME)]


class Measurement(TableRow):
    """One row of ``config/measurements.tsv``."""

    record: Name
    entry: Name  # of the gallery, and the target that makes it: rows of one structure share it
    paths: Annotated[tuple[Text, ...], BeforeValidator(_files), Field(min_length=1)]  # one model is fitted to all
    model: Text  # that is compared, and from which a climb begins: its name below ``models/``, or its file
    steps: Annotated[int, Field(ge=1, le=20)]  # effects that a climb may add
    options: Annotated[tuple[str, ...], BeforeValidator(_words)]  # of ``study compare``


def load_measurements(
    folder: Path, cases: Collection[str] = (), targets: Collection[str] = ()
) -> Mapping[str, Measurement]:
    """Read ``measurements.tsv`` of a folder; whether the data are there is not asked.

    No record, nor the target of its climb, nor its entry, may have one of the names of ``cases`` or of the workflow's
    other ``targets``.
    """
    measurements: dict[str, Measurement] = {}
    models = folder.parent / "models"
    known = ", ".join(sorted(path.stem for path in models.rglob("*.yaml")))
    for where, row in read_rows(folder / "measurements.tsv", Measurement):
        model = models / f"{row.model}.yaml"
        with at(where):
            expect(row.record not in measurements, "the record stands twice; expected each name once")
            for name in (row.record, f"{row.record}_climb", row.entry):
                case = f"{name!r} is a case of cases.tsv; give the record or the case another name"
                expect(name not in cases, case)
                other = f"{name!r} is another target of the workflow; give the record or its entry another name"
                expect(name not in targets, other)
            expect(model.is_file(), f"there is no model {row.model!r}; models/ holds {known}")
        folder_named = os.environ.get(VARIABLE[1:]) or VARIABLE
        paths = tuple(path.replace(VARIABLE, folder_named, 1) for path in row.paths)
        measurements[row.record] = row.model_copy(update={"paths": paths, "model": str(model)})
    return measurements


def is_structure(row: Measurement) -> bool:
    """Whether the model of a row has coordinates; it was read by :func:`load_measurements`."""
    return read_model(Path(row.model)).named


def check_present(path: Path) -> None:
    """See that a folder of data is named and a data file is there."""
    named = VARIABLE[1:]
    if VARIABLE in path.parts:
        raise StudyError(f"{path}: {named} is not set; expected the folder that holds {path.relative_to(VARIABLE)}")
    expect(path.is_file(), f"{path} is not there; the project holds no data: set {named} to the folder that holds them")
