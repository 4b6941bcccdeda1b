"""Models as YAML files: read, write, and extend without disturbing what the user wrote.

A file holds ``name`` and ``terms``; an entry of ``terms`` is a name, or a mapping with what is held::

    name: rig
    terms:
      - inertia                                          # fitted
      - {term: linear_stiffness, value: 355.3}           # held
      - {term: dead_band, u_g: 0.0025}                   # shape parameter given
      - {term: periodic_stiffness, f_m: 1.0, amplitude: 177.7, phase: 0.0}
      - {term: bracket, force: "u*abs(u) + 0.1*v**3"}    # the user's own

Files come from users, so nothing in them is trusted: size, depth and number of entries are bounded
before anything is built, aliases and tags are refused, and formulas are parsed, never evaluated.
"""

import json
import math
import os
import stat
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError

from study import expression, terms
from study.errors import StudyError
from study.graph import Graph
from study.model import Model, ModelTerm, free
from study.terms import Term

LARGEST_FILE = 1_000_000  # bytes; the longest sensible model has a few kilobytes
MOST_EVENTS = 10_000  # names, numbers and brackets in one file
DEEPEST = 8
MOST_TERMS = 200
LONGEST_NAME = 100


def read_model(path: Path) -> Model:
    """Read a model file.

    Parameters
    ----------
    path : Path
        A YAML file; a coefficient or shape parameter that it leaves out is None, to be fitted.

    Raises
    ------
    StudyError
        If the file cannot be read or is no model, naming the file, the value and what would be right.
    """
    return parse_model(_text(path), path)


def parse_model(text: str, source: Path) -> Model:
    """The model in a YAML text; ``source`` stands in messages and lends its stem to a model without a name.

    Raises
    ------
    StudyError
        As :func:`read_model`.
    """
    try:
        return _model(_document(text), source.stem)
    except StudyError as error:
        raise StudyError(f"{source}: {error}") from None


def format_model(model: Model) -> str:
    """The model as YAML text with every known value; :func:`parse_model` gives the same model back."""
    return f"name: {_scalar(model.name)}\nterms:\n" + "".join(f"  - {format_entry(t)}\n" for t in model.terms)


def format_entry(entry: ModelTerm) -> str:
    """One entry of ``terms``, on one line.

    Raises
    ------
    StudyError
        If a value is not finite.
    """
    known = {key: value for key, value in entry.values.items() if value is not None}
    for key, value in known.items():
        if not math.isfinite(value):
            raise StudyError(f"{key} of {entry.name} is {value}; only finite numbers can be written")
    fields = {"term": _scalar(entry.name)}
    if entry.name not in terms.LIBRARY:
        fields["force"] = json.dumps(entry.term.components[0].shape)
    parameters = {p.name: f"{entry.name}.{p.name}" for p in entry.term.parameters}
    fields |= {name: repr(float(known[key])) for name, key in parameters.items() if key in known}
    coefficients = {s: repr(float(known[s])) for s in entry.term.symbols if s in known}
    if len(entry.term.symbols) == 1:
        fields |= {"value": number for number in coefficients.values()}
    elif coefficients:
        fields["values"] = _flow(coefficients)
    return fields["term"] if len(fields) == 1 else _flow(fields)


def add_term(path: Path, entry: Term | ModelTerm) -> Model:
    """Append a term to a model file; every byte that was there stays, comments, order and quoting included.

    Parameters
    ----------
    path : Path
        The model file. It is replaced in one step: on any failure the old one is untouched.
    entry : Term or ModelTerm
        What to add; a ModelTerm's known values are written as held.

    Returns
    -------
    Model
        The model the file now holds.

    Raises
    ------
    StudyError
        If the file is no model, has the term already, or cannot be written.
    """
    text = _text(path)
    before = parse_model(text, path)
    new = entry if isinstance(entry, ModelTerm) else free(entry)
    if new.name in before:
        raise StudyError(f"{path}: the term {new.name!r} is already in this model; add another one, or edit its entry")
    line = format_entry(new)
    extended = _extended(text, line)
    after = before.with_term(new)
    if not _holds(extended, path, after):
        raise StudyError(f"{path}: its layout leaves no clear place for a new term; add '- {line}' to 'terms' by hand")
    replace_file(path, extended.encode())
    return after


def replace_file(path: Path, data: bytes) -> None:
    """Write a file in one step: readers see the old content or the new, and a failure leaves the old.

    Permission bits are kept; a symbolic link stays one.

    Raises
    ------
    StudyError
        If it cannot be written (no permission, no space); what was there is still there.
    """
    target = Path(os.path.realpath(path))
    try:
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(13, "it is write-protected")
        mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else 0o644
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            Path(name).chmod(mode)
            Path(name).replace(target)
        finally:
            with suppress(FileNotFoundError):
                Path(name).unlink()
    except OSError as error:
        why = error.strerror or str(error)
        raise StudyError(f"{path}: cannot be written ({why}); it is left as it was") from None


def _text(path: Path) -> str:
    """The text of a file that may be anything."""
    try:
        kind = path.stat().st_mode
        if not stat.S_ISREG(kind):
            what = "a folder" if stat.S_ISDIR(kind) else "not a regular file"
            raise StudyError(f"{path}: this is {what}; a YAML file with 'name' and 'terms' is right")
        with path.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        raise StudyError(
            f"{path}: there is no such file; give the path of a model such as models/duffing.yaml"
        ) from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise StudyError(f"{path}: cannot be read ({why}); a readable YAML file is right") from None
    if len(data) > LARGEST_FILE:
        raise StudyError(f"{path}: the file has more than {LARGEST_FILE} bytes; a model has a few lines")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise StudyError(
            f"{path}: byte {error.start} is {data[error.start]:#04x}, which is no UTF-8 text; a YAML file is right"
        ) from None


def _document(text: str) -> object:
    """The plain dicts, lists, texts and numbers of a YAML text."""
    try:
        _screen(text)
        return _yaml().load(text)
    except StudyError:
        raise
    except RecursionError:
        raise StudyError("is nested too deeply; a list of terms is right") from None
    except MarkedYAMLError as error:
        line = f" in line {error.problem_mark.line + 1}" if error.problem_mark else ""
        problem = str(error.problem or error.context).splitlines()[0]
        raise StudyError(f"is not YAML ({problem}{line}); a mapping of 'name' and 'terms' is right") from None
    except Exception as error:  # whatever else a parser trips over in hostile text means the same to the user
        problem = (str(error) or type(error).__name__).splitlines()[0]
        raise StudyError(f"is not YAML ({_short(problem)}); a mapping of 'name' and 'terms' is right") from None


def _yaml() -> YAML:
    return YAML(typ="safe", pure=True)  # pure: YAML 1.2, in which 2e7 is a number and no is a word


def _screen(text: str) -> None:
    """Refuse what could grow when built, or call for Python objects, before anything is built."""
    depth = 0
    for count, event in enumerate(_events(text)):
        kind = type(event).__name__
        line = event.start_mark.line + 1
        depth += kind.endswith(("SequenceStartEvent", "MappingStartEvent"))
        depth -= kind.endswith(("SequenceEndEvent", "MappingEndEvent"))
        if depth > DEEPEST or count > MOST_EVENTS:
            raise StudyError(f"is too large or too deeply nested (line {line}); a short list of terms is right")
        if kind == "AliasEvent" or getattr(event, "anchor", None) is not None:
            raise StudyError(f"uses the YAML anchor or alias {event.anchor!r} in line {line}; write the value itself")
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise StudyError(f"uses the YAML tag {_short(str(tag))} in line {line}; plain names and numbers are right")
        if getattr(event, "version", None) not in (None, (1, 2)):
            raise StudyError(f"asks for another YAML version in line {line}; leave the %YAML line out")


def _events(text: str) -> Iterator[Any]:
    yield from _yaml().parse(text)


def _model(document: object, stem: str) -> Model:
    if document is None:
        raise StudyError("is empty; a mapping of 'name' and 'terms' is right")
    if not isinstance(document, dict):
        raise StudyError(f"holds {_short(repr(document))}; a mapping of 'name' and 'terms' is right")
    top: Mapping[object, object] = document
    _refuse_unknown(top, ("name", "terms"), "the model")
    name = top.get("name", stem)
    if not isinstance(name, str) or not name.strip() or not name.isprintable() or len(name) > LONGEST_NAME:
        raise StudyError(f"the name is {_short(repr(name))}; a short text on one line is right")
    entries = top.get("terms")
    if not isinstance(entries, list) or not entries:
        what = _short(repr(entries)) if "terms" in top else "missing"
        raise StudyError(f"'terms' is {what}; a list such as [inertia, linear_damping, linear_stiffness] is right")
    listed: Sequence[object] = entries
    if len(listed) > MOST_TERMS:
        raise StudyError(f"'terms' has {len(listed)} entries; at most {MOST_TERMS} are read")
    return Model(name, tuple(_entry(item, number) for number, item in enumerate(listed, 1)))


def _entry(item: object, number: int) -> ModelTerm:
    try:
        if isinstance(item, str):
            return free(terms.get(item))
        if not isinstance(item, dict):
            raise StudyError(
                f"is {_short(repr(item))}; a name or a mapping such as {{term: inertia, value: 1.0}} is right"
            )
        return _mapping(item)
    except StudyError as error:
        raise StudyError(f"entry {number} of 'terms': {error}") from None


def _mapping(item: Mapping[object, object]) -> ModelTerm:
    name = item.get("term")
    if not isinstance(name, str):
        got = _short(repr(name)) if "term" in item else f"missing in {_short(repr(item))}"
        raise StudyError(f"'term' is {got}; a name such as 'term: inertia' is right")
    term = _own(name, item["force"]) if "force" in item else terms.get(name)
    _refuse_unknown(item, _keys(term), name)
    parameters = [_number(item, p.name, name) for p in term.parameters]
    for parameter, value in zip(term.parameters, parameters, strict=True):
        if value is not None and value <= 0.0 and not parameter.signed:
            raise StudyError(f"{parameter.name} of {name} is {value:g}; a {parameter.meaning} above zero is right")
    return ModelTerm(term, _coefficients(term, item), tuple(parameters))


def _keys(term: Term) -> tuple[str, ...]:
    own = ("force",) if term.name not in terms.LIBRARY else ()
    amount = ("amplitude", "phase") if _phasor(term) else ("value",)
    return ("term", *own, *amount, "values", *(p.name for p in term.parameters))


def _phasor(term: Term) -> bool:
    """Whether the coefficients are those of a cosine and a sine, that is, an amplitude with a phase."""
    return len(term.symbols) == 2 and term.symbols[0].endswith("_cos") and term.symbols[1].endswith("_sin")


def _own(name: str, force: object) -> Term:
    """A user's own term; its formula may name u, v, t and measured channels."""
    if not isinstance(force, str):
        raise StudyError(f"force of {name!r} is {_short(repr(force))}; a formula in quotes is right")
    term = terms.custom(name, force)
    names = expression.names(force)
    coefficients = {symbol for known in terms.LIBRARY.values() for symbol in known.symbols}
    for used in names:
        if used in coefficients:  # a channel of that name would be mixed up with the coefficient
            raise StudyError(
                f"force of {name!r} uses {used!r}, a coefficient's name; write a number or rename the channel"
            )
    graph = Graph()
    expression.build(graph, force, {used: graph.input(used) for used in names})
    return term


def _coefficients(term: Term, item: Mapping[object, object]) -> tuple[float | None, ...]:
    """The coefficients an entry holds.

    An amplitude A and a phase (rad) are A cos(phase) of the cosine and -A sin(phase) of the sine, as in (4.9).
    """
    ways = [key for key in ("value", "amplitude", "phase", "values") if key in item]
    if "values" in item:
        if len(ways) > 1:
            raise StudyError(f"{term.name} gives both {ways[0]!r} and 'values'; one of them is right")
        return _by_symbol(term, item["values"])
    if not _phasor(term):
        return (_number(item, "value", term.name), *(None for _ in term.symbols[1:]))
    amplitude, phase = _number(item, "amplitude", term.name), _number(item, "phase", term.name)
    if amplitude is None and phase is None:
        return (None, None)
    if amplitude is None or phase is None:
        raise StudyError(f"{term.name} gives {ways[0]!r} alone; amplitude and phase together, or neither, is right")
    return (amplitude * math.cos(phase), 0.0 - amplitude * math.sin(phase))  # 0 - 0, not -0, at phase 0


def _by_symbol(term: Term, values: object) -> tuple[float | None, ...]:
    if not isinstance(values, dict):
        like = ", ".join(f"{s}: 1.0" for s in term.symbols)
        raise StudyError(f"values of {term.name} is {_short(repr(values))}; a mapping such as {{{like}}} is right")
    given: Mapping[object, object] = values
    _refuse_unknown(given, term.symbols, f"values of {term.name}")
    return tuple(_number(given, symbol, term.name) for symbol in term.symbols)


def _number(item: Mapping[object, object], key: str, owner: str) -> float | None:
    """A finite number, or None if the key is left out."""
    if key not in item:
        return None
    value = item[key]
    if isinstance(value, int | float) and not isinstance(value, bool):
        with suppress(OverflowError):
            if math.isfinite(float(value)):
                return float(value)
    if value is None:
        raise StudyError(f"{key} of {owner} is empty; give a number, or leave the key out to have it estimated")
    raise StudyError(f"{key} of {owner} is {_short(repr(value))}; a finite number such as 355.3 or 2.0e7 is right")


def _refuse_unknown(item: Mapping[object, object], allowed: Sequence[str], owner: str) -> None:
    for key in item:
        if key not in allowed:
            near = get_close_matches(str(key)[:LONGEST_NAME], allowed, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(allowed)}"
            raise StudyError(f"{owner} has the unknown key {_short(repr(key))}; {hint}")


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."


def _scalar(text: str) -> str:
    """A text as YAML: plain where it reads back as itself, otherwise in double quotes."""
    plain = text.isidentifier() and text.isascii() and _yaml().load(text) == text
    return text if plain else json.dumps(text, ensure_ascii=False)


def _flow(fields: Mapping[str, str]) -> str:
    return "{" + ", ".join(f"{key}: {value}" for key, value in fields.items()) + "}"


def _holds(text: str, path: Path, model: Model) -> bool:
    with suppress(StudyError):
        return parse_model(text, path) == model
    return False


def _extended(text: str, line: str) -> str:
    """The text of a model file with one entry more, put right behind the last one."""
    root: Any = _yaml().compose(text)
    sequence: Any = next(value for key, value in root.value if key.value == "terms")
    if sequence.flow_style:
        end = sequence.value[-1].end_mark.index
        return f"{text[:end]}, {line}{text[end:]}"
    last = len(text[: _last_leaf(sequence).end_mark.index].rstrip())
    end = text.find("\n", last)
    newline = "\r\n" if "\r\n" in text else "\n"
    entry = " " * sequence.start_mark.column + f"- {line}"
    if end < 0:
        return f"{text}{newline}{entry}"
    return f"{text[: end + 1]}{entry}{newline}{text[end + 1 :]}"


def _last_leaf(node: Any) -> Any:
    """The node at the very end of a block, whose end mark is exact (a block's own lies behind its comments)."""
    while isinstance(node.value, list) and node.value and not node.flow_style:
        last = node.value[-1]
        node = last[1] if isinstance(last, tuple) else last
    return node
