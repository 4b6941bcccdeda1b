"""A trial of a structure on disk: the record, the model its owner believes in, and the answer."""

from pathlib import Path

from study.equations.model_file import format_model
from study.records.record import write_csv
from study.trials.sealed import write_trial_files
from study.trials.structure_draw import StructureTrial


def write_structure_trial(trial: StructureTrial, folder: Path) -> tuple[Path, Path, Path]:
    """Write record, believed model and sealed answer: their paths, or a ``StudyError`` if that cannot be."""
    hidden = [trial.hidden.name] if trial.hidden else []
    content: dict[str, object] = {
        "hidden": hidden, "shares": [trial.share] if hidden else [], "noise": trial.noise, "fault": {},
        "truth": format_model(trial.truth),
    }  # fmt: skip
    record = trial.record
    return write_trial_files(record.name, lambda path: write_csv(record, path), trial.believed, content, folder)
