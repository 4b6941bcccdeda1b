"""What the jobs ask of the settings beyond the bounds of each value: none shall end in want of it.

Each check raises a ``StudyError`` at the first fault, naming the value and what was expected; whose settings, force
or model it is, the caller adds.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from study.equations import terms
from study.equations.model import Model, free, named_channels
from study.equations.model_file import read_model
from study.identify.estimators import ESTIMATORS
from study.identify.estimators.base import true_parameters
from study.records.excitation import READINGS, SETTINGS, theoretical_autospectrum
from study.reproduction.settings import ExcitationSettings, Sampling, StudySettings, Tolerances
from study.support.errors import StudyError, at, expect

JUDGED, KIND = "report", "gaussian_lowpass"  # the force that the claims judge, Section 2.1
CURVES = ("siso", "miso", "local_polynomial", "instrumental", "output_error")  # have some of every case to be drawn
LOOKED_AT = (2.0, 4.0)  # hertz: where the claims read single lines, the Dead-Band's and the Mathieu's
LONGER, INPUTS = 4, 2  # the claims cut segments this many times as long too, and tell so many inputs apart in them
SHORTEST = 16  # samples in a segment, by its bounds
LINES = 4  # of a segment, that the fit band spans at least


def check_settings(settings: StudySettings) -> None:
    """Whether values fit together, and names are known."""
    samples, dt, length = settings.sampling.samples, settings.sampling.dt, settings.segments.length
    expect(
        length <= samples,
        f"segments.length is {length}, longer than the record of {samples} samples; expected that many or fewer",
    )
    (low, high), line = settings.fit_band, settings.resolution
    band, width = list(settings.fit_band), 2 * settings.local_polynomial.half_width + 1
    expect(low < high <= 0.5 / dt, f"fit_band is {band}; it must rise and end below {0.5 / dt:g} Hz")
    expect(high - low >= LINES * line, f"fit_band is {band}; it must span four lines of {line:g} Hz or more")
    expect(
        (high - low) * samples * dt >= width,
        f"local_polynomial.half_width makes bands of {width} lines; fit_band {band} of {samples} samples holds fewer",
    )
    _check_estimators(settings)
    for name, excitation in settings.excitations.items():
        _check_excitation(f"excitations.{name}", excitation, settings.sampling)


def _check_estimators(settings: StudySettings) -> None:
    """Every estimator that is named is there, MI/SO among them, and one with curves among the drawn."""
    own, compared = settings.estimators, settings.estimator_errors.estimators
    for name in (*own, *settings.monte_carlo.estimators, *compared):
        expect(name in ESTIMATORS, f"there is no estimator {name!r}; known are {', '.join(ESTIMATORS)}")
    expect("miso" in own, "estimators lacks 'miso', whose coherences are drawn of every case")
    expect("miso" in compared, "estimator_errors.estimators lacks 'miso', which the others are compared with")
    drawn: dict[str, Sequence[str]] = {f"drawn.{kind}": names for kind, names in settings.drawn}
    for kind, names in drawn.items():
        for name in names:
            expect(name in own, f"{kind} names {name!r}, which is not among the estimators")
        without = f"{kind} is [{', '.join(names)}], of which none has curves of every case"
        expect(set(names) & set(CURVES), f"{without}; one of {', '.join(CURVES)} is needed")


def _check_excitation(place: str, excitation: ExcitationSettings, sampling: Sampling) -> None:
    own = ("kind", "seed", "periods", *SETTINGS[excitation.kind])
    for key in excitation.plain():
        nothing = f"{place} has {key}, which means nothing to a {excitation.kind}; it may have {', '.join(own)}"
        expect(key in own, nothing)
    expect(excitation.seed is not None, f"{place}: 'seed' is missing; expected a whole number of 0 or more")
    with at(place):
        theoretical_autospectrum(excitation.at_level(1.0), np.zeros(1), sampling.samples, sampling.dt)


def check_periods(excitation: ExcitationSettings, settings: StudySettings) -> None:
    """Whether there are periods for those estimators that stand on them."""
    needed, periods = settings.settle_periods + 4, excitation.periods or 1
    expect(
        "errors_in_variables" not in settings.estimators or periods >= needed,
        f"the excitation has {periods} period{'s' if periods > 1 else ''}; the estimator errors_in_variables needs "
        f"settle_periods and four more, {needed}",
    )


def check_reached(excitation: ExcitationSettings, settings: StudySettings) -> None:
    """Whether a force reaches over the lines that parameters are fitted to: beyond it there is only leakage."""
    force, high, line = excitation.at_level(1.0), settings.fit_band[1], settings.resolution
    begun = f"fit_band of config.yaml is {list(settings.fit_band)}; the excitation"
    expect(high <= force.highest, f"{begun} has nothing above {force.highest:g} Hz, where the band must end or before")
    expect(
        high - force.lowest >= LINES * line,
        f"{begun} begins at {force.lowest:g} Hz, and four lines of {line:g} Hz or more must lie above",
    )


def check_model(path: Path, also_assumed: str, settings: StudySettings) -> Model:
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


def check_tolerances(tolerances: Tolerances, models: Path, cases: Sequence[str]) -> None:
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


def check_claims(settings: StudySettings) -> None:
    """Whether the claims can be judged under these settings."""
    known, force = ", ".join(settings.excitations), settings.excitations.get(JUDGED)
    if force is None:
        raise StudyError(f"excitations names {known}, not {JUDGED!r}; the claims judge a force of this name, a {KIND}")
    _check_force(force, settings.sampling)
    with at(f"excitations.{JUDGED}"):
        check_reached(force, settings)
    (low, high), (first, last) = settings.fit_band, LOOKED_AT
    below = first - settings.resolution  # the lowest line has a neighbour
    expect(
        low <= below and high >= last,
        f"fit_band is {list(settings.fit_band)}; the claims look at lines from {first:g} to {last:g} Hz, so that "
        f"it must begin at {below:.4g} Hz or below and end at {last:g} Hz or above",
    )
    _check_segments(settings)


def _check_force(force: ExcitationSettings, sampling: Sampling) -> None:
    expect(
        force.kind == KIND,
        f"excitations.{JUDGED}.kind is {force.kind!r}; the claims judge a {KIND} there, "
        "and a force of another kind needs a name of its own",
    )
    expect(
        force.reading,
        f"excitations.{JUDGED} has no reading, which the claims name; "
        f"it may be {' or '.join(READINGS)}, what unit variance refers to",
    )
    for kind in SETTINGS:  # Section 6 holds for any spectrum: the claims put each in its place
        other = force.model_copy(update={"kind": kind})
        with at(f"the claims put a {kind} in place of excitations.{JUDGED}"):
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
    advice = f"expected {right}" if right >= SHORTEST else "expected a longer record"
    raise StudyError(
        f"segments.length is {length}; the claims cut segments of {LONGER} times that too, which a "
        f"record of {samples} samples must hold for more than {INPUTS} averages: {advice}"
    )
