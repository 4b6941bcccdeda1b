"""What the commands do with a model of several coordinates."""

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from study.commands.command import progress
from study.commands.record_arguments import (
    accounted_together,
    inputs_of,
    layout_of,
    out_folder,
    read_records,
    sources,
    written_together,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from study.compare.comparison import Comparison
    from study.equations.model import Model
    from study.equations.term import Term
    from study.explore.placed_session import PlacedSession
    from study.records.prepared import Prepared


def modal_records(arguments: argparse.Namespace, model: "Model") -> "list[Prepared]":
    """The records that were named, made ready for a model whose linear part is as measured."""
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
    """``study compare`` where the linear part is as measured."""
    from study.compare.comparison_report import as_json
    from study.structure.measured_comparison import compare_measured, measured_document, measured_summary
    from study.support.files import write_files

    folder, ready = out_folder(arguments), modal_records(arguments, model)
    with progress("step", 3 * len(ready)) as step:
        comparisons = [compare_measured(model, prepared, step) for prepared in ready]
    prefix = [f"{c.prepared.record.name}_" if len(ready) > 1 else "" for c in comparisons]
    files = {f"{p}comparison.json": as_json(measured_document(c)) for p, c in zip(prefix, comparisons, strict=True)}
    write_files(folder, files)
    print("\n\n".join(measured_summary(c) for c in comparisons))
    print(f"\n{folder}: {', '.join(files)}")


def refuse_modal(model: "Model", command: str) -> None:
    """Say so where a command needs masses, stiffnesses and dampings."""
    from study.support.errors import expect

    like = "expected inertia at every coordinate; 'compare', 'diagnose', 'add' and 'drop' take it"
    expect(model.modal is None, f"{command} knows no {model.name!r} with 'linear: modal' yet; {like}")


def diagnose_command(arguments: argparse.Namespace, model: "Model") -> None:
    """``study diagnose`` of a structure."""
    from study.diagnose.diagnosis_files import (
        diagnosis_files,
        diagnosis_in_words,
        modes_before_and_after,
        unneeded_in_words,
    )
    from study.diagnose.diagnosis_report import candidate_table
    from study.diagnose.needless import needless
    from study.diagnose.user_candidates import own_candidates
    from study.diagnose.verdict import diagnose
    from study.equations import terms
    from study.structure.structure_page import PAGE, structure_page
    from study.support.errors import expect
    from study.support.files import write_files

    folder = out_folder(arguments)
    own = own_candidates(arguments.candidate, model)
    for name in arguments.without:
        terms.get(name)
    files: dict[str, bytes] = {}
    if model.modal:
        _diagnose_modal(arguments, model, modal_records(arguments, model), own)
        return
    expect(
        not arguments.each_record,
        "--each-record is for 'study compare' where the model has 'coordinates'; expected it left out of a diagnosis",
    )
    records = read_records(arguments, model)
    for record, path in zip(records, sources(arguments), strict=True):
        with progress(" candidates", name=record.name) as step:
            comparison = accounted_together(arguments, model, [record], path).comparison
            diagnosis = diagnose(
                comparison, extra=own, without=arguments.without, progress=lambda _, total: step("", total)
            )
            unneeded = needless(comparison)
        print(f"{record.name}: {diagnosis.verdict.replace('_', ' ')}")
        print(
            candidate_table(diagnosis)
            + "\n\n"
            + modes_before_and_after(diagnosis)
            + "\n\n"
            + diagnosis_in_words(diagnosis)
        )
        if unneeded:
            print(f"\n{unneeded_in_words(unneeded, diagnosis)} 'study drop' takes a term out.")
        prefix = f"{record.name}_" if len(records) > 1 else ""
        made = {PAGE: structure_page(comparison, diagnosis)}
        made |= diagnosis_files(diagnosis, diagnosis_in_words(diagnosis), unneeded)
        files |= {prefix + name: content for name, content in made.items()}
    write_files(folder, files, inputs_of(arguments))
    print(f"\n{folder}: {_listed(files)}")


def _diagnose_modal(arguments: argparse.Namespace, model: "Model", ready: "list[Prepared]", own: "list[Term]") -> None:
    """The same where the linear part is as measured."""
    from study.compare.comparison_report import as_json
    from study.structure.measured_comparison import compare_measured
    from study.structure.measured_diagnosis import diagnose_measured
    from study.structure.measured_report import measured_fields, measured_in_words, measured_table
    from study.support.files import write_files

    folder, files = out_folder(arguments), dict[str, bytes]()
    for prepared in ready:
        with progress(" candidates", name=prepared.record.name) as step:
            diagnosis = diagnose_measured(compare_measured(model, prepared), own, arguments.without, progress=step)
        print(f"{prepared.record.name}: {diagnosis.verdict.replace('_', ' ')}")
        print(f"{measured_table(diagnosis)}\n\n{measured_in_words(diagnosis)}")
        prefix = f"{prepared.record.name}_" if len(ready) > 1 else ""
        files[f"{prefix}diagnosis.json"] = as_json(measured_fields(diagnosis))
    write_files(folder, files, inputs_of(arguments))
    print(f"\n{folder}: {_listed(files)}")


def _listed(files: "Mapping[str, bytes]") -> str:
    return ", ".join(name for name in files if not name.endswith(".svg"))


@dataclass(frozen=True)
class Change:
    """One term more or less."""

    model: "Model"
    follow: "Callable[[Comparison], Comparison]"  # beginning where the fit without the change ended
    told: dict[str, str]  # in the history: what was ``added`` or ``dropped``


def add(arguments: argparse.Namespace, model: "Model") -> None:
    """``study add`` to a structure."""
    from study.compare import history
    from study.diagnose.adding import added
    from study.equations import layout, terms
    from study.equations.model import free
    from study.equations.model_file import text_with
    from study.support.errors import at
    from study.support.files import locked

    term = terms.get(arguments.term) if arguments.force is None else terms.custom(arguments.term, arguments.force)
    with at(arguments.model):
        where: dict[object, object] = {"at": arguments.at} if arguments.at else {}
        where |= {"between": arguments.between} if arguments.between else {}
        place = layout.place_of_entry(where, term.name, model.coordinates)
        entry = free(term, place)
        layout.check(model.with_term(entry))
    with locked(arguments.model):  # another run may have changed it meanwhile
        text, steps = text_with(arguments.model, entry), history.read_history(arguments.model)
        changed = Change(model.with_term(entry), lambda before: added(before, entry), {"added": entry.name})
        _revise(arguments, model, changed, text, steps)


def drop(arguments: argparse.Namespace, model: "Model", name: str, text: str) -> None:
    """``study drop`` from a structure; ``text`` is the model file's without the term."""
    from study.compare import history
    from study.diagnose.dropping import compared_without

    steps = history.read_history(arguments.model)
    changed = Change(model.without_term(name), lambda before: compared_without(before, name), {"dropped": name})
    _revise(arguments, model, changed, text, steps)


def _revise(
    arguments: argparse.Namespace, model: "Model", change: Change, text: str, steps: "list[dict[str, Any]]"
) -> None:  # fmt: skip
    """Compare a model and a changed one with all records; write the changed one with its history, and tell."""
    from study.compare import history
    from study.compare.comparison_report import as_json, comparison_document, comparison_summary, history_step
    from study.structure import measured_comparison

    folder, summaries, document = out_folder(arguments), list[str](), b""
    for prepared in modal_records(arguments, model) if model.modal else ():  # its modes are fitted anew
        linear, after = (measured_comparison.compare_measured(m, prepared) for m in (model, change.model))
        told = (measured_comparison.measured_step(linear), measured_comparison.measured_step(after, **change.told))
        document = as_json(measured_comparison.measured_document(after))
        summaries.append(measured_comparison.measured_summary(after))
        steps = history.with_step(steps, *told)
    pairs = zip(read_records(arguments, model), sources(arguments), strict=True)
    for record, path in () if model.modal else pairs:
        before = accounted_together(arguments, model, [record], path).comparison
        revised = change.follow(before)
        steps = history.with_step(steps, history_step(before), history_step(revised, **change.told))
        document = as_json(comparison_document([revised]))
        summaries.append(comparison_summary([revised]))
    written_together(arguments, text, steps, document, folder)
    print("\n\n".join(summaries))
    print("\n" + history.history_table(steps))


def session(arguments: argparse.Namespace, model: "Model", steps: "list[dict[str, Any]]") -> "PlacedSession":
    """What ``study explore`` of a structure begins with."""
    from study.compare.comparison import STEPS
    from study.explore.placed_session import begin_placed
    from study.support.errors import expect

    several = arguments.records[1:] or arguments.each_record
    expect(not several, f"{several and several[0]}: the page of a structure shows one record; expected no more")
    refuse_modal(model, "explore")
    (record,) = read_records(arguments, model)
    with progress("step", STEPS) as step:
        found = accounted_together(arguments, model, [record], arguments.records[0], progress=step)
    return begin_placed(found.comparison, steps)
