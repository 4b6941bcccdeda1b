"""Snakemake step: a case of structures -> its record, tables, claims and figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from study.compare.comparison import compare
from study.equations.model_file import read_model
from study.figures import page
from study.records.prepared import prepare_record
from study.records.record import write_csv
from study.reproduction import structure_figures, structure_tables, tables
from study.reproduction.cases import make_record
from study.reproduction.config import Case
from study.reproduction.settings import IdentificationSettings, RecordSettings
from study.support.files import replacing
from study.support.workflow_step import one_sentence


def main(
    model: Path, style: Path, outputs: Mapping[str, Path], pictures: Mapping[str, Sequence[Path]], case: Case,
    made_by: RecordSettings, settings: IdentificationSettings, limits: Mapping[str, float],
) -> None:  # fmt: skip
    structure, title = read_model(model), case.title
    record = make_record(structure, made_by)
    with replacing(outputs["record"]) as beside:
        write_csv(record, beside)
    if case.modal:
        comparison = compare(structure_tables.modal_model(structure, case.sensors), prepare_record(record))
        highest = made_by.excitation.at_level(made_by.level).highest
        responses = structure_tables.modal_responses(structure, comparison, settings, highest)
        made = {
            "responses": responses,
            "parameters": structure_tables.modal_parameters(structure, comparison, settings),
            "claims": structure_tables.modal_claims(structure, comparison, settings, limits, case.noise),
        }
        figures = {"measured": lambda: structure_figures.modal_figure(responses, title)}
    else:  # by its equations of motion
        result = structure_tables.identify_equations(structure, record, settings)
        responses = structure_tables.structure_responses(result)
        coherences = structure_tables.structure_coherences(result)
        made = {
            "responses": responses,
            "coherences": coherences,
            "parameters": structure_tables.structure_parameters(result, settings),
            "reactions": structure_tables.structure_reactions(case.case, result),
            "claims": structure_tables.structure_claims(record, result, settings, limits),
        }
        figures = {
            "connections": lambda: structure_figures.connections_figure(responses, title),
            "coherence": lambda: structure_figures.coherence_figure(coherences, title),
        }
    for name, table in made.items():
        tables.write_table(table, outputs[name])
    page.write_each(figures, pictures, style)


if "snakemake" in globals():
    step = globals()["snakemake"]
    with one_sentence():
        made = {kind: Path(path) for kind, path in step.output.items() if isinstance(path, str)}
        drawn = {kind: [Path(path) for path in paths] for kind, paths in step.output.items() if kind not in made}
        main(
            Path(step.input.model), Path(step.input.style), made,
            {kind.removeprefix("draw_"): paths for kind, paths in drawn.items()},
            Case.model_validate(step.params.case), RecordSettings.model_validate(step.params.record),
            IdentificationSettings.model_validate(step.params.settings), step.params.limits,
        )  # fmt: skip
