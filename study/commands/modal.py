"""What the commands do with a model whose linear part is a sum of modes."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import progress
from study.commands.record_arguments import (
    inputs_of,
    layout_of,
    out_folder,
    read_records,
    sources,
    written_together,
)

if TYPE_CHECKING:
    from study.equations.model import Model
    from study.equations.term import Term
    from study.records.prepared import Prepared


def modal_records(arguments: argparse.Namespace, model: "Model") -> "list[Prepared]":
    """The records that were named, made ready for such a model."""
    from study.faults.fault import settings_beside
    from study.records.sampling_rate import without_spare_samples
    from study.support.errors import at, expect
    from study.way_in.compare_records import made_ready

    for option, usual in (("estimator", "output_error"), ("each_record", "[]")):
        given = f"--{option.replace('_', '-')} is not for 'linear: modal'; expected it left out"
        expect(str(getattr(arguments, option, usual)) == usual, given)
    made: list[Prepared] = []
    for path, record in zip(sources(arguments), read_records(arguments, model), strict=True):
        with at(path):
            beside = settings_beside(path)
            held = f"measurement holds {', '.join(beside.held)}, which is looked for in records of a single mass alone"
            expect(arguments.no_measurement or not beside.held, f"{held}; expected 'measurement: off'")
            layout = layout_of(arguments, record)
            prepared = made_ready([record], model, layout, arguments.absolute)[1]
            whole = layout.as_sampled or beside.as_sampled
            made.append(prepared if whole else without_spare_samples(prepared))
    return made


def compare_modal_command(arguments: argparse.Namespace, model: "Model") -> None:
    """``study compare`` where the linear part is a sum of modes."""
    from study.compare.comparison_report import as_json
    from study.compare.modal_comparison import compare_modal, modal_document, modal_summary
    from study.support.files import write_files

    folder, ready = out_folder(arguments), modal_records(arguments, model)
    with progress("step", 3 * len(ready)) as step:
        comparisons = [compare_modal(model, prepared, step) for prepared in ready]
    prefix = [f"{c.prepared.record.name}_" if len(ready) > 1 else "" for c in comparisons]
    files = {f"{p}comparison.json": as_json(modal_document(c)) for p, c in zip(prefix, comparisons, strict=True)}
    write_files(folder, files)
    print("\n\n".join(modal_summary(c) for c in comparisons))
    print(f"\n{folder}: {', '.join(files)}")


def refuse_modal(model: "Model", command: str) -> None:
    """Say so where a command needs masses, stiffnesses and dampings."""
    from study.support.errors import expect

    like = "expected inertia at every coordinate; 'compare', 'diagnose', 'add' and 'drop' take it"
    expect(model.modal is None, f"{command} knows no {model.name!r} with 'linear: modal' yet; {like}")


def diagnose_modal_command(arguments: argparse.Namespace, model: "Model", own: "list[Term]") -> None:
    """``study diagnose`` where the linear part is a sum of modes."""
    from study.compare.comparison_report import as_json
    from study.compare.modal_comparison import compare_modal
    from study.diagnose.modal_diagnosis import diagnose_modal
    from study.diagnose.modal_report import modal_fields, modal_in_words, modal_table
    from study.support.files import write_files

    folder, files, ready = out_folder(arguments), dict[str, bytes](), modal_records(arguments, model)
    for prepared in ready:
        with progress(" candidates", name=prepared.record.name) as step:
            diagnosis = diagnose_modal(compare_modal(model, prepared), own, arguments.without, progress=step)
        print(f"{prepared.record.name}: {diagnosis.verdict.replace('_', ' ')}")
        print(f"{modal_table(diagnosis)}\n\n{modal_in_words(diagnosis)}")
        prefix = f"{prepared.record.name}_" if len(ready) > 1 else ""
        files[f"{prefix}diagnosis.json"] = as_json(modal_fields(diagnosis))
    write_files(folder, files, inputs_of(arguments))
    print(f"\n{folder}: {', '.join(files)}")


def revise_modal(
    arguments: argparse.Namespace, model: "Model", changed: "Model", text: str, folder: Path, **told: str | None
) -> None:
    """Compare a model and a changed one with all records, its modes fitted anew; write it with its history, and tell.

    ``told`` is the term that was ``added`` or ``dropped``.
    """
    from study.compare import history
    from study.compare.comparison_report import as_json
    from study.compare.modal_comparison import (
        compare_modal,
        modal_document,
        modal_step,
        modal_summary,
    )

    steps, summaries, document = history.read_history(arguments.model), list[str](), b""
    for prepared in modal_records(arguments, model):
        before, after = (compare_modal(m, prepared) for m in (model, changed))
        steps = history.with_step(steps, modal_step(before), modal_step(after, **told))
        document = as_json(modal_document(after))
        summaries.append(modal_summary(after))
    written_together(arguments, text, steps, document, folder)
    print("\n\n".join(summaries))
    print("\n" + history.history_table(steps))
