"""One entry of a model file's ``terms``: a term with the values that are given."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches

from study.equations import terms
from study.equations.model import ModelTerm
from study.equations.terms import Term
from study.support.errors import StudyError
from study.support.yaml_text import as_mapping, shown

LONGEST_NAME = 100
SMALLEST, LARGEST = 1e-50, 1e50  # of a value: no unit makes one beyond, and the square of one beyond may be no number


def refuse_long(name: str) -> None:
    """Refuse a name that no figure has room for."""
    if len(name) > LONGEST_NAME:
        raise StudyError(f"the name {shown(name)} has {len(name)} characters; at most {LONGEST_NAME} are read")


def entry_from(item: Mapping[object, object]) -> ModelTerm:
    """An entry of ``terms`` from its mapping, as a file or a caller gives it.

    Raises as ``model_file.parse_model``.
    """
    name = item.get("term")
    if not isinstance(name, str):
        content = shown(name) if "term" in item else f"missing in {shown(item)}"
        raise StudyError(f"'term' is {content}; expected a name such as 'term: inertia'")
    refuse_long(name)
    term = _own(name, item["force"]) if "force" in item else terms.get(name)
    refuse_unknown(item, _keys(term), name)
    parameters = [_number(item, p.name, name) for p in term.parameters]
    for parameter, value in zip(term.parameters, parameters, strict=True):
        if value is not None and value <= 0.0 and not parameter.signed:
            raise StudyError(f"{parameter.name} of {name} is {value:g}; expected a {parameter.meaning} above zero")
    coefficients = _coefficients(term, item)
    if name == "inertia" and coefficients[0] is not None and coefficients[0] <= 0.0:
        raise StudyError(f"value of {name} is {coefficients[0]:g}; expected a mass above zero")
    return ModelTerm(term, coefficients, tuple(parameters))


def _keys(term: Term) -> tuple[str, ...]:
    own = ("force",) if term.name not in terms.LIBRARY else ()
    amount = ("amplitude", "phase") if _phasor(term) else ("value",)
    return ("term", *own, *amount, "values", *(p.name for p in term.parameters))


def _phasor(term: Term) -> bool:
    """Whether the coefficients are those of a cosine and a sine, that is, an amplitude with a phase."""
    return len(term.symbols) == 2 and term.symbols[0].endswith("_cos") and term.symbols[1].endswith("_sin")


def _own(name: str, force: object) -> Term:
    """A user's own term; its formula may name u, v, t and measured channels, whatever these are called."""
    if not isinstance(force, str):
        raise StudyError(f"force of {name!r} is {shown(force)}; expected a formula in quotes")
    return terms.custom(name, force)


def _coefficients(term: Term, item: Mapping[object, object]) -> tuple[float | None, ...]:
    """The coefficients of an entry: A cos(phase) of the cosine and -A sin(phase) of the sine, as in (4.9)."""
    ways = [key for key in ("value", "amplitude", "phase", "values") if key in item]
    if "values" in item:
        if len(ways) > 1:
            raise StudyError(f"{term.name} gives both {ways[0]!r} and 'values'; expected one of them")
        return _by_symbol(term, item["values"])
    if not _phasor(term):
        return (_number(item, "value", term.name), *(None for _ in term.symbols[1:]))
    amplitude, phase = _number(item, "amplitude", term.name), _number(item, "phase", term.name)
    if amplitude is None and phase is None:
        return (None, None)
    if amplitude is None or phase is None:
        raise StudyError(f"{term.name} gives {ways[0]!r} alone; expected amplitude and phase together, or neither")
    return (amplitude * math.cos(phase), 0.0 - amplitude * math.sin(phase))  # 0 - 0, not -0, at phase 0


def _by_symbol(term: Term, values: object) -> tuple[float | None, ...]:
    given = as_mapping(values)
    if given is None:
        like = ", ".join(f"{s}: 1.0" for s in term.symbols)
        raise StudyError(f"values of {term.name} is {shown(values)}; expected a mapping such as {{{like}}}")
    refuse_unknown(given, term.symbols, f"values of {term.name}")
    return tuple(_number(given, symbol, term.name) for symbol in term.symbols)


def _number(item: Mapping[object, object], key: str, owner: str) -> float | None:
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
