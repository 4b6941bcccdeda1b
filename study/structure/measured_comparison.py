"""A structure with a measured linear part held against a record: modes, coefficients, and the error of its free run."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from study.compare.prediction import Prediction
from study.equations import model_file
from study.equations.model import Model, ModelTerm
from study.equations.place import place_in_words
from study.records.prepared import Prepared
from study.structure.measured_fit import MeasuredFit, fit_measured, fit_with_term
from study.structure.measured_prediction import predict_measured
from study.structure.measured_screening import screened_by_lines
from study.structure.measured_spectra import CoefficientSpectrum, coefficient_spectra
from study.support.arrays import Floats
from study.support.errors import DivergenceError, expect
from study.support.numbers import percent

ASIDE = (0.9, 0.95, 1.05, 1.1)  # of a shape parameter: where fits begin beside what the screening found


@dataclass(frozen=True, eq=False)
class MeasuredModes:
    """Modes of the linear part without coupling by damping, the slowest first; standard errors beside.

    Attributes
    ----------
    frequency, frequency_error : array, shape (modes,)
        Natural frequencies in hertz.
    damping, damping_error : array, shape (modes,)
        Damping ratios.
    shape : array, shape (modes, points)
        Amplitudes for a modal mass of one, in 1/sqrt(kg).
    """

    frequency: Floats
    frequency_error: Floats
    damping: Floats
    damping_error: Floats
    shape: Floats


@dataclass(frozen=True, eq=False)
class MeasuredComparison:
    """A model with ``linear: measured`` held against one record."""

    model: Model  # as it was given
    prepared: Prepared
    fit: MeasuredFit
    modes: MeasuredModes
    prediction: Prediction
    spectra: tuple[CoefficientSpectrum, ...]
    notes: tuple[str, ...]


def compare_measured(
    model: Model, prepared: Prepared, progress: Callable[[str], None] | None = None
) -> MeasuredComparison:
    """Fit modes and what the terms leave open to one part of a record and judge the free run on the other.

    Shape parameters that are open are searched for along the lines of the record.

    Raises
    ------
    StudyError
        If the model cannot be fitted.
    """
    report: Callable[[str], None] = progress or (lambda _: None)
    report("modes")
    fit = _first_fit(model, prepared)
    report("free run")
    prediction = predict_measured(fit, prepared)
    report("coefficients by frequency")
    notes = list(prepared.notes)
    if not fit.converged:
        notes.append(f"the fit has not converged: {fit.message}")
    return MeasuredComparison(
        model, prepared, fit, modes_measured(fit), prediction, coefficient_spectra(fit, prepared), tuple(notes)
    )


def _first_fit(model: Model, prepared: Prepared) -> MeasuredFit:
    """The fit of a model; of terms with an open shape parameter one after the other, beside those before."""
    unknown = [t for t in model.terms if None in t.parameters]
    known = replace(model, terms=tuple(t for t in model.terms if t not in unknown))
    fit = fit_measured(known, prepared)
    for entry in unknown:
        found = screened_by_lines(known, prepared, [entry], fit.residual, fit.modal.modes)
        expect(found, f"{entry.name} explains nothing of {prepared.record.name!r}; expected an effect that does")
        fit, known = _beside_minima(known, found[0].entry, prepared), known.with_term(entry)
        known = known.with_values({k: fit.values[k] for k in entry.keys[len(entry.symbols) :]})
    return fit


def _beside_minima(known: Model, entry: ModelTerm, prepared: Prepared) -> MeasuredFit:
    """The best of fits from the shape that the screening found and from shapes a little aside.

    Along a gap or a dead band the misfit has kinks, and a local minimum between any two.
    """
    fits: list[MeasuredFit] = []
    for factor in (1.0, *ASIDE):
        shape = tuple(factor * (value or 0.0) for value in entry.parameters)
        with suppress(DivergenceError):
            fits.append(fit_with_term(known, replace(entry, parameters=shape), prepared))
    expect(fits, f"no values of {entry.name} let it follow {prepared.record.name!r}; expected them in the model file")
    return min(fits, key=lambda fit: float(np.mean((fit.residual / prepared.scale) ** 2)))


def modes_measured(fit: MeasuredFit) -> MeasuredModes:
    """Modes of the linear part of a fit, with errors to first order."""
    modal, n = fit.modal, fit.modal.modes
    w2 = np.array([fit.values[key] for key in modal.stiffness])
    own = [key for (r, s), key in zip(modal.pairs, modal.damping, strict=True) if r == s]
    g, omega = np.array([fit.values[key] for key in own]), np.sqrt(w2)
    w2_error, g_error = (np.array([fit.error(key) for key in keys]) for keys in (modal.stiffness, own))
    shape = np.array([[fit.values[key] for key in modal.shape(point)] for point in modal.points]).T
    order = np.argsort(w2)[:n]
    return MeasuredModes(
        (omega / (2.0 * np.pi))[order], (w2_error / (2.0 * omega) / (2.0 * np.pi))[order], (g / (2.0 * omega))[order],
        (g_error / (2.0 * omega))[order], shape[order],
    )  # fmt: skip


def measured_document(comparison: MeasuredComparison) -> dict[str, Any]:
    """What ``comparison.json`` holds."""
    fit, prediction, prepared = comparison.fit, comparison.prediction, comparison.prepared
    model, modes = comparison.model, comparison.modes
    sensors = [str(s) for s in prepared.sensors]
    return {
        "record": prepared.record.name,
        "model": {
            "name": model.name, "coordinates": list(model.coordinates), "linear": "measured",
            "terms": [model_file.format_entry(t) for t in model.terms],
        },
        "error": {"response": prediction.error, "sensors": dict(zip(sensors, prediction.errors.tolist(), strict=True))},
        "noise_floor": {
            "response": prediction.floor, "sensors": dict(zip(sensors, prediction.floors.tolist(), strict=True)),
        },
        "coefficients": [
            {
                "key": key, "value": fit.values[key], "standard_error": fit.error(key) or None,
                "held": key not in fit.keys,
            }
            for key in model.values
        ],
        "modes": [
            {
                "frequency": float(modes.frequency[r]), "frequency_error": float(modes.frequency_error[r]),
                "damping": float(modes.damping[r]), "damping_error": float(modes.damping_error[r]),
                "shape": dict(zip(fit.modal.points, modes.shape[r].tolist(), strict=True)),
            }
            for r in range(len(modes.frequency))
        ],
        "by_frequency": [_plain(s) for s in comparison.spectra],
        "fit": {
            "samples": list(prepared.plan.fit), "judged": list(prepared.plan.judge), "converged": fit.converged,
            "message": fit.message,
        },
        "notes": list(comparison.notes), "says": measured_says(comparison),
    }  # fmt: skip


def _plain(spectrum: CoefficientSpectrum) -> dict[str, Any]:
    summary = {
        name: {"value": value, "standard_error": error}
        for name, (value, error) in (
            ("mean", spectrum.mean), ("imaginary", spectrum.imaginary), ("trend", spectrum.trend)
        )
    }  # fmt: skip
    return {
        "key": spectrum.key, **spectrum.place.plain(), **summary, "frequency": spectrum.frequency.tolist(),
        "real": spectrum.values.real.tolist(), "imaginary_part": spectrum.values.imag.tolist(),
        "standard_error": spectrum.error.tolist(),
    }  # fmt: skip


def measured_says(comparison: MeasuredComparison) -> str:
    """What a person wants to know, in sentences."""
    prediction = comparison.prediction
    said = [
        f"With {comparison.fit.modal.modes} modes of its own the free run leaves {percent(prediction.error)} of the "
        f"motion; noise alone would leave {percent(prediction.floor)}."
    ]
    for spectrum in comparison.spectra:
        (mean, error), (imaginary, wrong), (trend, slope) = spectrum.mean, spectrum.imaginary, spectrum.trend
        said.append(
            f"Line by line {spectrum.key} {place_in_words(spectrum.place)} is {mean:.4g} +- {error:.2g}, "
            f"its imaginary part {imaginary:.2g} +- {wrong:.2g} and its rise over the band {trend:.2g} +- {slope:.2g}, "
            "which are zero for a term that is the right one at the right place."
        )
    return " ".join(said)


def measured_summary(comparison: MeasuredComparison) -> str:
    """The tables that a person reads first, and the sentences below them."""
    from tabulate import tabulate

    prediction, fit, modes = comparison.prediction, comparison.fit, comparison.modes
    sensors = [
        [str(s), percent(e), percent(f)]
        for s, e, f in zip(comparison.prepared.sensors, prediction.errors, prediction.floors, strict=True)
    ]
    values = [
        [key, f"{fit.values[key]:.5g}", "held" if key not in fit.keys else f"{fit.error(key):.2g}"]
        for key in comparison.model.values
    ]
    shapes = [
        [f"{f:.4g} Hz", f"{fe:.2g}", percent(d), percent(de), *(f"{x:.3g}" for x in shape)]
        for f, fe, d, de, shape in zip(
            modes.frequency, modes.frequency_error, modes.damping, modes.damping_error, modes.shape, strict=True
        )
    ]
    heads = ["mode", "error", "damping", "error", *(f"at {p}" for p in fit.modal.points)]
    first, last = comparison.prepared.plan.fit, comparison.prepared.plan.judge
    parts = [
        f"model {comparison.model.name}, its linear part as measured: fitted to samples {first[0]} to {first[1]}, "
        f"judged on {last[0]} to {last[1]}",
        tabulate(sensors, ["sensor", "error", "noise floor"], tablefmt="simple", disable_numparse=True),
        tabulate(values, ["", "value", "standard error"], tablefmt="simple", disable_numparse=True),
        tabulate(shapes, heads, tablefmt="simple", disable_numparse=True), measured_says(comparison),
    ]  # fmt: skip
    return "\n\n".join(parts) + (f"\n({'; '.join(comparison.notes)})" if comparison.notes else "")


def measured_step(
    comparison: MeasuredComparison, added: str | None = None, dropped: str | None = None
) -> dict[str, Any]:
    """A comparison as a step of the history (``study.compare.history``); there is no error of the force."""
    prediction, document = comparison.prediction, measured_document(comparison)
    return {
        "terms": [t.name for t in comparison.model.terms], "added": added, "dropped": dropped,
        "record": comparison.prepared.record.name, "error": {"force": None, "response": prediction.error},
        "rms": float(np.sqrt(np.mean(prediction.misfit**2))), "unit": "",
        "noise_floor": {"response": prediction.floor}, "converged": comparison.fit.converged,
        "coefficients": document["coefficients"],
    }  # fmt: skip
