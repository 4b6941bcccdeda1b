"""Configuration files: read, turned into what a schema wants, and held against it, each fault one sentence."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import jsonschema
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from study.support.errors import StudyError

Table = dict[str, Any]
SHOWN = 64  # letters of a cell that a sentence repeats


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
    except (YAMLError, UnicodeDecodeError, ValueError, RecursionError) as error:
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
    return [row for _, row in numbered_rows(path, schema)]


def numbered_rows(path: Path, schema: Path) -> list[tuple[str, Table]]:
    """The same, each row with the words that say where it stands; rows count as an editor's lines do."""
    try:
        text = path.read_text(encoding="utf-8-sig")  # a spreadsheet begins the file with a byte-order mark
    except OSError as error:
        raise StudyError(f"{path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise StudyError(f"{path} is no UTF-8 text: {error.reason} at byte {error.start}") from None
    cells = csv.reader(text.splitlines(), delimiter="\t", quoting=csv.QUOTE_NONE)
    lines = [(number, row) for number, row in enumerate(cells, start=1) if any(c.strip() for c in row)]
    if len(lines) < 2:
        raise StudyError(f"{path} has no rows; a heading and at least one row are needed")
    rules = read_yaml(schema)
    heading = [name.strip() for name in lines[0][1]]
    _check_heading(heading, rules["properties"], path)
    return [_row(number, row, heading, path, rules) for number, row in lines[1:]]


def _check_heading(heading: Sequence[str], properties: Table, path: Path) -> None:
    known = ", ".join(properties)
    for name in heading:
        if name not in properties:
            raise StudyError(f"{path}: its heading names {name!r}, which is no column; known are {known}")
        if heading.count(name) > 1:
            raise StudyError(f"{path}: its heading names {name!r} twice; each column may stand once")
    for name in properties:
        if name not in heading:
            raise StudyError(f"{path}: its heading lacks the column {name!r}; {known} are needed")


def _row(number: int, cells: Sequence[str], heading: Sequence[str], path: Path, rules: Table) -> tuple[str, Table]:
    if len(cells) != len(heading):
        raise StudyError(
            f"{path}, row {number} has {len(cells)} cells where the heading has {len(heading)}; "
            "cells are separated by tabs"
        )
    where = f"{path}, row {number} ({heading[0]} {_short(cells[0])!r})"
    pairs = zip(heading, cells, strict=True)
    row = {column: _cell(text, rules["properties"][column], f"{where}: {column}") for column, text in pairs}
    check(row, rules, where)
    return where, row


def _short(text: str) -> str:
    """A cell in a sentence: its beginning where it is long."""
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


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


def check(value: object, rules: Table, where: str) -> None:
    """Hold a value against a JSON Schema, ``rules``; ``where`` begins the sentence.

    Raises
    ------
    StudyError
        With the fault that explains most, in one sentence; numbers must be finite.
    """
    library = cast(Any, jsonschema)  # its annotations are partial
    validator = library.Draft202012Validator(rules)
    error = library.exceptions.best_match(validator.iter_errors(value))
    if error is not None:
        raise StudyError(f"{where}: {_sentence(error)}")
    _refuse_infinite(value, where, ())


def _sentence(error: Any) -> str:
    place = ".".join(str(p) for p in error.absolute_path)
    if error.validator == "additionalProperties":
        allowed = cast(Table, error.schema).get("properties", {})
        extra = [key for key in cast(Table, error.instance) if key not in allowed]
        return f"{place + ': ' if place else ''}unknown key {extra[0]!r}; known are {', '.join(allowed)}"
    words = cast(Table, error.schema).get("description", "")
    if error.validator in ("pattern", "maxLength") and words:  # a pattern tells nobody what would be right
        return f"{place} is not right: {_short(str(error.instance))!r}; right {words}"
    message = " ".join(str(error.message).split())
    return f"{place} is not right: {message[:300]}" if place else message[:300]


def _refuse_infinite(value: object, where: str, place: tuple[str, ...]) -> None:
    """A schema lets ``.nan`` and ``.inf`` pass as numbers."""
    if isinstance(value, float) and not math.isfinite(value):
        raise StudyError(f"{where}: {'.'.join(place)} is {value}; a finite number is right")
    if isinstance(value, dict):
        for key, item in cast(Table, value).items():
            _refuse_infinite(item, where, (*place, str(key)))
    if isinstance(value, list):
        for index, item in enumerate(cast(list[object], value)):
            _refuse_infinite(item, where, (*place, str(index)))
