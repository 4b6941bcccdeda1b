"""Section 2 and Table 1: systems, force, integration, noise."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.equations.simulate import Integrator, simulate
from study.identify.estimators.base import true_parameters
from study.records.excitation import displacement_noise
from study.records.spectra import Segments, autospectrum
from study.reproduction.claims.common import TESTS_WRONG
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import Claim, Condition, at_least, conclude
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average, departure, gaussian_score, is_gaussian, kurtosis, share
from study.reproduction.preliminary import model_restoring_force

Floats = NDArray[np.float64]
SYSTEMS = ("linear", "duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", "dead_band", "extreme")
ERROR_FREE = 0.01  # "relatively error free": the integrator moves no parameter by more than this share
ROUNDED = 0.005  # Table 1 rounds f_n and zeta to two digits


def stiffness_gap(evidence: Evidence, reported: Reported) -> Claim:
    """(2.8): no stiffness within the gap, k beyond it."""
    model = evidence.model(Drive("dead_band"))
    gap, k = reported.table_1("dead_band", "u_g"), reported.table_1("dead_band", "k")
    u = np.linspace(-3.0 * gap, 3.0 * gap, 601)
    found = model_restoring_force(model, u, np.zeros_like(u), np.zeros_like(u))
    stated = k * (u - np.clip(u, -gap, gap))
    worst = float(np.max(np.abs(found - stated)))
    allowed = 1e-6 * k * gap
    return conclude(
        reported, "system_stiffness_gap",
        Condition(
            f"restoring force at rest within {allowed:.2g} N of k (u - u_g sgn u), zero within the gap",
            f"largest difference {worst:.2g} N", worst <= allowed,
            f"the model's restoring force differs by up to {worst:.2g} N from what Table 1's k and u_g give",
        ),
    )  # fmt: skip


def amplitude_nonlinear(evidence: Evidence, reported: Reported) -> Claim:
    """Doubling the force doubles the response of a system that is linear, the Mathieu included."""
    sampling = evidence.settings["sampling"]
    excess: dict[str, float] = {}
    for system in SYSTEMS:
        model, first = evidence.model(Drive(system)), evidence.records(Drive(system))[0]
        told = Integrator(**evidence.settings["integrator"])
        twice: Floats = simulate(model, 2.0 * first["force"], sampling["dt"], told)["displacement"]
        once: Floats = first["displacement"]
        excess[system] = float(np.sqrt(np.mean((twice - 2.0 * once) ** 2) / np.mean((2.0 * once) ** 2)))
    straight = ("linear", "mathieu")
    conditions = [
        Condition(
            f"{s}: departure from superposition {'below 1e-9' if s in straight else 'above 1 %'}",
            f"{s} {excess[s]:.2g}",
            excess[s] < 1e-9 if s in straight else excess[s] > 0.01,
        )
        for s in SYSTEMS
    ]
    return conclude(reported, "amplitude_nonlinear", *conditions)


def nyquist(evidence: Evidence, reported: Reported) -> Claim:
    """Half the sampling rate of the study and of the report."""
    dt, stated = evidence.settings["sampling"]["dt"], reported.value("nyquist")
    found, step = 0.5 / dt, reported.value("nyquist.dt")
    return conclude(
        reported, "nyquist",
        Condition(f"1 / (2 dt) equals {stated:g} Hz", f"{found:g} Hz", math.isclose(found, stated, rel_tol=1e-9)),
        Condition(f"dt equals {step:g} s", f"{dt:g} s", math.isclose(dt, step, rel_tol=1e-9)),
    )  # fmt: skip


def lowpass(evidence: Evidence, reported: Reported) -> Claim:
    """Averaged autospectrum of the force."""
    cutoff = reported.value("lowpass")
    spectra = [autospectrum(r["force"], r.dt, _segments(evidence)) for r in evidence.records(Drive("linear"))[1:]]
    frequency, mean = spectra[0][0], np.mean([s for _, s in spectra], axis=0)
    width = 2.0 * float(frequency[1])  # the Hann window's main lobe reaches two lines
    inside = (frequency > width) & (frequency < cutoff - width)
    level = average(mean[inside])
    found = departure(np.array([s[inside] for _, s in spectra]))
    above = float(np.sum(mean[frequency > cutoff + width]) / np.sum(mean))
    return conclude(
        reported, "lowpass",
        Condition(
            f"no line up to {cutoff:g} Hz off the mean by more than chance's {found.allowed:.2g} standard errors",
            f"{level:.4g} N^2/Hz, {found}", found.uniform,
        ),
        Condition(f"less than 1 % of the power above {cutoff:g} Hz", f"{above:.1g} of the power above", above < 0.01),
    )  # fmt: skip


def force_gaussian(evidence: Evidence, reported: Reported) -> Claim:
    """Kurtosis of the force."""
    records = evidence.records(Drive("linear"))
    shape = Sample(tuple(kurtosis(r["force"]) for r in records[1:]), kurtosis(records[0]["force"]))
    refused = share([not is_gaussian(r["force"]) for r in records[1:]])
    score = gaussian_score(records[0]["force"])
    return conclude(
        reported, "force_gaussian",
        Condition(
            f"a 5 % test refuses a Gaussian for at most {TESTS_WRONG:g} of the records",
            f"kurtosis {shape}; refused {refused.mean:.2g}; own record {score:+.2g} standard errors from 3",
            refused.mean <= TESTS_WRONG,
        ),
    )  # fmt: skip


def below_10_hz(evidence: Evidence, reported: Reported) -> Claim:
    """Share of the response's power below 10 Hz."""
    limit = reported.value("below_10_hz")

    def below(system: str) -> Sample:
        def one(displacement: Floats, dt: float) -> float:
            frequency, density = autospectrum(displacement, dt, _segments(evidence))
            return float(np.sum(density[frequency <= limit]) / np.sum(density))

        return evidence.each(Drive(system), lambda r: one(r["displacement"], r.dt))

    return conclude(
        reported, "below_10_hz",
        *(at_least(f"{s}: share of the displacement's power below {limit:g} Hz", below(s), 0.99) for s in SYSTEMS),
    )  # fmt: skip


def error_free(evidence: Evidence, reported: Reported) -> Claim:
    """What the integrator does alone, from ``results/integrator_steps.csv``."""
    own = [r for r in evidence.integrator_steps if (r["method"], r["steps_per_sample"]) == ("abm4", 1)]
    reading = evidence.integrator_steps[0]["reading"]  # the study's own stands first
    moved = [_moved([r for r in own if r["reading"] == reading], name) for name in ("k", "f_n", "m", "c", "zeta")]
    conditions = [condition for _, condition in sorted(moved, key=lambda m: -m[0])]
    return conclude(
        reported, "error_free", *conditions, *_lost(own),
        because="the integrator's amplitude and phase errors within the band act as mass and as negative damping, "
        "and only more steps a sample take them away",
    )  # fmt: skip


def _moved(rows: Sequence[Mapping[str, Any]], name: str) -> tuple[float, Condition]:
    """The largest error that the integrator makes in a parameter of any system, and whether it is small."""
    finite = [r for r in rows if r["parameter"] == name and math.isfinite(r["relative_error"])]
    worst = max(finite, key=lambda r: abs(r["relative_error"]))
    error, spread = worst["relative_error"], worst["standard_error"] / abs(worst["true"])
    found = f"{name} {100 * error:+.3g} +- {100 * spread:.1g} % ({worst['system']})"
    return abs(error), Condition(
        f"largest error of {name} over the systems at most {100 * ERROR_FREE:g} %",
        found, abs(error) <= ERROR_FREE, f"one step a sample moves {found}",
    )  # fmt: skip


def _lost(rows: Sequence[Mapping[str, Any]]) -> list[Condition]:
    """A condition that fails for every system with runs that diverge, by either reading of unit variance.

    There is none where all runs stay finite: that alone makes no run free of error.
    """
    lost = {(r["system"], r["reading"]): (r["diverged"], r["seeds"]) for r in rows if r["diverged"] > 0}
    return [
        Condition("no run diverges", text, False, text)
        for (system, reading), (diverged, seeds) in lost.items()
        for text in [f"{diverged} of {seeds} runs of {system} diverge (unit variance {reading})"]
    ]


def noise_uncorrelated(evidence: Evidence, reported: Reported) -> Claim:
    """Correlation of force and noise, whiteness and shape of the noise."""
    clean = evidence.records(Drive("duffing_van_der_pol"))[1:]
    fraction = reported.value("noise_random_only.middle")
    pairs = [
        (r, displacement_noise(r["displacement"], fraction, s)) for r, s in zip(clean, evidence.seeds, strict=True)
    ]
    correlation = Sample(tuple(float(np.corrcoef(r["force"], n)[0, 1]) for r, n in pairs))
    spectra = [autospectrum(n / np.std(n), r.dt, _segments(evidence))[1][2:-2] for r, n in pairs]
    found = departure(np.array(spectra))
    refused = share([not is_gaussian(n) for _, n in pairs])
    return conclude(
        reported, "noise_uncorrelated",
        Condition(
            "mean correlation with the force within 3 standard errors of zero", f"correlation {correlation}",
            abs(correlation.mean) <= 3.0 * correlation.error,
        ),
        Condition(
            f"no line of the spectrum off the mean by more than chance's {found.allowed:.2g} standard errors",
            str(found), found.uniform,
        ),
        Condition(
            f"a 5 % test refuses a Gaussian for at most {TESTS_WRONG:g} of the records",
            f"refused {refused.mean:.2g}", refused.mean <= TESTS_WRONG,
        ),
    )  # fmt: skip


def table_1(evidence: Evidence, reported: Reported) -> Claim:
    """The model files hold Table 1, and its f_n and zeta follow from its k and c."""
    conditions: list[Condition] = []
    for system in SYSTEMS:
        values = evidence.model(Drive(system)).values
        found = true_parameters(values)
        rows = [s for s in reported.statements.values() if s.id.startswith(f"table_1.{system}.")]
        wrong = [
            f"{name} {found.get(name, 0.0):.6g} for {s.value:.6g}"
            for s in rows
            if s.value is not None
            and not math.isclose(
                found.get(name := s.id.split(".")[-1], 0.0), s.value,
                rel_tol=ROUNDED if name in ("f_n", "zeta") else 1e-9, abs_tol=1e-12,
            )
        ]  # fmt: skip
        conditions.append(
            Condition(
                f"{system}: k, c and nonlinear parameters equal, f_n and zeta within {100 * ROUNDED:g} %",
                f"{system}: {'equal' if not wrong else ', '.join(wrong)}", not wrong,
                f"models/{system}.yaml differs from Table 1 in {', '.join(wrong)}",
            )
        )  # fmt: skip
    return conclude(reported, "table_1", *conditions)


def exact_stiffness(evidence: Evidence, reported: Reported) -> Claim:
    """Section 5.2.1 names another exact stiffness than Table 1."""
    stated, table = reported.value("exact_stiffness"), reported.table_1("linear", "k")
    model = evidence.model(Drive("linear")).values["k"] or 0.0
    modal = reported.table_1("linear", "m") * (2.0 * math.pi * reported.table_1("linear", "f_n")) ** 2
    return conclude(
        reported, "exact_stiffness",
        Condition(
            "the exact stiffness equals that of Table 1 and of (2 pi f_n)^2 m to four digits",
            f"Table 1 {table:g}, (2 pi f_n)^2 m {modal:.1f}, model {model:g} N/m",
            all(math.isclose(stated, x, rel_tol=1e-4) for x in (table, modal, model)),
            f"Section 5.2.1 says {stated:g} where Table 1 says {table:g}, which (2 pi f_n)^2 m = {modal:.1f} confirms",
        ),
    )  # fmt: skip


def _segments(evidence: Evidence) -> Segments:
    return Segments(**evidence.settings["segments"])


CLAIMS = (
    stiffness_gap, amplitude_nonlinear, nyquist, lowpass, force_gaussian, below_10_hz, error_free,
    noise_uncorrelated, table_1, exact_stiffness,
)  # fmt: skip
