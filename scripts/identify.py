"""Snakemake step: record -> frequency response functions, coherences, parameters and all figures of a case.

One process for all of it: it begins for longer than it identifies or draws.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from study.equations.model_file import read_model
from study.records.record import read_csv
from study.reproduction import study_figures, tables
from study.reproduction.cases import identify_case
from study.reproduction.settings import IdentificationSettings
from study.reproduction.study_figures import CaseFiles
from study.support.workflow_step import one_sentence

TABLES = ("responses", "coherences", "noise", "parameters")


def identify(model: Path, record: Path, outputs: Mapping[str, Path], settings: IdentificationSettings) -> None:
    system = read_model(model)
    found = identify_case(system, read_csv(record), settings)
    for note in (f.note for f in found.values() if f.note):
        print(f"{settings.case}: {note}", file=sys.stderr)
    made = {
        "responses": tables.response_table(system, found),
        "coherences": tables.coherence_table(found),
        "noise": tables.noise_spectra(found),
        "parameters": tables.parameter_table(settings.case, system, found, settings),
    }
    for name, table in made.items():
        tables.write_table(table, outputs[name])


def main(
    model: Path, record: Path, outputs: Mapping[str, Path], pictures: Mapping[str, Sequence[Path]], style: Path,
    settings: IdentificationSettings, title: str, drawn: Sequence[str],
) -> None:  # fmt: skip
    identify(model, record, outputs, settings)
    case = CaseFiles(
        record, model, outputs["responses"], outputs["coherences"], title, outputs["parameters"], drawn,
        settings.segments.segments(),
    )  # fmt: skip
    study_figures.draw_case(case, pictures, style)


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        outputs = dict(step.output.items())
        main(
            Path(step.input.model), Path(step.input.record), {name: Path(outputs.pop(name)) for name in TABLES},
            {kind: [Path(path) for path in paths] for kind, paths in outputs.items()}, Path(step.input.style),
            IdentificationSettings.model_validate(step.params.settings), step.params.title, step.params.drawn,
        )  # fmt: skip
