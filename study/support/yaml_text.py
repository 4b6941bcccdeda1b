"""YAML text from users: bounded, plain data out of it, and a place in it for one list entry more.

Nothing in the text is trusted: its size in events and its depth are checked before anything is built,
and aliases (which can grow without bound) and tags (which call for Python objects) are refused.
"""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from typing import Any, cast

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError

from study.support.errors import StudyError, expect
from study.support.numbers import LARGEST, SMALLEST

MOST_EVENTS = 10_000  # names, numbers and brackets in one text
DEEPEST_YAML = 8
EXPECTED_MAPPING = "expected a mapping such as 'name: rig'"


def _yaml() -> Any:
    """A parser of YAML 1.2, in which ``2e7`` is a number and ``no`` is a word; the compiled one reads 1.1."""
    return YAML(typ="safe", pure=True)


def read_plain(text: str) -> object:
    """The dicts, lists, texts and numbers of a YAML text."""
    try:
        _screen(text)
        return _yaml().load(text)
    except StudyError:
        raise
    except MarkedYAMLError as error:
        told: Any = error
        line = f" in line {told.problem_mark.line + 1}" if told.problem_mark else ""
        problem = excerpt(str(told.problem or told.context).splitlines()[0])
        raise StudyError(f"is not YAML ({problem}{line}); {EXPECTED_MAPPING}") from None
    except Exception as error:  # whatever else a parser trips over in hostile text means the same to the user
        problem = (str(error) or type(error).__name__).splitlines()[0]
        if problem.startswith("Exceeds the limit"):  # Python reads no number of thousands of digits
            problem = "a number of too many digits"
        raise StudyError(f"is not YAML ({excerpt(problem)}); {EXPECTED_MAPPING}") from None


def _screen(text: str) -> None:
    """Refuse what could grow when built, or call for Python objects, before anything is built."""
    depth = 0
    for count, event in enumerate(_yaml().parse(text)):
        kind, line = type(event).__name__, event.start_mark.line + 1
        depth += kind in ("SequenceStartEvent", "MappingStartEvent")
        depth -= kind in ("SequenceEndEvent", "MappingEndEvent")
        small = depth <= DEEPEST_YAML and count <= MOST_EVENTS
        expect(small, f"is too large or too deeply nested (line {line}); expected a short list")
        if getattr(event, "anchor", None) is not None:  # an alias has one too: the name it repeats
            raise StudyError(f"uses the YAML anchor or alias {event.anchor!r} in line {line}; write the value itself")
        if getattr(event, "tag", None) is not None:
            tag = excerpt(repr(str(event.tag)))
            raise StudyError(f"uses the YAML tag {tag} in line {line}; expected plain names and numbers")
        if getattr(event, "version", None) not in (None, (1, 2)):
            raise StudyError(f"asks for another YAML version before line {line}; leave the %YAML line out")


def as_mapping(value: object) -> dict[object, object] | None:
    """The value if it is a mapping."""
    return cast("dict[object, object]", value) if isinstance(value, dict) else None


def as_list(value: object) -> list[object] | None:
    """The value if it is a list."""
    return cast("list[object]", value) if isinstance(value, list) else None


def shown(value: object) -> str:
    """A value from a file as a message shows it."""
    try:
        return excerpt(repr(value))
    except ValueError:  # Python does not print a number of thousands of digits
        return "a number of too many digits"


def excerpt(text: str, most: int = 60) -> str:
    """A text that fits in a message."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def scalar(text: str) -> str:
    """A text as YAML: plain where it reads back as itself, otherwise in double quotes."""
    plain = text.isidentifier() and text.isascii() and _yaml().load(text) == text
    return text if plain else json.dumps(text, ensure_ascii=False)


def number_of(item: Mapping[object, object], key: str, owner: str) -> float | None:
    """A finite number of usual size, or None if the key is left out."""
    if key not in item:
        return None
    value = item[key]
    if isinstance(value, int | float) and not isinstance(value, bool):
        with suppress(OverflowError):
            if value == 0 or SMALLEST <= abs(float(value)) <= LARGEST:
                return float(value)
    if value is None:
        raise StudyError(f"{key} of {owner} is empty; give a number, or leave the key out to have it estimated")
    like = f"such as 355.3 or 2.0e7 (0, or {SMALLEST:g} to {LARGEST:g} in size)"
    raise StudyError(f"{key} of {owner} is {shown(value)}; expected a finite number {like}")


def refuse_unknown(item: Mapping[object, object], allowed: Sequence[str], owner: str) -> None:
    """Refuse a mapping with a key that it cannot have; the message tells the nearest one."""
    for key in item:
        if key not in allowed:
            near = get_close_matches(shown(key).strip("'"), allowed, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(allowed)}"
            raise StudyError(f"{owner} has the unknown key {shown(key)}; {hint}")


def with_entry(text: str, key: str, entry: str) -> str:
    """The text with one entry, YAML on one line, more at the end of its top-level list ``key``; nothing else changes.

    :func:`read_plain` must accept the text.
    """
    sequence = _list(text, key)
    if not sequence.value:  # in brackets, as there is no other way to write that
        inside = sequence.start_mark.index + 1
        return text[:inside] + entry + text[inside:]
    if sequence.flow_style:
        end = sequence.value[-1].end_mark.index
        return f"{text[:end]}, {entry}{text[end:]}"
    last = len(text[: _last_leaf(sequence).end_mark.index].rstrip())
    end = text.find("\n", last)
    newline = "\r\n" if "\r\n" in text else "\n"
    line = " " * sequence.start_mark.column + f"- {entry}"
    return f"{text}{newline}{line}" if end < 0 else f"{text[: end + 1]}{line}{newline}{text[end + 1 :]}"


def with_changed(text: str, key: str, number: int, entry: str) -> str:
    """The text with one entry of that list, counted from zero, replaced; comments between its own lines go with it."""
    node = _list(text, key).value[number]
    return text[: node.start_mark.index] + entry + text[_last_leaf(node).end_mark.index :]


def without_entry(text: str, key: str, number: int) -> str:
    """The text without one entry of that list, counted from zero, which must have another; nothing else changes.

    A comment behind the entry, on its own line, goes with it: it is about what goes.
    """
    nodes = _list(text, key)
    node = nodes.value[number]
    if nodes.flow_style:
        return _without_item(text, nodes.value, number)
    dash = text.rindex("-", 0, node.start_mark.index)
    first = text.rfind("\n", 0, dash) + 1
    end = text.find("\n", len(text[: _last_leaf(node).end_mark.index].rstrip()))
    if end < 0:  # the last line, which nothing ends: nor does the one before it then
        return text[: max(first - 1, 0)].removesuffix("\r")
    return text[:first] + text[end + 1 :]


def _without_item(text: str, nodes: list[Any], number: int) -> str:
    """The text without one item of a list in brackets, and without the comma that it needed."""
    start, end = nodes[number].start_mark.index, _last_leaf(nodes[number]).end_mark.index
    if number > 0:
        before = nodes[number - 1].end_mark.index
        if text[before:start].strip() == ",":  # no comment between
            return text[:before] + text[end:]
    if number + 1 < len(nodes):
        behind = nodes[number + 1].start_mark.index
        if text[end:behind].strip() == ",":
            return text[:start] + text[behind:]
    comma = text.find(",", end)
    follows = comma >= 0 and not text[end:comma].strip()
    rest = text[comma + 1 if follows else end :]
    line = text.rfind("\n", 0, start) + 1
    alone = not text[line:start].strip()
    comment = rest.partition("\n")[0].strip()
    if alone and (not comment or comment.startswith("#")):
        return text[:line] + rest.partition("\n")[2]
    return text[:start] + rest


def _list(text: str, key: str) -> Any:
    return next(value for name, value in _yaml().compose(text).value if name.value == key)


def _last_leaf(node: Any) -> Any:
    """The node at the very end of a block, whose end mark is exact (a block's own lies behind its comments)."""
    if node.id == "scalar" or node.flow_style or not node.value:
        return node
    last = node.value[-1]
    return _last_leaf(last[1] if node.id == "mapping" else last)
