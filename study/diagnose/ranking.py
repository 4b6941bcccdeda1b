"""Candidates in order, with what an engineer needs to believe or doubt each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.compare.prediction import Prediction
from study.diagnose import constancy
from study.diagnose.candidates import Candidate
from study.diagnose.constancy import Curve
from study.equations.terms import Term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise
from study.records.prepared import Prepared
from study.support import statistics
from study.support.statistics import Gain

Floats = NDArray[np.float64]
TIE = 3.0  # standard errors of their difference within which two candidates are a tie: 5 %, shared by a library of 18
COMPARABLE = 0.75  # of what the better explains: one that explains less is not its equal, however uncertain both are
ALIKE = 0.01  # ... and so are two whose predictions differ by less than this share of what either leaves
RESOLUTION = 3e-4  # ... or of the rms response: what integration with few steps a sample leaves uncertain
UNSTEADY = 0.3  # relative change of its coefficient at which a candidate is no longer believed ...
NEARLY = 0.9  # ... if a steadier one explains at least so much of what it does
PRACTICALLY = 0.99  # of what an effect of three unknowns explains: enough for one of a single unknown
INDISTINCT = 1e-6
CERTAIN, STILL = 1e-4, 0.01  # p value, and relative change with the amplitude, of a coefficient that moves
EXAMINED = 6  # candidates whose coefficient is followed along frequency and amplitude


@dataclass(frozen=True)
class Ranked:
    """One candidate."""

    term: Term  # the effect
    fit: FreeRunFit  # the model with it
    prediction: Prediction
    gain: Gain  # what it explains of the held-out residual, with the p value of one comparison
    p_value: float  # the same with the number of candidates accounted for (Bonferroni)
    coefficient: float  # its size: the amplitude, for an effect of any phase
    error: float  # standard error of that
    parameters: dict[str, float]  # shape parameters, and the phase of an effect of any phase
    parameter_errors: dict[str, float]  # their standard errors
    flatness: Curve | None  # the coefficient along frequency, for the first few
    steadiness: Curve | None  # the coefficient along amplitude
    tied_with: tuple[str, ...]  # candidates that this record cannot tell from it

    @property
    def name(self) -> str:
        """Name of the term."""
        return self.term.name

    @property
    def residual(self) -> Floats:
        """Held-out residual."""
        return self.prediction.residual

    @property
    def response_error(self) -> float:
        """Rms of the held-out residual over that of the response."""
        return self.prediction.error

    @property
    def unphysical(self) -> str:
        """Why it is no physical effect as fitted, in a sentence; empty if it is one."""
        return self.term.physical(self.fit.model.values)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the coefficient."""
        return self.coefficient - 1.96 * self.error, self.coefficient + 1.96 * self.error

    @property
    def unsteadiness(self) -> float:
        """By how much, relative to itself, the coefficient changes with frequency or amplitude."""
        return changes(self.flatness, self.steadiness)


def rank(candidates: Sequence[Candidate], before: Floats, prepared: Prepared) -> list[Ranked]:
    """Candidates by what they leave of the held-out residual, ties by how few unknowns they need.

    ``before`` is the held-out residual without any of them, shape (samples to judge,).
    """
    rows = [_row(candidate, before, len(candidates), prepared) for candidate in candidates]
    rows.sort(key=lambda r: float(r.residual @ r.residual))
    rows = _physical_first(_ties_by_simplicity(rows))
    rows = [_examined(row, prepared) if i < EXAMINED else row for i, row in enumerate(rows)]
    rows = _simple_first(_constant_first(rows))
    return [replace(row, tied_with=_tied(row, rows)) for row in rows]


def _row(candidate: Candidate, before: Floats, count: int, prepared: Prepared) -> Ranked:
    fit = candidate.fit
    gain = statistics.gain(before, candidate.prediction.residual)
    covariance = statistics.clustered_covariance(linearise(fit, prepared), fit.residual)
    coefficient, error, parameters, errors = _amount(candidate, covariance)
    return Ranked(
        term=candidate.term, fit=fit, prediction=candidate.prediction, gain=gain,
        p_value=min(1.0, gain.p_value * count), coefficient=coefficient, error=error, parameters=parameters,
        parameter_errors=errors, flatness=None, steadiness=None, tied_with=(),
    )  # fmt: skip


def _amount(candidate: Candidate, covariance: Floats) -> tuple[float, float, dict[str, float], dict[str, float]]:
    """Coefficient and shape parameters of the candidate with standard errors."""
    fit, term = candidate.fit, candidate.term
    place = {key: i for i, key in enumerate(fit.keys)}
    values = {key: float(fit.values[i]) for key, i in place.items()}
    errors = {key: math.sqrt(max(float(covariance[i, i]), 0.0)) for key, i in place.items()}
    names = {p.name: f"{term.name}.{p.name}" for p in term.parameters}
    parameters = {name: values[key] for name, key in names.items() if key in values}
    parameter_errors = {name: errors[key] for name, key in names.items() if key in values}
    if len(term.symbols) == 1:
        return values[term.symbols[0]], errors[term.symbols[0]], parameters, parameter_errors
    a, b = (values[s] for s in term.symbols)
    size = math.hypot(a, b)
    direction = np.array([a, b]) / size if size > 0.0 else np.array([1.0, 0.0])
    block = covariance[np.ix_([place[s] for s in term.symbols], [place[s] for s in term.symbols])]
    across = np.array([direction[1], -direction[0]])
    parameters["phase"] = math.atan2(-b, a)
    parameter_errors["phase"] = math.sqrt(max(float(across @ block @ across), 0.0)) / size if size > 0.0 else math.inf
    return size, math.sqrt(max(float(direction @ block @ direction), 0.0)), parameters, parameter_errors


def _unknowns(row: Ranked) -> int:
    return len(row.term.components) + len(row.term.parameters)


def _misfit(row: Ranked) -> float:
    """Both parts of the record together, with the price of each unknown (Schwarz, 1978); lower is better."""
    power = float(row.residual @ row.residual) + float(row.fit.residual @ row.fit.residual)
    n = len(row.residual) + len(row.fit.residual)
    return n * math.log(max(power, 1e-300)) + _unknowns(row) * math.log(n)


def _ties_by_simplicity(rows: list[Ranked]) -> list[Ranked]:
    """Of the candidates that the held-out residual cannot tell from the first, put the best of the simplest first.

    One with more unknowns never overtakes; one with as many or fewer does if both parts of the record say so.
    """
    if not rows:
        return rows
    first = rows[0]
    level = [r for r in rows if _alike(r, first) or (_comparable(r, first) and _distance(r, first) < TIE)]
    level = [r for r in level if _unknowns(r) <= _unknowns(first)]
    first = min(level, key=_misfit)
    first = min((r for r in level if _alike(r, first)), key=lambda r: (_unknowns(r), _misfit(r)), default=first)
    return [first] + [r for r in rows if r is not first]


def _physical_first(rows: list[Ranked]) -> list[Ranked]:
    """Put what is fitted outside of what makes it physical behind a physical effect that explains nearly as much.

    A Bouc-Wen element of negative stiffness, say, is a hardening spring in disguise.
    """
    if not rows or not rows[0].unphysical:
        return rows
    enough = NEARLY * rows[0].gain.explained
    physical = [r for r in rows if not r.unphysical and r.gain.explained >= enough]
    return physical[:1] + [r for r in rows if r is not physical[0]] if physical else rows


def _constant_first(rows: list[Ranked]) -> list[Ranked]:
    """Put a candidate whose coefficient is no constant behind one that explains nearly as much and has one.

    A wrong term that imitates a true one needs a coefficient which changes with frequency and level.
    """
    if not rows or rows[0].unsteadiness <= UNSTEADY:
        return rows
    enough = NEARLY * rows[0].gain.explained
    steady = [r for r in rows[:EXAMINED] if r.unsteadiness <= UNSTEADY and r.gain.explained >= enough]
    return steady[:1] + [r for r in rows if r is not steady[0]] if steady else rows


def _simple_first(rows: list[Ranked]) -> list[Ranked]:
    """Put an effect with a memory or a frequency of its own behind a single coefficient that does practically as much.

    With three unknowns and a free initial state it can imitate an offset or a weak curvature.
    """
    if not rows or _unknowns(rows[0]) < 3:
        return rows
    plain = [r for r in rows if _unknowns(r) == 1 and r.gain.explained >= PRACTICALLY * rows[0].gain.explained]
    return plain[:1] + [r for r in rows if r is not plain[0]] if plain else rows


def _distance(row: Ranked, other: Ranked) -> float:
    """How much worse than the other a candidate is, in standard errors, over both parts of the record."""
    if row is other:
        return 0.0
    held_out = statistics.difference(row.residual, other.residual)
    if len(row.fit.residual) != len(other.fit.residual):
        return held_out
    both = statistics.difference(
        np.concatenate([row.fit.residual, row.residual]), np.concatenate([other.fit.residual, other.residual])
    )
    return max(held_out, both)


def _tied(row: Ranked, rows: Sequence[Ranked]) -> tuple[str, ...]:
    if row.gain.explained <= 0.0 or row.p_value > 0.05:
        return ()
    return tuple(o.name for o in rows if o is not row and _level(o, row))


def _level(one: Ranked, other: Ranked) -> bool:
    """Whether the record cannot tell two candidates apart.

    Two forms of the same equation (a steady force and u^2 beside u^3, where the rest position is not
    measured) leave residuals that differ by rounding alone, and that very evenly.
    """
    if _alike(one, other):
        return True
    if not _comparable(one, other) or not _comparable(other, one):
        return False
    return abs(_distance(one, other)) < TIE and abs(_distance(other, one)) < TIE


def _comparable(one: Ranked, other: Ranked) -> bool:
    return one.gain.explained >= COMPARABLE * other.gain.explained


def _alike(one: Ranked, other: Ranked) -> bool:
    """Whether two predictions differ by no more than integration and rounding make of them."""
    power, size = float(one.residual @ one.residual), one.response_error
    apart = float(np.sum((one.residual - other.residual) ** 2))
    nearer = min(power, float(other.residual @ other.residual))
    return apart < ALIKE**2 * nearer or apart * size**2 < RESOLUTION**2 * power


def _examined(row: Ranked, prepared: Prepared) -> Ranked:
    """Follow the candidate's coefficient along frequency and amplitude."""
    flatness, steady = curves(row.fit, row.term, prepared)
    return replace(row, flatness=flatness, steadiness=steady)


def curves(fit: FreeRunFit, term: Term, prepared: Prepared) -> tuple[Curve | None, Curve | None]:
    """The coefficient of a term in a fitted model along frequency and along amplitude.

    None where it is zero, or the model's other coefficients could do all that it does.
    """
    jacobian = linearise(fit, prepared)
    columns = [fit.keys.index(s) for s in term.symbols]
    direction = fit.values[columns]
    size = float(np.linalg.norm(direction))
    if size == 0.0:
        return None, None
    own = jacobian[:, columns] @ (direction / size)
    scale = np.linalg.norm(jacobian, axis=0)
    others = np.delete(jacobian / np.where(scale > 0.0, scale, 1.0), columns, axis=1)
    basis = np.linalg.qr(others)[0]
    alone = own - basis @ (basis.T @ own)
    if np.linalg.norm(alone) <= INDISTINCT * np.linalg.norm(own):
        return None, None
    along = constancy.along_frequency(alone, fit.residual, size, prepared.dt)
    classes = constancy.along_amplitude(alone, fit.residual, size)
    # A short record has not lines enough for a band, or not blocks enough for a class.
    return along if len(along.at) else None, classes if len(classes.at) else None


def changes(*along: Curve | None) -> float:
    """The largest relative change of a coefficient along any of these; nan where it was followed along none."""
    return max((c.spread() for c in along if c is not None), default=math.nan)


def wavers(steady: Curve | None) -> bool:
    """Whether a coefficient moves with the amplitude for certain, and by more than integration makes of it."""
    return steady is not None and steady.p_value() < CERTAIN and steady.spread() > STILL
