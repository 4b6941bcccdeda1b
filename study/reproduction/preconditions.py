"""What the jobs ask of the settings beyond the bounds of each value: none shall end in want of it."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from study.equations import terms
from study.equations.model import Model, forward_graph, free
from study.equations.model_file import read_model
from study.identify.estimators import ESTIMATORS
from study.identify.estimators.base import true_parameters
from study.records.excitation import READINGS, SETTINGS, theoretical_autospectrum
from study.reproduction.settings import ExcitationSettings, Sampling, StudySettings, Tolerances
from study.support.errors import StudyError

JUDGED, KIND = "report", "gaussian_lowpass"  # the force that the claims judge, Section 2.1
CURVES = ("siso", "miso", "local_polynomial", "instrumental", "output_error")  # have some of every case to be drawn
LOOKED_AT = (2.0, 4.0)  # hertz: where the claims read single lines, the Dead-Band's and the Mathieu's
LONGER, INPUTS = 4, 2  # the claims cut segments this many times as long too, and tell so many inputs apart in them
SHORTEST = 16  # samples in a segment, by its bounds
LINES = 4  # of a segment, that the fit band spans at least


@contextmanager
def named(where: object) -> Generator[None, None, None]:
    """Begin the sentence of a fault with the place where its value stands."""
    try:
        yield
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None


def check_settings(settings: StudySettings) -> None:
    """Whether values fit together, and names are known.

    Raises
    ------
    StudyError
        At the first that does not; the caller names the file.
    """
    samples, dt = settings.sampling.samples, settings.sampling.dt
    if settings.segments.length > samples:
        raise StudyError(
            f"segments.length is {settings.segments.length}, longer than the record of {samples} samples; "
            "expected that many or fewer"
        )
    (low, high), band, line = settings.fit_band, list(settings.fit_band), settings.resolution
    if not low < high <= 0.5 / dt:
        raise StudyError(f"fit_band is {band}; it must rise and end below {0.5 / dt:g} Hz")
    if high - low < LINES * line:
        raise StudyError(f"fit_band is {band}; it must span four lines of {line:g} Hz or more")
    width = 2 * settings.local_polynomial.half_width + 1
    if (high - low) * samples * dt < width:
        raise StudyError(
            f"local_polynomial.half_width makes bands of {width} lines; "
            f"fit_band {band} of {samples} samples holds fewer"
        )
    _check_estimators(settings)
    for name, excitation in settings.excitations.items():
        _check_excitation(f"excitations.{name}", excitation, settings.sampling)


def _check_estimators(settings: StudySettings) -> None:
    """Every estimator that is named is there, MI/SO among them, and one with curves among the drawn."""
    own, compared = settings.estimators, settings.estimator_errors.estimators
    for name in (*own, *settings.monte_carlo.estimators, *compared):
        if name not in ESTIMATORS:
            raise StudyError(f"there is no estimator {name!r}; known are {', '.join(ESTIMATORS)}")
    if "miso" not in own:
        raise StudyError("estimators lacks 'miso', whose coherences are drawn of every case")
    if "miso" not in compared:
        raise StudyError("estimator_errors.estimators lacks 'miso', which the others are compared with")
    drawn: dict[str, Sequence[str]] = {f"drawn.{kind}": names for kind, names in settings.drawn}
    for kind, names in drawn.items():
        if unknown := [name for name in names if name not in own]:
            raise StudyError(f"{kind} names {unknown[0]!r}, which is not among the estimators")
        if not set(names) & set(CURVES):
            raise StudyError(
                f"{kind} is [{', '.join(names)}], of which none has curves of every case; "
                f"one of {', '.join(CURVES)} is needed"
            )


def _check_excitation(place: str, excitation: ExcitationSettings, sampling: Sampling) -> None:
    own = ("kind", "seed", "periods", *SETTINGS[excitation.kind])
    if extra := [key for key in excitation.plain() if key not in own]:
        raise StudyError(
            f"{place} has {extra[0]}, which means nothing to a {excitation.kind}; it may have {', '.join(own)}"
        )
    if excitation.seed is None:
        raise StudyError(f"{place}: 'seed' is missing; expected a whole number of 0 or more")
    with named(place):
        theoretical_autospectrum(excitation.at_level(1.0), np.zeros(1), sampling.samples, sampling.dt)


def check_periods(excitation: ExcitationSettings, settings: StudySettings) -> None:
    """Whether there are periods for those estimators that stand on them.

    Raises
    ------
    StudyError
        If there are too few; the caller says of which force.
    """
    needed, periods = settings.settle_periods + 4, excitation.periods or 1
    if "errors_in_variables" in settings.estimators and periods < needed:
        raise StudyError(
            f"the excitation has {periods} period{'s' if periods > 1 else ''}; the estimator errors_in_variables needs "
            f"settle_periods and four more, {needed}"
        )


def check_reached(excitation: ExcitationSettings, settings: StudySettings) -> None:
    """Whether a force reaches over the lines that parameters are fitted to: beyond it there is only leakage.

    Raises
    ------
    StudyError
        If it does not; the caller says whose force it is.
    """
    force, high, line = excitation.at_level(1.0), settings.fit_band[1], settings.resolution
    begun = f"fit_band of config.yaml is {list(settings.fit_band)}; the excitation"
    if high > force.highest:
        raise StudyError(f"{begun} has nothing above {force.highest:g} Hz, where the band must end or before")
    if high - force.lowest < LINES * line:
        raise StudyError(f"{begun} begins at {force.lowest:g} Hz, and four lines of {line:g} Hz or more must lie above")


def check_model(path: Path, also_assumed: str, settings: StudySettings) -> Model:
    """A case's model, which can be simulated, and whose inputs the record can tell apart with a term more.

    Raises
    ------
    StudyError
        If a value or a formula lacks something, or the inputs are too many.
    """
    from study.identify.frequency_domain.local_polynomial_method import LocalPolynomial

    model = read_model(path)
    with named(path):
        model.numbers()
        forward_graph(model)
    assumed = model
    if also_assumed:
        term = terms.get(also_assumed)
        if term.parameters:
            needed = term.parameters[0].name
            raise StudyError(f"also_assumed {also_assumed!r} needs a value for {needed}; take a term without")
        assumed = model.with_term(term)
    inputs = len({c.shape for entry in assumed.terms for c in entry.term.components})
    cut, samples = settings.segments.segments(), settings.sampling.samples
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
    LocalPolynomial(**settings.local_polynomial.model_dump()).check(inputs)
    return model


def check_tolerances(tolerances: Tolerances, models: Path, cases: Sequence[str]) -> None:
    """Whether tolerances are of parameters that there are, and of cases or systems.

    Raises
    ------
    StudyError
        At the first that is of neither; the caller names the file.
    """
    for name in tolerances.of_case:
        if name not in cases and not (models / f"{name}.yaml").is_file():
            raise StudyError(f"tolerances.of_case names {name!r}, which is neither a case nor a system")
    keys = [key for term in terms.LIBRARY.values() for key in free(term).keys]
    keys += [key for path in sorted(models.glob("*.yaml")) for key in read_model(path).values]
    known = sorted(true_parameters(dict.fromkeys(keys, 1.0)))  # as tables name them
    groups = {"relative": tolerances.relative, "absolute": tolerances.absolute}
    groups |= {f"of_case.{name}": own for name, own in tolerances.of_case.items()}
    for group, names in groups.items():
        if unknown := [name for name in names if name not in known]:
            raise StudyError(
                f"tolerances.{group} names {unknown[0]!r}, which is no parameter; known are {', '.join(known)}"
            )


def check_claims(settings: StudySettings) -> None:
    """Whether the claims can be judged under these settings.

    Raises
    ------
    StudyError
        At the first thing that they lack, naming the value and what would be right; the caller names the file.
    """
    if JUDGED not in settings.excitations:
        known = ", ".join(settings.excitations)
        raise StudyError(f"excitations names {known}, not {JUDGED!r}; the claims judge a force of this name, a {KIND}")
    _check_force(settings.excitations[JUDGED], settings.sampling)
    with named(f"excitations.{JUDGED}"):
        check_reached(settings.excitations[JUDGED], settings)
    (low, high), (first, last) = settings.fit_band, LOOKED_AT
    below = first - settings.resolution  # the lowest line has a neighbour
    if low > below or high < last:
        raise StudyError(
            f"fit_band is {list(settings.fit_band)}; the claims look at lines from {first:g} to {last:g} Hz, so that "
            f"it must begin at {below:.4g} Hz or below and end at {last:g} Hz or above"
        )
    _check_segments(settings)


def _check_force(force: ExcitationSettings, sampling: Sampling) -> None:
    if force.kind != KIND:
        raise StudyError(
            f"excitations.{JUDGED}.kind is {force.kind!r}; the claims judge a {KIND} there, "
            "and a force of another kind needs a name of its own"
        )
    if force.reading is None:
        raise StudyError(
            f"excitations.{JUDGED} has no reading, which the claims name; "
            f"it may be {' or '.join(READINGS)}, what unit variance refers to"
        )
    for kind in SETTINGS:  # Section 6 holds for any spectrum: the claims put each in its place
        other = force.model_copy(update={"kind": kind})
        with named(f"the claims put a {kind} in place of excitations.{JUDGED}"):
            theoretical_autospectrum(other.at_level(1.0), np.zeros(1), sampling.samples, sampling.dt)


def _check_segments(settings: StudySettings) -> None:
    length, samples = settings.segments.length, settings.sampling.samples

    def enough(length: int) -> bool:
        cut = settings.segments.model_copy(update={"length": length}).segments(LONGER)
        return samples >= cut.length and cut.effective_averages(samples) > INPUTS

    if enough(length):
        return
    right = length // 2
    while right >= SHORTEST and not enough(right):
        right //= 2
    advice = f"{right} is right" if right >= SHORTEST else "a longer record is right"
    raise StudyError(
        f"segments.length is {length}; the claims cut segments of {LONGER} times that too, which a "
        f"record of {samples} samples must hold for more than {INPUTS} averages: {advice}"
    )
