"""What the claims are judged on: records and identifications over many seeds, computed once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model
from study.equations.terms import get
from study.identify.estimators.base import Identified, Settings
from study.identify.estimators.in_reverse import miso, read_curve, siso
from study.identify.frequency_domain.conditioned import MisoResult
from study.records.record import Record
from study.records.spectra import autospectrum
from study.reproduction.cases import make_record
from study.reproduction.claims.sample import Sample, average
from study.reproduction.ensemble import NOISE_OFFSET
from study.reproduction.settings import ClaimSettings, RecordSettings
from study.support.arrays import Complexes, Floats
from study.support.cores import side_by_side
from study.support.errors import StudyError

ENSEMBLES_KEPT = 20  # at a time, 7 MB each: so many that few are simulated twice


@dataclass(frozen=True)
class Drive:
    """A system and what is done to it; anything not named is as the study's configuration has it."""

    system: str  # a model of models/
    level: float = 1.0  # input variance in N^2
    noise: float = 0.0  # mean square of the noise on the displacement over that of the displacement
    excitation: tuple[tuple[str, Any], ...] = ()  # settings of the excitation that replace the configured ones
    values: tuple[tuple[str, float], ...] = ()  # values of the model that replace its own


@dataclass(frozen=True)
class Assumed:
    """What the identification assumes beside (or without) the system's own terms, and how it cuts the record."""

    plus: tuple[str, ...] = ()  # terms added to the system's own
    minus: tuple[str, ...] = ()  # terms of the system that are left out
    segments: tuple[tuple[str, Any], ...] = ()  # settings of the segments that replace the configured ones
    band: tuple[float, float] | None = None  # hertz: lines the parameters are fitted to, if not the configured band


OWN_TERMS = Assumed()


@dataclass(frozen=True)
class Analysis:
    """What one estimator finds in one record, on the lines of the fit band."""

    frequency: Floats  # hertz, shape (lines,)
    response: Complexes  # L_1 of SI/SO or A_j of MI/SO, shape (inputs, lines)
    cumulative: Floats  # cumulative coherence, shape (inputs, lines)
    averages: float  # effective number
    values: dict[str, float]  # fitted parameters
    errors: dict[str, float]  # standard errors of the fitted parameters
    read: dict[str, float]  # parameters as a hand reads them off the first curve (Section 5.2.1)


@dataclass(frozen=True)
class Outcome:
    """One record, identified both ways."""

    siso: Analysis
    miso: Analysis


@dataclass(frozen=True)
class Ensemble:
    """A system identified from the study's own record (its configured seed) and from those of the ensemble's seeds."""

    system: str
    own: Outcome
    seeds: tuple[Outcome, ...]

    def sample(self, number: Callable[[Outcome], float]) -> Sample:
        return Sample(tuple(number(o) for o in self.seeds), number(self.own))

    def siso(self, name: str) -> Sample:
        return self.sample(lambda o: o.siso.values[name])

    def hand_read(self, name: str) -> Sample:
        """A parameter as a hand reads it off the SI/SO curve; nan where the curve has no minimum."""
        return self.sample(lambda o: o.siso.read.get(name, np.nan))

    def miso(self, name: str) -> Sample:
        return self.sample(lambda o: o.miso.values[name])

    def lines(self, rows: Callable[[Outcome], Floats]) -> Floats:
        """Mean over the seeds of a quantity with one value per line, shape (lines,)."""
        return np.mean([rows(o) for o in self.seeds], axis=0)

    def lowest(self, rows: Callable[[Outcome], Floats]) -> tuple[float, float]:
        """Frequency and height of the lowest line of the mean over the seeds."""
        heights = self.lines(rows)
        i = int(np.argmin(heights))
        return float(self.frequency[i]), float(heights[i])

    @property
    def frequency(self) -> Floats:
        return self.own.miso.frequency

    def between(self, low: float, high: float) -> NDArray[np.bool_]:
        return (self.frequency >= low) & (self.frequency <= high)

    def linear_coherence(self, low: float = 0.0, high: float = np.inf) -> Sample:
        """Mean over the lines from ``low`` to ``high`` hertz of the share that passes through L_1."""
        keep = self.between(low, high)
        return self.sample(lambda o: average(o.miso.cumulative[0][keep]))

    def multiple_coherence(self) -> Sample:
        """Mean over the fit band of the coherence of the whole model."""
        return self.sample(lambda o: average(o.miso.cumulative[-1]))


class Evidence:
    """Records and identifications on demand, each computed once.

    They follow from the settings of ``config/config.yaml``, the models by the system's name, and the rows of
    ``results/integrator_steps.csv``.
    """

    def __init__(
        self, settings: ClaimSettings, models: Mapping[str, Model], integrator_steps: Sequence[Mapping[str, Any]]
    ) -> None:
        self.settings, self.models, self.integrator_steps = settings, models, integrator_steps
        first = settings.ensembles.first_seed
        self.seeds = range(first, first + settings.ensembles.seeds)
        self.segments = settings.segments.segments()
        self.records: Callable[[Drive], tuple[Record, ...]] = lru_cache(ENSEMBLES_KEPT)(self._records)
        self._ensembles = cache(self._identified)

    def model(self, drive: Drive) -> Model:
        """The model of a drive, with the drive's values; a ``StudyError`` names the file of one that is missing."""
        if drive.system not in self.models:
            raise StudyError(
                f"expected models/{drive.system}.yaml, a system of the report's Table 1; there is no such model"
            )
        return self.models[drive.system].with_values(dict(drive.values))

    def _records(self, drive: Drive) -> tuple[Record, ...]:
        """Records of a drive, the study's own first."""
        model, settings = self.model(drive), record_settings(self.settings, drive)
        streams = [(None, None), *((seed, NOISE_OFFSET + seed) for seed in self.seeds)]
        return tuple(side_by_side(lambda s: make_record(model, settings, seed=s[0], noise_seed=s[1]), streams))

    def ensemble(self, drive: Drive, assumed: Assumed = OWN_TERMS) -> Ensemble:
        return self._ensembles(drive, assumed)

    def _identified(self, drive: Drive, assumed: Assumed) -> Ensemble:
        model = self.model(drive)
        own, *others = side_by_side(lambda r: self.analyse(model, r, assumed), self.records(drive))
        return Ensemble(drive.system, own, tuple(others))

    def at(self, system: str, level: float = 1.0, noise: float = 0.0) -> Ensemble:
        """A system at a level, with or without noise, identified with its own terms."""
        return self.ensemble(Drive(system, level, noise))

    def each(self, drive: Drive, number: Callable[[Record], float]) -> Sample:
        return Sample.own_first(list(side_by_side(number, self.records(drive))))

    def of_channel(self, system: str, number: Callable[[Floats], float], channel: str = "displacement") -> Sample:
        """A number of one channel of each record of a system at unit variance."""
        return self.each(Drive(system), lambda r: number(r[channel]))

    def spectra(self, drive: Drive, channel: str = "displacement") -> tuple[Floats, Floats]:
        """Frequency, and the autospectrum of one channel of each record, shape (records, lines)."""
        spectra = [autospectrum(r[channel], r.dt, self.segments) for r in self.records(drive)]
        return spectra[0][0], np.stack([density for _, density in spectra])

    def tolerance(self, system: str, name: str) -> float:
        """The configured tolerance of a parameter, relative to its true value."""
        tolerances = self.settings.tolerances
        return tolerances.of_case.get(system, {}).get(name, tolerances.relative[name])

    def estimator_settings(self, assumed: Assumed = OWN_TERMS) -> Settings:
        """What the estimators go by: the configured segments and band, where nothing else is assumed."""
        segments = self.settings.segments.model_copy(update=dict(assumed.segments))
        low, high = assumed.band or self.settings.fit_band
        return Settings(segments.segments(), (low, high))

    def analyse(self, model: Model, record: Record, assumed: Assumed = OWN_TERMS) -> Outcome:
        """Identify one record, SI/SO and MI/SO."""
        for name in assumed.minus:
            model = model.without_term(name)
        for name in assumed.plus:
            model = model.with_term(get(name))
        settings = self.estimator_settings(assumed)
        single, multiple = (estimator(model, record, settings) for estimator in (siso, miso))
        return Outcome(_analysis(single, settings), _analysis(multiple, settings))


def record_settings(settings: ClaimSettings, drive: Drive) -> RecordSettings:
    """What ``study.reproduction.cases.make_record`` expects, for a drive."""
    return RecordSettings(
        case=drive.system, excitation=settings.excitation.model_copy(update=dict(drive.excitation)), level=drive.level,
        noise=drive.noise, noise_seed=settings.noise_seed if drive.noise > 0.0 else None, sampling=settings.sampling,
        integrator=settings.integrator,
    )  # fmt: skip


def _analysis(identified: Identified, settings: Settings) -> Analysis:
    result = identified.responses
    assert isinstance(result, MisoResult)  # both estimators give coherences
    keep = (result.frequency >= settings.band[0]) & (result.frequency <= settings.band[1])
    return Analysis(
        frequency=result.frequency[keep], response=result.response[:, keep], cumulative=result.cumulative[:, keep],
        averages=result.averages, values={p.name: p.value for p in identified.parameters},
        errors={p.name: p.error for p in identified.parameters}, read=read_curve(result, settings.band),
    )  # fmt: skip


def models_of(folder: Path) -> dict[str, Model]:
    """Every model of a folder by its file's name."""
    from study.equations.model_file import read_model

    return {path.stem: read_model(path) for path in sorted(folder.glob("*.yaml"))}
