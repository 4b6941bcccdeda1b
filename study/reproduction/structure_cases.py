"""Structures of several coordinates in the study: their configuration, their records, and what is found in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from study.equations.layout import LINEAR
from study.equations.linear_part import connections
from study.equations.modal_part import ModalPart
from study.equations.model import Model, ModelTerm, free
from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.identify.estimators.base import Settings
from study.identify.frequency_domain.action_reaction import JointEstimate, joint_estimate
from study.identify.frequency_domain.local_polynomial import LocalPolynomial
from study.identify.frequency_domain.reverse_system import ESTIMATORS, ReverseSystem, equations_of, reverse_system
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.record import MOTIONS, Record, Sensor
from study.reproduction.config import Name, rules
from study.reproduction.settings import (
    AllowedErrors,
    Band,
    LocalPolynomialSettings,
    Names,
    Positive,
    Sampling,
    Seed,
    SegmentSettings,
)
from study.support.config_files import Section, TableRow, Text, read_rows, read_yaml
from study.support.errors import StudyError, at, expect


def _words(cell: object) -> object:
    """Words of a cell; a job's plain data has them apart already."""
    return cell.split() if isinstance(cell, str) else cell


class MeasuredTolerances(Section):
    """What a structure with a measured linear part may be off: its coefficients, and its free run over the noise."""

    coefficient: Positive
    error: Positive


class StructureTolerances(AllowedErrors):
    """What an estimate may be off, by its symbol wherever it stands."""

    measured: MeasuredTolerances


class ClaimLimits(Section):
    """From where on a number has changed, and a probability is chance."""

    changed: Positive
    by_chance: Positive


class StructureSettings(Section):
    """``config/structures.yaml``; the comments there say what each section is for."""

    sampling: Sampling
    steps_per_sample: Annotated[int, Field(ge=1, le=64)]
    seed: Seed
    noise_seed: Seed
    segments: SegmentSettings
    fit_band: Band
    local_polynomial: LocalPolynomialSettings
    estimators: Names
    tolerances: StructureTolerances
    claims: ClaimLimits

    @property
    def for_estimators(self) -> Settings:
        low, high = self.fit_band
        return Settings(
            self.segments.segments(), (low, high), LocalPolynomial(**self.local_polynomial.model_dump())
        )  # fmt: skip


class StructureCase(TableRow):
    """One row of ``config/structures.tsv``."""

    case: Name
    model: Text
    cutoff: Positive  # hertz, of the force
    level: Positive  # mean square of the force, N^2
    noise: Annotated[float, Field(ge=0.0, lt=1.0)]  # mean square on each sensor over that of its motion
    sensors: Annotated[tuple[str, ...], BeforeValidator(_words)]  # coordinates whose displacement is measured
    also_assumed: str  # a term that the identification assumes at every connection that has none
    measured: Annotated[Literal["", "yes"], Field(description="yes or nothing")]  # the linear part is as measured
    title: Text

    @property
    def model_file(self) -> str:
        return f"models/{self.model}.yaml"


@dataclass(frozen=True)
class StructureCases:
    """Settings, and cases by name in the order of the table."""

    settings: StructureSettings
    cases: Mapping[str, StructureCase]


def load_structures(folder: Path, taken: Sequence[str] = ()) -> StructureCases:
    """Read ``structures.yaml`` and ``structures.tsv`` of a folder, and check the models that they name.

    ``taken`` are the names of other cases.
    """
    source, models = folder / "structures.yaml", folder.parent / "models"
    settings = read_yaml(source, StructureSettings)
    with at(source):
        unknown = [name for name in settings.estimators if name not in ESTIMATORS]
        expect(not unknown, f"there is no estimator {unknown[:1]} of structures; known are {', '.join(ESTIMATORS)}")
        expect("miso" in settings.estimators, "estimators lacks 'miso', whose coherences are drawn of every case")
        low, high = settings.fit_band
        expect(low < high <= 0.5 / settings.sampling.dt, f"fit_band is [{low:g}, {high:g}]; expected it to rise")
    cases: dict[str, StructureCase] = {}
    for where, case in read_rows(folder / "structures.tsv", StructureCase):
        with at(where):
            expect(case.case not in (*taken, *cases), "the case stands twice; expected each name once")
            expect(case.case not in rules(folder.parent), f"{case.case!r} is the name of a rule; give the case another")
            path = models / f"{case.model}.yaml"
            known = ", ".join(sorted(p.relative_to(models).as_posix()[:-5] for p in models.rglob("*.yaml")))
            expect(path.is_file(), f"there is no model {case.model!r}; models/ holds {known}")
            model = read_model(path)
            expect(model.named, f"{case.model!r} has no 'coordinates'; expected a structure")
            unknown = [name for name in case.sensors if name not in model.coordinates]
            expect(not unknown, f"sensors name {unknown[:1]}; {case.model!r} has {', '.join(model.coordinates)}")
            expect(len(model.forces) == 1, f"{case.model!r} has {len(model.forces)} forces; expected one")
            if case.also_assumed:
                get(case.also_assumed)
            if case.measured:
                ends = [c for t in model.terms if t.term.name not in LINEAR for c in t.place.moving]
                needed = dict.fromkeys([*(where for _, where in model.forces), *ends])
                blind = ", ".join(name for name in needed if name not in case.sensors)
                expect(not blind, f"sensors lack {blind}, where the force or a nonlinear term acts; expected one")
        cases[case.case] = case
    return StructureCases(settings, cases)


def make_structure_record(model: Model, case: StructureCase, settings: StructureSettings) -> Record:
    """Simulate a case: all motions without noise, or the displacements at its sensors with noise."""
    samples, dt = settings.sampling.samples, settings.sampling.dt
    drive = force(Excitation(level=case.level, reading="filtered", cutoff=case.cutoff), samples, dt, settings.seed)
    (name, _), *_ = model.forces
    full = simulate(model, {name: drive}, dt, Integrator("rk4", settings.steps_per_sample))
    wanted = case.sensors or model.coordinates
    kinds = MOTIONS[:1] if case.noise > 0.0 else MOTIONS
    rng = np.random.default_rng(settings.noise_seed)
    kept = {s: full[s] for kind in kinds for s in (Sensor(c, kind) for c in wanted)}
    if case.noise > 0.0:
        kept = {s: x + np.sqrt(case.noise) * np.std(x) * rng.standard_normal(samples) for s, x in kept.items()}
    return replace(full.with_motions(kept), name=case.case)


def assumed_structure(model: Model, also_assumed: str) -> Model:
    """The structure with one term more at every connection that has none of its kind, all its values known."""
    if not also_assumed:
        return model
    term = get(also_assumed)
    there = {t.place.path for t in model.terms if t.term.name == also_assumed}
    tied = {t.place.path for t in model.terms if t.term.name != "inertia"}
    added = [p for p in connections(model) if p.path in tied and p.path not in there]
    entries = [ModelTerm(term, (0.0,) * len(term.symbols), free(term).parameters, place) for place in added]
    return replace(model, terms=(*model.terms, *entries))


@dataclass(frozen=True, eq=False)
class StructureFindings:
    """What one estimator finds in a structure."""

    system: ReverseSystem
    joint: JointEstimate


@dataclass(frozen=True, eq=False)
class CaseResult:
    """A case in reverse: the model that is assumed, and by estimator what is found."""

    model: Model
    found: Mapping[str, StructureFindings]


def identify_structure(model: Model, record: Record, case: StructureCase, settings: StructureSettings) -> CaseResult:
    """Every equation of a case by every estimator of the settings."""
    assumed = assumed_structure(model, case.also_assumed)
    equations, _ = equations_of(assumed, prepare_record(record), (0, len(record)))
    found: dict[str, StructureFindings] = {}
    for name in settings.estimators:
        system = reverse_system(name, equations, record.dt, settings.for_estimators)
        try:
            found[name] = StructureFindings(system, joint_estimate(system))
        except StudyError as error:
            raise StudyError(f"{case.case}, {name}: {error}") from None
    return CaseResult(assumed, found)


def measured_model(model: Model, sensors: Sequence[str]) -> Model:
    """The nonlinear terms of a structure alone, their coefficients open, between its sensors; all else as measured."""
    kept = tuple(t for t in model.terms if t.term.name not in LINEAR)
    opened = tuple(t.with_values(dict.fromkeys(t.symbols)) for t in kept)
    return Model(f"{model.name} as measured", opened, tuple(sensors), model.forces, ModalPart(tuple(sensors)))
