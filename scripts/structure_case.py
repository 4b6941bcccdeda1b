"""Snakemake step: a case of structures -> its record, tables, claims and figures."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd
from matplotlib import style as styles
from matplotlib.figure import Figure

from study.equations.model import Model
from study.equations.model_file import read_model
from study.figures import page
from study.records.record import Record, write_csv
from study.reproduction import tables
from study.structure import measured_tables, reverse_figures, reverse_tables
from study.structure.measured_comparison import compare_measured
from study.structure.prepared_structure import prepare_structure
from study.structure.structure_claims import measured_claims, structure_claims
from study.structure.structure_study import (
    StructureCase,
    StructureSettings,
    identify_structure,
    make_structure_record,
    measured_model,
)
from study.support.files import replace_file, replacing
from study.support.workflow_step import one_sentence

Made = tuple[dict[str, pd.DataFrame], dict[str, Callable[[], Figure]]]


def main(
    model: Path, style: Path, outputs: Mapping[str, Path], pictures: Mapping[str, Path], case: StructureCase,
    settings: StructureSettings,
) -> None:  # fmt: skip
    structure = read_model(model)
    record = make_structure_record(structure, case, settings)
    made, figures = (as_measured if case.measured else in_reverse)(structure, record, case, settings)
    for name, table in made.items():
        tables.write_table(table, outputs[name])
    with replacing(outputs["record"]) as beside:
        write_csv(record, beside)
    with styles.context(style):
        drawn = {kind: draw() for kind, draw in figures.items()}
        for kind, path in pictures.items():
            replace_file(path, page.rendered(drawn[kind.rpartition("_")[0]], path.suffix[1:]))


def in_reverse(
    structure: Model, record: Record, case: StructureCase, settings: StructureSettings
) -> Made:  # fmt: skip
    """Tables and figures of the equations of motion."""
    result = identify_structure(structure, record, case, settings)
    responses, coherences = reverse_tables.structure_responses(result), reverse_tables.structure_coherences(result)
    made = {
        "responses": responses,
        "coherences": coherences,
        "parameters": reverse_tables.structure_parameters(case.case, result, settings.tolerances),
        "reactions": reverse_tables.structure_reactions(case.case, result),
        "claims": structure_claims(case, record, result, settings),
    }
    return made, {
        "connections": lambda: reverse_figures.connections_figure(responses, case.title),
        "coherence": lambda: reverse_figures.coherence_figure(coherences, case.title),
    }


def as_measured(
    structure: Model, record: Record, case: StructureCase, settings: StructureSettings
) -> Made:  # fmt: skip
    """Tables and figures of a structure by its own modes."""
    model = measured_model(structure, case.sensors)
    comparison = compare_measured(model, prepare_structure(record, model))
    responses = measured_tables.measured_responses(case, structure, comparison, settings)
    made = {
        "responses": responses,
        "parameters": measured_tables.measured_parameters(case, structure, comparison, settings),
        "claims": measured_claims(case, structure, comparison, settings),
    }
    return made, {"measured": lambda: measured_tables.measured_figure(responses, case.title)}


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        paths = {kind: Path(path) for kind, path in step.output.items()}
        main(
            Path(step.input.model), Path(step.input.style),
            {kind: path for kind, path in paths.items() if path.suffix == ".csv"},
            {kind: path for kind, path in paths.items() if path.suffix != ".csv"},
            StructureCase.model_validate(step.params.case), StructureSettings.model_validate(step.params.settings),
        )  # fmt: skip
