"""What the report states: ``config/reported.tsv``."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from study.support.errors import StudyError
from study.support.schema import read_table, read_yaml

MANY = 8  # numbers that still read well in one cell


@dataclass(frozen=True)
class Statement:
    """One row: a statement, with its number where it has one.

    Attributes
    ----------
    id : str
        A claim's name; further numbers of the same claim are ``<claim>.<name>``.
    where : str
        Section, figure or table.
    what : str
        The statement in a sentence, or what the number is.
    value : float or None
        The number.
    unit : str
        Its unit.
    """

    id: str
    where: str
    what: str
    value: float | None
    unit: str

    def __str__(self) -> str:
        """The number with its unit."""
        return "" if self.value is None else f"{self.value:.6g} {self.unit}".strip()


@dataclass(frozen=True)
class Reported:
    """All statements by id."""

    statements: Mapping[str, Statement]

    def __getitem__(self, name: str) -> Statement:
        """One statement.

        Raises
        ------
        StudyError
            If there is none of this id.
        """
        if name not in self.statements:
            raise StudyError(f"config/reported.tsv has no row {name!r}")
        return self.statements[name]

    def value(self, name: str) -> float:
        """The number of one statement.

        Raises
        ------
        StudyError
            If the statement has none.
        """
        value = self[name].value
        if value is None:
            raise StudyError(f"config/reported.tsv gives no value for {name!r}")
        return value

    def table_1(self, system: str, name: str) -> float:
        """A parameter of a system by Table 1; zero where the system has no such term."""
        if name == "m":
            return self.value("table_1.m")
        key = {"k_dead_band": "k"}.get(name, name)
        row = self.statements.get(f"table_1.{system}.{key}")
        return 0.0 if row is None or row.value is None else row.value

    def numbers(self, name: str) -> str:
        """Every number of a claim, for the column ``reported``."""
        rows = [s for s in self.statements.values() if s.id == name or s.id.startswith(f"{name}.")]
        found = [str(s) for s in rows if s.value is not None]
        return "as tabulated" if len(found) > MANY else ", ".join(found) or "as stated"


def check_complete(reported: Reported, path: Path, schema: Path) -> None:
    """Whether the rows are those that the claims ask for, by the two lists of ``schema``.

    Raises
    ------
    StudyError
        At the first row that no claim asks for, that lacks its value, or that is not there.
    """
    lists = cast(dict[str, list[str]], read_yaml(schema)["statements"])
    known = [*lists["with_a_value"], *lists["in_words"]]
    for name in reported.statements:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            raise StudyError(
                f"{path}: no claim asks for {name!r}"
                + (f"; {near[0]!r} is near it" if near else f"; a new claim's row is listed in {schema}")
            )
    for name in known:
        if name not in reported.statements:
            raise StudyError(f"{path} has no row {name!r}, which the claims ask for")
    for name in lists["with_a_value"]:
        if reported[name].value is None:
            raise StudyError(f"{path}: {name!r} has no value; the number that the report states is needed")


def check_systems(reported: Reported, models: Path) -> None:
    """Whether each system of Table 1 has its model.

    Raises
    ------
    StudyError
        At the first that has none, naming it.
    """
    for name in reported.statements:
        where, _, rest = name.partition(".")
        system, _, parameter = rest.partition(".")
        if where == "table_1" and parameter and not (models / f"{system}.yaml").is_file():
            raise StudyError(f"config/reported.tsv: {name!r} names a system that is not in {models.name}/")


def load(path: Path, schema: Path) -> Reported:
    """Read and check the table.

    Raises
    ------
    StudyError
        At the first fault, naming row and value.
    """
    found: dict[str, Statement] = {}
    for row in read_table(path, schema):
        statement = Statement(**row)
        if statement.id in found:
            raise StudyError(f"{path}: the id {statement.id!r} stands twice; each may be used once")
        found[statement.id] = statement
    return Reported(found)
