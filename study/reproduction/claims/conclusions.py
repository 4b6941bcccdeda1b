"""Section 6: the conclusions."""

import numpy as np
from numpy.typing import NDArray

from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force, theoretical_autospectrum
from study.reproduction.claims.common import recovered
from study.reproduction.claims.damping import COMBINED
from study.reproduction.claims.duffing import LINEAR_PARTS, levels
from study.reproduction.claims.evidence import Assumed, Drive, Ensemble, Evidence, Outcome
from study.reproduction.claims.judgement import Claim, Condition, at_least, conclude, together
from study.reproduction.claims.levels import PARTS, noises
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample
from study.reproduction.ensemble import threaded

Floats = NDArray[np.float64]
ALL_PARTS = {
    "duffing": (*LINEAR_PARTS, "k3"),
    "van_der_pol": (*LINEAR_PARTS, "c3"),
    "mathieu": (*LINEAR_PARTS, "k_m"),
    "dead_band": (*LINEAR_PARTS, "k_dead_band"),
}
SPECTRA = {
    "Pierson-Moskowitz": (("kind", "pierson_moskowitz"),),
    "random-phase multisine": (("kind", "random_phase_multisine"),),
    "swept sine": (("kind", "swept_sine"),),
}


def conclusion_3(evidence: Evidence, reported: Reported) -> Claim:
    """Two terms that the combined system does not have, assumed beside its own."""
    more = ("quadratic_stiffness", "quintic_stiffness")
    ensemble = evidence.ensemble(Drive(COMBINED), Assumed(plus=more))
    found = recovered(evidence, reported, COMBINED, ensemble, PARTS)
    extra: list[Condition] = []
    for name in ("k2", "k5"):
        sample = ensemble.miso(name)
        inside = abs(sample.mean) <= 2.0 * sample.scatter
        extra.append(Condition(f"mean {name} within 2 standard deviations of zero", f"{name} {sample}", inside))
    return conclude(reported, "conclusion_3", *found, *extra)


def conclusion_4(evidence: Evidence, reported: Reported) -> Claim:
    """Other spectra, a periodic force, a sweep, and a strongly skewed force."""
    conditions: list[Condition] = []
    for label, excitation in SPECTRA.items():
        ensemble = evidence.ensemble(Drive(COMBINED, excitation=excitation), Assumed())
        conditions.append(together(label, recovered(evidence, reported, COMBINED, ensemble, PARTS)))
    skewed = recovered(evidence, reported, COMBINED, _skewed(evidence), PARTS)
    conditions.append(together("squared Gaussian", skewed))
    low, (_, high) = _force_from(evidence), evidence.settings["fit_band"]
    drive = Drive(COMBINED, excitation=SPECTRA["Pierson-Moskowitz"])
    there = recovered(evidence, reported, COMBINED, evidence.ensemble(drive, Assumed(band=(low, high))), PARTS)
    return conclude(
        reported, "conclusion_4", *conditions,
        because="lines that the force hardly excites hold leakage; fitted from "
        f"{low:.1f} Hz on, where the Pierson-Moskowitz force begins, {', '.join(c.measured for c in there)} are left; "
        "a sweep, which is not stationary, excites each line in one or two segments only",
    )  # fmt: skip


def _force_from(evidence: Evidence) -> float:
    """Where the Pierson-Moskowitz autospectrum exceeds a tenth of its peak, in hertz."""
    sampling = evidence.settings["sampling"]
    frequency = np.linspace(0.01, 10.0, 1000)
    density = theoretical_autospectrum(Excitation("pierson_moskowitz"), frequency, sampling["samples"], sampling["dt"])
    return float(frequency[np.argmax(density > 0.1 * np.max(density))])


def squared(seed: int, samples: int, dt: float, cutoff: float) -> Floats:
    """A force of unit variance distributed as the square of a Gaussian: skewness 2.8, nothing above the cut-off."""
    values = force(Excitation(reading="filtered", cutoff=0.5 * cutoff), samples, dt, seed) ** 2
    return (values - np.mean(values)) / np.std(values)


def _skewed(evidence: Evidence) -> Ensemble:
    sampling, settings = evidence.settings["sampling"], evidence.settings["excitations"]["report"]
    model, told = evidence.model(Drive(COMBINED)), Integrator(**evidence.settings["integrator"])

    def one(seed: int) -> Outcome:
        values = squared(seed, sampling["samples"], sampling["dt"], settings.get("cutoff", 12.5))
        return evidence.analyse(model, simulate(model, values, sampling["dt"], told))

    own, *others = threaded(one, [settings["seed"], *evidence.seeds])
    return Ensemble(own, tuple(others))


def conclusion_5_level(evidence: Evidence, reported: Reported) -> Claim:
    """Nonlinear systems at the levels of Section 5.3."""
    conditions: list[Condition] = []
    for system in ("duffing", "van_der_pol", "dead_band"):
        for level in (levels(reported)[0], levels(reported)[-1]):
            ensemble = evidence.at(system, level)
            found = recovered(evidence, reported, system, ensemble, ALL_PARTS[system])
            conditions.append(together(f"{system} at {level:g}", found))
    return conclude(reported, "conclusion_5_level", *conditions)


def conclusion_5_noise(evidence: Evidence, reported: Reported) -> Claim:
    """Each parameter under the lowest noise within 5 %."""
    noise = noises(reported)[0]
    ensemble = evidence.at(COMBINED, 1.0, noise)
    conditions: list[Condition] = []
    for name in PARTS:
        true = reported.table_1(COMBINED, name)
        sample: Sample = ensemble.miso(name).scaled(1.0 / true)
        text = f"{100 * noise:g} % noise: {name} {100 * (sample.mean - 1):+.3g} +- {100 * sample.error:.1g} %"
        conditions.append(Condition(f"mean {name} within 5 %", text, abs(sample.mean - 1.0) <= 0.05, text))
    return conclude(
        reported, "conclusion_5_noise", *conditions,
        because="noise on u biases the reverse estimate, most where the response is weak",
    )  # fmt: skip


def conclusion_6(evidence: Evidence, reported: Reported) -> Claim:
    """The lowest level of Section 5.3."""
    ensemble = evidence.at(COMBINED, levels(reported)[0])
    return conclude(
        reported, "conclusion_6",
        at_least("linear coherence at the lowest level", ensemble.linear_coherence(), 0.95),
        *recovered(evidence, reported, COMBINED, ensemble, ("k3", "c3")),
    )  # fmt: skip


def conclusion_7(evidence: Evidence, reported: Reported) -> Claim:
    """Every parameter of the four kinds."""
    conditions: list[Condition] = []
    for system, names in ALL_PARTS.items():
        conditions.append(together(system, recovered(evidence, reported, system, evidence.unit(system), names)))
    return conclude(reported, "conclusion_7", *conditions)


CLAIMS = (conclusion_3, conclusion_4, conclusion_5_level, conclusion_5_noise, conclusion_6, conclusion_7)
