"""A structure with a modal linear part held against a record: modes, coefficients, and the error of its free run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from study.compare.comparison_report import mode_rows
from study.compare.prediction import Prediction, predict
from study.equations import model_file
from study.equations.linear_part import Modes, modes_of, modes_table
from study.equations.model import Model
from study.equations.place import place_in_words
from study.identify.frequency_domain.coefficient_spectra import CoefficientSpectrum, coefficient_spectra
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise, uncertainty
from study.identify.time_domain.structure_start import first_fit
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.numbers import percent


@dataclass(frozen=True, eq=False)
class ModalComparison:
    """A model with ``linear: modal`` held against one record."""

    model: Model  # as it was given
    prepared: Prepared
    fit: FreeRunFit
    covariance: Floats  # of the estimates; shape (keys, keys)
    prediction: Prediction
    modes: Modes
    spectra: tuple[CoefficientSpectrum, ...]
    notes: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """Every coefficient, shape parameter and number of a mode."""
        return self.fit.model.numbers()

    def error(self, key: str) -> float:
        """Standard error of one of them; zero if it was held."""
        if key not in self.fit.keys:
            return 0.0
        i = self.fit.keys.index(key)
        return float(np.sqrt(self.covariance[i, i]))


def compare_modal(model: Model, prepared: Prepared, progress: Callable[[str], None] | None = None) -> ModalComparison:
    """Fit modes and what the terms leave open to one part of a record and judge the free run on the other.

    Shape parameters that are open are searched for along the lines of the record.

    Raises
    ------
    StudyError
        If the model cannot be fitted.
    """
    report: Callable[[str], None] = progress or (lambda _: None)
    report("modes")
    fit = finished(first_fit(model, prepared), prepared)
    covariance = uncertainty(fit, prepared, linearise(fit, prepared))[: len(fit.keys), : len(fit.keys)]
    report("free run")
    prediction = predict(fit, prepared)
    report("coefficients by frequency")
    notes = list(prepared.notes)
    if not fit.converged:
        notes.append(f"the fit has not converged: {fit.message}")
    return ModalComparison(
        model, prepared, fit, covariance, prediction, modes_of(fit.model, fit.keys, covariance),
        coefficient_spectra(fit, prepared), tuple(notes),
    )  # fmt: skip


def modal_document(comparison: ModalComparison) -> dict[str, Any]:
    """What ``comparison.json`` holds."""
    fit, prediction, prepared = comparison.fit, comparison.prediction, comparison.prepared
    model = comparison.model
    sensors = [str(s) for s in prepared.sensors]
    return {
        "record": prepared.record.name,
        "model": {
            "name": model.name, "coordinates": list(model.coordinates), "linear": "modal",
            "terms": [model_file.format_entry(t) for t in model.terms],
        },
        "error": {"response": prediction.error, "sensors": dict(zip(sensors, prediction.errors.tolist(), strict=True))},
        "noise_floor": {
            "response": prediction.floor, "sensors": dict(zip(sensors, prediction.floors.tolist(), strict=True)),
        },
        "coefficients": [
            {
                "key": key, "value": comparison.values[key], "standard_error": comparison.error(key) or None,
                "held": key not in fit.keys,
            }
            for key in model.values
        ],
        "modes": mode_rows(comparison.modes),
        "by_frequency": [_plain(s) for s in comparison.spectra],
        "fit": {
            "samples": list(prepared.plan.fit), "judged": list(prepared.plan.judge), "converged": fit.converged,
            "message": fit.message,
        },
        "notes": list(comparison.notes), "says": modal_says(comparison),
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


def modal_says(comparison: ModalComparison) -> str:
    """What a person wants to know, in sentences."""
    prediction = comparison.prediction
    said = [
        f"With {len(comparison.modes.frequency)} modes of its own the free run leaves {percent(prediction.error)} of "
        f"the motion; noise alone would leave {percent(prediction.floor)}."
    ]
    for spectrum in comparison.spectra:
        (mean, error), (imaginary, wrong), (trend, slope) = spectrum.mean, spectrum.imaginary, spectrum.trend
        said.append(
            f"Line by line {spectrum.key} {place_in_words(spectrum.place)} is {mean:.4g} +- {error:.2g}, "
            f"its imaginary part {imaginary:.2g} +- {wrong:.2g} and its rise over the band {trend:.2g} +- {slope:.2g}, "
            "which are zero for a term that is the right one at the right place."
        )
    return " ".join(said)


def modal_summary(comparison: ModalComparison) -> str:
    """The tables that a person reads first, and the sentences below them."""
    from tabulate import tabulate

    prediction, fit = comparison.prediction, comparison.fit
    sensors = [
        [str(s), percent(e), percent(f)]
        for s, e, f in zip(comparison.prepared.sensors, prediction.errors, prediction.floors, strict=True)
    ]
    values = [
        [key, f"{comparison.values[key]:.5g}", "held" if key not in fit.keys else f"{comparison.error(key):.2g}"]
        for key in comparison.model.values
    ]
    first, last = comparison.prepared.plan.fit, comparison.prepared.plan.judge
    parts = [
        f"model {comparison.model.name}, its linear part a sum of modes: fitted to samples {first[0]} to {first[1]}, "
        f"judged on {last[0]} to {last[1]}",
        tabulate(sensors, ["sensor", "error", "noise floor"], tablefmt="simple", disable_numparse=True),
        tabulate(values, ["", "value", "standard error"], tablefmt="simple", disable_numparse=True),
        modes_table(comparison.modes, comparison.model.coordinates), modal_says(comparison),
    ]  # fmt: skip
    return "\n\n".join(parts) + (f"\n({'; '.join(comparison.notes)})" if comparison.notes else "")


def modal_step(comparison: ModalComparison, added: str | None = None, dropped: str | None = None) -> dict[str, Any]:
    """A comparison as a step of the history (``study.compare.history``); there is no error of the force."""
    prediction, document = comparison.prediction, modal_document(comparison)
    return {
        "terms": [t.name for t in comparison.model.terms], "added": added, "dropped": dropped,
        "record": comparison.prepared.record.name, "error": {"force": None, "response": prediction.error},
        "rms": float(np.sqrt(np.mean(prediction.misfit**2))), "unit": "",
        "noise_floor": {"response": prediction.floor}, "converged": comparison.fit.converged,
        "coefficients": document["coefficients"],
    }  # fmt: skip
