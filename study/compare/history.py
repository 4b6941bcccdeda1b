"""The history: every model tried on a record so far, its errors, and the noise floor, kept beside the model file."""

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from types import NoneType
from typing import Any, cast

from study.support.errors import StudyError
from study.support.files import read_text, recover
from study.support.numbers import percent
from study.support.yaml_text import shown

Step = dict[str, Any]
STEPS_FILE = "the steps that 'study add' or 'drop' writes"
STEP_FIELDS: Mapping[str, Any] = {  # what a step holds
    "terms": list, "record": str, "unit": str, "rms": int | float, "error.response": int | float,
    "error.force": int | float | NoneType, "noise_floor.response": int | float, "added": str | NoneType,
    "dropped": str | NoneType,
}  # fmt: skip
OPTIONAL = ("added", "dropped")


def path_of(model: Path) -> Path:
    """Where the history of a model file is kept.

    ``rig.yaml`` has ``rig.history.json`` beside it; ``rig.yml``, which is another model, ``rig.yml.history.json``.
    """
    return model.parent / name_for(model.name)


def name_for(model: str) -> str:
    """The name of the history's file by that of the model's."""
    stem, _, ending = model.rpartition(".")
    return f"{stem if stem and ending == 'yaml' else f'{stem}.{ending}'}.history.json"


def read_history(model: Path) -> list[Step]:
    """The steps so far, oldest first, none where nothing was added; a ``StudyError`` if the file is no history.

    What a killed run has left half changed is put back first.
    """
    recover(model)
    path = path_of(model)
    if not os.path.exists(path):  # noqa: PTH110  (false also for a name that no file can have)
        return []
    try:
        content: object = json.loads(read_text(path, STEPS_FILE))
    except json.JSONDecodeError as error:
        raise StudyError(f"{path}: line {error.lineno} is not JSON; expected {STEPS_FILE}") from None
    except RecursionError:
        raise StudyError(f"{path}: it is nested too deeply; expected {STEPS_FILE}") from None
    except ValueError:  # Python reads no number of thousands of digits
        raise StudyError(f"{path}: it holds a number of too many digits; expected {STEPS_FILE}") from None
    steps = cast(Step, content).get("steps") if isinstance(content, dict) else None
    if not isinstance(steps, list):
        raise StudyError(f"{path}: it holds no list of steps; expected {STEPS_FILE}")
    for number, step in enumerate(cast(list[object], steps)):
        if fault := _fault(step):
            raise StudyError(f"{path}: step {number} {fault}; expected {STEPS_FILE}")
    return cast(list[Step], steps)


def _fault(step: object) -> str:
    """What is wrong with a step; empty if nothing is."""
    if not isinstance(step, dict):
        return f"is {shown(step)}"
    given = cast(Step, step)
    for keys, kinds in STEP_FIELDS.items():
        value: Any = given
        for key in keys.split("."):
            if not isinstance(value, dict) or (key not in value and keys not in OPTIONAL):
                return f"has no {keys!r}"
            value = cast(Step, value).get(key)
        if not isinstance(value, kinds) or isinstance(value, bool) or not _fits(value):
            return f"has {keys} = {shown(value)}"
    names = cast(list[object], given["terms"])
    return "" if all(isinstance(name, str) for name in names) else f"has terms = {shown(names)}"


def _fits(value: object) -> bool:
    """Whether a number is one that a table can show: finite, and of fewer than hundreds of digits."""
    try:
        return not isinstance(value, int | float) or math.isfinite(value)
    except OverflowError:
        return False


def as_bytes(steps: list[Step]) -> bytes:
    """The steps as the content of a file."""
    return (json.dumps({"steps": steps}, indent=1) + "\n").encode()


def with_step(steps: list[Step], before: Step, after: Step) -> list[Step]:
    """The history with a step more; it begins with the model before it, unless that is where it stands."""
    known = steps and steps[-1]["terms"] == before["terms"] and steps[-1]["record"] == before["record"]
    return [*steps, *([] if known else [before]), after]


def label(step: Step) -> str:
    """What was done to arrive at a model: ``+ term``, ``- term`` or ``as given``."""
    if step.get("added"):
        return f"+ {step['added']}"
    return f"- {step['dropped']}" if step.get("dropped") else "as given"


def _listed(names: list[str]) -> str:
    """Terms of a model; of a structure, which has them at places, how many there are of each effect."""
    effects = [name.partition("[")[0] for name in names]
    return ", ".join(
        name if effects.count(effect) == 1 else f"{effects.count(effect)} {effect}"
        for i, (name, effect) in enumerate(zip(names, effects, strict=True))
        if effects.index(effect) == i
    )


def history_table(steps: list[Step]) -> str:
    """The history for people, one line a model."""
    from tabulate import tabulate

    rows: list[list[str]] = []
    for number, step in enumerate(steps):
        done = label(step)
        what = _listed(step["terms"]) if done == "as given" else done
        error = step["error"]
        force = "-" if error["force"] is None else percent(error["force"])
        rows.append(
            [str(number), what, step["record"], force, percent(error["response"]),
             f"{step['rms']:.4g} {step['unit']}", percent(step["noise_floor"]["response"])]
        )  # fmt: skip
    head = ["", "model", "record", "force error", "response error", "rms", "noise floor"]
    return tabulate(rows, head, tablefmt="simple", disable_numparse=True)
