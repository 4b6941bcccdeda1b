"""Section 6: the conclusions."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force, theoretical_autospectrum
from study.reproduction.claims.common import COMBINED, LINEAR_PARTS, input_variances, noises, recovered
from study.reproduction.claims.evidence import Assumed, Drive, Ensemble, Evidence, Outcome
from study.reproduction.claims.judgement import Condition, at_least, claims, explained, together
from study.reproduction.claims.levels import PARTS
from study.reproduction.claims.reported import Reported
from study.reproduction.ensemble import threaded
from study.support.numbers import percent

Floats = NDArray[np.float64]
NONLINEAR_PART = {"duffing": "k3", "van_der_pol": "c3", "mathieu": "k_m", "dead_band": "k_dead_band"}
SPECTRA = {
    "Pierson-Moskowitz": "pierson_moskowitz",
    "random-phase multisine": "random_phase_multisine",
    "swept sine": "swept_sine",
}


def conclusion_3(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Two terms that the combined system does not have, assumed beside its own."""
    ensemble = evidence.ensemble(Drive(COMBINED), Assumed(plus=("quadratic_stiffness", "quintic_stiffness")))
    conditions = recovered(evidence, reported, ensemble, PARTS)
    for name in ("k2", "k5"):
        sample = ensemble.miso(name)
        met = abs(sample.mean) <= 2.0 * sample.scatter
        conditions.append(Condition(f"mean {name} within 2 standard deviations of zero", f"{name} {sample}", met))
    return conditions


def conclusion_4(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Other spectra, a periodic force, a sweep, and a strongly skewed force."""
    drives = {label: Drive(COMBINED, excitation=(("kind", kind),)) for label, kind in SPECTRA.items()}
    ensembles = {label: evidence.ensemble(drive) for label, drive in drives.items()}
    ensembles["squared Gaussian"] = _skewed(evidence)
    low, high = _force_from(evidence), evidence.settings.fit_band[1]
    excited = evidence.ensemble(drives["Pierson-Moskowitz"], Assumed(band=(low, high)))
    left = ", ".join(condition.measured for condition in recovered(evidence, reported, excited, PARTS))
    return explained(
        f"lines that the force hardly excites hold leakage; fitted from {low:.1f} Hz on, where the Pierson-Moskowitz "
        f"force begins, {left} are left; a sweep, which is not stationary, excites each line in one or two segments "
        "only",
        [together(label, recovered(evidence, reported, e, PARTS)) for label, e in ensembles.items()],
    )


def _force_from(evidence: Evidence) -> float:
    """Where the Pierson-Moskowitz autospectrum exceeds a tenth of its peak, in hertz."""
    sampling = evidence.settings.sampling
    frequency = np.linspace(0.01, 10.0, 1000)
    density = theoretical_autospectrum(Excitation("pierson_moskowitz"), frequency, sampling.samples, sampling.dt)
    return float(frequency[np.argmax(density > 0.1 * np.max(density))])


def squared(seed: int, samples: int, dt: float, cutoff: float) -> Floats:
    """A force of unit variance distributed as the square of a Gaussian: skewness 2.8, nothing above the cut-off."""
    values = force(Excitation(reading="filtered", cutoff=0.5 * cutoff), samples, dt, seed) ** 2
    return (values - np.mean(values)) / np.std(values)


def _skewed(evidence: Evidence) -> Ensemble:
    sampling, excitation = evidence.settings.sampling, evidence.settings.excitation
    model, integrator = evidence.model(Drive(COMBINED)), Integrator(**evidence.settings.integrator.model_dump())

    def outcome(seed: int) -> Outcome:
        values = squared(seed, sampling.samples, sampling.dt, excitation.at_level(1.0).cutoff)
        return evidence.analyse(model, simulate(model, values, sampling.dt, integrator))

    assert excitation.seed is not None  # records of the same excitation are simulated before
    own, *others = threaded(outcome, [excitation.seed, *evidence.seeds])
    return Ensemble(COMBINED, own, tuple(others))


def _parts(system: str) -> tuple[str, ...]:
    return (*LINEAR_PARTS, NONLINEAR_PART[system])


def conclusion_5_level(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Nonlinear systems at the lowest and the highest level of Section 5.3."""
    lowest, *_, highest = input_variances(reported)
    return [
        together(
            f"{system} at {level:g}", recovered(evidence, reported, evidence.at(system, level), _parts(system))
        )
        for system in ("duffing", "van_der_pol", "dead_band")
        for level in (lowest, highest)
    ]  # fmt: skip


def conclusion_5_noise(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Each parameter under the lowest noise within 5 %."""
    noise = noises(reported)[0]
    conditions: list[Condition] = []
    for name in PARTS:
        ratio = evidence.at(COMBINED, noise=noise).miso(name).scaled(1.0 / reported.table_1(COMBINED, name))
        text = f"{percent(noise)} noise: {name} {percent(ratio.mean - 1.0, '+.3g', ratio.error)}"
        conditions.append(Condition(f"mean {name} within 5 %", text, abs(ratio.mean - 1.0) <= 0.05, text))
    return explained("noise on u biases the reverse estimate, most where the response is weak", conditions)


def conclusion_6(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """The lowest level of Section 5.3."""
    ensemble = evidence.at(COMBINED, input_variances(reported)[0])
    yield at_least("linear coherence at the lowest level", ensemble.linear_coherence(), 0.95)
    yield from recovered(evidence, reported, ensemble, ("k3", "c3"))


def conclusion_7(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Every parameter of the four kinds."""
    return [
        together(system, recovered(evidence, reported, evidence.at(system), _parts(system)))
        for system in NONLINEAR_PART
    ]  # fmt: skip


CLAIMS = claims(conclusion_3, conclusion_4, conclusion_5_level, conclusion_5_noise, conclusion_6, conclusion_7)
