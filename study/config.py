"""The study's configuration: read, checked whole before any job starts, and handed out case by case."""

import csv
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

import jsonschema
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from study.errors import StudyError

Table = dict[str, Any]
FIGURE_KINDS = ("linear", "nonlinear", "coherence", "histogram")


@dataclass(frozen=True)
class Case:
    """One row of ``config/cases.tsv`` with everything that its jobs need.

    Attributes
    ----------
    name : str
        As targets and tables name it.
    model : str
        Path of the model file.
    excitation : dict
        Kind and settings of the force, seed included.
    level : float
        "Input variance" of the force, in units^2.
    noise : float
        Mean square of the noise on the displacement over that of the displacement.
    also_assumed : str
        A term that the identification assumes beside those of the model, or empty.
    figures : dict
        Stem of the file name of each kind of figure.
    title : str
        For captions.
    """

    name: str
    model: str
    excitation: Table
    level: float
    noise: float
    also_assumed: str
    figures: dict[str, str]
    title: str


@dataclass(frozen=True)
class StudyConfig:
    """Settings and cases.

    Attributes
    ----------
    settings : dict
        ``config/config.yaml`` as read.
    cases : dict of Case
        By name, in the order of the table.
    """

    settings: Table
    cases: Mapping[str, Case]

    def record_settings(self, case: str) -> Table:
        """What a case's record depends on; a job re-runs when it changes."""
        row = self.cases[case]
        return {
            "case": case,
            "excitation": row.excitation,
            "level": row.level,
            "noise": row.noise,
            "noise_seed": self.settings["noise_seed"],
            "sampling": self.settings["sampling"],
            "integrator": self.settings["integrator"],
        }

    def identification_settings(self, case: str) -> Table:
        """What a case's identification depends on beside its record."""
        tolerances = self.settings["tolerances"]
        own = tolerances.get("of_case", {}).get(case, {})
        return {
            "case": case,
            "also_assumed": self.cases[case].also_assumed,
            "estimators": self.settings["estimators"],
            "segments": self.settings["segments"],
            "fit_band": self.settings["fit_band"],
            "relative": {**tolerances["relative"], **own},
            "absolute": tolerances["absolute"],
        }

    def as_dict(self) -> Table:
        """Everything, for the rules that need every case."""
        return {"settings": self.settings, "cases": {name: asdict(case) for name, case in self.cases.items()}}


def load(folder: Path) -> StudyConfig:
    """Read ``config.yaml`` and ``cases.tsv`` of a folder and check them against its schemas.

    Raises
    ------
    StudyError
        At the first fault, naming file, row and value.
    """
    settings = read_yaml(folder / "config.yaml")
    check(settings, folder / "schemas" / "config.schema.yaml", str(folder / "config.yaml"))
    _check_settings(settings, str(folder / "config.yaml"))
    table = folder / "cases.tsv"
    rows = read_table(table, folder / "schemas" / "cases.schema.yaml")
    cases: dict[str, Case] = {}
    figures: dict[str, str] = {}
    for number, row in enumerate(rows, start=2):
        where = f"{table}, row {number} (case {row['case']!r})"
        if row["case"] in cases:
            raise StudyError(f"{where}: the case stands twice; each name may be used once")
        cases[row["case"]] = _case(row, where, settings, folder.parent / "models", figures)
    return StudyConfig(settings, cases)


def _case(row: Table, where: str, settings: Table, models: Path, taken: dict[str, str]) -> Case:
    model = models / f"{row['model']}.yaml"
    if not model.is_file():
        known = ", ".join(sorted(p.stem for p in models.glob("*.yaml")))
        raise StudyError(f"{where}: there is no system {row['model']!r}; {models.name}/ holds {known}")
    if row["excitation"] not in settings["excitations"]:
        known = ", ".join(settings["excitations"])
        raise StudyError(f"{where}: there is no excitation {row['excitation']!r}; config.yaml names {known}")
    figures: dict[str, str] = {}
    for kind in FIGURE_KINDS:
        stem = f"figure_{row[kind]}" if row[kind] is not None else f"{row['case']}_{kind}"
        if stem in taken:
            raise StudyError(f"{where}: {kind} is {stem.removeprefix('figure_')}, which {taken[stem]} has already")
        taken[stem] = figures[kind] = stem
        taken[stem] = f"case {row['case']!r}"
    return Case(
        name=row["case"],
        model=str(Path(models.name) / model.name),
        excitation=settings["excitations"][row["excitation"]],
        level=row["level"],
        noise=row["noise"],
        also_assumed=row["also_assumed"],
        figures=figures,
        title=row["title"],
    )


def _check_settings(settings: Table, where: str) -> None:
    """What a schema cannot say: relations between two values, and names the code knows."""
    sampling, segments = settings["sampling"], settings["segments"]
    if segments["length"] > sampling["samples"]:
        raise StudyError(
            f"{where}: segments.length is {segments['length']}, longer than the record of {sampling['samples']} samples"
        )
    low, high = settings["fit_band"]
    nyquist = 0.5 / sampling["dt"]
    if not low < high <= nyquist:
        raise StudyError(f"{where}: fit_band is [{low}, {high}]; it must rise and end below {nyquist:g} Hz")
    for name, excitation in settings["excitations"].items():
        cutoff = excitation.get("cutoff", 0.0)
        if cutoff > nyquist:
            raise StudyError(f"{where}: excitations.{name}.cutoff is {cutoff:g} Hz, above the Nyquist {nyquist:g} Hz")


def read_yaml(path: Path) -> Table:
    """A YAML file that holds a mapping, read without executing anything.

    Raises
    ------
    StudyError
        If it cannot be read or is no mapping.
    """
    try:
        content: object = cast(Any, YAML(typ="safe")).load(path)
    except OSError as error:
        raise StudyError(f"{path} cannot be read: {error.strerror}") from None
    except (YAMLError, UnicodeDecodeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise StudyError(f"{path} is not valid YAML: {reason[:200]}") from None
    if not isinstance(content, dict):
        raise StudyError(f"{path} holds {type(content).__name__}, not a mapping of settings")
    return cast(Table, content)


def read_table(path: Path, schema: Path) -> list[Table]:
    """Rows of a tab-separated table, each cell turned into what the schema wants and checked.

    Raises
    ------
    StudyError
        At the first fault, naming file, row, column and value.
    """
    properties: Table = read_yaml(schema)["properties"]
    try:
        lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path} cannot be read: {error}") from None
    if len(lines) < 2:
        raise StudyError(f"{path} has no rows; a heading and at least one row are needed")
    rows = list(csv.reader(lines, delimiter="\t"))
    heading = rows[0]
    found: list[Table] = []
    for number, cells in enumerate(rows[1:], start=2):
        if len(cells) != len(heading):
            raise StudyError(f"{path}, row {number} has {len(cells)} cells; its heading has {len(heading)}")
        where = f"{path}, row {number} ({heading[0]} {cells[0]!r})"
        row = {
            column: _cell(text, properties.get(column, {}), f"{where}: {column}")
            for column, text in zip(heading, cells, strict=True)
        }
        check(row, schema, where)
        found.append(row)
    return found


def _cell(text: str, rule: Table, where: str) -> object:
    wanted = rule.get("type", "string")
    kinds = cast(list[str], wanted) if isinstance(wanted, list) else [str(wanted)]
    if "null" in kinds and not text.strip():
        return None
    if "string" in kinds:
        return text.strip()
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise StudyError(f"{where} is {text!r}, which is not a number")
    return int(number) if "integer" in kinds and number == int(number) else number


def check(value: object, schema: Path, where: str) -> None:
    """Hold a value against a JSON Schema.

    Raises
    ------
    StudyError
        With the fault that explains most, in one sentence.
    """
    library = cast(Any, jsonschema)  # its annotations are partial
    validator = library.Draft202012Validator(read_yaml(schema))
    error = library.exceptions.best_match(validator.iter_errors(value))
    if error is not None:
        raise StudyError(f"{where}: {_sentence(error)}")


def _sentence(error: Any) -> str:
    place = ".".join(str(p) for p in error.absolute_path)
    if error.validator == "additionalProperties":
        allowed = cast(Table, error.schema).get("properties", {})
        extra = [key for key in cast(Table, error.instance) if key not in allowed]
        return f"{place + ': ' if place else ''}unknown key {extra[0]!r}; known are {', '.join(allowed)}"
    return f"{place} is not right: {error.message}" if place else error.message
