"""What the commands do with a model of several coordinates."""

import argparse
from typing import TYPE_CHECKING

from study.commands.command import progress
from study.commands.record_arguments import inputs_of, out_folder, read_options, refuse_groups, written_together

if TYPE_CHECKING:
    from collections.abc import Mapping

    from study.equations.model import Model
    from study.structure.prepared_structure import PreparedStructure
    from study.structure.structure_comparison import StructureComparison


def prepared_structures(arguments: argparse.Namespace, model: "Model") -> "list[PreparedStructure]":
    """The records that were named, made ready."""
    from study.structure.prepared_structure import prepare_structure
    from study.structure.structure_reader import read_structure
    from study.support.errors import at

    refuse_groups(arguments)
    made: list[PreparedStructure] = []
    for path in arguments.records:
        record = read_structure(path, model, read_options(arguments))
        parts = [_within(span, len(record)) for span in (arguments.fit, arguments.judge)]
        with at(path):
            made.append(prepare_structure(record, model, parts[0], parts[1], arguments.cutoff))
    return made


def _within(span: "tuple[int, int | None] | None", samples: int) -> tuple[int, int] | None:
    return None if span is None else (span[0], samples if span[1] is None else span[1])


def compare(arguments: argparse.Namespace, model: "Model") -> None:
    """``study compare`` of a structure."""
    from study.compare.comparison_report import as_json
    from study.structure.structure_comparison import compare_structure, document, summary
    from study.structure.structure_page import PAGE, structure_page
    from study.structure.structure_pictures import pictures
    from study.support.file_sets import write_files

    folder = out_folder(arguments)
    ready = prepared_structures(arguments, model)
    if model.measured:
        _compare_measured(arguments, model, ready)
        return
    with progress("step", 3 * len(ready)) as step:
        comparisons = [compare_structure(model, prepared, progress=step) for prepared in ready]
    prefix = [f"{c.prepared.record.name}_" if len(ready) > 1 else "" for c in comparisons]
    files: dict[str, bytes] = {}
    for before, comparison in zip(prefix, comparisons, strict=True):
        made = {PAGE: structure_page(comparison), "comparison.json": as_json(document(comparison))}
        made |= pictures(comparison)
        files |= {before + name: content for name, content in made.items()}
    write_files(folder, files, inputs_of(arguments))
    print("\n\n".join(summary(c) for c in comparisons))
    print(f"\n{folder}: {_listed(files)}")


def _compare_measured(arguments: argparse.Namespace, model: "Model", ready: "list[PreparedStructure]") -> None:
    """The same where the linear part is as measured."""
    from study.compare.comparison_report import as_json
    from study.structure.measured_comparison import compare_measured, measured_document, measured_summary
    from study.support.file_sets import write_files

    folder = out_folder(arguments)
    with progress("step", 3 * len(ready)) as step:
        comparisons = [compare_measured(model, prepared, step) for prepared in ready]
    prefix = [f"{c.prepared.record.name}_" if len(ready) > 1 else "" for c in comparisons]
    files = {f"{p}comparison.json": as_json(measured_document(c)) for p, c in zip(prefix, comparisons, strict=True)}
    write_files(folder, files)
    print("\n\n".join(measured_summary(c) for c in comparisons))
    print(f"\n{folder}: {', '.join(files)}")


def _refuse_measured(model: "Model", command: str) -> None:
    """Say so where a command needs masses, stiffnesses and dampings."""
    from study.support.errors import expect

    like = "expected a model with inertia at every coordinate; 'study compare' takes this one"
    expect(not model.measured, f"{command} knows no {model.name!r} with 'linear: measured' yet; {like}")


def diagnose(arguments: argparse.Namespace, model: "Model") -> None:
    """``study diagnose`` of a structure."""
    from study.compare.comparison_report import as_json
    from study.diagnose.user_candidates import own_candidates
    from study.equations import terms
    from study.structure.structure_comparison import compare_structure
    from study.structure.structure_page import PAGE, structure_page
    from study.structure.structure_pictures import diagnosis_pictures
    from study.structure.structure_report import fields, in_words, modes_before_and_after, table
    from study.structure.structure_verdict import diagnose_structure
    from study.support.file_sets import write_files

    _refuse_measured(model, "diagnose")
    folder = out_folder(arguments)
    own = own_candidates(arguments.candidate, model)
    for name in arguments.without:
        terms.get(name)
    files: dict[str, bytes] = {}
    ready = prepared_structures(arguments, model)
    for prepared in ready:
        with progress(" candidates", name=prepared.record.name) as step:
            comparison = compare_structure(model, prepared)
            diagnosis = diagnose_structure(comparison, own, arguments.without, progress=step)
        print(f"{prepared.record.name}: {diagnosis.verdict.replace('_', ' ')}")
        print(table(diagnosis) + "\n\n" + modes_before_and_after(diagnosis) + "\n\n" + in_words(diagnosis))
        prefix = f"{prepared.record.name}_" if len(ready) > 1 else ""
        made = {PAGE: structure_page(comparison, diagnosis), "diagnosis.json": as_json(fields(diagnosis))}
        made |= diagnosis_pictures(diagnosis)
        files |= {prefix + name: content for name, content in made.items()}
    write_files(folder, files, inputs_of(arguments))
    print(f"\n{folder}: {_listed(files)}")


def _listed(files: "Mapping[str, bytes]") -> str:
    return ", ".join(name for name in files if not name.endswith(".svg"))


def add(arguments: argparse.Namespace, model: "Model") -> None:
    """``study add`` to a structure."""
    from study.compare import history
    from study.compare.comparison_report import as_json
    from study.equations import layout, terms
    from study.equations.model import free
    from study.equations.model_file import text_with
    from study.structure.structure_comparison import compare_structure, document, history_step, summary
    from study.structure.structure_verdict import added_term
    from study.support.errors import at
    from study.support.transaction import locked

    _refuse_measured(model, "add")
    folder = out_folder(arguments)
    term = terms.get(arguments.term) if arguments.force is None else terms.custom(arguments.term, arguments.force)
    with at(arguments.model):
        where: dict[object, object] = {"at": arguments.at} if arguments.at else {}
        where |= {"between": arguments.between} if arguments.between else {}
        place = layout.place_of(where, term.name, model.coordinates)
        entry = free(term, place)
        layout.check(model.with_term(entry))
    with locked(arguments.model):  # another run may have changed it meanwhile
        text, steps = text_with(arguments.model, entry), history.read(arguments.model)
        comparisons: list[StructureComparison] = []
        for prepared in prepared_structures(arguments, model):
            before = compare_structure(model, prepared)
            comparisons.append(added_term(before, entry))
            steps = history.climbed(steps, history_step(before), history_step(comparisons[-1], entry.name))
        page = as_json(document(comparisons[-1]))
        written_together(arguments, text, steps, page, folder)
    print("\n\n".join(summary(c) for c in comparisons))
    print("\n" + history.table(steps))


def drop(arguments: argparse.Namespace, model: "Model", name: str, text: str) -> None:
    """``study drop`` from a structure; ``text`` is the model file's without the term."""
    from study.compare import history
    from study.compare.comparison_report import as_json
    from study.structure.placed_dropping import dropped_term
    from study.structure.structure_comparison import compare_structure, document, history_step, summary

    folder, steps = out_folder(arguments), history.read(arguments.model)
    comparisons: list[StructureComparison] = []
    for prepared in prepared_structures(arguments, model):
        before = compare_structure(model, prepared)
        comparisons.append(dropped_term(before, name))
        steps = history.climbed(steps, history_step(before), history_step(comparisons[-1], dropped=name))
    written_together(arguments, text, steps, as_json(document(comparisons[-1])), folder)
    print("\n\n".join(summary(c) for c in comparisons))
    print("\n" + history.table(steps))


def explore(arguments: argparse.Namespace) -> None:
    """``study explore`` of a structure: its diagnosis as a page that stays as it is."""
    from study.equations.model_file import read_model
    from study.structure.structure_comparison import compare_structure
    from study.structure.structure_page import PAGE, structure_page
    from study.structure.structure_verdict import diagnose_structure
    from study.support.errors import expect
    from study.support.file_sets import write_files

    several = arguments.records[1:] or arguments.each_record
    expect(not several, f"{several and several[0]}: the page of a structure shows one record; expected no more")
    folder, model = out_folder(arguments), read_model(arguments.model)
    (prepared,) = prepared_structures(arguments, model)
    with progress(" candidates", name=prepared.record.name) as step:
        comparison = compare_structure(model, prepared)
        diagnosis = diagnose_structure(comparison, progress=step)
    write_files(folder, {PAGE: structure_page(comparison, diagnosis)}, inputs_of(arguments))
    print(f"{folder / PAGE} shows the structure; 'study add' adds what is missing, and this command draws it again")
    opened((folder / PAGE).resolve().as_uri(), not arguments.no_browser)


def opened(address: str, browser: bool) -> None:
    """Open a page in the browser, if that is wanted."""
    import webbrowser

    if browser:
        webbrowser.open(address)
