"""Configuration files, YAML or tab-separated, read into typed and frozen values: each fault is one sentence."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from study.support.errors import StudyError, expect
from study.support.files import read_text
from study.support.yaml_text import as_mapping, read_plain, shown

EXPECTED_VALUES = {  # by the first part of pydantic's name of a fault, with its numbers
    "greater_than_equal": "{ge:.12g} or more",
    "greater_than": "a number above {gt:.12g}",
    "less_than_equal": "{le:.12g} or less",
    "less_than": "a number below {lt:.12g}",
    "literal_error": "{expected}",
    "int": "a whole number",
    "float": "a number",
    "finite_number": "a finite number",
    "bool": "true or false",
    "string": "text",
    "tuple": "a list",
    "too_short": "{min_length} entries or more",
    "too_long": "{max_length} entries or fewer",
    "model": "a mapping",
    "dict": "a mapping",
}


class Section(BaseModel):
    """Values that belong together: typed, frozen, none unknown, every number finite, nothing converted."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, regex_engine="python-re")

    def plain(self) -> dict[str, Any]:
        """As plain data, which the workflow keeps of each job's settings; what is not set is left out."""
        return self.model_dump(mode="json", exclude_none=True)


class TableRow(Section):
    """One row of a table, whose cells are text until they are read."""

    model_config = ConfigDict(strict=False)


Text = Annotated[str, Field(min_length=1)]
S = TypeVar("S", bound=Section)
R = TypeVar("R", bound=TableRow)


def read_yaml(path: Path, kind: type[S]) -> S:
    """A YAML file as a section, read without executing or repeating anything: tags and aliases are refused."""
    text = read_text(path, "a text in YAML")
    try:
        content = read_plain(text)
    except StudyError as error:
        raise StudyError(f"{path} {error}") from None
    if as_mapping(content) is None:
        raise StudyError(f"{path} holds {type(content).__name__}; expected a mapping of settings")
    return checked(kind, content, str(path))


def read_rows(path: Path, kind: type[R]) -> list[tuple[str, R]]:
    """Rows of a tab-separated table, each with the words that say where it stands, counted as an editor does.

    A column whose field has a default may be left out.
    """
    text = read_text(path, "a table with tabs between its cells").removeprefix("\ufeff")  # a spreadsheet's mark
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if len(lines) < 2:
        raise StudyError(f"{path} has no rows; expected a heading and at least one row")
    heading, known = _cells(lines[0][1]), list(kind.model_fields)
    for name in heading:
        if name not in known:
            raise StudyError(f"{path}: its heading names {name!r}, which is no column; expected {', '.join(known)}")
        if heading.count(name) > 1:
            raise StudyError(f"{path}: its heading names {name!r} twice; expected each column once")
    if lacking := [name for name, field in kind.model_fields.items() if field.is_required() and name not in heading]:
        raise StudyError(f"{path}: its heading lacks the column {lacking[0]!r}; expected {', '.join(known)}")
    rows: list[tuple[str, R]] = []
    for number, line in lines[1:]:
        cells, where = _cells(line), f"{path}, row {number}"
        wanted = f"{len(cells)} cells where the heading has {len(heading)}; expected as many, tabs between them"
        expect(len(cells) == len(heading), f"{where} has {wanted}")
        where = f"{where} ({heading[0]} {shown(cells[0])})"
        rows.append((where, checked(kind, dict(zip(heading, cells, strict=True)), where)))
    return rows


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split("\t")]


def checked(kind: type[S], content: object, where: str) -> S:
    """Plain data as a section; ``where`` begins the sentence of a fault."""
    try:
        return kind.model_validate(content)
    except StudyError as error:  # a validator's own sentence
        raise StudyError(f"{where}: {error}") from None
    except ValidationError as error:
        faults = cast(list[dict[str, Any]], error.errors(include_url=False))
    fault = min(faults, key=lambda f: f["type"] != "extra_forbidden")  # a misspelt key explains the one that is missing
    raise StudyError(f"{where}: {_sentence(fault, kind)}")


def _sentence(fault: Mapping[str, Any], kind: type[Section]) -> str:
    code, path, numbers = str(fault["type"]), tuple(fault["loc"]), fault.get("ctx", {})
    place, above = (".".join(str(name) for name in part) for part in (path, path[:-1]))
    if code in ("extra_forbidden", "missing"):
        words = f"unknown key {path[-1]!r}" if code == "extra_forbidden" else f"{str(path[-1])!r} is missing"
        known = ", ".join(_at(kind, path[:-1]).model_fields)
        return f"{above + ': ' if above else ''}{words}; expected {known}"
    if code == "value_error":
        return f"{place} {numbers['error']}".strip()
    near = [words for begin, words in EXPECTED_VALUES.items() if code.startswith(begin)]
    expected = near[0].format(**numbers) if near else str(fault["msg"])
    if code in ("string_pattern_mismatch", "string_too_long"):  # a pattern tells nobody what was expected
        expected = _at(kind, path[:-1]).model_fields[path[-1]].description or expected
    return f"{place} is {shown(fault['input'])}; expected {expected}"


def _at(kind: Any, path: Sequence[object]) -> Any:
    """The section that stands at a place within another."""
    if not path:
        return kind
    fields: Any = getattr(kind, "model_fields", None)  # what is no section is a mapping of some
    return _at(get_args(kind)[-1] if fields is None else fields[path[0]].annotation, path[1:])
