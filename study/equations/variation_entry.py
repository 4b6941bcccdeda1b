"""Coefficients that vary, as entries of a model file beside those whose coefficients change.

::

    - {term: linear_stiffness, value: 355.0}            # at the first knot
    - {term: linear_stiffness, varies_with: time}       # fitted: a smooth curve, its knots laid along the record
    - {term: linear_stiffness, varies_with: time, shape: curve, knots: [0, 20, 40], changes: [0, -3.1, -9.0]}
    - {term: linear_stiffness, varies_with: time, shape: line, knots: [0, 60], changes: [0, -35.0], held: false}
    - {term: linear_stiffness, varies_with: time, shape: step, step_at: 31.2, lasts: 0.1, changes: -35.0}
    - {term: coulomb_friction, varies_with: band_force, only: v > 0}
"""

from collections.abc import Mapping, Sequence
from typing import cast

from study.equations.model import Model, ModelTerm, free
from study.equations.term import Term
from study.equations.variation import HOW, SIDES, STEP_AT, Shape, Variation, changes_at, varying
from study.support import yaml_text
from study.support.errors import StudyError, expect
from study.support.yaml_text import as_list, as_mapping, scalar, shown

VARIATION_KEYS = ("term", "varies_with", "shape", "knots", "lasts", "only", "changes", "held", STEP_AT)


def entry_of(of: Term, item: Mapping[object, object]) -> ModelTerm:
    """The change of a term's coefficients, from its entry."""
    yaml_text.refuse_unknown(item, (*VARIATION_KEYS, *(p.name for p in of.parameters)), f"{of.name} that varies")
    along, shape, side = item["varies_with"], item.get("shape", "curve"), item.get("only", "")
    if not isinstance(along, str):
        raise StudyError(f"varies_with of {of.name} is {shown(along)}; expected 'time' or the name of a channel")
    expect(shape in HOW, f"shape of {of.name} is {shown(shape)}; expected {', '.join(HOW)}")
    expect(side in SIDES, f"only of {of.name} is {shown(side)}; expected one of {', '.join(filter(None, SIDES))}")
    for key in (STEP_AT, "lasts") if shape != "step" else ("knots",):
        expect(key not in item, f"{of.name} has {key!r} and varies in a {shape}; expected one of both")
    knots = _numbers(item, "knots", of.name)
    variation = Variation(
        of, along, cast(Shape, shape), knots, yaml_text.number_of(item, "lasts", of.name), cast(str, side)
    )
    expect(
        not variation.open or "changes" not in item,
        f"{of.name} has 'changes' and no {'lasts' if shape == 'step' else 'knots'}; expected both, or neither",
    )
    entry = free(varying(variation))
    given = {p.name: yaml_text.number_of(item, p.name, of.name) for p in entry.term.parameters}
    named = {f"{entry.name}.{name}": value for name, value in given.items()}
    return entry.with_values(named | _amounts(item, entry, of))


def _numbers(item: Mapping[object, object], key: str, owner: str) -> tuple[float, ...]:
    if key not in item:
        return ()
    listed = as_list(item[key])
    if not listed:
        raise StudyError(f"{key} of {owner} is {shown(item[key])}; expected numbers such as [0, 20, 40]")
    found = [yaml_text.number_of({key: value}, key, owner) for value in listed]
    return tuple(x for x in found if x is not None)


def _amounts(item: Mapping[object, object], entry: ModelTerm, of: Term) -> dict[str, float | None]:
    """The changes of each coefficient at the knots but the first, where they are zero."""
    if "changes" not in item:
        return {}
    if len(of.symbols) > 1:
        given = as_mapping(item["changes"])
        like = ", ".join(f"{s}: [0, 1.0]" for s in of.symbols)
        if given is None:
            raise StudyError(f"changes of {of.name} is {shown(item['changes'])}; expected a mapping such as {{{like}}}")
        yaml_text.refuse_unknown(given, of.symbols, f"changes of {of.name}")
    else:
        given = dict.fromkeys(of.symbols, item["changes"])
    variation, each = entry.term.variation, len(entry.symbols) // len(of.symbols)
    found = dict[str, float | None]()
    for i, symbol in enumerate(of.symbols):
        own = entry.symbols[i * each : (i + 1) * each]
        value = given.get(symbol)
        listed = _numbers({"changes": value if as_list(value) else [value]}, "changes", of.name)
        if variation is not None and variation.shape != "step":
            expect(
                len(listed) == each + 1 and not any(listed[:1]),
                f"changes of {of.name} is {shown(value)}; expected one number for each of the {each + 1} knots, the "
                "first 0, as the value there is that of the entry without 'varies_with'",
            )
            listed = listed[1:]
        expect(len(listed) == each, f"changes of {of.name} is {shown(value)}; expected one number for a step")
        found |= dict(zip(own, listed, strict=True))
    return found


def variation_fields(variation: Variation) -> dict[str, str]:
    """What a coefficient varies with, as fields of an entry in YAML."""
    found = {"varies_with": scalar(variation.along), "shape": variation.shape}
    found |= {"only": variation.side} if variation.side else {}
    found |= {"knots": _listed(variation.knots)} if variation.knots else {}
    return found | ({} if variation.lasts is None else {"lasts": repr(float(variation.lasts))})


def changes_field(entry: ModelTerm, values: Mapping[str, float]) -> dict[str, str]:
    """The changes of a term that varies, held or where a fit begins, as fields of an entry in YAML."""
    variation, known = entry.term.variation, [values[key] for key in entry.symbols if key in values]
    if variation is None or not known or len(known) < len(entry.coefficients):
        return {}
    of, each = variation.of.symbols, len(known) // len(variation.of.symbols)
    told = [changes_at(variation, known[i * each : (i + 1) * each]) for i in range(len(of))]
    texts = [_listed(x) if len(x) > 1 else repr(float(sum(x))) for x in told]
    if len(of) == 1:
        return {"changes": "".join(texts)}
    return {"changes": "{" + ", ".join(f"{s}: {x}" for s, x in zip(of, texts, strict=True)) + "}"}


def _listed(values: Sequence[float]) -> str:
    return f"[{', '.join(repr(float(x)) for x in values)}]"


def refuse_loose_changes(model: Model) -> None:
    """Refuse a change of a coefficient that the model does not have."""
    there = {entry.effect for entry in model.terms}
    for entry in model.terms:
        if (variation := entry.term.variation) is not None and (variation.of.name, entry.place.path) not in there:
            raise StudyError(
                f"{variation.of.name} varies with {variation.along}, and no entry says from where; expected "
                f"{variation.of.name} without 'varies_with' beside it, its value at the start"
            )
