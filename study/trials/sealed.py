"""A trial on disk: the record, the model its owner believes in, and the answer, which no glance gives away."""

import base64
import binascii
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

from study.equations.model_file import format_model
from study.records.record import Record, write_csv
from study.structure.structure_record import write_structure_csv
from study.support.errors import StudyError
from study.support.files import read_text, replace_file, replacing
from study.support.yaml_text import shown
from study.trials.draw import Trial

WANTED = "the answer file of a trial, as 'study trial' writes it"


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
        if isinstance(trial.record, Record):
            write_csv(trial.record, beside)
        else:
            write_structure_csv(trial.record, beside)
    replace_file(model, format_model(trial.believed).encode())
    hidden = base64.b64encode(json.dumps(contents(trial)).encode()).decode()
    page = {"trial": stem, "open_with": f"study trial --open {answer.name}", "answer": hidden}
    replace_file(answer, (json.dumps(page, indent=1) + "\n").encode())
    return record, model, answer


def contents(trial: Trial) -> dict[str, Any]:
    """What the answer holds: hidden effects, their shares of the restoring force, noise, fault, and the true model."""
    return {
        "hidden": list(trial.hidden), "shares": list(trial.shares), "noise": trial.noise, "fault": dict(trial.fault),
        "truth": format_model(trial.truth),
    }  # fmt: skip


def unseal(path: Path) -> dict[str, Any]:
    """The answer of a trial; a ``StudyError`` if the file holds none."""
    text = read_text(path, WANTED)
    try:
        page: object = json.loads(text)
        sealed = cast(dict[str, Any], page)["answer"]
        answer: object = json.loads(base64.b64decode(sealed, validate=True))
    except (ValueError, KeyError, TypeError, RecursionError, binascii.Error):
        raise StudyError(f"{path}: this holds no sealed answer; expected {WANTED}") from None
    if not isinstance(answer, dict) or set(cast(dict[str, Any], answer)) != set(KINDS):
        raise StudyError(f"{path}: the answer in it is not that of a trial; expected {WANTED}")
    found = cast(dict[str, Any], answer)
    for key, kind in KINDS.items():
        if not kind(found[key]):
            raise StudyError(f"{path}: the answer in it has {key} = {shown(found[key])}; expected {WANTED}")
    if len(found["hidden"]) != len(found["shares"]):
        raise StudyError(f"{path}: the answer in it has not a share for each effect; expected {WANTED}")
    return found


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _are(value: object, kind: Callable[[object], bool]) -> bool:
    return isinstance(value, list) and all(kind(item) for item in cast(list[object], value))


def _is_fault(value: object) -> bool:
    if not isinstance(value, dict):
        return False
    fault = cast(dict[str, object], value)
    words = all(_is_text(fault.get(key)) for key in ("unit", "fault", "channel"))
    return not fault or (words and _is_number(fault.get("value")))


LARGEST = 1e50  # of a number in an answer
KINDS: Mapping[str, Callable[[object], bool]] = {
    "hidden": lambda value: _are(value, _is_text), "shares": lambda value: _are(value, _is_number),
    "noise": _is_number, "fault": _is_fault, "truth": _is_text,
}  # fmt: skip


def answer_in_words(answer: Mapping[str, Any]) -> str:
    """An answer for people."""
    hidden = [f"{name} ({100.0 * share:.0f} %)" for name, share in zip(answer["hidden"], answer["shares"], strict=True)]
    what = f"hidden, with the share of the restoring force: {', '.join(hidden)}" if hidden else "nothing is hidden"
    noise = f"noise: {100.0 * answer['noise']:g} % of the mean square of the response"
    fault, said = answer["fault"], "none"
    if fault:
        unit = "" if fault["unit"] == "1" else f" {fault['unit']}"
        said = f"{str(fault['fault']).replace('_', ' ')} of the {fault['channel']}, {fault['value']:.4g}{unit}"
    return f"{what}\n{noise}\nfault of the measurement: {said}\nthe model that made the record:\n\n{answer['truth']}"
