"""The study's configuration: read, checked whole before any job starts, and handed out case by case."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.equations import terms
from study.equations.model import Model, forward_graph, free
from study.equations.model_file import read_model
from study.identify.estimators.base import true_parameters
from study.records.excitation import SETTINGS, Excitation, theoretical_autospectrum
from study.reproduction import case_names, preconditions
from study.support.errors import StudyError
from study.support.schema import check, numbered_rows, read_yaml

Table = dict[str, Any]
IDENTIFIED = ("linear", "nonlinear", "coherence", "histogram")  # drawn of every case
PRELIMINARY = ("pattern", "autospectrum", "force_history", "force_histogram")  # of Section 3: drawn where numbered
FIGURE_KINDS = IDENTIFIED + PRELIMINARY


@dataclass(frozen=True)
class Case:
    """One row of ``config/cases.tsv`` with everything that its jobs need.

    Attributes
    ----------
    name : str
        As targets and tables name it.
    model : str
        Path of the model file.
    excitation : dict
        Kind and settings of the force, seed included.
    level : float
        "Input variance" of the force, in units^2.
    noise : float
        Mean square of the noise on the displacement over that of the displacement.
    also_assumed : str
        A term that the identification assumes beside those of the model, or empty.
    figures : dict
        Stem of the file name of each kind of figure that is drawn: ``figure_<number>``, and for kinds
        of ``IDENTIFIED`` without a number ``<case>_<kind>``.
    title : str
        For captions.
    """

    name: str
    model: str
    excitation: Table
    level: float
    noise: float
    also_assumed: str
    figures: dict[str, str]
    title: str


@dataclass(frozen=True)
class StudyConfig:
    """Settings and cases.

    Attributes
    ----------
    settings : dict
        ``config/config.yaml`` as read.
    cases : dict of Case
        By name, in the order of the table.
    """

    settings: Table
    cases: Mapping[str, Case]

    def record_settings(self, case: str) -> Table:
        """What a case's record depends on; a job re-runs when it changes."""
        row = self.cases[case]
        return {
            "case": case,
            "excitation": row.excitation,
            "level": row.level,
            "noise": row.noise,
            **({"noise_seed": self.settings["noise_seed"]} if row.noise > 0.0 else {}),
            "sampling": self.settings["sampling"],
            "integrator": self.settings["integrator"],
        }

    def ensemble_settings(self, case: str) -> Table:
        """The same for a job that brings seeds of its own: it does not re-run when those of the study change."""
        told = self.record_settings(case)
        told.pop("noise_seed", None)
        return {**told, "excitation": {key: value for key, value in told["excitation"].items() if key != "seed"}}

    def identification_settings(self, case: str) -> Table:
        """What a case's identification depends on beside its record."""
        tolerances = self.settings["tolerances"]
        own = tolerances.get("of_case", {}).get(case, {})
        return {
            "case": case,
            "also_assumed": self.cases[case].also_assumed,
            "estimators": self.settings["estimators"],
            "segments": self.settings["segments"],
            "fit_band": self.settings["fit_band"],
            "local_polynomial": self.settings["local_polynomial"],
            "settle_periods": self.settings["settle_periods"],
            "period": self.period(case),
            "relative": {**tolerances["relative"], **own},
            "absolute": tolerances["absolute"],
        }

    def period(self, case: str) -> int | None:
        """Samples in a period of a case's force, where it repeats."""
        periods = self.cases[case].excitation.get("periods", 1)
        return self.settings["sampling"]["samples"] // periods if periods > 1 else None

    def drawn(self, case: str) -> list[str]:
        """The estimators that a case's figures show."""
        return self.settings["drawn"]["with_noise" if self.cases[case].noise > 0.0 else "without_noise"]


def load(folder: Path) -> StudyConfig:
    """Read ``config.yaml`` and ``cases.tsv`` of a folder, and the models that they name, and check them all.

    Nothing that passes here can be refused by a job for the way it is configured.

    Raises
    ------
    StudyError
        At the first fault, naming file, row and value.
    """
    source = folder / "config.yaml"
    settings = read_yaml(source)
    check(settings, read_yaml(folder / "schemas" / "config.schema.yaml"), str(source))
    _check_settings(settings, str(source))
    cases: dict[str, Case] = {}
    figures: dict[str, str] = {}
    taken = case_names.taken(folder.parent, settings["estimator_errors"]["many"])
    for where, row in numbered_rows(folder / "cases.tsv", folder / "schemas" / "cases.schema.yaml"):
        if row["case"] in cases:
            raise StudyError(f"{where}: the case stands twice; each name may be used once")
        if row["case"] in taken:
            raise StudyError(f"{where}: {row['case']!r} is the name of {taken[row['case']]}; give the case another")
        cases[row["case"]] = _case(row, where, settings, folder.parent / "models", figures)
    for name in settings["tolerances"].get("of_case", {}):
        if name not in cases and not (folder.parent / "models" / f"{name}.yaml").is_file():
            raise StudyError(f"{source}: tolerances.of_case names {name!r}, which is neither a case nor a system")
    _check_tolerances(settings["tolerances"], parameter_names(folder.parent / "models"), str(source))
    preconditions.check_claims(settings, str(source))
    return StudyConfig(settings, cases)


def _case(row: Table, where: str, settings: Table, models: Path, taken: dict[str, str]) -> Case:
    path = models / f"{row['model']}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in models.glob("*.yaml")))
        raise StudyError(f"{where}: there is no system {row['model']!r}; {models.name}/ holds {known}")
    if row["excitation"] not in settings["excitations"]:
        known = ", ".join(settings["excitations"])
        raise StudyError(f"{where}: there is no excitation {row['excitation']!r}; config.yaml names {known}")
    try:
        model = _complete_model(path)
        _check_assumed(model, row["also_assumed"], settings)
        preconditions.check_periods(settings["excitations"][row["excitation"]], settings)
        preconditions.check_reached(settings["excitations"][row["excitation"]], settings)
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None
    figures = _figures(row, where, taken)
    if "autospectrum" in figures and "periodic_stiffness" not in model:
        raise StudyError(f"{where}: autospectrum is {row['autospectrum']}; its lines need a term periodic_stiffness")
    if "pattern" in figures and (model.states or not model.numbers().get("k", 0.0) > 0.0):
        raise StudyError(
            f"{where}: pattern is {row['pattern']}; it needs a linear stiffness above zero and no term with a memory"
        )
    return Case(
        name=row["case"],
        model=str(Path(models.name) / path.name),
        excitation=settings["excitations"][row["excitation"]],
        level=row["level"],
        noise=row["noise"],
        also_assumed=row["also_assumed"],
        figures=figures,
        title=row["title"],
    )


def _figures(row: Table, where: str, taken: dict[str, str]) -> dict[str, str]:
    """Stems of the files of a case's figures; ``taken`` holds those of the rows before."""
    figures: dict[str, str] = {}
    for kind in FIGURE_KINDS:
        number = row[kind]
        if number is None and kind in PRELIMINARY:
            continue
        stem = f"{row['case']}_{kind}" if number is None else f"figure_{number}"
        if stem in taken:
            raise StudyError(f"{where}: {kind} is {number}, a number that {taken[stem]} has already")
        taken[stem] = f"{kind} of the case {row['case']!r}"
        figures[kind] = stem
    return figures


def _complete_model(path: Path) -> Model:
    """A model that can be simulated: every value known, every formula of motion and time alone."""
    model = read_model(path)
    try:
        model.numbers()
        forward_graph(model)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None
    return model


def _check_assumed(model: Model, extra: str, settings: Table) -> None:
    """Whether the record can tell the inputs of the assumed model apart."""
    from study.identify.frequency_domain.local_polynomial_method import LocalPolynomial
    from study.records.spectra import Segments

    if extra:
        term = terms.get(extra)
        if term.parameters:
            raise StudyError(f"also_assumed {extra!r} needs a value for {term.parameters[0].name}; take a term without")
        model = model.with_term(term)
    inputs = len({c.shape for entry in model.terms for c in entry.term.components})
    cut, samples = Segments(**settings["segments"]), settings["sampling"]["samples"]
    count, worth = cut.count(samples), cut.effective_averages(samples)
    if count <= inputs:
        raise StudyError(
            f"segments of config.yaml cut the record into {count}; {inputs} inputs need {inputs + 1} or more"
        )
    if worth <= inputs:
        raise StudyError(
            f"segments of config.yaml cut the record into {count} that are worth {worth:.3g} averages, as they "
            f"overlap; {inputs} inputs need more than {inputs}: shorter segments are right"
        )
    LocalPolynomial(**settings["local_polynomial"]).check(inputs)


def _check_settings(settings: Table, where: str) -> None:
    """What a schema cannot say: relations between two values, and names the code knows."""
    sampling, segments = settings["sampling"], settings["segments"]
    if segments["length"] > sampling["samples"]:
        raise StudyError(
            f"{where}: segments.length is {segments['length']}, longer than the record of {sampling['samples']} samples"
        )
    low, high = settings["fit_band"]
    nyquist, resolution = 0.5 / sampling["dt"], 1.0 / (segments["length"] * sampling["dt"])
    if not low < high <= nyquist:
        raise StudyError(f"{where}: fit_band is [{low}, {high}]; it must rise and end below {nyquist:g} Hz")
    if high - low < 4.0 * resolution:
        raise StudyError(f"{where}: fit_band is [{low}, {high}]; it must span four lines of {resolution:g} Hz or more")
    width = 2 * settings["local_polynomial"]["half_width"] + 1
    if (high - low) * sampling["samples"] * sampling["dt"] < width:
        raise StudyError(
            f"{where}: local_polynomial.half_width makes bands of {width} lines; fit_band [{low}, {high}] of "
            f"{sampling['samples']} samples holds fewer"
        )
    preconditions.check_estimators(settings, where)
    for name, described in settings["excitations"].items():
        own = ("kind", "seed", "periods", *SETTINGS[described["kind"]])
        for key in described:
            if key not in own:
                raise StudyError(
                    f"{where}: excitations.{name} has {key}, which means nothing to a {described['kind']}; "
                    f"it may have {', '.join(own)}"
                )
        try:
            excitation = Excitation(**{key: value for key, value in described.items() if key != "seed"})
            theoretical_autospectrum(excitation, np.zeros(1), sampling["samples"], sampling["dt"])
        except StudyError as error:
            raise StudyError(f"{where}: excitations.{name}: {error}") from None


def parameter_names(models: Path) -> list[str]:
    """Names that tables give to the parameters of the library's terms and of those of the models in a folder."""
    keys = [key for term in terms.LIBRARY.values() for key in free(term).keys]
    keys += [key for path in sorted(models.glob("*.yaml")) for key in read_model(path).values]
    return sorted(true_parameters(dict.fromkeys(keys, 1.0)))


def _check_tolerances(tolerances: Table, known: Sequence[str], where: str) -> None:
    groups = {"relative": tolerances["relative"], "absolute": tolerances["absolute"]}
    groups |= {f"of_case.{name}": own for name, own in tolerances.get("of_case", {}).items()}
    for group, names in groups.items():
        for name in names:
            if name not in known:
                raise StudyError(
                    f"{where}: tolerances.{group} names {name!r}, which is no parameter; known are {', '.join(known)}"
                )
