"""Tables of structures: as those of a single mass (``tables``), equation by equation or by modes; and what is claimed.

Where nothing drives a coordinate, its A_j(f) are over the own mass; tables have them times the true one, in N.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from study.compare.comparison import Comparison
from study.equations.linear_part import modes_of, transfer
from study.equations.modal_part import ModalPart
from study.equations.model import Model
from study.equations.terms import LINEAR
from study.identify.frequency_domain.action_reaction import JointEstimate, joint_estimate
from study.identify.frequency_domain.conditioned import MisoResult
from study.identify.frequency_domain.inputs import Input
from study.identify.frequency_domain.reverse_system import ReverseSystem, equations_of, exact_responses, reverse_system
from study.records.prepared import prepare_record
from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import Segments, cross_spectra
from study.reproduction.cases import assumed_model, estimator_settings
from study.reproduction.claims.judgement import SEPARATOR, Condition, verdict
from study.reproduction.settings import IdentificationSettings
from study.reproduction.tables import (
    COHERENCE_COLUMNS,
    PARAMETER_COLUMNS,
    RESPONSE_COLUMNS,
    judge_estimate,
    stacked,
)
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.numbers import percent

WHERE = ["equation", "place"]  # what the tables of structures have beside
REACTION_COLUMNS = ["case", "estimator", "parameter", "first", "second", "in_first", "in_second", "error", "p_value"]
MODAL_COLUMNS = [
    "quantity", "place", "unit", "frequency", "estimator", "real", "imag", "standard_error", "exact_real", "exact_imag",
]  # fmt: skip
BY_MODES = "output_error"  # the estimator of a linear part as measured
LEAKED = 3  # lines of a window, next to the end of the band that is driven
COEFFICIENT, TRANSFER = "coefficient", "transfer function"
STATEMENTS = {
    "transfer_functions": "SI/SO: one nonlinear connection changes the transfer function to every coordinate",
    "placed": "MI/SO finds every coefficient, and nothing where nothing nonlinear is",
    "measured": "The linear part as measured: modes of its own and the nonlinear terms run free as the structure does",
    "reaction": "Two equations agree on what they share in MI/SO, and do not in SI/SO",
}


# ---- equation by equation


@dataclass(frozen=True, eq=False)
class EquationsFound:
    """What one estimator finds: equation by equation, and of all equations together."""

    system: ReverseSystem
    joint: JointEstimate


@dataclass(frozen=True, eq=False)
class CaseResult:
    """A case in reverse."""

    model: Model  # that is assumed, with the true values: zero of what the structure does not have
    found: Mapping[str, EquationsFound]  # by estimator


def identify_equations(model: Model, record: Record, settings: IdentificationSettings) -> CaseResult:
    """Every equation of a structure by every estimator of the settings."""
    assumed = assumed_model(model, settings.also_assumed)
    assumed = assumed.with_values({key: value or 0.0 for key, value in assumed.values.items()})
    equations, _ = equations_of(assumed, prepare_record(record), (0, len(record)))
    found: dict[str, EquationsFound] = {}
    for name in settings.estimators:
        system = reverse_system(name, equations, record.dt, estimator_settings(settings))
        try:
            found[name] = EquationsFound(system, joint_estimate(system))
        except StudyError as error:
            raise StudyError(f"{settings.case}, {name}: {error}") from None
    return CaseResult(assumed, found)


def input_place(item: Input) -> str:
    """Where an input acts: that of its coefficients, ``first-second``; several stand side by side."""
    labels = [p.symbol[p.symbol.index("[") + 1 : -1] for p in item.parts]
    return " and ".join(dict.fromkeys(labels))


def structure_parameters(result: CaseResult, settings: IdentificationSettings) -> pd.DataFrame:
    """Every coefficient of every estimator from all equations together, one row each."""
    rows: list[tuple[Any, ...]] = []
    for estimator, found in result.found.items():
        for key in found.joint.estimate.symbols:
            true, value = result.model.numbers()[key], found.joint.estimate[key]
            judged = judge_estimate(key[: key.index("[")], true, value, settings).values()
            rows.append((settings.case, estimator, key, true, value, found.joint.estimate.error(key), *judged, ""))
    return pd.DataFrame(rows, columns=PARAMETER_COLUMNS)


def structure_reactions(case: str, result: CaseResult) -> pd.DataFrame:
    """Every coefficient that stands in two equations, as each of them has it."""
    rows = [
        (case, estimator, r.key, *r.coordinates, *r.values, r.error, r.p_value)
        for estimator, found in result.found.items()
        for r in found.joint.reactions
    ]
    return pd.DataFrame(rows, columns=REACTION_COLUMNS)


def structure_responses(result: CaseResult) -> pd.DataFrame:
    """A_j(f) of every equation and estimator with its standard error and the exact function, in long form."""
    values, parts = result.model.numbers(), list[Sequence[Any]]()
    for estimator, found in result.found.items():
        for own in found.system.results:
            responses, scale = own.found.responses, 1.0 if own.mass is None else values[own.mass]
            assert responses is not None, "estimators of structures have frequency response functions"
            for j, (item, exact) in enumerate(zip(own.found.inputs, exact_responses(own, values), strict=True)):
                value, error = responses.response[j] * scale, np.sqrt(responses.covariance[:, j, j].real) * scale
                share: Floats | float = np.nan if own.independent is None else own.independent[:, j]
                parts.append(
                    (own.coordinate, input_place(item), responses.frequency, estimator, j + 1, item.shape, value.real,
                     value.imag, error, exact.real * scale, exact.imag * scale, share)
                )  # fmt: skip
    return stacked([*WHERE, *RESPONSE_COLUMNS, "independent"], parts)


def structure_coherences(result: CaseResult) -> pd.DataFrame:
    """Ordinary, partial, nonlinear and cumulative coherence of each input of each equation, in long form."""

    def words(name: str) -> str:  # of a placed term: cubic stiffness first-second
        term, _, place = name.partition("[")
        return f"{term.replace('_', ' ')} {place.rstrip(']')}"

    parts: list[Sequence[Any]] = []
    for estimator, found in result.found.items():
        for own in found.system.results:
            analysis = own.found.responses
            if not isinstance(analysis, MisoResult):
                continue
            for j, item in enumerate(own.found.inputs):
                parts.append(
                    (own.coordinate, input_place(item), analysis.frequency, estimator, j + 1, item.shape,
                     " + ".join(map(words, item.terms)), analysis.ordinary[j], analysis.partial[j],
                     analysis.contribution[j], analysis.cumulative[j])
                )  # fmt: skip
    return stacked([*WHERE, *COHERENCE_COLUMNS], parts)


# ---- by modes


def modal_model(model: Model, sensors: Sequence[str]) -> Model:
    """The nonlinear terms of a structure alone, their coefficients open, between its sensors, beside its modes."""
    kept = tuple(t for t in model.terms if t.term.name not in LINEAR)
    opened = tuple(t.with_values(dict.fromkeys(t.symbols)) for t in kept)
    return Model(f"{model.name} as measured", opened, tuple(sensors), model.forces, ModalPart(tuple(sensors)))


def modal_parameters(truth: Model, comparison: Comparison, settings: IdentificationSettings) -> pd.DataFrame:
    """Coefficients with their tolerance, then natural frequencies and damping ratios beside the exact ones."""
    modes, exact, rows = comparison.modes, modes_of(truth), list[tuple[Any, ...]]()
    for found in comparison.coefficients:
        key, value, true = found.key, found.value, truth.numbers()[found.key]
        judged = judge_estimate(key[: key.index("[")], true, value, settings).values()
        rows.append((settings.case, BY_MODES, key, true, value, found.error or 0.0, *judged, ""))
    for r, frequency in enumerate(modes.frequency.tolist()):
        k = int(np.argmin(np.abs(exact.frequency - frequency)))
        for name, true, value, error in (
            ("f_n", exact.frequency[k], modes.frequency[r], modes.frequency_error[r]),
            ("zeta", exact.damping[k], modes.damping[r], modes.damping_error[r]),
        ):
            off = float(value / true) - 1.0
            told = (float(true), float(value), float(error), off)
            rows.append((settings.case, BY_MODES, f"{name}[{k + 1}]", *told, np.nan, "", ""))
    return pd.DataFrame(rows, columns=PARAMETER_COLUMNS)


def modal_responses(
    truth: Model, comparison: Comparison, settings: IdentificationSettings, highest: float
) -> pd.DataFrame:
    """Coefficients line by line, and transfer functions of the linear part: SI/SO, the modes', and the exact ones.

    ``highest`` is the frequency in Hz up to which the structure is driven.
    """
    parts: list[tuple[Any, ...]] = []
    units = {
        key: t.term.unit(s, "N", "m") for t in truth.terms for key, s in zip(t.symbols, t.term.symbols, strict=True)
    }
    for spectrum in comparison.by_line:
        values, true = spectrum.values, truth.numbers()[spectrum.key]
        parts.append(
            (COEFFICIENT, spectrum.key, units[spectrum.key], spectrum.frequency, "instrumental", values.real,
             values.imag, spectrum.error, true, 0.0)
        )  # fmt: skip
    prepared = comparison.prepared
    (name, where), *_ = truth.forces
    places = [s.coordinate for s in prepared.sensors]
    cut, fitted = settings.segments.segments(), comparison.fit.model
    f, found, exact = transfer_functions(truth, prepared.record[name], prepared.measured.T, places, prepared.dt, cut)
    inside = (f > 0.0) & (f < highest - LEAKED * f[1])
    sensors = [Sensor(place, MOTIONS[0]) for place in places]
    modal = transfer(fitted, sensors, prepared.dt, cut.length)[:, :, fitted.coordinates.index(where)]
    for k, place in enumerate(places):
        for estimator, values in (("siso", found[:, k]), (BY_MODES, modal[:, k])):
            own, true = values[inside], exact[inside, k]
            parts.append(
                (TRANSFER, place, "m/N", f[inside], estimator, own.real, own.imag, np.nan, true.real, true.imag)
            )
    return stacked(MODAL_COLUMNS, parts)


def transfer_functions(
    model: Model, force: Floats, motions: Iterable[Floats], places: Sequence[str], dt: float, cut: Segments
) -> tuple[Floats, Complexes, Complexes]:
    """Frequency, and from a structure's force to displacements: the best linear approximation, and the linear part's.

    ``motions`` are the displacements at the places; shapes (lines,), (lines, places) and (lines, places).
    """
    (_, where), *_ = model.forces
    sensors = tuple(Sensor(place, MOTIONS[0]) for place in places)
    matrix = cross_spectra([force, *motions], dt, cut)
    linear = transfer(model, sensors, dt, cut.length)
    found = matrix.density[:, 0, 1:] / matrix.density[:, :1, 0].real
    return matrix.frequency, found, linear[:, :, model.coordinates.index(where)]


# ---- claims: SI/SO shows one nonlinear connection everywhere, MI/SO puts it where it is


def structure_claims(
    record: Record, result: CaseResult, settings: IdentificationSettings, limits: Mapping[str, float]
) -> pd.DataFrame:
    """Every claim on a case, a row each: what must hold, what was measured, the verdict."""
    return _judged(
        settings.case,
        transfer_functions=_changed(result.model, record, settings, limits["changed"]),
        placed=_placed(structure_parameters(result, settings), "miso"),
        reaction=_reaction(result, limits["by_chance"]),
    )


def modal_claims(
    truth: Model, comparison: Comparison, settings: IdentificationSettings, limits: Mapping[str, float], noise: float
) -> pd.DataFrame:
    """The same of a case whose linear part is a sum of modes; ``noise`` is the mean square on the response."""
    found = modal_parameters(truth, comparison, settings)
    coefficients = found[found["parameter"].isin(c.key for c in comparison.coefficients)]
    least, error = float(np.sqrt(noise / (1.0 + noise))), comparison.prediction.error
    criterion = f"error of the free run at most {limits['error']:g} times the noise of {percent(least)}"
    runs_free = Condition(criterion, f"error {percent(error)}", error <= limits["error"] * least)
    return _judged(settings.case, measured=[*_placed(coefficients, BY_MODES), runs_free])


def _judged(case: str, **claims: Iterable[Condition]) -> pd.DataFrame:
    """The claims of ``STATEMENTS`` with their conditions."""
    rows: list[dict[str, str]] = []
    for name, conditions in claims.items():
        held = list(conditions)
        rows.append({
            "case": case, "claim": STATEMENTS[name], "criterion": SEPARATOR.join(c.criterion for c in held),
            "measured": SEPARATOR.join(c.measured for c in held),
            "verdict": verdict([c.met for c in held], ("holds", "partly", "does not hold")),
        })  # fmt: skip
    return pd.DataFrame(rows)


def _changed(model: Model, record: Record, settings: IdentificationSettings, limit: float) -> Iterable[Condition]:
    """The best linear approximation of every motion by the force against that of the structure's linear part."""
    (name, _), *_ = model.forces
    motions = [record[Sensor(c, MOTIONS[0])] for c in model.coordinates]
    f, found, exact = transfer_functions(
        model, record[name], motions, model.coordinates, record.dt, settings.segments.segments()
    )
    inside = (f >= settings.fit_band[0]) & (f <= settings.fit_band[1])
    power = np.sum(np.abs(exact[inside]) ** 2, axis=0)
    off = np.sqrt(np.sum(np.abs(found[inside] - exact[inside]) ** 2, axis=0) / power)
    for place, share in zip(model.coordinates, off.tolist(), strict=True):
        yield Condition(
            f"transfer function to {place} off that of the linear part by {percent(limit)} or more",
            f"{place} {percent(share)}", share >= limit,
        )  # fmt: skip


def _placed(table: pd.DataFrame, estimator: str) -> Iterable[Condition]:
    """Whether an estimator has every coefficient of a table of parameters within its tolerance."""
    for _, row in table[table["estimator"] == estimator].iterrows():
        true, value, allowed = (float(row[name]) for name in ("true", "estimate", "tolerance"))
        criterion = f"within {percent(allowed)} of {true:.6g}" if true else f"within +-{allowed:g} of zero"
        measured = percent(value / true - 1.0, "+.2g") if true else f"{value:+.2g}"
        key, met = str(row["parameter"]), bool(row["within_tolerance"])
        yield Condition(f"{key} {criterion}", f"{key} {measured}", met)


def _reaction(result: CaseResult, limit: float) -> Iterable[Condition]:
    for name, label, sign in (("miso", "MI/SO", "at least"), ("siso", "SI/SO", "below")):
        p = result.found[name].joint.least_p
        yield Condition(
            f"{label}: probability that chance makes the largest difference {sign} {limit:g}", f"{label} {p:.2g}",
            (p >= limit) == (name == "miso"),
        )  # fmt: skip
