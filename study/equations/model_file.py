"""Models as YAML files: read, write, and extend without disturbing what the user wrote.

A file holds ``name`` and ``terms``; an entry of ``terms`` is a name, or a mapping with what is held::

    name: rig
    terms:
      - inertia                                          # fitted
      - {term: linear_stiffness, value: 355.3}           # held
      - {term: linear_damping, value: 3.8, held: false}  # fitted, and a fit begins there
      - {term: dead_band, u_g: 0.0025}                   # shape parameter given
      - {term: periodic_stiffness, f_m: 1.0, amplitude: 177.7, phase: 0.0}
      - {term: bracket, force: "u*abs(u) + 0.1*v**3"}    # the user's own
      - {term: linear_stiffness, varies_with: time}      # beside the entry whose coefficient changes (variation_entry)
      - {term: friction(vs), force: "tanh(v/vs)"}        # the same, with a parameter that is fitted

A structure has ``coordinates`` and ``forces`` as well, and each of its terms a place (``layout``).

Nothing in a file is trusted: size, depth and number of entries are bounded before anything is built, aliases and
tags are refused, and formulas are parsed, never evaluated.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from study.equations import layout, terms, variation_entry
from study.equations.modal_part import ModalPart
from study.equations.model import Model, ModelTerm, free
from study.equations.place import Place
from study.equations.redundancy import repeated_force
from study.equations.terms import Term
from study.support import yaml_text
from study.support.errors import StudyError, at, expect
from study.support.files import read_text, recover
from study.support.yaml_text import as_list, as_mapping, scalar, shown

LONGEST_NAME = 100
MOST_TERMS = 200
NO_TERMS = re.compile(r"^terms:[ \t]*(#.*)?$", re.MULTILINE)  # of an entry that was taken out with its list
MODEL_FILE = "a YAML file with 'name' and 'terms', such as models/duffing.yaml"


def read_model(path: Path) -> Model:
    """Read a model file; a coefficient or shape parameter that it leaves out is None, to be fitted.

    What a killed run has left half changed is put back first.
    """
    recover(path)
    return parse_model(read_text(path, MODEL_FILE), path)


def parse_model(text: str, source: Path) -> Model:
    """The model in a YAML text; ``source`` is named in messages, its stem names a model without a name."""
    with at(source):
        document = yaml_text.read_plain(text)
        top = as_mapping(document)
        if top is None:
            content = "is empty" if document is None else f"holds {shown(document)}"
            raise StudyError(f"{content}; expected a mapping of 'name' and 'terms'")
        yaml_text.refuse_unknown(top, ("name", "terms", *layout.STRUCTURE_KEYS), "the model")
        name = top.get("name", source.stem)
        if not isinstance(name, str) or not name.strip() or not name.isprintable() or len(name) > LONGEST_NAME:
            raise StudyError(f"the name is {shown(name)}; expected a short text on one line")
        entries, modal = as_list(top.get("terms")), layout.linear_modal(top)
        if not entries and not (modal and top.get("terms") == []):
            content = shown(top["terms"]) if "terms" in top else "missing"
            like = "expected a list such as [inertia, linear_damping, linear_stiffness]"
            raise StudyError(f"'terms' is {content}; {like}")
        entries = entries or []
        expect(len(entries) <= MOST_TERMS, f"'terms' has {len(entries)} entries; at most {MOST_TERMS} are read")
        coordinates, forces = layout.coordinates_and_forces(top)
        listed = tuple(_entry(item, number, coordinates) for number, item in enumerate(entries, 1))
        model = Model(name, listed, coordinates, forces, ModalPart(coordinates) if modal else None)
        if model.named:
            layout.check(model)
        elif fault := repeated_force(model):
            raise StudyError(fault)
        variation_entry.refuse_loose_changes(model)
        return model


def _entry(item: object, number: int, coordinates: Sequence[str]) -> ModelTerm:
    with at(f"entry {number} of 'terms'"):
        if isinstance(item, str):
            refuse_long(item)
            return free(terms.get(item), layout.place_of_entry({}, item, coordinates))
        mapping = as_mapping(item)
        if mapping is None:
            raise StudyError(f"is {shown(item)}; expected a name or a mapping such as {{term: inertia, value: 1.0}}")
        place = layout.place_of_entry(mapping, mapping.get("term"), coordinates)
        plain = {key: value for key, value in mapping.items() if key not in layout.PLACES}
        return placed(entry_from(plain), place)


def placed(entry: ModelTerm, place: Place) -> ModelTerm:
    """An entry at a place, its starts included."""
    moved = replace(entry, place=place)
    keys = dict(zip(entry.keys, moved.keys, strict=True))
    return replace(moved, starts=tuple((keys[key], value) for key, value in entry.starts))


def format_model(model: Model) -> str:
    """The model as YAML text with every known value; :func:`parse_model` gives the same model back."""
    head = f"name: {scalar(model.name)}\n" + layout.written(model)
    entries = "".join(f"  - {format_entry(t)}\n" for t in model.terms)
    return f"{head}terms:\n{entries}" if entries else f"{head}terms: []\n"


def format_entry(entry: ModelTerm) -> str:
    """One entry of ``terms``, on one line; refuses values that are not finite."""
    held = {key: value for key, value in entry.values.items() if value is not None}
    known = held | {key: value for key, value in entry.starts if key not in held}
    for key, value in known.items():
        if not math.isfinite(value):
            raise StudyError(f"{key} of {entry.name} is {value}; only finite numbers can be written")
    varied = entry.term.variation
    own_term = entry.term if varied is None else varied.of
    own_formula = own_term.name not in terms.LIBRARY
    fields = {"term": scalar(own_term.heading if own_formula else own_term.name)} | layout.place_fields(entry.place)
    if own_formula:
        fields["force"] = json.dumps(own_term.components[0].shape)
    fields |= {} if varied is None else variation_entry.variation_fields(varied)
    parameters = {p.name: f"{entry.name}.{p.name}" for p in entry.term.parameters}
    fields |= {name: repr(float(known[key])) for name, key in parameters.items() if key in known}
    own = zip(entry.term.symbols, entry.symbols, strict=True)
    coefficients = {symbol: repr(float(known[key])) for symbol, key in own if key in known}
    if varied is not None:
        fields |= variation_entry.changes_field(entry, known)
    elif coefficients and len(entry.term.symbols) == 1:
        fields["value"] = coefficients[entry.term.symbols[0]]
    elif coefficients:
        fields["values"] = _flow(coefficients)
    if len(held) < len(known):
        own = dict(zip(entry.keys, (*entry.term.symbols, *(p.name for p in entry.term.parameters)), strict=True))
        fields["held"] = f"[{', '.join(own[key] for key in held)}]" if held else "false"
    return fields["term"] if len(fields) == 1 else _flow(fields)


def text_with(path: Path, entry: Term | ModelTerm) -> str:
    """The text of a model file with a term more; the known values of a ModelTerm are written as held.

    Every byte that was there stays, comments, order and quoting included.
    """
    text = read_text(path, MODEL_FILE)
    before = parse_model(text, path)
    new = entry if isinstance(entry, ModelTerm) else free(entry)
    if new.name in before:
        raise StudyError(f"{path}: the term {new.name!r} is already in this model; add another one, or edit its entry")
    line = format_entry(new)
    extended = yaml_text.with_entry(text, "terms", line)
    if not _holds(extended, path, before.with_term(new)):
        raise StudyError(f"{path}: its layout leaves no clear place for a new term; add '- {line}' to 'terms' by hand")
    return extended


def text_without(path: Path, name: str) -> str:
    """The text of a model file without a term.

    Every other byte stays, but for a comment behind the entry on its own line.
    """
    text = read_text(path, MODEL_FILE)
    before = parse_model(text, path)
    if name not in before or (len(before.terms) == 1 and not before.modal):
        raise StudyError(f"{path}: {shown(name)} cannot be taken out of {', '.join(t.name for t in before.terms)}")
    return revised(text, str(path), before.without_term(name))


def revised(text: str, source: str, model: Model) -> str:
    """The text of a model file, changed to hold this model; comments, order and quoting stay.

    The model has terms of the file in their order, values held or freed, and perhaps further terms behind them; what it
    lacks of the file is taken out. ``source`` is named in messages.
    """
    wanted, gone = [t.name for t in model.terms], list[int]()
    entries = parse_model(text, Path(source)).terms
    for number, entry in enumerate(entries):
        if wanted[number - len(gone) :][:1] != [entry.name]:
            gone.append(number)
    if len(gone) == len(entries) and entries and (wanted or not model.modal):
        raise StudyError(f"{source}: none of its terms is left; expected a model that keeps one")
    for number in reversed(gone):
        text = yaml_text.without_entry(text, "terms", number)
    if not wanted:  # a sum of modes is a model of its own
        text = NO_TERMS.sub(lambda found: f"terms: []{'  ' + found[1] if found[1] else ''}", text)
    before = [entry for number, entry in enumerate(entries) if number not in gone]
    for number, entry in enumerate(model.terms):
        if number >= len(before):
            text = yaml_text.with_entry(text, "terms", format_entry(entry))
        elif entry != before[number]:
            text = yaml_text.with_changed(text, "terms", number, format_entry(entry))
    if not _holds(text, Path(source), model):
        raise StudyError(f"{source}: its layout leaves no clear place for a change; expected one entry a line")
    return text


def refuse_long(name: str) -> None:
    """Refuse a name that no figure has room for."""
    if len(name) > LONGEST_NAME:
        raise StudyError(f"the name {shown(name)} has {len(name)} characters; at most {LONGEST_NAME} are read")


def entry_from(item: Mapping[object, object]) -> ModelTerm:
    """An entry of ``terms`` from its mapping, as a file or a caller gives it."""
    name = item.get("term")
    if not isinstance(name, str):
        content = shown(name) if "term" in item else f"missing in {shown(item)}"
        raise StudyError(f"'term' is {content}; expected a name such as 'term: inertia'")
    refuse_long(name)
    force = item.get("force")
    if "force" in item and not isinstance(force, str):
        raise StudyError(f"force of {name!r} is {shown(force)}; expected a formula in quotes")
    term = terms.custom(name, force) if isinstance(force, str) else terms.get(name)
    own = ("force",) if term.name not in terms.LIBRARY else ()
    if "varies_with" in item:
        plain = {key: value for key, value in item.items() if key not in own}
        entry = variation_entry.entry_of(term, plain)
        return entry if "held" not in item else entry.opened(_held(entry, item["held"]))
    amount = ("amplitude", "phase") if _phasor(term) else ("value",)
    yaml_text.refuse_unknown(item, ("term", *own, *amount, "values", "held", *(p.name for p in term.parameters)), name)
    parameters = [yaml_text.number_of(item, p.name, name) for p in term.parameters]
    for parameter, value in zip(term.parameters, parameters, strict=True):
        if value is not None and value <= 0.0 and not parameter.signed:
            raise StudyError(f"{parameter.name} of {name} is {value:g}; expected a {parameter.meaning} above zero")
    coefficients = _coefficients(term, item)
    if term.name == "inertia" and coefficients[0] is not None and coefficients[0] <= 0.0:
        raise StudyError(f"value of {name} is {coefficients[0]:g}; expected a mass above zero")
    entry = ModelTerm(term, coefficients, tuple(parameters))
    return entry if "held" not in item else entry.opened(_held(entry, item["held"]))


def _held(entry: ModelTerm, said: object) -> tuple[str, ...]:
    """The keys of an entry that a fit holds: all or none, or those that are listed."""
    own = dict(zip((*entry.term.symbols, *(p.name for p in entry.term.parameters)), entry.keys, strict=True))
    given = [name for name, key in own.items() if entry.values[key] is not None]
    if isinstance(said, bool):
        return tuple(entry.keys) if said else ()
    listed = as_list(said)
    if listed is None or not all(name in given for name in listed):
        wanted = f"false, or a list of {', '.join(given)}" if given else "no 'held' where no value is given"
        raise StudyError(f"held of {entry.term.name} is {shown(said)}; expected {wanted}")
    return tuple(own[name] for name in given if name in listed)


def _phasor(term: Term) -> bool:
    """Whether the coefficients are those of a cosine and a sine, that is, an amplitude with a phase."""
    return len(term.symbols) == 2 and term.symbols[0].endswith("_cos") and term.symbols[1].endswith("_sin")


def _coefficients(term: Term, item: Mapping[object, object]) -> tuple[float | None, ...]:
    """The coefficients of an entry: A cos(phase) of the cosine and -A sin(phase) of the sine, as in (4.9)."""
    ways = [key for key in ("value", "amplitude", "phase", "values") if key in item]
    if "values" in item:
        if len(ways) > 1:
            raise StudyError(f"{term.name} gives both {ways[0]!r} and 'values'; expected one of them")
        given = as_mapping(item["values"])
        if given is None:
            like = ", ".join(f"{s}: 1.0" for s in term.symbols)
            raise StudyError(f"values of {term.name} is {shown(item['values'])}; expected a mapping such as {{{like}}}")
        yaml_text.refuse_unknown(given, term.symbols, f"values of {term.name}")
        return tuple(yaml_text.number_of(given, symbol, term.name) for symbol in term.symbols)
    if not _phasor(term):
        return (yaml_text.number_of(item, "value", term.name), *(None for _ in term.symbols[1:]))
    amplitude, phase = yaml_text.number_of(item, "amplitude", term.name), yaml_text.number_of(item, "phase", term.name)
    if amplitude is None and phase is None:
        return (None, None)
    if amplitude is None or phase is None:
        raise StudyError(f"{term.name} gives {ways[0]!r} alone; expected amplitude and phase together, or neither")
    return (amplitude * math.cos(phase), 0.0 - amplitude * math.sin(phase))  # 0 - 0, not -0, at phase 0


def _flow(fields: Mapping[str, str]) -> str:
    return "{" + ", ".join(f"{key}: {value}" for key, value in fields.items()) + "}"


def _holds(text: str, path: Path, model: Model) -> bool:
    with suppress(StudyError):
        return parse_model(text, path) == model
    return False
