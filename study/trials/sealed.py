"""A trial on disk: the record, the model its owner believes in, and the answer, which no glance gives away."""

import base64
import binascii
import json
import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from study.equations.model_file import format_model
from study.records.record import write_csv
from study.support.errors import StudyError, expect
from study.support.files import read_text, replace_file, replacing
from study.trials.draw import Trial

ANSWER_FILE = "the answer file of a trial, as 'study trial' writes it"


def write_trial(trial: Trial, folder: Path) -> tuple[Path, Path, Path]:
    """Write record, believed model and sealed answer: their paths, or a ``StudyError`` if that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(
            f"{folder}: no such folder can be made ({error.strerror}); expected a writable place"
        ) from None
    stem = trial.record.name
    record, model, answer = (folder / f"{stem}{ending}" for ending in (".csv", ".yaml", ".answer.json"))
    with replacing(record) as beside:
        write_csv(trial.record, beside)
    replace_file(model, format_model(trial.believed).encode())
    content = {
        "hidden": trial.hidden, "shares": trial.shares, "noise": trial.noise, "fault": dict(trial.fault),
        "truth": format_model(trial.truth),
    }  # fmt: skip
    sealed = base64.b64encode(json.dumps(content).encode()).decode()
    page = {"trial": stem, "open_with": f"study trial --open {answer.name}", "answer": sealed}
    replace_file(answer, (json.dumps(page, indent=1) + "\n").encode())
    return record, model, answer


@dataclass(frozen=True)
class Imposed:
    """A fault of the measurement, as it was put on."""

    fault: str
    channel: str
    value: float
    unit: str


@dataclass(frozen=True)
class Answer:
    """What is sealed."""

    hidden: list[str]  # effects
    shares: list[float]  # of the force that each is sized by
    noise: float  # mean square, over that of the response
    fault: Imposed | None  # None if nothing was put on
    truth: str  # the model that made the record


def unseal(path: Path) -> Answer:
    """The answer of a trial; a ``StudyError`` if the file holds none."""
    text = read_text(path, ANSWER_FILE)
    try:
        page = json.loads(text)
        answer = _answer(json.loads(base64.b64decode(page["answer"], validate=True)))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError, binascii.Error):
        raise StudyError(f"{path}: this holds no sealed answer; expected {ANSWER_FILE}") from None
    alike = len(answer.hidden) == len(answer.shares)
    expect(alike, f"{path}: the answer in it has not a share for each effect; expected {ANSWER_FILE}")
    return answer


def _answer(content: Any) -> Answer:
    """What was sealed; any error of a missing key, one too many or a wrong type if it is none."""
    if set(content) != {field.name for field in fields(Answer)}:
        raise KeyError(*content)
    fault: Any = content["fault"]
    imposed = None
    if not isinstance(fault, dict):
        raise TypeError(fault)
    if fault:
        name, channel, unit = (_text(fault[key]) for key in ("fault", "channel", "unit"))
        imposed = Imposed(name, channel, _number(fault["value"]), unit)
    hidden, shares = [_text(name) for name in content["hidden"]], [_number(share) for share in content["shares"]]
    return Answer(hidden, shares, _number(content["noise"]), imposed, _text(content["truth"]))


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TypeError(value)
    return float(value)


def answer_in_words(answer: Answer) -> str:
    """An answer for people."""
    hidden = [f"{name} ({100.0 * share:.0f} %)" for name, share in zip(answer.hidden, answer.shares, strict=True)]
    what = (
        f"hidden, with the share of the force, or of a rig the error without it: {', '.join(hidden)}"
        if hidden
        else "nothing is hidden"
    )
    noise = f"noise: {100.0 * answer.noise:g} % of the mean square of the response"
    fault, said = answer.fault, "none"
    if fault is not None:
        unit = "" if fault.unit == "1" else f" {fault.unit}"
        said = f"{fault.fault.replace('_', ' ')} of the {fault.channel}, {fault.value:.4g}{unit}"
    return f"{what}\n{noise}\nfault of the measurement: {said}\nthe model that made the record:\n\n{answer.truth}"
