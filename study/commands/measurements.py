"""Measured records that the workflow analyses: one row a record, in the words of the command line."""

import os
import shlex
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from study.commands.parser import parser
from study.support.errors import StudyError
from study.support.schema import numbered_rows

VARIABLE = "$STUDY_DATA"
BESIDE = Path("../shared/data")  # where data lie that no variable points to
TAKEN = ("--out", "--model", "-h", "--help")


@dataclass(frozen=True)
class Measurement:
    """One row of ``config/measurements.tsv``.

    Attributes
    ----------
    name : str
        As targets and folders name it.
    path : str
        The data file.
    model : str
        The model file that is compared, and from which a climb begins.
    steps : int
        Effects that a climb may add.
    options : tuple of str
        How the record is read, fitted and judged: options of ``study compare``.
    """

    name: str
    path: str
    model: str
    steps: int
    options: tuple[str, ...]


def data_folder() -> Path:
    """The folder that ``STUDY_DATA`` names; ``../shared/data`` if it is not set."""
    return Path(os.environ.get(VARIABLE[1:]) or BESIDE)


def load(folder: Path, cases: Collection[str] = ()) -> Mapping[str, Measurement]:
    """Read ``measurements.tsv`` of a folder; whether the data are there is not asked.

    Parameters
    ----------
    folder : Path
        ``config/``.
    cases : collection of str
        Names that a record may not have, nor the target of its climb.

    Raises
    ------
    StudyError
        At the first fault, naming file, row and value.
    """
    found: dict[str, Measurement] = {}
    for where, row in numbered_rows(folder / "measurements.tsv", folder / "schemas" / "measurements.schema.yaml"):
        if row["record"] in found:
            raise StudyError(f"{where}: the record stands twice; each name may be used once")
        for name in (row["record"], f"{row['record']}_climb"):
            if name in cases:
                raise StudyError(f"{where}: {name!r} is a case of cases.tsv; give the record or the case another name")
        model = folder.parent / "models" / f"{row['model']}.yaml"
        if not model.is_file():
            known = ", ".join(sorted(p.stem for p in (folder.parent / "models").rglob("*.yaml")))
            raise StudyError(f"{where}: there is no model {row['model']!r}; models/ holds {known}")
        path = row["path"].replace(VARIABLE, str(data_folder()), 1)
        options = _options(row["options"], where)
        found[row["record"]] = Measurement(row["record"], path, str(model), row["steps"], options)
    return found


def _options(text: str, where: str) -> tuple[str, ...]:
    """The words of the options, read once by the command's own parser so that no job has to refuse them."""
    try:
        words = tuple(shlex.split(text))
    except ValueError as error:
        raise StudyError(f"{where}: options {text!r} cannot be split into words: {error}") from None
    for word in words:
        if word.partition("=")[0] in TAKEN:
            raise StudyError(f"{where}: options name {word}, which the workflow gives; leave it out")
    try:
        parser().parse_args(["compare", "record", "--model", "model", *words])
    except StudyError as error:
        raise StudyError(f"{where}: options: {error}") from None
    return words


def check_present(path: Path) -> None:
    """See that a data file is there.

    Raises
    ------
    StudyError
        If not.
    """
    if not path.is_file():
        raise StudyError(
            f"{path} is not there; the project holds no data: set {VARIABLE[1:]} to the folder that holds them"
        )
