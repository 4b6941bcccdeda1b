"""Section 2 and Table 1: systems, force, integration, noise."""

import math
from collections.abc import Iterator

import numpy as np

from study.equations.simulate import Integrator, simulate
from study.identify.estimators.base import true_parameters
from study.records.excitation import displacement_noise
from study.records.spectra import autospectrum
from study.reproduction.claims.conditions import refused
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import Condition, at_least, claims, explained
from study.reproduction.claims.reported import COMBINED, SYSTEMS, Reported
from study.reproduction.claims.sample import (
    Sample,
    average,
    departure,
    gaussian_score,
    is_gaussian,
    kurtosis,
    share_of_power,
)
from study.reproduction.preliminary import model_restoring_force
from study.support.arrays import Floats
from study.support.numbers import percent

LINEAR_IN_FORCE = ("linear", "mathieu")


def system_stiffness_gap(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """(2.8): no stiffness within the gap, k beyond it."""
    gap, k = reported.table_1("dead_band", "u_g"), reported.table_1("dead_band", "k")
    u = np.linspace(-3.0 * gap, 3.0 * gap, 601)
    at_rest = model_restoring_force(evidence.model(Drive("dead_band")), u, np.zeros_like(u), np.zeros_like(u))
    worst = float(np.max(np.abs(at_rest - k * (u - np.clip(u, -gap, gap)))))
    allowed = 1e-6 * k * gap
    yield Condition(
        f"restoring force at rest within {allowed:.2g} N of k (u - u_g sgn u), zero within the gap",
        f"largest difference {worst:.2g} N", worst <= allowed,
        f"the model's restoring force differs by up to {worst:.2g} N from what Table 1's k and u_g give",
    )  # fmt: skip


def amplitude_nonlinear(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Doubling the force doubles the response of a system that is linear, the Mathieu included."""
    dt, integrator = evidence.settings.sampling.dt, Integrator(**evidence.settings.integrator.model_dump())
    for system in SYSTEMS:
        record, linear = evidence.records(Drive(system))[0], system in LINEAR_IN_FORCE
        doubled: Floats = 2.0 * record["displacement"]
        twice = simulate(evidence.model(Drive(system)), 2.0 * record["force"], dt, integrator)["displacement"]
        departs = float(np.sqrt(np.mean((twice - doubled) ** 2) / np.mean(doubled**2)))
        criterion = f"{system}: departure from superposition {'below 1e-9' if linear else 'above 1 %'}"
        yield Condition(criterion, f"{system} {departs:.2g}", departs < 1e-9 if linear else departs > 0.01)


def nyquist(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Half the sampling rate of the study and of the report."""
    dt, highest, step = evidence.settings.sampling.dt, reported.value("nyquist"), reported.value("nyquist.dt")
    own = 0.5 / dt
    yield Condition(f"1 / (2 dt) equals {highest:g} Hz", f"{own:g} Hz", math.isclose(own, highest, rel_tol=1e-9))
    yield Condition(f"dt equals {step:g} s", f"{dt:g} s", math.isclose(dt, step, rel_tol=1e-9))


def lowpass(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Averaged autospectrum of the force."""
    cutoff = reported.value("lowpass")
    frequency, density = evidence.spectra(Drive("linear"), "force")
    mean: Floats = np.mean(density[1:], axis=0)
    width = 2.0 * float(frequency[1])  # the Hann window's main lobe reaches two lines
    inside = (frequency > width) & (frequency < cutoff - width)
    largest = departure(density[1:, inside])
    above = float(np.sum(mean[frequency > cutoff + width]) / np.sum(mean))
    yield Condition(
        f"no line up to {cutoff:g} Hz off the mean by more than chance's {largest.allowed:.2g} standard errors",
        f"{average(mean[inside]):.4g} N^2/Hz, {largest}", largest.uniform,
    )  # fmt: skip
    yield Condition(f"less than 1 % of the power above {cutoff:g} Hz", f"{above:.1g} of the power above", above < 0.01)


def force_gaussian(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Kurtosis of the force."""
    shape, score = (evidence.of_channel("linear", number, "force") for number in (kurtosis, gaussian_score))
    words = f"; own record {score.own:+.2g} standard errors from 3"
    yield _rarely_refused(reported, refused(evidence, "linear", "force"), f"kurtosis {shape}; ", words)


def _rarely_refused(reported: Reported, refusals: Sample, before: str = "", after: str = "") -> Condition:
    """A Gaussian is refused hardly more often than the level of the test allows."""
    most = reported.limit("tests_wrong")
    return Condition(
        f"a 5 % test refuses a Gaussian for at most {most:g} of the records",
        f"{before}refused {refusals.mean:.2g}{after}", refusals.mean <= most,
    )  # fmt: skip


def below_10_hz(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Share of the response's power below 10 Hz."""
    limit = reported.value("below_10_hz")
    for system in SYSTEMS:
        frequency, density = evidence.spectra(Drive(system))
        below = share_of_power(density, frequency <= limit)
        yield at_least(f"{system}: share of the displacement's power below {limit:g} Hz", below, 0.99)


def error_free(evidence: Evidence, reported: Reported) -> list[Condition]:
    """What the integrator does alone, from ``results/integrator_steps.csv``.

    A run that diverges fails, by either reading of unit variance; that all stay finite makes none free of error.
    """
    small, moved = reported.limit("error_free"), list[tuple[float, Condition]]()
    own = [r for r in evidence.integrator_steps if (r["method"], r["steps_per_sample"]) == ("abm4", 1)]
    reading = evidence.integrator_steps[0]["reading"]  # the study's own stands first
    for name in ("k", "f_n", "m", "c", "zeta"):
        rows = [r for r in own if r["reading"] == reading and r["parameter"] == name]
        worst = max((r for r in rows if math.isfinite(r["relative_error"])), key=lambda r: abs(r["relative_error"]))
        error, spread = worst["relative_error"], worst["standard_error"] / abs(worst["true"])
        text = f"{name} {percent(error, '+.3g', spread)} ({worst['system']})"
        criterion = f"largest error of {name} over the systems at most {percent(small)}"
        condition = Condition(criterion, text, abs(error) <= small, f"one step a sample moves {text}")
        moved.append((abs(error), condition))
    counts = {(r["system"], r["reading"]): f"{r['diverged']} of {r['seeds']}" for r in own if r["diverged"] > 0}
    lost = [f"{count} runs of {system} diverge (unit variance {of})" for (system, of), count in counts.items()]
    return explained(
        "the integrator's amplitude and phase errors within the band act as mass and as negative damping, and only "
        "more steps a sample take them away",
        [
            *(condition for _, condition in sorted(moved, key=lambda m: -m[0])),
            *(Condition("no run diverges", text, False, text) for text in lost),
        ],
    )


def noise_uncorrelated(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Correlation of force and noise, whiteness and shape of the noise."""
    records, fraction = evidence.records(Drive(COMBINED))[1:], reported.noises[1]
    noises = [displacement_noise(r["displacement"], fraction, s) for r, s in zip(records, evidence.seeds, strict=True)]
    pairs = list(zip(records, noises, strict=True))
    correlation = Sample(tuple(float(np.corrcoef(r["force"], n)[0, 1]) for r, n in pairs))
    spectra = [autospectrum(n / np.std(n), r.dt, evidence.segments)[1][2:-2] for r, n in pairs]
    largest = departure(np.array(spectra))
    yield Condition(
        "mean correlation with the force within 3 standard errors of zero", f"correlation {correlation}",
        abs(correlation.mean) <= 3.0 * correlation.error,
    )  # fmt: skip
    yield Condition(
        f"no line of the spectrum off the mean by more than chance's {largest.allowed:.2g} standard errors",
        str(largest), largest.uniform,
    )  # fmt: skip
    yield _rarely_refused(reported, Sample(tuple(float(not is_gaussian(n)) for n in noises)))


def table_1(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """The model files hold Table 1, and its f_n and zeta follow from its k and c."""
    rounded = reported.limit("rounded")
    for system in SYSTEMS:
        values, wrong = true_parameters(evidence.model(Drive(system)).values), list[str]()
        for statement in reported.statements.values():
            if statement.id.startswith(f"table_1.{system}.") and statement.value is not None:
                name = statement.id.split(".")[-1]
                value, rounding = values.get(name, 0.0), rounded if name in ("f_n", "zeta") else 1e-9
                if not math.isclose(value, statement.value, rel_tol=rounding, abs_tol=1e-12):
                    wrong.append(f"{name} {value:.6g} for {statement.value:.6g}")
        said = ", ".join(wrong)
        yield Condition(
            f"{system}: k, c and nonlinear parameters equal, f_n and zeta within {percent(rounded)}",
            f"{system}: {said or 'equal'}", not said, f"models/{system}.yaml differs from Table 1 in {said}",
        )  # fmt: skip


def exact_stiffness(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Section 5.2.1 names another exact stiffness than Table 1."""
    own, table = reported.value("exact_stiffness"), reported.table_1("linear", "k")
    model = evidence.model(Drive("linear")).values["k"] or 0.0
    modal = reported.table_1("linear", "m") * (2.0 * math.pi * reported.table_1("linear", "f_n")) ** 2
    yield Condition(
        "the exact stiffness equals that of Table 1 and of (2 pi f_n)^2 m to four digits",
        f"Table 1 {table:g}, (2 pi f_n)^2 m {modal:.1f}, model {model:g} N/m",
        all(math.isclose(own, x, rel_tol=1e-4) for x in (table, modal, model)),
        f"Section 5.2.1 says {own:g} where Table 1 says {table:g}, which (2 pi f_n)^2 m = {modal:.1f} confirms",
    )  # fmt: skip


SIMULATION_CLAIMS = claims(
    system_stiffness_gap, amplitude_nonlinear, nyquist, lowpass, force_gaussian, below_10_hz, error_free,
    noise_uncorrelated, table_1, exact_stiffness,
)  # fmt: skip
