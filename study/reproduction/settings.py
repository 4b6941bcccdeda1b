"""The study's settings as typed, frozen values: the sections of ``config/config.yaml``, and what its jobs are given."""

from difflib import get_close_matches
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import AfterValidator, Field

from study.records.excitation import Excitation
from study.records.spectra import Segments
from study.support.config_files import Section
from study.support.errors import StudyError


def _each_once(names: tuple[object, ...]) -> tuple[object, ...]:
    if len(set(names)) < len(names):
        raise ValueError(f"is {list(names)}; expected each entry once")
    return names


def _with(*needed: str) -> AfterValidator:
    """Refuses a mapping that lacks one of the names that the claims and the tables judge."""

    def check(values: dict[str, float]) -> dict[str, float]:
        if lacking := [name for name in needed if name not in values]:
            if near := get_close_matches(lacking[0], [name for name in values if name not in needed], n=1):
                raise ValueError(f"names {near[0]!r}, which is no parameter; did you mean {lacking[0]!r}?")
            raise ValueError(f"lacks {lacking[0]!r}; expected at least {', '.join(needed)}")
        return values

    return AfterValidator(check)


Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0)]
Seeds = Annotated[int, Field(ge=2)]
Positive = Annotated[float, Field(gt=0.0)]
Rate = Annotated[float, Field(ge=0.0, le=1.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Names = Annotated[tuple[str, ...], Field(min_length=1, strict=False), AfterValidator(_each_once)]
Band = Annotated[tuple[NotNegative, ...], Field(min_length=2, max_length=2, strict=False)]
RatePair = Annotated[tuple[Rate, ...], Field(min_length=2, max_length=2, strict=False)]
RateOne = Annotated[tuple[Rate, ...], Field(min_length=1, max_length=1, strict=False)]
Limits = dict[str, Positive]


class Sampling(Section):
    """Samples of a record, as many as memory holds, and seconds from one to the next."""

    samples: Annotated[int, Field(ge=64, le=100_000_000)]
    dt: Positive


class ExcitationSettings(Section):
    """A force history; what is left out is as :class:`Excitation` has it, and the seed as the job brings it."""

    kind: Literal[
        "gaussian_lowpass", "pierson_moskowitz", "random_phase_multisine", "swept_sine", "gaussian_band",
        "stepped_sine", "blows",
    ]  # fmt: skip
    reading: Literal["raw", "filtered"] | None = None
    cutoff: Positive | None = None
    peak_frequency: Positive | None = None
    start_frequency: Positive | None = None
    stop_frequency: Positive | None = None
    odd_only: bool | None = None
    sweep: Literal["linear", "logarithmic"] | None = None
    steps: Annotated[int, Field(ge=2)] | None = None
    blows: Count | None = None
    periods: Count | None = None
    seed: Seed | None = None

    def at_level(self, level: float) -> Excitation:
        return Excitation(level=level, **self.model_dump(exclude_none=True, exclude={"seed"}))


class IntegratorSettings(Section):
    """How motion is simulated."""

    method: Literal["abm4", "rk4"]
    steps_per_sample: Annotated[int, Field(ge=1, le=1000)]


class SegmentSettings(Section):
    """How records are cut."""

    length: Annotated[int, Field(ge=16)]
    overlap: Annotated[float, Field(ge=0.0, le=0.95)]
    window: Literal["hann", "hamming", "blackman", "boxcar", "flattop", "blackmanharris"]

    def segments(self, times: int = 1) -> Segments:
        """As the estimators want them, so many times as long."""
        return Segments(times * self.length, self.overlap, self.window)


class LocalPolynomialSettings(Section):
    """Bands of the local polynomial estimator."""

    degree: Annotated[int, Field(ge=0, le=6)]
    half_width: Count


class DrawnEstimators(Section):
    """Estimators that the figures show."""

    without_noise: Names
    with_noise: Names


class AllowedErrors(Section):
    """What an estimate may be off by name: relative, absolute and in its own unit where the true value is zero."""

    relative: Limits
    absolute: Limits


class CaseTolerances(AllowedErrors):
    """Those of all cases, and what takes the place of the relative ones in single cases."""

    of_case: dict[str, Limits] = Field(default_factory=dict[str, Limits])


class Tolerances(CaseTolerances):
    """Those of the report's systems."""

    relative: Annotated[Limits, _with("m", "f_n", "k", "k3", "k_m", "k_dead_band", "u_g", "f_m", "c3", "c", "zeta")]
    absolute: Annotated[Limits, _with("k", "c", "k3", "phase")]


class Ensembles(Section):
    """Seeds, from the first one on."""

    seeds: Seeds
    first_seed: Seed


class MonteCarlo(Ensembles):
    """Seeds and estimators of the rates at which tolerances are met."""

    estimators: Names


class EstimatorErrors(MonteCarlo):
    """The same for the errors of the estimators, and of ``many`` seeds as a target of its own."""

    many: Seeds


class Wanted(Section):
    """Rates that the trials are to reach, and sizes of tie sets: without a fault of the measurement, and with one."""

    first: RatePair
    first_in_noise: RatePair
    tied: RatePair
    size: Band
    size_in_noise: Band
    nothing: RatePair
    both: RatePair
    removed: RateOne
    fault: RateOne
    held: RatePair
    held_most: RatePair


class TrialSettings(Section):
    """Trials with hidden effects, as many with a fault of the measurement; there are 136 pairs of effects."""

    first_seed: Seed
    noises: Annotated[tuple[NotNegative, ...], Field(min_length=1, strict=False), AfterValidator(_each_once)]
    rounds: Count
    none: Count
    completed: Count
    pairs: Annotated[int, Field(ge=1, le=136)]
    removed: Count
    jobs: Count


class Trials(TrialSettings):
    """The same with the rates that they are to reach."""

    wanted: Wanted


T = TypeVar("T", bound=CaseTolerances)


class CaseSettings(Section, Generic[T]):
    """What the cases of a table share: how their records are made, and what is found in them."""

    sampling: Sampling
    excitations: Annotated[dict[str, ExcitationSettings], Field(min_length=1)]
    noise_seed: Seed
    integrator: IntegratorSettings
    segments: SegmentSettings
    fit_band: Band
    local_polynomial: LocalPolynomialSettings
    settle_periods: Seed = 0  # of a force that repeats
    estimators: Names
    tolerances: T
    limits: Limits = Field(default_factory=dict[str, Positive])  # of what is claimed of a structure, each by its name


class StudySettings(CaseSettings[Tolerances]):
    """``config/config.yaml``; the comments there say what each section is for."""

    drawn: DrawnEstimators
    monte_carlo: MonteCarlo
    estimator_errors: EstimatorErrors
    ensembles: Ensembles
    trials: Trials

    @property
    def claims(self) -> "ClaimSettings":
        """What the claims depend on; a ``StudyError`` if the force history that they judge is not configured."""
        if "report" not in self.excitations:
            raise StudyError("config/config.yaml: expected an excitation 'report'; the claims judge that force history")
        own = {name: getattr(self, name) for name in ClaimSettings.model_fields if name != "excitation"}
        return ClaimSettings(excitation=self.excitations["report"], **own)

    @property
    def resolution(self) -> float:
        """Hertz from one line of a segment to the next."""
        return 1.0 / (self.segments.length * self.sampling.dt)


class ClaimSettings(Section):
    """What the claims depend on; the seed of the noise is left out for a job whose records have none."""

    excitation: ExcitationSettings  # the report's
    noise_seed: Seed | None = None
    sampling: Sampling
    integrator: IntegratorSettings
    segments: SegmentSettings
    fit_band: Band
    tolerances: Tolerances
    ensembles: Ensembles


class RecordSettings(Section):
    """What a case's record depends on; its seeds are left out where a job brings its own.

    ``sensors`` are the coordinates of which the displacement alone is measured; all motions where they are left out.
    """

    case: str
    excitation: ExcitationSettings
    level: float
    noise: float
    noise_seed: Seed | None = None
    sampling: Sampling
    integrator: IntegratorSettings
    sensors: Names | None = None

    def without_seeds(self) -> "RecordSettings":
        """The same for a job that brings seeds of its own: it does not re-run when those of the study change."""
        excitation = self.excitation.model_copy(update={"seed": None})
        return self.model_copy(update={"excitation": excitation, "noise_seed": None})


class IdentificationSettings(AllowedErrors):
    """What a case's identification depends on beside its record; ``period`` counts samples, if the force repeats."""

    case: str
    also_assumed: str
    estimators: Names
    segments: SegmentSettings
    fit_band: Band
    local_polynomial: LocalPolynomialSettings
    settle_periods: Seed
    period: Count | None = None
