"""What the report's claims, the estimators and the figures ask of the settings: no job shall end in want of it."""

from typing import Any

import numpy as np

from study.identify.estimators import ESTIMATORS
from study.records.excitation import READINGS, SETTINGS, Excitation, theoretical_autospectrum
from study.support.errors import StudyError

Table = dict[str, Any]
JUDGED, KIND = "report", "gaussian_lowpass"  # the force that the claims judge, Section 2.1
CURVES = ("siso", "miso", "local_polynomial", "instrumental", "output_error")  # have some of every case to be drawn
LOOKED_AT = (2.0, 4.0)  # hertz: where the claims read single lines, the Dead-Band's and the Mathieu's
LONGER, INPUTS = 4, 2  # the claims cut segments this many times as long too, and tell so many inputs apart in them
SHORTEST = 16  # samples in a segment, by the schema


def check_claims(settings: Table, where: str) -> None:
    """Whether the claims can be judged under these settings.

    Raises
    ------
    StudyError
        At the first thing that they lack, naming the value and what would be right.
    """
    _check_force(settings, where)
    _check_band(settings, where)
    _check_segments(settings, where)


def check_estimators(settings: Table, where: str) -> None:
    """Whether every estimator that is named is there, MI/SO among them, and one with curves among the drawn.

    Raises
    ------
    StudyError
        At the first that is not.
    """
    compared = settings["estimator_errors"]["estimators"]
    for name in (*settings["estimators"], *settings["monte_carlo"]["estimators"], *compared):
        if name not in ESTIMATORS:
            raise StudyError(f"{where}: there is no estimator {name!r}; known are {', '.join(ESTIMATORS)}")
    if "miso" not in settings["estimators"]:
        raise StudyError(f"{where}: estimators lacks 'miso', whose coherences are drawn of every case")
    if "miso" not in compared:
        raise StudyError(f"{where}: estimator_errors.estimators lacks 'miso', which the others are compared with")
    for kind, names in settings["drawn"].items():
        for name in names:
            if name not in settings["estimators"]:
                raise StudyError(f"{where}: drawn.{kind} names {name!r}, which is not among the estimators")
    _check_drawn(settings, where)


def check_periods(excitation: Table, settings: Table) -> None:
    """Whether there are periods for those estimators that stand on them.

    Raises
    ------
    StudyError
        If there are too few; the caller says of which force.
    """
    needed, periods = settings["settle_periods"] + 4, excitation.get("periods", 1)
    if "errors_in_variables" in settings["estimators"] and periods < needed:
        raise StudyError(
            f"the excitation has {periods} period{'s' if periods > 1 else ''}; the estimator errors_in_variables needs "
            f"settle_periods and four more, {needed}"
        )


def check_reached(excitation: Table, settings: Table) -> None:
    """Whether a force reaches over the lines that parameters are fitted to: beyond it there is only leakage.

    Raises
    ------
    StudyError
        If it does not; the caller says whose force it is.
    """
    low, high = settings["fit_band"]
    resolution = 1.0 / (settings["segments"]["length"] * settings["sampling"]["dt"])
    force = Excitation(**{key: value for key, value in excitation.items() if key != "seed"})
    if high > force.highest:
        raise StudyError(
            f"fit_band of config.yaml is [{low}, {high}]; the excitation has nothing above {force.highest:g} Hz, "
            "where the band must end or before"
        )
    if high - force.lowest < 4.0 * resolution:
        raise StudyError(
            f"fit_band of config.yaml is [{low}, {high}]; the excitation begins at {force.lowest:g} Hz, "
            f"and four lines of {resolution:g} Hz or more must lie above"
        )


def _check_drawn(settings: Table, where: str) -> None:
    """Whether every case has a curve to be drawn."""
    for kind, names in settings["drawn"].items():
        if not set(names) & set(CURVES):
            raise StudyError(
                f"{where}: drawn.{kind} is [{', '.join(names)}], of which none has curves of every case; "
                f"one of {', '.join(CURVES)} is needed"
            )


def _check_force(settings: Table, where: str) -> None:
    if JUDGED not in settings["excitations"]:
        known = ", ".join(settings["excitations"])
        raise StudyError(
            f"{where}: excitations names {known}, not {JUDGED!r}; the claims judge a force of this name, a {KIND}"
        )
    force, sampling = settings["excitations"][JUDGED], settings["sampling"]
    if force["kind"] != KIND:
        raise StudyError(
            f"{where}: excitations.{JUDGED}.kind is {force['kind']!r}; the claims judge a {KIND} there, "
            "and a force of another kind needs a name of its own"
        )
    if "reading" not in force:
        raise StudyError(
            f"{where}: excitations.{JUDGED} has no reading, which the claims name; "
            f"it may be {' or '.join(READINGS)}, what unit variance refers to"
        )
    for kind in SETTINGS:  # Section 6 holds for any spectrum: the claims put each in its place
        asked: Table = {key: value for key, value in force.items() if key != "seed"} | {"kind": kind}
        try:
            theoretical_autospectrum(Excitation(**asked), np.zeros(1), sampling["samples"], sampling["dt"])
        except StudyError as error:
            raise StudyError(f"{where}: the claims put a {kind} in place of excitations.{JUDGED}: {error}") from None


def _check_band(settings: Table, where: str) -> None:
    """The lines that the claims look at lie in the fit band, the lowest one with a neighbour below."""
    try:
        check_reached(settings["excitations"][JUDGED], settings)
    except StudyError as error:
        raise StudyError(f"{where}: excitations.{JUDGED}: {error}") from None
    (low, high), (first, last) = settings["fit_band"], LOOKED_AT
    resolution = 1.0 / (settings["segments"]["length"] * settings["sampling"]["dt"])
    if low > first - resolution or high < last:
        raise StudyError(
            f"{where}: fit_band is [{low}, {high}]; the claims look at lines from {first:g} to {last:g} Hz, so that "
            f"it must begin at {first - resolution:.4g} Hz or below and end at {last:g} Hz or above"
        )


def _check_segments(settings: Table, where: str) -> None:
    from study.records.spectra import Segments  # SciPy, for those alone who load a configuration

    told, samples = settings["segments"], settings["sampling"]["samples"]

    def enough(length: int) -> bool:
        longer: Table = {**told, "length": LONGER * length}
        cut = Segments(**longer)
        return samples >= cut.length and cut.effective_averages(samples) > INPUTS

    if enough(told["length"]):
        return
    right = told["length"] // 2
    while right >= SHORTEST and not enough(right):
        right //= 2
    advice = f"{right} is right" if right >= SHORTEST else "a longer record is right"
    raise StudyError(
        f"{where}: segments.length is {told['length']}; the claims cut segments of {LONGER} times that too, which a "
        f"record of {samples} samples must hold for more than {INPUTS} averages: {advice}"
    )
