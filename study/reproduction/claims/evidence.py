"""What the claims are judged on: records and identifications over many seeds, computed once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model
from study.equations.terms import get
from study.identify.estimators import miso, siso
from study.identify.estimators.base import Identified, Settings
from study.identify.estimators.hand_read import read_curve
from study.identify.frequency_domain.conditioned import MisoResult
from study.records.record import Record
from study.records.spectra import Segments
from study.reproduction.claims.sample import Sample, average
from study.reproduction.ensemble import NOISE_OFFSET, threaded
from study.reproduction.make_record import make_record
from study.support.errors import StudyError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Table = Mapping[str, Any]
T = TypeVar("T")
KEPT = 9  # ensembles of records held at a time: seven systems and what is being worked on


@dataclass(frozen=True)
class Drive:
    """A system and what is done to it; anything not named is as the study's configuration has it.

    Attributes
    ----------
    system : str
        A model of ``models/``.
    level, noise : float
        Input variance in N^2; mean square of the noise on the displacement over its own.
    excitation : tuple of (str, value)
        Settings of the excitation in place of the configured.
    values : tuple of (str, float)
        Values of the model in place of its own.
    """

    system: str
    level: float = 1.0
    noise: float = 0.0
    excitation: tuple[tuple[str, Any], ...] = ()
    values: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Assumed:
    """What the identification assumes beside (or without) the system's own terms, and how it cuts.

    Attributes
    ----------
    plus, minus : tuple of str
        Terms added to the system's own; terms left out.
    segments : tuple of (str, value)
        Settings of the segments in place of the configured.
    band : pair of float, optional
        Lines that the parameters are fitted to, in hertz, in place of the configured.
    """

    plus: tuple[str, ...] = ()
    minus: tuple[str, ...] = ()
    segments: tuple[tuple[str, Any], ...] = ()
    band: tuple[float, float] | None = None


@dataclass(frozen=True)
class Analysis:
    """What one estimator finds in one record, on the lines of the fit band.

    Attributes
    ----------
    frequency : array, shape (lines,)
        In hertz.
    response : complex array, shape (inputs, lines)
        ``L_1`` of SI/SO, ``A_j`` of MI/SO.
    cumulative : array, shape (inputs, lines)
        Cumulative coherence.
    averages : float
        Effective number of averages.
    values, errors : dict of float
        Fitted parameters and their standard errors.
    read : dict of float
        Parameters as a hand reads them off the first curve (Section 5.2.1).
    """

    frequency: Floats
    response: Complexes
    cumulative: Floats
    averages: float
    values: dict[str, float]
    errors: dict[str, float]
    read: dict[str, float]


@dataclass(frozen=True)
class Outcome:
    """One record, identified both ways."""

    siso: Analysis
    miso: Analysis


@dataclass(frozen=True)
class Ensemble:
    """The study's own record (its configured seed) and those of the ensemble's seeds."""

    own: Outcome
    seeds: tuple[Outcome, ...]

    def sample(self, number: Callable[[Outcome], float]) -> Sample:
        """A number of each outcome."""
        return Sample(tuple(number(o) for o in self.seeds), number(self.own))

    def siso(self, name: str) -> Sample:
        """A parameter fitted to the SI/SO curve."""
        return self.sample(lambda o: o.siso.values[name])

    def miso(self, name: str) -> Sample:
        """A parameter fitted to the MI/SO curves."""
        return self.sample(lambda o: o.miso.values[name])

    def lines(self, rows: Callable[[Outcome], Floats]) -> Floats:
        """Mean over the seeds of something per line, shape (lines,)."""
        return np.mean([rows(o) for o in self.seeds], axis=0)

    def lowest(self, rows: Callable[[Outcome], Floats]) -> tuple[float, float]:
        """Frequency and height of the lowest line of the mean over the seeds."""
        found = self.lines(rows)
        i = int(np.argmin(found))
        return float(self.frequency[i]), float(found[i])

    @property
    def frequency(self) -> Floats:
        """Lines of the fit band in hertz."""
        return self.own.miso.frequency

    def linear_coherence(self) -> Sample:
        """Mean over the fit band of the share that passes through L_1."""
        return self.sample(lambda o: average(o.miso.cumulative[0]))

    def multiple_coherence(self) -> Sample:
        """Mean over the fit band of the coherence of the whole model."""
        return self.sample(lambda o: average(o.miso.cumulative[-1]))


@dataclass(frozen=True)
class Evidence:
    """Records and identifications on demand, each computed once.

    Attributes
    ----------
    settings : dict
        Of ``config/config.yaml``.
    models : dict of Model
        The systems by name.
    seeds : range
        Seeds of the ensembles.
    integrator_steps : sequence of dict
        Rows of ``results/integrator_steps.csv``.
    records : callable
        ``Drive -> tuple of Record``, the study's own first.
    ensemble : callable
        ``(Drive, Assumed) -> Ensemble``.
    """

    settings: Table
    models: Mapping[str, Model]
    seeds: range
    integrator_steps: Sequence[Table]
    records: Callable[[Drive], tuple[Record, ...]]
    ensemble: Callable[[Drive, Assumed], Ensemble]

    def unit(self, system: str) -> Ensemble:
        """A system at unit variance without noise, identified with its own terms."""
        return self.ensemble(Drive(system), Assumed())

    def at(self, system: str, level: float, noise: float = 0.0) -> Ensemble:
        """A system at another level or with noise, identified with its own terms."""
        return self.ensemble(Drive(system, level, noise), Assumed())

    def model(self, drive: Drive) -> Model:
        """The model of a drive, with the drive's values."""
        return driven_model(self.models, drive)

    def each(self, drive: Drive, number: Callable[[Record], float]) -> Sample:
        """A number of each record."""
        own, *others = threaded(number, self.records(drive))
        return Sample(tuple(others), own)

    def tolerance(self, system: str, name: str) -> float:
        """The configured tolerance of a parameter: relative, or absolute where Table 1 has a zero."""
        tolerances = self.settings["tolerances"]
        own = tolerances.get("of_case", {}).get(system, {})
        return own.get(name, tolerances["relative"][name])

    def analyse(self, model: Model, record: Record, assumed: Assumed | None = None) -> Outcome:
        """Identify one record."""
        return identify(model, record, assumed or Assumed(), self.settings)


def gather(settings: Table, models: Mapping[str, Model], integrator_steps: Sequence[Table]) -> Evidence:
    """Evidence from a configuration and the models it names."""
    first, count = settings["ensembles"]["first_seed"], settings["ensembles"]["seeds"]
    seeds = range(first, first + count)

    @lru_cache(KEPT)
    def records(drive: Drive) -> tuple[Record, ...]:
        model, told = driven_model(models, drive), record_settings(settings, drive)
        streams = [(None, None), *((seed, NOISE_OFFSET + seed) for seed in seeds)]
        return tuple(threaded(lambda s: make_record(model, told, seed=s[0], noise_seed=s[1]), streams))

    @cache
    def ensemble(drive: Drive, assumed: Assumed) -> Ensemble:
        model = driven_model(models, drive)
        own, *others = threaded(lambda r: identify(model, r, assumed, settings), records(drive))
        return Ensemble(own, tuple(others))

    return Evidence(settings, models, seeds, integrator_steps, records, ensemble)


def driven_model(models: Mapping[str, Model], drive: Drive) -> Model:
    """The model of a drive, with the drive's values.

    Raises
    ------
    StudyError
        If there is no model of this name.
    """
    if drive.system not in models:
        raise StudyError(f"the claims need models/{drive.system}.yaml, the report's Table 1; there is no such model")
    return models[drive.system].with_values(dict(drive.values))


def record_settings(settings: Table, drive: Drive) -> dict[str, Any]:
    """What ``study.reproduction.make_record.make_record`` wants, for a drive.

    Raises
    ------
    StudyError
        If the configuration has no excitation ``report``.
    """
    if "report" not in settings["excitations"]:
        raise StudyError("config/config.yaml: excitations has no 'report'; the claims judge that force history")
    return {
        "case": drive.system,
        "excitation": {**settings["excitations"]["report"], **dict(drive.excitation)},
        "level": drive.level,
        "noise": drive.noise,
        **({"noise_seed": settings["noise_seed"]} if drive.noise > 0.0 else {}),
        "sampling": settings["sampling"],
        "integrator": settings["integrator"],
    }


def identify(model: Model, record: Record, assumed: Assumed, settings: Table) -> Outcome:
    """Identify one record, SI/SO and MI/SO."""
    for name in assumed.minus:
        model = model.without_term(name)
    for name in assumed.plus:
        model = model.with_term(get(name))
    low, high = assumed.band or settings["fit_band"]
    told = Settings(Segments(**{**settings["segments"], **dict(assumed.segments)}), (low, high))
    single = _analysis(siso.identify(model, record, told), told)
    return Outcome(single, _analysis(miso.identify(model, record, told), told))


def _analysis(found: Identified, told: Settings) -> Analysis:
    result = found.responses
    assert isinstance(result, MisoResult)  # both estimators give coherences
    keep = (result.frequency >= told.band[0]) & (result.frequency <= told.band[1])
    return Analysis(
        frequency=result.frequency[keep],
        response=result.response[:, keep],
        cumulative=result.cumulative[:, keep],
        averages=result.averages,
        values={p.name: p.value for p in found.parameters},
        errors={p.name: p.error for p in found.parameters},
        read=read_curve(result, told.band),
    )


def models_of(folder: Path) -> dict[str, Model]:
    """Every model of a folder by its file's name."""
    from study.equations.model_file import read_model

    return {path.stem: read_model(path) for path in sorted(folder.glob("*.yaml"))}
