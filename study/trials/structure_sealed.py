"""A trial of a structure on disk: the record, the model its owner believes in, and the answer."""

from pathlib import Path

from study.equations.model_file import format_model
from study.structure.structure_record import write_structure_csv
from study.support.errors import StudyError
from study.support.files import replace_file, replacing
from study.trials.sealed import seal
from study.trials.structure_draw import StructureTrial


def write(trial: StructureTrial, folder: Path) -> tuple[Path, Path, Path]:
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
        write_structure_csv(trial.record, beside)
    replace_file(model, format_model(trial.believed).encode())
    hidden = [trial.hidden.name] if trial.hidden else []
    content: dict[str, object] = {
        "hidden": hidden, "shares": [trial.share] if hidden else [], "noise": trial.noise, "fault": {},
        "truth": format_model(trial.truth),
    }  # fmt: skip
    seal(content, answer, stem)
    return record, model, answer
