"""Snakemake step: a case of structures -> its record, tables, claims and figures."""

from collections.abc import Mapping
from pathlib import Path

from matplotlib import style as styles

from study.equations.model_file import read_model
from study.figures import page
from study.reproduction import tables
from study.structure import reverse_figures, reverse_tables
from study.structure.structure_claims import structure_claims
from study.structure.structure_record import write_structure_csv
from study.structure.structure_study import (
    StructureCase,
    StructureSettings,
    identify_structure,
    make_structure_record,
)
from study.support.files import replace_file, replacing
from study.support.workflow_step import one_sentence


def main(
    model: Path, style: Path, outputs: Mapping[str, Path], pictures: Mapping[str, Path], case: StructureCase,
    settings: StructureSettings,
) -> None:  # fmt: skip
    structure = read_model(model)
    record = make_structure_record(structure, case, settings)
    result = identify_structure(structure, record, case, settings)
    responses, coherences = reverse_tables.structure_responses(result), reverse_tables.structure_coherences(result)
    tables.write_csv(responses, outputs["responses"])
    tables.write_csv(coherences, outputs["coherences"])
    parameters = reverse_tables.structure_parameters(case.case, result, settings.tolerances)
    tables.write_csv(parameters, outputs["parameters"])
    tables.write_csv(reverse_tables.structure_reactions(case.case, result), outputs["reactions"])
    tables.write_csv(structure_claims(case, record, result, settings), outputs["claims"])
    with replacing(outputs["record"]) as beside:
        write_structure_csv(record, beside)
    with styles.context(style):
        drawn = {
            "connections": reverse_figures.connections_figure(responses, case.title),
            "coherence": reverse_figures.coherence_figure(coherences, case.title),
        }
        for kind, path in pictures.items():
            replace_file(path, page.rendered(drawn[kind.rpartition("_")[0]], path.suffix[1:]))


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
