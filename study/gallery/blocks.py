"""An entry of the gallery in words and tables, for the page and for the documentation."""

from collections.abc import Mapping, Sequence

from study.compare import history
from study.gallery.findings_of_record import Beside, Fields, RecordFindings
from study.gallery.known import Literature
from study.support import document
from study.support.document import Block, Text
from study.support.numbers import percent

MISSING, NOTHING = "missing_effect", "nothing_missing"  # verdicts of diagnoses
SHOWN = 5  # candidates


def told(known: Literature, found: Sequence[RecordFindings], values: Sequence[Beside]) -> list[Block]:
    """What stands in the literature, what each of the records shows, and published values beside those found."""
    blocks: list[Block] = [Text(f"{known.test}. {known.source}"), Text(f"**In the literature.** {known.known}")]
    for one in found:
        blocks += of_record(one, named=len(found) > 1)
    if values:
        blocks += [Text("**Published values beside those found.**"), beside_each_other(values)]
    return blocks


def of_record(found: RecordFindings, named: bool) -> list[Block]:
    """The ladder of one record: from the model as given to the one reached, and what is left of the response."""
    begins = ", ".join(_spoken(name) for name in found.steps[0]["terms"])
    name = f"**`{found.record}`.** " if named else ""
    return [
        Text(f"{name}The model is given as {begins}. **What is found.** {found.first['says']}"),
        climb_block(found),
        Text(f"**What is left.** {left(found)}"),
    ]


def climb_block(found: RecordFindings) -> Block:
    """Every model of the climb with its held-out error."""
    rows = [
        ("as given" if number == 0 else _spoken(history.label(step)), percent(step["error"]["response"]),
         _in_units(step), percent(step["noise_floor"]["response"]))
        for number, step in enumerate(found.steps)
    ]  # fmt: skip
    return document.table(("model", "held-out error", "rms", "noise floor"), rows)


def left(found: RecordFindings) -> str:
    """What the model reached leaves, and whether that is noise."""
    last, step = found.last, found.steps[-1]
    size = f"{percent(step['error']['response'])} of the response"
    floor = percent(step["noise_floor"]["response"])
    if step["error"]["response"] >= 1.0:
        return f"{size} (noise floor {floor}): more than the response itself, so the model predicts none of it."
    if last["verdict"] == NOTHING:
        return (
            f"{size} (noise floor {floor}), which depends no more than chance has it on the motion or its past: noise, "
            "as far as this record can say."
        )
    if last["verdict"] == MISSING:
        return f"{size} (noise floor {floor}): no noise. {_still(found)}"
    depends = percent(last["left"]) if last.get("left") else "much"
    return (
        f"{size} (noise floor {floor}): no noise, but nothing with a name either. General functions of the motion "
        f"explain a part of it, {depends} of the response; no single candidate does."
    )


def _still(found: RecordFindings) -> str:
    first = found.last["candidates"][0]
    tied = [_effect(t) for t in first.get("tied_with", ())]
    also = f", which the record cannot tell from {', '.join(tied)}," if tied else ""
    return (
        f"The diagnosis still names {_effect(first)}{also} and with it {percent(first['response_error'])} would be "
        "left; the climb ends here."
    )


def candidates(found: RecordFindings) -> Block:
    """The first candidates of the model as given."""
    rows = [
        (_effect(c), percent(c["explained"]), percent(c["response_error"]), _changes(c),
         ", ".join(_effect(t) for t in c["tied_with"][:3]))
        for c in found.first["candidates"][:SHOWN]
    ]  # fmt: skip
    return document.table(("candidate", "explains", "error with it", "its coefficient changes by", "tied with"), rows)


def _changes(candidate: Fields) -> str:
    changes: Mapping[str, float | None] = candidate.get("changes") or {}
    known = [value for value in changes.values() if value is not None]
    return percent(max(known)) if known else ""


def beside_each_other(values: Sequence[Beside]) -> Block:
    """Published values and those found."""
    rows = [
        (f"`{v.published.record}`, {v.published.quantity}", _number(v.published.value, v.published.unit),
         "not in the model" if v.found is None else _number(v.found, v.published.unit),
         "" if v.interval is None else f"{v.interval[0]:.4g} to {v.interval[1]:.4g}",
         "" if v.found is None else f"{v.found / v.published.value - 1.0:+.1%}".replace("%", " %"), v.published.within)
        for v in values
    ]  # fmt: skip
    return document.table(("", "published", "found", "95 % interval", "differs by", "to be expected"), rows)


def _number(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".strip()


def _in_units(step: Fields) -> str:
    return f"{step['rms']:.3g} {step['unit']}" if step["unit"] else ""


def _effect(candidate: Fields | str) -> str:
    """An effect, in a structure with its place."""
    if isinstance(candidate, str):
        return _spoken(candidate)
    place = " and ".join(candidate.get("between", ()))
    where = f" between {place}" if place else f" at {candidate['at']}" if "at" in candidate else ""
    return _spoken(candidate["term"]) + where


def _spoken(name: str) -> str:
    return name.replace("_", " ")
