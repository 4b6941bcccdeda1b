"""The study's configuration: read, checked whole before any job starts, and handed out case by case."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field

from study.reproduction import case_names, preconditions
from study.reproduction.settings import IdentificationSettings, Positive, RecordSettings, StudySettings
from study.support.config_files import TableRow, Text, read_rows, read_yaml
from study.support.errors import StudyError, at, expect

IDENTIFIED = ("linear", "nonlinear", "coherence", "histogram")  # drawn of every case
PRELIMINARY = ("pattern", "autospectrum", "force_history", "force_histogram")  # of Section 3: drawn where numbered
NAME = "up to 64 of a to z, 0 to 9 and _, a letter first, and a dot between two digits alone"
Name = Annotated[  # a dot elsewhere is that of a file or of a rule
    str, Field(pattern=r"^[a-z]([a-z0-9_]|(?<=[0-9])[.](?=[0-9]))*\Z", max_length=64, description=NAME)
]
Number = Annotated[Annotated[int, Field(ge=1)] | None, BeforeValidator(lambda cell: cell or None)]


class Case(TableRow):
    """One row of ``config/cases.tsv``; the numbers are those of the report's figures."""

    case: Name
    model: Text
    excitation: Text
    level: Positive
    noise: Annotated[float, Field(ge=0.0, lt=1.0)]
    also_assumed: str
    linear: Number
    nonlinear: Number
    coherence: Number
    histogram: Number
    pattern: Number
    autospectrum: Number
    force_history: Number
    force_histogram: Number
    title: Text

    @property
    def model_file(self) -> str:
        """Where the system is described."""
        return f"models/{self.model}.yaml"

    @property
    def figures(self) -> dict[str, str]:
        """By kind the stem of a figure's files: by its number, or in ``IDENTIFIED`` by the case where it has none."""
        numbers = {kind: getattr(self, kind) for kind in IDENTIFIED + PRELIMINARY}
        return {
            kind: f"figure_{number}" if number else f"{self.case}_{kind}"
            for kind, number in numbers.items()
            if number or kind in IDENTIFIED
        }


@dataclass(frozen=True)
class StudyConfig:
    """Settings, and cases by name in the order of the table."""

    settings: StudySettings
    cases: Mapping[str, Case]

    @property
    def noise(self) -> dict[str, float]:
        """Noise of each case: mean square on the displacement over that of the displacement."""
        return {name: case.noise for name, case in self.cases.items()}

    def record_settings(self, case: str) -> RecordSettings:
        """What a case's record depends on; a job re-runs when it changes."""
        row = self.cases[case]
        return RecordSettings(
            case=case, excitation=self.settings.excitations[row.excitation], level=row.level, noise=row.noise,
            noise_seed=self.settings.noise_seed if row.noise > 0.0 else None, sampling=self.settings.sampling,
            integrator=self.settings.integrator,
        )  # fmt: skip

    def identification_settings(self, case: str, estimators: tuple[str, ...] = ()) -> IdentificationSettings:
        """What a case's identification depends on beside its record; other estimators than the study's if named."""
        shared, tolerances = self.settings, self.settings.tolerances
        return IdentificationSettings(
            case=case, also_assumed=self.cases[case].also_assumed, estimators=estimators or shared.estimators,
            segments=shared.segments, fit_band=shared.fit_band, local_polynomial=shared.local_polynomial,
            settle_periods=shared.settle_periods, period=self.period(case),
            relative={**tolerances.relative, **tolerances.of_case.get(case, {})}, absolute=tolerances.absolute,
        )  # fmt: skip

    def period(self, case: str) -> int | None:
        """Samples in a period of a case's force, where it repeats."""
        periods = self.settings.excitations[self.cases[case].excitation].periods or 1
        return self.settings.sampling.samples // periods if periods > 1 else None

    def drawn(self, case: str) -> list[str]:
        """The estimators that a case's figures show."""
        drawn = self.settings.drawn
        return list(drawn.with_noise if self.cases[case].noise > 0.0 else drawn.without_noise)


def load_config(folder: Path) -> StudyConfig:
    """Read ``config.yaml`` and ``cases.tsv`` of a folder, and the models that they name, and check them all.

    Nothing that passes here can be refused by a job for the way it is configured.

    Raises
    ------
    StudyError
        At the first fault, naming file, row and value.
    """
    source, models = folder / "config.yaml", folder.parent / "models"
    settings = read_yaml(source, StudySettings)
    with at(source):
        preconditions.check_settings(settings)
    cases: dict[str, Case] = {}
    stems: dict[str, str] = {}
    taken = case_names.taken(folder.parent, settings.estimator_errors.many)
    for where, case in read_rows(folder / "cases.tsv", Case):
        with at(where):
            expect(case.case not in cases, "the case stands twice; expected each name once")
            name = taken.get(case.case)
            expect(not name, f"{case.case!r} is the name of {name}; give the case another")
            _check_case(case, settings, models, stems)
        cases[case.case] = case
    with at(source):
        preconditions.check_tolerances(settings.tolerances, models, list(cases))
        preconditions.check_claims(settings)
    return StudyConfig(settings, cases)


def _check_case(case: Case, settings: StudySettings, models: Path, taken: dict[str, str]) -> None:
    """Whether a case has its model, its force and its figures; ``taken`` holds the stems of the rows before."""
    path = models / f"{case.model}.yaml"
    known = ", ".join(sorted(p.stem for p in models.glob("*.yaml")))
    expect(path.is_file(), f"there is no system {case.model!r}; {models.name}/ holds {known}")
    excitation = settings.excitations.get(case.excitation)
    if excitation is None:
        known = ", ".join(settings.excitations)
        raise StudyError(f"there is no excitation {case.excitation!r}; config.yaml names {known}")
    model = preconditions.check_model(path, case.also_assumed, settings)
    preconditions.check_periods(excitation, settings)
    preconditions.check_reached(excitation, settings)
    for kind, stem in case.figures.items():
        expect(stem not in taken, f"{kind} is {getattr(case, kind)}, a number that {taken.get(stem)} has already")
        taken[stem] = f"{kind} of the case {case.case!r}"
    expect(
        not case.autospectrum or "periodic_stiffness" in model,
        f"autospectrum is {case.autospectrum}; its lines need a term periodic_stiffness",
    )
    expect(
        not case.pattern or (not model.states and model.numbers().get("k", 0.0) > 0.0),
        f"pattern is {case.pattern}; it needs a linear stiffness above zero and no term with a memory",
    )
