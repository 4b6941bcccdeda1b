"""The history: every model tried on a record so far, its errors, and the noise floor, kept beside the model file."""

import json
from pathlib import Path
from typing import Any, cast

from study.support.errors import StudyError
from study.support.files import read_text, replace_file
from study.support.numbers import percent

Step = dict[str, Any]


def path_of(model: Path) -> Path:
    """Where the history of a model file is kept: ``rig.yaml`` has ``rig.history.json`` beside it."""
    return model.with_name(f"{model.stem}.history.json")


def read(model: Path) -> list[Step]:
    """The steps so far, oldest first, none where nothing was added; a ``StudyError`` if the file is no history."""
    path = path_of(model)
    if not path.exists():
        return []
    wanted = "the steps as 'study add' writes them"
    try:
        content: object = json.loads(read_text(path, wanted))
    except json.JSONDecodeError as error:
        raise StudyError(f"{path}: line {error.lineno} is not JSON; expected {wanted}") from None
    steps = cast(Step, content).get("steps") if isinstance(content, dict) else None
    if not isinstance(steps, list) or not all(_is_step(s) for s in cast(list[object], steps)):
        raise StudyError(f"{path}: it holds no list of steps with terms, record and errors; expected {wanted}")
    return cast(list[Step], steps)


def _is_step(step: object) -> bool:
    return isinstance(step, dict) and {"terms", "record", "error", "noise_floor"} <= set(cast(Step, step))


def write(model: Path, steps: list[Step]) -> None:
    """Keep the steps, the old file surviving any failure."""
    replace_file(path_of(model), as_bytes(steps))


def as_bytes(steps: list[Step]) -> bytes:
    """The steps as the content of a file."""
    return (json.dumps({"steps": steps}, indent=1) + "\n").encode()


def climbed(steps: list[Step], before: Step, after: Step) -> list[Step]:
    """The history with a step more; it begins with the model before it, unless that is where it stands."""
    known = steps and steps[-1]["terms"] == before["terms"] and steps[-1]["record"] == before["record"]
    return [*steps, *([] if known else [before]), after]


def label(step: Step) -> str:
    """What was done to arrive at a model: ``+ term``, ``- term`` or ``as given``."""
    if step.get("added"):
        return f"+ {step['added']}"
    return f"- {step['dropped']}" if step.get("dropped") else "as given"


def table(steps: list[Step]) -> str:
    """The history for people, one line a model."""
    from tabulate import tabulate

    rows: list[list[str]] = []
    for number, step in enumerate(steps):
        done = label(step)
        what = ", ".join(step["terms"]) if done == "as given" else done
        error = step["error"]
        force = "-" if error["force"] is None else percent(error["force"])
        rows.append(
            [str(number), what, step["record"], force, percent(error["response"]),
             f"{step['rms']:.4g} {step['unit']}", percent(step["noise_floor"]["response"])]
        )  # fmt: skip
    head = ["", "model", "record", "force error", "response error", "rms", "noise floor"]
    return tabulate(rows, head, tablefmt="simple", disable_numparse=True)
