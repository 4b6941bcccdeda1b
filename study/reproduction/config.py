"""The study's configuration: read, checked whole before any job starts, and handed out case by case.

What a value may be by itself, ``settings`` says; here, what the jobs ask beyond: none shall end in want of it. Each
check raises a ``StudyError`` at the first fault, naming the value and what was expected.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field

from study.equations import terms
from study.equations.model import Model, free, named_channels
from study.equations.model_file import read_model
from study.equations.terms import LINEAR
from study.identify.estimators import ESTIMATORS
from study.identify.estimators.base import true_parameters
from study.identify.frequency_domain import reverse_system
from study.records.excitation import READINGS, SETTINGS, theoretical_autospectrum
from study.reproduction.settings import (
    CaseSettings,
    CaseTolerances,
    ExcitationSettings,
    IdentificationSettings,
    Positive,
    RecordSettings,
    Sampling,
    StudySettings,
    Tolerances,
)
from study.support.config_files import TableRow, Text, read_rows, read_yaml
from study.support.errors import StudyError, at, expect

IDENTIFIED = ("linear", "nonlinear", "coherence", "histogram")  # drawn of every case
PRELIMINARY = ("pattern", "autospectrum", "force_history", "force_histogram")  # of Section 3: drawn where numbered
NAME_OR_DECIMAL = "up to 64 of a to z, 0 to 9 and _, a letter first, and a dot between two digits alone"
Name = Annotated[  # a dot elsewhere is that of a file or of a rule
    str, Field(pattern=r"^[a-z]([a-z0-9_]|(?<=[0-9])[.](?=[0-9]))*\Z", max_length=64, description=NAME_OR_DECIMAL)
]
Number = Annotated[Annotated[int, Field(ge=1)] | None, BeforeValidator(lambda cell: cell or None)]
Words = Annotated[tuple[str, ...], BeforeValidator(lambda cell: cell.split() if isinstance(cell, str) else cell)]
RULE = re.compile(r"^\s*(?:use rule \w+ as|rule) (\w+)(?: with)?:", re.MULTILINE)
JUDGED, KIND = "report", "gaussian_lowpass"  # the force that the claims judge, Section 2.1
CURVES = ("siso", "miso", "local_polynomial", "instrumental", "output_error")  # have some of every case to be drawn
LOOKED_AT = (2.0, 4.0)  # hertz: where the claims read single lines, the Dead-Band's and the Mathieu's
LONGER, INPUTS = 4, 2  # the claims cut segments this many times as long too, and tell so many inputs apart in them
FEWEST_BAND_LINES = 4  # of a segment, that the fit band spans
CLAIMED = ("changed", "by_chance", "error")  # limits of what is claimed of a structure


class Case(TableRow):
    """A row of ``config/cases.tsv`` or ``structures.tsv``: a model under a force, and noise on what is measured.

    The numbers are those of the report's figures.
    """

    case: Name
    model: Text
    excitation: Text
    level: Positive  # mean square of the force, N^2
    noise: Annotated[float, Field(ge=0.0, lt=1.0)]  # mean square on each displacement over its own
    also_assumed: str  # a term that the identification assumes wherever it is not
    title: Text
    linear: Number = None
    nonlinear: Number = None
    coherence: Number = None
    histogram: Number = None
    pattern: Number = None
    autospectrum: Number = None
    force_history: Number = None
    force_histogram: Number = None
    sensors: Words = ()  # coordinates whose displacement alone is measured; all motions of all where there are none
    modal: Annotated[Literal["", "yes"], Field(description="yes or nothing")] = ""  # the linear part is a sum of modes

    @property
    def model_file(self) -> str:
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


S = TypeVar("S", bound=CaseSettings[Any], covariant=True)


@dataclass(frozen=True)
class Cases(Generic[S]):
    """Settings, and cases by name in the order of the table."""

    settings: S
    cases: Mapping[str, Case]

    def record_settings(self, case: str) -> RecordSettings:
        """What a case's record depends on; a job re-runs when it changes."""
        row = self.cases[case]
        return RecordSettings(
            case=case, excitation=self.settings.excitations[row.excitation], level=row.level, noise=row.noise,
            noise_seed=self.settings.noise_seed if row.noise > 0.0 else None, sampling=self.settings.sampling,
            integrator=self.settings.integrator, sensors=row.sensors or None,
        )  # fmt: skip

    def identification_settings(self, case: str, estimators: tuple[str, ...] = ()) -> IdentificationSettings:
        """What a case's identification depends on beside its record; other estimators than the study's if named."""
        shared, tolerances = self.settings, self.settings.tolerances
        periods = shared.excitations[self.cases[case].excitation].periods or 1
        return IdentificationSettings(
            case=case, also_assumed=self.cases[case].also_assumed, estimators=estimators or shared.estimators,
            segments=shared.segments, fit_band=shared.fit_band, local_polynomial=shared.local_polynomial,
            settle_periods=shared.settle_periods,
            period=shared.sampling.samples // periods if periods > 1 else None,
            relative={**tolerances.relative, **tolerances.of_case.get(case, {})}, absolute=tolerances.absolute,
        )  # fmt: skip


class StudyConfig(Cases[StudySettings]):
    """The report's systems."""

    @property
    def noise(self) -> dict[str, float]:
        """Noise of each case: mean square on the displacement over that of the displacement."""
        return {name: case.noise for name, case in self.cases.items()}

    def drawn(self, case: str) -> list[str]:
        drawn = self.settings.drawn
        return list(drawn.with_noise if self.cases[case].noise > 0.0 else drawn.without_noise)


def load_config(folder: Path) -> StudyConfig:
    """Read ``config.yaml`` and ``cases.tsv`` of a folder, and the models that they name, and check them all.

    Nothing that passes here can be refused by a job for the way it is configured.
    """
    source, models = folder / "config.yaml", folder.parent / "models"
    settings = read_yaml(source, StudySettings)
    with at(source):
        _check_settings(settings)
    stems: dict[str, str] = {}  # of figures, with whose each is
    folders = ("benchmarks", "part_two", f"estimators_{settings.estimator_errors.many}")
    taken = dict.fromkeys(folders, "a folder of results/")
    cases = _read_cases(folder / "cases.tsv", taken, lambda case: _check_case(case, settings, models, stems))
    with at(source):
        _check_tolerances(settings.tolerances, models, cases)
        _check_claims(settings)
    return StudyConfig(settings, cases)


def load_structures(folder: Path, taken: Iterable[str] = ()) -> Cases[CaseSettings[CaseTolerances]]:
    """Read ``structures.yaml`` and ``structures.tsv`` of a folder, and check the models that they name.

    ``taken`` are the names of other cases.
    """
    source = folder / "structures.yaml"
    settings = read_yaml(source, CaseSettings[CaseTolerances])
    with at(source):
        unknown = [name for name in settings.estimators if name not in reverse_system.STRUCTURE_ESTIMATORS]
        known = ", ".join(reverse_system.STRUCTURE_ESTIMATORS)
        expect(not unknown, f"there is no estimator {unknown[:1]} of structures; known are {known}")
        expect("miso" in settings.estimators, "estimators lacks 'miso', whose coherences are drawn of every case")
        low, high = settings.fit_band
        expect(low < high <= 0.5 / settings.sampling.dt, f"fit_band is [{low:g}, {high:g}]; expected it to rise")
        expect(
            set(settings.limits) == set(CLAIMED),
            f"limits has {', '.join(settings.limits) or 'nothing'}; expected {', '.join(CLAIMED)}",
        )
    models = folder.parent / "models"
    others = dict.fromkeys(taken, "a case of cases.tsv")
    cases = _read_cases(folder / "structures.tsv", others, lambda case: _check_structure(case, settings, models))
    return Cases(settings, cases)


def _read_cases(path: Path, taken: Mapping[str, str], check: Callable[[Case], None]) -> dict[str, Case]:
    """Rows of a table of cases, each checked; ``taken`` has names that none may have, and whose each is."""
    cases: dict[str, Case] = {}
    taken = {**taken, **dict.fromkeys(rules(path.parents[1]), "a rule")}
    for where, case in read_rows(path, Case):
        with at(where):
            expect(case.case not in cases, "the case stands twice; expected each name once")
            named = taken.get(case.case)
            expect(not named, f"{case.case!r} is the name of {named}; give the case another")
            check(case)
        cases[case.case] = case
    return cases


def rules(project: Path) -> set[str]:
    """Names of the rules of a folder's Snakefile and ``rules/``: no case's, for its target would be another's."""
    files = [path for path in (project / "Snakefile", *project.glob("rules/*.smk")) if path.is_file()]
    return {"all"}.union(*(RULE.findall(path.read_text(encoding="utf-8")) for path in files))


# ---- settings


def _check_settings(settings: StudySettings) -> None:
    """Whether values fit together, and names are known."""
    expect(not settings.limits, "limits are those of structures.yaml; expected the report's in config/reported.tsv")
    samples, dt, length = settings.sampling.samples, settings.sampling.dt, settings.segments.length
    expect(
        length <= samples,
        f"segments.length is {length}, longer than the record of {samples} samples; expected that many or fewer",
    )
    (low, high), line = settings.fit_band, settings.resolution
    band, width = list(settings.fit_band), 2 * settings.local_polynomial.half_width + 1
    expect(low < high <= 0.5 / dt, f"fit_band is {band}; it must rise and end below {0.5 / dt:g} Hz")
    expect(
        high - low >= FEWEST_BAND_LINES * line, f"fit_band is {band}; it must span four lines of {line:g} Hz or more"
    )
    expect(
        (high - low) * samples * dt >= width,
        f"local_polynomial.half_width makes bands of {width} lines; fit_band {band} of {samples} samples holds fewer",
    )
    own, compared = settings.estimators, settings.estimator_errors.estimators
    for name in (*own, *settings.monte_carlo.estimators, *compared):
        expect(name in ESTIMATORS, f"there is no estimator {name!r}; known are {', '.join(ESTIMATORS)}")
    expect("miso" in own, "estimators lacks 'miso', whose coherences are drawn of every case")
    expect("miso" in compared, "estimator_errors.estimators lacks 'miso', which the others are compared with")
    for kind, names in (("without_noise", settings.drawn.without_noise), ("with_noise", settings.drawn.with_noise)):
        for name in names:
            expect(name in own, f"drawn.{kind} names {name!r}, which is not among the estimators")
        without = f"drawn.{kind} is [{', '.join(names)}], of which none has curves of every case"
        expect(set(names) & set(CURVES), f"{without}; one of {', '.join(CURVES)} is needed")
    for name, excitation in settings.excitations.items():
        place, known = f"excitations.{name}", ("kind", "seed", "periods", *SETTINGS[excitation.kind])
        for key in excitation.plain():
            nothing = f"{place} has {key}, which means nothing to a {excitation.kind}; it may have {', '.join(known)}"
            expect(key in known, nothing)
        expect(excitation.seed is not None, f"{place}: 'seed' is missing; expected a whole number of 0 or more")
        with at(place):
            _check_force(excitation, settings.sampling)


def _check_force(excitation: ExcitationSettings, sampling: Sampling) -> None:
    """Whether there is such a force at this sampling, by its spectrum."""
    theoretical_autospectrum(excitation.at_level(1.0), np.zeros(1), sampling.samples, sampling.dt)


def _check_reached(excitation: ExcitationSettings, settings: StudySettings) -> None:
    """Whether a force reaches over the lines that parameters are fitted to: beyond it there is only leakage."""
    force, high, line = excitation.at_level(1.0), settings.fit_band[1], settings.resolution
    begun = f"fit_band of config.yaml is {list(settings.fit_band)}; the excitation"
    expect(high <= force.highest, f"{begun} has nothing above {force.highest:g} Hz, where the band must end or before")
    expect(
        high - force.lowest >= FEWEST_BAND_LINES * line,
        f"{begun} begins at {force.lowest:g} Hz, and four lines of {line:g} Hz or more must lie above",
    )


# ---- cases


def _checked_force(case: Case, settings: CaseSettings[Any], models: Path, source: str) -> ExcitationSettings:
    """A case's excitation; whether its model is there too."""
    path = models / f"{case.model}.yaml"
    beside = ", ".join(sorted(p.stem for p in path.parent.glob("*.yaml"))) or "none"
    expect(path.is_file(), f"there is no model {case.model!r}; {path.parent.name}/ holds {beside}")
    excitation = settings.excitations.get(case.excitation)
    if excitation is None:
        known = ", ".join(settings.excitations)
        raise StudyError(f"there is no excitation {case.excitation!r}; {source} names {known}")
    return excitation


def _check_structure(case: Case, settings: CaseSettings[Any], models: Path) -> None:
    """Whether a case has its model and its force, and sensors where its modes need them."""
    _checked_force(case, settings, models, "structures.yaml")
    model = read_model(models / f"{case.model}.yaml")
    expect(model.named, f"{case.model!r} has no 'coordinates'; expected a structure")
    unknown = [name for name in case.sensors if name not in model.coordinates]
    expect(not unknown, f"sensors name {unknown[:1]}; {case.model!r} has {', '.join(model.coordinates)}")
    expect(len(model.forces) == 1, f"{case.model!r} has {len(model.forces)} forces; expected one")
    if case.also_assumed:
        terms.get(case.also_assumed)
    if case.modal:
        ends = [c for t in model.terms if t.term.name not in LINEAR for c in t.place.moving]
        needed = dict.fromkeys([*(where for _, where in model.forces), *ends])
        blind = ", ".join(name for name in needed if name not in case.sensors)
        expect(not blind, f"sensors lack {blind}, where the force or a nonlinear term acts; expected one")


def _check_case(case: Case, settings: StudySettings, models: Path, taken: dict[str, str]) -> None:
    """Whether a case has its model, its force and its figures; ``taken`` holds the stems of the rows before."""
    excitation = _checked_force(case, settings, models, "config.yaml")
    model = _checked_model(models / f"{case.model}.yaml", case.also_assumed, settings)
    expect(not case.sensors and not case.modal, "sensors and modal are for structures.tsv; expected neither")
    needed, periods = settings.settle_periods + 4, excitation.periods or 1
    expect(
        "errors_in_variables" not in settings.estimators or periods >= needed,
        f"the excitation has {periods} period{'s' if periods > 1 else ''}; the estimator errors_in_variables needs "
        f"settle_periods and four more, {needed}",
    )
    _check_reached(excitation, settings)
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


def _checked_model(path: Path, also_assumed: str, settings: StudySettings) -> Model:
    """A case's model, which can be simulated, and whose inputs the record can tell apart with a term more."""
    from study.identify.frequency_domain.local_polynomial import LocalPolynomial

    model = assumed = read_model(path)
    with at(path):
        model.numbers()
        named_channels(model, ())
    if also_assumed:
        term = terms.get(also_assumed)
        for needed in term.parameters:
            raise StudyError(f"also_assumed {also_assumed!r} needs a value for {needed.name}; take a term without")
        assumed = model.with_term(term)
    inputs = len({c.shape for entry in assumed.terms for c in entry.term.components})
    cut, samples = settings.segments.segments(), settings.sampling.samples
    count, worth = cut.count(samples), cut.effective_averages(samples)
    begun = f"segments of config.yaml cut the record into {count}"
    expect(count > inputs, f"{begun}; {inputs} inputs need {inputs + 1} or more")
    expect(
        worth > inputs,
        f"{begun} that are worth {worth:.3g} averages, as they overlap; {inputs} inputs need more than {inputs}: "
        "expected shorter segments",
    )
    LocalPolynomial(**settings.local_polynomial.model_dump()).check(inputs)
    return model


def _check_tolerances(tolerances: Tolerances, models: Path, cases: Iterable[str]) -> None:
    """Whether tolerances are of parameters that there are, and of cases or systems."""
    systems = [path.stem for path in sorted(models.glob("*.yaml"))]
    for name in tolerances.of_case:
        neither = f"tolerances.of_case names {name!r}, which is neither a case nor a system"
        expect(name in cases or name in systems, neither)
    keys = [key for term in terms.LIBRARY.values() for key in free(term).keys]
    keys += [key for name in systems for key in read_model(models / f"{name}.yaml").values]
    known = sorted(true_parameters(dict.fromkeys(keys, 1.0)))  # as tables name them
    groups = {"relative": tolerances.relative, "absolute": tolerances.absolute}
    groups |= {f"of_case.{name}": own for name, own in tolerances.of_case.items()}
    for group, names in groups.items():
        for name in names:
            unknown = f"tolerances.{group} names {name!r}, which is no parameter; known are {', '.join(known)}"
            expect(name in known, unknown)


# ---- claims


def _check_claims(settings: StudySettings) -> None:
    """Whether the claims can be judged under these settings."""
    force = settings.excitations.get(JUDGED)
    if force is None:
        known = ", ".join(settings.excitations)
        raise StudyError(f"excitations names {known}, not {JUDGED!r}; the claims judge a force of this name, a {KIND}")
    place = f"excitations.{JUDGED}"
    expect(
        force.kind == KIND,
        f"{place}.kind is {force.kind!r}; the claims judge a {KIND} there, "
        "and a force of another kind needs a name of its own",
    )
    expect(
        force.reading,
        f"{place} has no reading, which the claims name; "
        f"it may be {' or '.join(READINGS)}, what unit variance refers to",
    )
    for kind in SETTINGS:  # Section 6 holds for any spectrum: the claims put each in its place
        with at(f"the claims put a {kind} in place of {place}"):
            _check_force(force.model_copy(update={"kind": kind}), settings.sampling)
    with at(place):
        _check_reached(force, settings)
    (low, high), (first, last) = settings.fit_band, LOOKED_AT
    below = first - settings.resolution  # the lowest line has a neighbour
    expect(
        low <= below and high >= last,
        f"fit_band is {list(settings.fit_band)}; the claims look at lines from {first:g} to {last:g} Hz, so that "
        f"it must begin at {below:.4g} Hz or below and end at {last:g} Hz or above",
    )
    samples, length = settings.sampling.samples, settings.segments.length

    def enough(length: int) -> bool:
        cut = settings.segments.model_copy(update={"length": length}).segments(LONGER)
        return samples >= cut.length and cut.effective_averages(samples) > INPUTS

    shortest = 16  # by its bounds
    right = next((n for k in range(1, length.bit_length()) if enough(n := length >> k) and n >= shortest), None)
    expect(
        enough(length),
        f"segments.length is {length}; the claims cut segments of {LONGER} times that too, which a record of {samples} "
        f"samples must hold for more than {INPUTS} averages: expected {right or 'a longer record'}",
    )
