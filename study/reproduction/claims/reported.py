"""What the report states: ``config/reported.tsv``; a ``StudyError`` names the row or the value that is at fault."""

import difflib
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple, Self

from pydantic import BeforeValidator, Field, model_validator

from study.support.config_files import TableRow, Text, read_rows
from study.support.errors import StudyError, expect

SYSTEMS = ("linear", "duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", "dead_band", "extreme")
COMBINED = "duffing_van_der_pol"
COEFFICIENTS = ("m", "c", "k", "k3", "c3")  # of the combined system
LINEAR_PARTS = ("m", "c", "k", "f_n", "zeta")
PARAMETERS = (*LINEAR_PARTS, "k3", "c3", "k_m", "k_dead_band")
INPUT_VARIANCES = ("lowest", "second", "third", "highest")  # input variances of Section 5.3
NOISE_LEVELS = ("low", "middle", "high")  # of Section 5.4
LIMIT = "limit."  # begins the ids of what was chosen here, before looking, to judge the report's words by
# What a condition in the column ``holds_if`` may say: its subject, then a verb, with what must follow, if anything.
READERS = ("SI/SO", "MI/SO", "fitted", "hand-read")  # of parameters, whose names come after; fitted as SI/SO does
MEASURES = (
    "linear coherence", "multiple coherence", "slope", "mean slope", "cubic part of the mean",
    "gap read off the pattern", "Gaussian", "histogram",
)  # fmt: skip
VERBS = {
    "recovered": "", "near unity": "", "rises": "", "of one record": "", "within": "limit", "off by": "limit",
    "refused at most": "limit", "refused at least": "limit", "at least": "limit", "less distorted than": "system",
}  # fmt: skip
CONDITION = re.compile(rf"(?P<subject>.+?) (?P<verb>{'|'.join(VERBS)})(?: (?P<argument>\S+))?")


class Stated(NamedTuple):
    """A condition in words."""

    subject: str  # names of parameters, after their reader where it is not the study's own; or what is measured
    verb: str
    argument: str


def _stated(cell: object) -> object:
    """The conditions of a cell, with semicolons between them."""
    found: list[Stated] = []
    for words in filter(None, map(str.strip, str(cell).split(";"))):
        match = CONDITION.fullmatch(words)
        if match is None or bool(match["argument"]) != bool(VERBS[match["verb"]]):
            told = ", ".join(f"{verb} <{what}>" if what else verb for verb, what in VERBS.items())
            raise ValueError(f"{words!r} is no condition; expected a subject and one of {told}")
        subject, verb = match["subject"], match["verb"]
        reader, _, names = ("", "", subject) if verb == "recovered" else subject.partition(" ")
        parameters = PARAMETERS if reader in ("", "MI/SO") else LINEAR_PARTS
        if reader in ("", *READERS) and (unknown := [name for name in names.split() if name not in parameters]):
            raise ValueError(f"{words!r} names {unknown[0]!r}; expected some of {', '.join(parameters)}")
        if reader not in ("", *READERS) and not subject.startswith(MEASURES):
            raise ValueError(f"{words!r} is about nothing known; expected {', '.join((*READERS, *MEASURES))}")
        found.append(Stated(subject, verb, match["argument"] or ""))
    return tuple(found)


Words = Annotated[tuple[str, ...], BeforeValidator(lambda cell: tuple(str(cell).split()))]


class Statement(TableRow):
    """One row: a statement, with its number where it has one, and its conditions where they need no code."""

    id: Annotated[
        str,
        Field(pattern=r"^[a-z0-9_]+([.][a-z0-9_]+)*\Z", description="names of a to z, 0 to 9 and _ with dots between"),
    ]  # a claim's name; further numbers of the same claim are ``<claim>.<name>``
    where: Text  # section, figure or table
    what: Text  # the statement in a sentence, or what the number is
    value: Annotated[float | None, BeforeValidator(lambda cell: None if cell == "" else cell)]  # the number
    unit: str  # its unit
    systems: Words  # of Table 1: each must meet the conditions, all of them together where there are several
    levels: Words  # likewise, of ``INPUT_VARIANCES``; at unit variance if there is none
    holds_if: Annotated[tuple[Stated, ...], BeforeValidator(_stated)]
    why: str  # the reason, in case a condition is not met

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        """What a number means bounds it: by its unit, and a share, an error or a noise, which have none, by the id."""
        value = 0.5 if self.value is None else self.value  # which no bound refuses
        if not self.unit and re.search("_(share|error)$|^noise_", self.id):
            holds, expected = 0.0 < value < 1.0, "a number above 0 and below 1"
        elif self.unit in ("kg", "m", "s", "samples", "N^2"):
            holds, expected = value > 0.0, "a number above 0"
        else:
            holds, expected = value >= 0.0, "0 or more"
            holds |= self.unit != "Hz" and not re.search("[.]zeta$|^averages$", self.id)
        if not holds:
            raise ValueError(f"value is {value:g}; expected {expected}")
        for name, known in (
            (n, k) for names, k in ((self.systems, SYSTEMS), (self.levels, INPUT_VARIANCES)) for n in names
        ):
            if name not in known:
                raise ValueError(f"names {name!r}; expected some of {', '.join(known)}")
        if bool(self.holds_if) != bool(self.systems):
            raise ValueError("has conditions or systems without the other; expected both or neither")
        return self

    def __str__(self) -> str:
        return "" if self.value is None else f"{self.value:.6g} {self.unit}".strip()


@dataclass(frozen=True)
class Reported:
    """All statements by id."""

    statements: Mapping[str, Statement]

    def __getitem__(self, name: str) -> Statement:
        if name not in self.statements:
            raise StudyError(f"config/reported.tsv has no row {name!r}")
        return self.statements[name]

    def value(self, name: str) -> float:
        value = self[name].value
        if value is None:
            raise StudyError(f"config/reported.tsv gives no value for {name!r}")
        return value

    def limit(self, name: str) -> float:
        """What a word of the report is judged by: a row ``limit.<name>``, or a number in digits."""
        return float(name) if re.fullmatch("[0-9.]+", name) else self.value(LIMIT + name)

    def table_1(self, system: str, name: str) -> float:
        """A parameter of a system by Table 1; zero where the system has no such term."""
        if name == "m":
            return self.value("table_1.m")
        row = self.statements.get(f"table_1.{system}.{'k' if name == 'k_dead_band' else name}")
        return 0.0 if row is None or row.value is None else row.value

    def band(self, name: str) -> tuple[float, float]:
        """A band of frequencies that the report names, in hertz."""
        return self.value(f"{name}.low"), self.value(f"{name}.high")

    @property
    def levels(self) -> list[float]:
        return [self.value(f"levels_invariant.{name}") for name in INPUT_VARIANCES]

    @property
    def noises(self) -> list[float]:
        return [self.value(f"noise_random_only.{name}") for name in NOISE_LEVELS]

    def numbers(self, name: str) -> str:
        """Every number of a claim, for the column ``reported``."""
        rows = [s for s in self.statements.values() if s.id == name or s.id.startswith(f"{name}.")]
        found = [str(s) for s in rows if s.value is not None]
        return "as tabulated" if len(found) > 8 else ", ".join(found) or "as stated"  # more would not read well


def load_reported(path: Path) -> Reported:
    """Read and check the table."""
    statements: dict[str, Statement] = {}
    for _, statement in read_rows(path, Statement):
        expect(
            statement.id not in statements, f"{path}: the id {statement.id!r} stands twice; expected each once"
        )  # fmt: skip
        statements[statement.id] = statement
    return Reported(statements)


def check_complete(reported: Reported, path: Path, judged: Collection[str], numbers: Collection[str]) -> None:
    """Whether the rows are what the claims ask for, so that one deleted or misspelt is named before any job starts.

    ``judged`` are the claims whose conditions are in code, ``numbers`` the rows whose value that code reads.
    """
    limits = [f"{LIMIT}{s.argument}" for row in reported.statements.values() for s in row.holds_if
              if VERBS[s.verb] == "limit" and not re.fullmatch("[0-9.]+", s.argument)]  # fmt: skip
    known = [*judged, *numbers, *limits]
    for name, row in reported.statements.items():
        if name not in known and not row.holds_if:
            near = difflib.get_close_matches(name, known, n=1)
            expected = (
                f"{near[0]!r} is near it" if near else "expected conditions in holds_if, or a function of that name"
            )
            raise StudyError(f"{path}: no claim asks for {name!r}; {expected}")
    for name in known:
        expect(name in reported.statements, f"{path} has no row {name!r}, which the claims ask for")
    for name in (*numbers, *limits):
        given = reported[name].value is not None
        expect(given, f"{path}: {name!r} has no value; expected the number that the report states")


def check_systems(reported: Reported, models: Path) -> None:
    """Whether each system of Table 1 has its model."""
    for name in reported.statements:
        where, _, rest = name.partition(".")
        system, _, parameter = rest.partition(".")
        if where == "table_1" and parameter and not (models / f"{system}.yaml").is_file():
            raise StudyError(f"config/reported.tsv: {name!r} names a system that is not in {models.name}/")
