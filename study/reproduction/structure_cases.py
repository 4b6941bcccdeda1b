"""Structures of several coordinates in the study: their table and its checks, and what is found in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from study.equations.layout import LINEAR
from study.equations.modal_part import ModalPart
from study.equations.model import Model
from study.equations.model_file import read_model
from study.equations.terms import get
from study.identify.frequency_domain.action_reaction import JointEstimate, joint_estimate
from study.identify.frequency_domain.reverse_system import ESTIMATORS, ReverseSystem, equations_of, reverse_system
from study.records.prepared import prepare_record
from study.records.record import Record
from study.reproduction.cases import assumed_model, estimator_settings
from study.reproduction.config import Cases, SimulatedCase, rules
from study.reproduction.settings import CaseSettings, CaseTolerances, IdentificationSettings, Positive, RecordSettings
from study.support.config_files import Section, read_rows, read_yaml
from study.support.errors import StudyError, at, expect


class ClaimLimits(Section):
    """From where on a number has changed, a probability is chance, and a free run is not that of the structure."""

    changed: Positive
    by_chance: Positive
    error: Positive  # of a free run over the noise


class StructureSettings(CaseSettings[CaseTolerances]):
    """``config/structures.yaml``; the comments there say what each section is for."""

    claims: ClaimLimits


def _words(cell: object) -> object:
    """Words of a cell; a job's plain data has them apart already."""
    return cell.split() if isinstance(cell, str) else cell


class StructureCase(SimulatedCase):
    """One row of ``config/structures.tsv``."""

    sensors: Annotated[tuple[str, ...], BeforeValidator(_words)]  # coordinates whose displacement is measured
    modal: Annotated[Literal["", "yes"], Field(description="yes or nothing")]  # the linear part is a sum of modes


class StructureCases(Cases[StructureSettings, StructureCase]):
    """The structures of several coordinates."""

    def record_settings(self, case: str) -> RecordSettings:
        """As of any case, with the sensors of this one."""
        return super().record_settings(case).model_copy(update={"sensors": self.cases[case].sensors or None})


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
            forces = ", ".join(settings.excitations)
            expect(
                case.excitation in settings.excitations,
                f"there is no excitation {case.excitation!r}; structures.yaml names {forces}",
            )
            model = read_model(path)
            expect(model.named, f"{case.model!r} has no 'coordinates'; expected a structure")
            unknown = [name for name in case.sensors if name not in model.coordinates]
            expect(not unknown, f"sensors name {unknown[:1]}; {case.model!r} has {', '.join(model.coordinates)}")
            expect(len(model.forces) == 1, f"{case.model!r} has {len(model.forces)} forces; expected one")
            if case.also_assumed:
                get(case.also_assumed)
            if case.modal:
                ends = [c for t in model.terms if t.term.name not in LINEAR for c in t.place.moving]
                needed = dict.fromkeys([*(where for _, where in model.forces), *ends])
                blind = ", ".join(name for name in needed if name not in case.sensors)
                expect(not blind, f"sensors lack {blind}, where the force or a nonlinear term acts; expected one")
        cases[case.case] = case
    return StructureCases(settings, cases)


@dataclass(frozen=True, eq=False)
class EquationsFound:
    """What one estimator finds: equation by equation, and of all equations together."""

    system: ReverseSystem
    joint: JointEstimate


@dataclass(frozen=True, eq=False)
class CaseResult:
    """A case in reverse."""

    model: Model  # that is assumed, with the true values: zero of what the structure does not have
    found: Mapping[str, EquationsFound]  # by estimator


def identify_equations(model: Model, record: Record, settings: IdentificationSettings) -> CaseResult:
    """Every equation of a structure by every estimator of the settings."""
    assumed = assumed_model(model, settings.also_assumed)
    assumed = assumed.with_values({key: value or 0.0 for key, value in assumed.values.items()})
    equations, _ = equations_of(assumed, prepare_record(record), (0, len(record)))
    found: dict[str, EquationsFound] = {}
    for name in settings.estimators:
        system = reverse_system(name, equations, record.dt, estimator_settings(settings))
        try:
            found[name] = EquationsFound(system, joint_estimate(system))
        except StudyError as error:
            raise StudyError(f"{settings.case}, {name}: {error}") from None
    return CaseResult(assumed, found)


def modal_model(model: Model, sensors: Sequence[str]) -> Model:
    """The nonlinear terms of a structure alone, their coefficients open, between its sensors, beside its modes."""
    kept = tuple(t for t in model.terms if t.term.name not in LINEAR)
    opened = tuple(t.with_values(dict.fromkeys(t.symbols)) for t in kept)
    return Model(f"{model.name} as measured", opened, tuple(sensors), model.forces, ModalPart(tuple(sensors)))
