"""Tables and figures of a case whose linear part is as measured."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from study.equations.mass_matrix import matrices
from study.equations.model import Model
from study.figures import frequency_response, page
from study.figures.curves import InputResponse, ResponseCurve
from study.records.record import MOTIONS, Sensor
from study.records.spectra import cross_spectra
from study.reproduction.tables import PARAMETER_COLUMNS, stacked
from study.structure.measured_comparison import MeasuredComparison
from study.structure.measured_fit import MeasuredFit
from study.structure.modes import modes_of
from study.structure.places import transfer
from study.structure.structure_study import StructureCase, StructureSettings
from study.support.arrays import Complexes, Floats

ESTIMATOR = "output_error"
COLUMNS = [
    "quantity",
    "place",
    "unit",
    "frequency",
    "estimator",
    "real",
    "imag",
    "standard_error",
    "exact_real",
    "exact_imag",
]
LEAKED = 3  # lines of a window, next to the end of the band that is driven
COEFFICIENT, TRANSFER = "coefficient", "transfer function"


def measured_parameters(
    case: StructureCase, truth: Model, comparison: MeasuredComparison, settings: StructureSettings
) -> pd.DataFrame:
    """Coefficients with their tolerance, then natural frequencies and damping ratios beside the exact ones."""
    fit, modes, exact = comparison.fit, comparison.modes, modes_of(truth)
    allowed, rows = settings.tolerances.measured.coefficient, list[tuple[Any, ...]]()
    for key in comparison.model.values:
        true, value = truth.numbers()[key], fit.values[key]
        off = value / true - 1.0
        rows.append((case.case, ESTIMATOR, key, true, value, fit.error(key), off, allowed, abs(off) <= allowed, ""))
    for r, frequency in enumerate(modes.frequency.tolist()):
        k = int(np.argmin(np.abs(exact.frequency - frequency)))
        pairs = (("f_n", exact.frequency, modes.frequency, modes.frequency_error),
                 ("zeta", exact.damping, modes.damping, modes.damping_error))  # fmt: skip
        for name, true, found, error in pairs:
            off = float(found[r] / true[k]) - 1.0
            rows.append(
                (case.case, ESTIMATOR, f"{name}[{k + 1}]", float(true[k]), float(found[r]), float(error[r]), off,
                 np.nan, "", "")
            )  # fmt: skip
    return pd.DataFrame(rows, columns=PARAMETER_COLUMNS)


def measured_responses(
    case: StructureCase, truth: Model, comparison: MeasuredComparison, settings: StructureSettings
) -> pd.DataFrame:  # fmt: skip
    """Coefficients line by line, and transfer functions of the linear part: SI/SO, the modes', and the exact ones."""
    parts: list[tuple[Any, ...]] = []
    units = {
        key: t.term.unit(s, "N", "m") for t in truth.terms for key, s in zip(t.symbols, t.term.symbols, strict=True)
    }
    for spectrum in comparison.spectra:
        values, true = spectrum.values, truth.numbers()[spectrum.key]
        parts.append(
            (COEFFICIENT, spectrum.key, units[spectrum.key], spectrum.frequency, "instrumental", values.real,
             values.imag, spectrum.error, true, 0.0)
        )  # fmt: skip
    prepared, cut = comparison.prepared, settings.segments.segments()
    (name, where), *_ = truth.forces
    sensors = tuple(Sensor(s.coordinate, MOTIONS[0]) for s in prepared.sensors)
    matrix = cross_spectra([prepared.record[name], *prepared.measured.T], prepared.dt, cut)
    f = matrix.frequency
    inside = (f > 0.0) & (f < case.cutoff - LEAKED * f[1])
    linear = transfer(matrices(truth, truth.numbers()), sensors, truth.coordinates, prepared.dt, cut.length)
    exact = linear[:, :, truth.coordinates.index(where)]
    found = matrix.density[:, 0, 1:] / matrix.density[:, :1, 0].real
    modal = modal_transfer(comparison.fit, [s.coordinate for s in sensors], where, f)
    for k, sensor in enumerate(sensors):
        for estimator, values in (("siso", found[:, k]), (ESTIMATOR, modal[:, k])):
            own, true = values[inside], exact[inside, k]
            parts.append(
                (TRANSFER, sensor.coordinate, "m/N", f[inside], estimator, own.real, own.imag, np.nan, true.real,
                 true.imag)
            )  # fmt: skip
    return stacked(COLUMNS, parts)


def modal_transfer(fit: MeasuredFit, places: list[str], where: str, frequency: Floats) -> Complexes:
    """Displacement at each place by a force at another, from the modes; shape (lines, places)."""
    modal, n = fit.modal, fit.modal.modes
    s = 2j * np.pi * frequency[:, None, None]
    damping = np.zeros((n, n))
    for (r, c), key in zip(modal.pairs, modal.damping, strict=True):
        damping[r, c] = damping[c, r] = fit.values[key]
    stiffness = np.diag([fit.values[key] for key in modal.stiffness])
    push = np.array([fit.values[key] for key in modal.shape(where)])
    moved = np.linalg.solve(s**2 * np.eye(n) + s * damping + stiffness, push[:, None])[:, :, 0]
    felt = np.array([[fit.values[key] for key in modal.shape(place)] for place in places])
    return np.asarray(moved @ felt.T, dtype=np.complex128)


def measured_figure(table: pd.DataFrame, title: str) -> Figure:
    """Every coefficient by frequency, which must be real and flat, and the linear part at every sensor."""
    groups = dict.fromkeys((str(q), str(p)) for q, p in zip(table["quantity"], table["place"], strict=True))
    figure, axes = page.empty_page(
        title, "Coefficients line by line, and transfer functions of the linear part", rows=len(groups), columns=2,
        width=page.width(2), legend_rows=page.rows_for(5), share=False,
    )  # fmt: skip
    names: list[str] = []
    for k, (quantity, place) in enumerate(groups):
        rows = table[(table["quantity"] == quantity) & (table["place"] == place)]
        item, (left, right) = _item(rows, k + 1), axes[2 * k : 2 * k + 2]
        if quantity == COEFFICIENT:
            unit = str(rows["unit"].iloc[0])
            frequency_response.real_and_imaginary(left, right, item, unit, frequency_response.common_span([item]))
            names += [f"{place}: real part", "imaginary part"]
        else:
            frequency_response.magnitude_panel(left, item, "m/N")
            left.set_ylabel("|H| (m/N)")
            frequency_response.phase_panel(right, item)
            right.set_ylabel("phase (deg)")
            names += [f"shaker to {place}: magnitude", "phase"]
        for panel in (left, right):
            panel.set_xlabel("frequency (Hz)" if k == len(groups) - 1 else "")
    page.letter(axes, names)
    page.shared_legend(figure, axes, bands=True)
    return figure


def _item(rows: pd.DataFrame, number: int) -> InputResponse:
    curves: list[ResponseCurve] = []
    for name in dict.fromkeys(str(e) for e in rows["estimator"]):
        own = rows[rows["estimator"] == name]
        curves.append(
            ResponseCurve(name, _of(own, "frequency"), _pair(own, ""), np.nan_to_num(_of(own, "standard_error")))
        )
    first = rows[rows["estimator"] == str(rows["estimator"].iloc[0])]
    return InputResponse(number, "u", tuple(curves), _of(first, "frequency"), _pair(first, "exact_"))


def _of(rows: pd.DataFrame, name: str) -> Floats:
    return rows[name].to_numpy(dtype=np.float64)


def _pair(rows: pd.DataFrame, prefix: str) -> Complexes:
    return (_of(rows, f"{prefix}real") + 1j * _of(rows, f"{prefix}imag")).astype(np.complex128)
