"""Tables of a structure in reverse: as those of a single mass (``reproduction.tables``), equation by equation.

Where nothing drives a coordinate, its A_j(f) are over the own mass; tables have them times the true one, in N.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from study.identify.frequency_domain.conditioned import MisoResult
from study.identify.frequency_domain.inputs import Input
from study.reproduction.tables import (
    COHERENCE_COLUMNS,
    PARAMETER_COLUMNS,
    RESPONSE_COLUMNS,
    AllowedErrors,
    judge_estimate,
    stacked,
)
from study.structure.action_reaction import JointEstimate
from study.structure.reverse_system import EquationResult, exact_responses
from study.structure.structure_study import CaseResult
from study.support.arrays import Floats

WHERE = ["equation", "place"]  # what the tables of structures have beside
REACTION_COLUMNS = ["case", "estimator", "parameter", "first", "second", "in_first", "in_second", "error", "p_value"]


def input_place(item: Input) -> str:
    """Where an input acts: that of its coefficients, ``first-second``; several stand side by side."""
    labels = [p.symbol[p.symbol.index("[") + 1 : -1] for p in item.parts]
    return " and ".join(dict.fromkeys(labels))


def structure_parameters(case: str, result: CaseResult, limits: AllowedErrors) -> pd.DataFrame:
    """Every coefficient of every estimator from all equations together, one row each."""
    rows = [
        (case, estimator, *_judged(symbol, result.model.values[symbol], found.joint, limits), "")
        for estimator, found in result.found.items()
        for symbol in found.joint.estimate.symbols
    ]
    return pd.DataFrame(rows, columns=PARAMETER_COLUMNS)


def _judged(key: str, true: float | None, joint: JointEstimate, limits: AllowedErrors) -> tuple[Any, ...]:
    value, error = joint.estimate[key], joint.estimate.error(key)
    known = 0.0 if true is None else true
    return (key, known, value, error, *judge_estimate(key[: key.index("[")], known, value, limits).values())


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
    values = {key: value for key, value in result.model.values.items() if value is not None}
    parts: list[Sequence[Any]] = []
    for estimator, found in result.found.items():
        for own in found.system.results:
            parts += _responses(estimator, own, values)
    return stacked([*WHERE, *RESPONSE_COLUMNS, "independent"], parts)


def _responses(estimator: str, own: EquationResult, values: Mapping[str, float]) -> list[Sequence[Any]]:
    responses, scale = own.found.responses, 1.0 if own.mass is None else values[own.mass]
    assert responses is not None, "estimators of structures have frequency response functions"
    found: list[Sequence[Any]] = []
    for j, (item, exact) in enumerate(zip(own.found.inputs, exact_responses(own, values), strict=True)):
        value, error = responses.response[j] * scale, np.sqrt(responses.covariance[:, j, j].real) * scale
        share: Floats | float = np.nan if own.independent is None else own.independent[:, j]
        found.append(
            (own.coordinate, input_place(item), responses.frequency, estimator, j + 1, item.shape, value.real,
             value.imag, error, exact.real * scale, exact.imag * scale, share)
        )  # fmt: skip
    return found


def structure_coherences(result: CaseResult) -> pd.DataFrame:
    """Ordinary, partial, nonlinear and cumulative coherence of each input of each equation, in long form."""
    parts: list[Sequence[Any]] = []
    for estimator, found in result.found.items():
        for own in found.system.results:
            analysis = own.found.responses
            if isinstance(analysis, MisoResult):
                for j, item in enumerate(own.found.inputs):
                    terms = " + ".join(_words(name) for name in item.terms)
                    parts.append(
                        (own.coordinate, input_place(item), analysis.frequency, estimator, j + 1, item.shape, terms,
                         analysis.ordinary[j], analysis.partial[j], analysis.contribution[j], analysis.cumulative[j])
                    )  # fmt: skip
    return stacked([*WHERE, *COHERENCE_COLUMNS], parts)


def _words(name: str) -> str:
    """A placed term in words: ``cubic stiffness first-second``."""
    term, _, place = name.partition("[")
    return f"{term.replace('_', ' ')} {place.rstrip(']')}"
