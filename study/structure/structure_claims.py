"""What the study says of structures: SI/SO shows one nonlinear connection everywhere, MI/SO puts it where it is."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from study.equations.mass_matrix import matrices
from study.equations.model import Model
from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import cross_spectra
from study.reproduction.claims.judgement import SEPARATOR, Condition
from study.structure.measured_comparison import MeasuredComparison
from study.structure.places import transfer
from study.structure.reverse_tables import structure_parameters
from study.structure.structure_study import CaseResult, StructureCase, StructureFindings, StructureSettings
from study.support.numbers import percent

STATEMENTS = {
    "transfer_functions": "SI/SO: one nonlinear connection changes the transfer function to every coordinate",
    "placed": "MI/SO finds every coefficient, and nothing where nothing nonlinear is",
    "measured": "The linear part as measured: modes of its own and the nonlinear terms run free as the structure does",
    "reaction": "Two equations agree on what they share in MI/SO, and do not in SI/SO",
}


def structure_claims(
    case: StructureCase, record: Record, result: CaseResult, settings: StructureSettings
) -> pd.DataFrame:
    """Every claim on a case, a row each: what must hold, what was measured, the verdict."""
    conditions = {
        "transfer_functions": list(_transfer_functions(result.model, record, settings)),
        "placed": list(_placed(case, result, settings)),
        "reaction": list(_reaction(result.found, settings)),
    }
    return _table(case, conditions)


def measured_claims(
    case: StructureCase, truth: Model, comparison: MeasuredComparison, settings: StructureSettings
) -> pd.DataFrame:
    """The same of a case whose linear part is as measured."""
    return _table(case, {"measured": list(_measured(case, truth, comparison, settings))})


def _measured(
    case: StructureCase, truth: Model, comparison: MeasuredComparison, settings: StructureSettings
) -> Iterable[Condition]:
    allowed, fit = settings.tolerances.measured, comparison.fit
    for key in comparison.model.values:
        true, off = truth.numbers()[key], fit.values[key] / truth.numbers()[key] - 1.0
        met = abs(off) <= allowed.coefficient
        yield Condition(
            f"{key} within {percent(allowed.coefficient)} of {true:.6g}", f"{key} {percent(off, '+.2g')}", met
        )
    noise = float(np.sqrt(case.noise / (1.0 + case.noise)))
    error = comparison.prediction.error
    criterion = f"error of the free run at most {allowed.error:g} times the noise of {percent(noise)}"
    yield Condition(criterion, f"error {percent(error)}", error <= allowed.error * noise)


def _table(case: StructureCase, conditions: Mapping[str, list[Condition]]) -> pd.DataFrame:
    rows = [
        {
            "case": case.case, "claim": STATEMENTS[name], "criterion": SEPARATOR.join(c.criterion for c in held),
            "measured": SEPARATOR.join(c.measured for c in held), "verdict": _verdict([c.met for c in held]),
        }
        for name, held in conditions.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


def _verdict(met: Sequence[bool]) -> str:
    return "holds" if all(met) else "partly" if any(met) else "does not hold"


def _transfer_functions(model: Model, record: Record, settings: StructureSettings) -> Iterable[Condition]:
    """The best linear approximation of every motion by the force against that of the structure's linear part."""
    cut, limit = settings.segments.segments(), settings.claims.changed
    (name, where), *_ = model.forces
    sensors = tuple(Sensor(c, MOTIONS[0]) for c in model.coordinates)
    matrix = cross_spectra([record[name], *(record[s] for s in sensors)], record.dt, cut)
    linear = transfer(matrices(model, model.numbers()), sensors, model.coordinates, record.dt, cut.length)
    exact = linear[:, :, model.coordinates.index(where)]
    inside = (matrix.frequency >= settings.fit_band[0]) & (matrix.frequency <= settings.fit_band[1])
    found = matrix.density[:, 0, 1:] / matrix.density[:, :1, 0].real
    power = np.sum(np.abs(exact[inside]) ** 2, axis=0)
    off = np.sqrt(np.sum(np.abs(found[inside] - exact[inside]) ** 2, axis=0) / power)
    for sensor, share in zip(sensors, off.tolist(), strict=True):
        yield Condition(
            f"transfer function to {sensor.coordinate} off that of the linear part by {percent(limit)} or more",
            f"{sensor.coordinate} {percent(share)}", share >= limit,
        )  # fmt: skip


def _placed(case: StructureCase, result: CaseResult, settings: StructureSettings) -> Iterable[Condition]:
    table = structure_parameters(case.case, result, settings.tolerances)
    for _, row in table[table["estimator"] == "miso"].iterrows():
        true, value, allowed = (float(row[name]) for name in ("true", "estimate", "tolerance"))
        criterion = f"within {percent(allowed)} of {true:.6g}" if true else f"within +-{allowed:g} of zero"
        measured = percent(value / true - 1.0, "+.2g") if true else f"{value:+.2g}"
        key, met = str(row["parameter"]), bool(row["within_tolerance"])
        yield Condition(f"{key} {criterion}", f"{key} {measured}", met)


def _reaction(found: Mapping[str, StructureFindings], settings: StructureSettings) -> Iterable[Condition]:
    limit = settings.claims.by_chance
    for name, holds in (("miso", True), ("siso", False)):
        p = found[name].joint.least_p
        sign = "at least" if holds else "below"
        label = {"miso": "MI/SO", "siso": "SI/SO"}[name]
        yield Condition(
            f"{label}: probability that chance makes the largest difference {sign} {limit:g}", f"{label} {p:.2g}",
            (p >= limit) == holds,
        )  # fmt: skip
