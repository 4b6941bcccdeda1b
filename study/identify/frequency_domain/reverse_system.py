"""Reverse MI/SO of a structure: the equation of motion of each coordinate as a system of its own.

Inputs are shapes of the relative motions at the places of its terms, the output is the measured force there. Where no
force acts, the output is the coordinate's own force of inertia with the opposite sign, for a mass of one: every A_j(f)
is then over that mass, which the other equations tell (``action_reaction``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from study.equations.linear_part import acting
from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.estimators.in_reverse import identify_lines
from study.identify.frequency_domain import coefficients, conditioned, local_polynomial
from study.identify.frequency_domain.inputs import INERTIA, Input, along, histories, reverse_inputs
from study.identify.frequency_domain.local_polynomial import transform
from study.records import spectra
from study.records.prepared import Prepared
from study.records.record import FORCE, Record, Sensor
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError


@dataclass(frozen=True, eq=False)
class Equation:
    """The equation of motion of one coordinate, ready to be identified.

    Attributes
    ----------
    coordinate : str
        Whose equation it is.
    inputs : tuple of Input
        Without the coordinate's own inertia where nothing drives it.
    mass : str or None
        Key of the own mass that every A_j(f) is divided by; None where a measured force is the output.
    channels : tuple of arrays, shape (samples,)
        Histories of the inputs, then the output.
    """

    coordinate: str
    inputs: tuple[Input, ...]
    mass: str | None
    channels: tuple[Floats, ...]


@dataclass(frozen=True, eq=False)
class EquationResult:
    """What an estimator finds in one equation: ``Identified`` as of a single mass.

    ``independent`` is the share of each input that the others do not determine, shape (lines, inputs): no A_j(f) can be
    read where it is nothing, though the coefficients can be found over all lines (``coefficients.fit_jointly``).
    """

    coordinate: str
    mass: str | None
    found: Identified
    independent: Floats | None = None


@dataclass(frozen=True, eq=False)
class ReverseSystem:
    """All equations of a structure as one estimator finds them, one by one.

    Attributes
    ----------
    results : tuple of EquationResult
        In the order of the coordinates.
    covariance : array, shape (coefficients, coefficients)
        Of the coefficients of all equations, one equation after the other.
    """

    results: tuple[EquationResult, ...]
    covariance: Floats


def equations_of(
    model: Model, prepared: Prepared, span: tuple[int, int] | None = None
) -> tuple[tuple[Equation, ...], dict[str, str]]:
    """The equations whose motions are all measured, and why each of the others is none.

    ``span`` is the first sample and the one after the last: the fitting part without its edges if left out.

    Raises
    ------
    StudyError
        If no equation is left, or a formula has no finite value along the motion.
    """
    if span is None:
        edge = prepared.edge
        span = max(prepared.plan.fit[0], edge), min(prepared.plan.fit[1], len(prepared.record) - edge)
    own, lacking = list[Equation](), dict[str, str]()
    cache: dict[tuple[float, ...], Record] = {}
    for coordinate in model.coordinates:
        inputs = reverse_inputs(model, coordinate)
        needed = [c for c, *weights in _columns(model, inputs) if any(weights) or c == coordinate]
        blind = [c for c in needed if c not in prepared.coordinates and (c == coordinate or not model.prescribed)]
        if blind:
            lacking[coordinate] = f"no {'force' if model.prescribed else 'sensor'} is at {', '.join(blind)}"
        else:
            own.append(_equation(model, prepared, coordinate, inputs, span, cache))
    if not own:
        told = "; ".join(f"{c}: {why}" for c, why in lacking.items())
        raise StudyError(f"no equation of motion of {model.name!r} can be written with these sensors ({told})")
    return tuple(own), lacking


def _columns(model: Model, inputs: Sequence[Input]) -> list[tuple[str, *tuple[float, ...]]]:
    return [(c, *(i.direction[k] for i in inputs)) for k, c in enumerate(model.coordinates)]


def _equation(
    model: Model, prepared: Prepared, coordinate: str, inputs: tuple[Input, ...], span: tuple[int, int],
    cache: dict[tuple[float, ...], Record],
) -> Equation:  # fmt: skip
    record, mass = prepared.record, None
    own = acting(model)[model.coordinates.index(coordinate)]
    forces = [(unit, name) for unit, (name, _) in zip(own, model.forces, strict=True)]
    if model.prescribed:
        forces = [(1.0, str(Sensor(coordinate, FORCE)))]
    drives = [unit * record[name] for unit, name in forces if unit != 0.0 and np.any(record[name])]
    output = np.sum(drives, axis=0) if drives else -prepared.record.motion(coordinate)[INERTIA]
    if not drives:
        mass = next(
            t.symbols[0] for t in model.terms
            if t.term.name == "inertia" and t.place.kind == "at" and coordinate in t.place.ends
        )  # fmt: skip
        inputs = _without(inputs, mass)
    part, values = slice(*span), list[Floats]()
    for item in inputs:
        if item.direction not in cache:
            cache[item.direction] = along(item.direction, model, record)
        values += histories((item,), cache[item.direction])
    return Equation(coordinate, inputs, mass, tuple(x[part] for x in (*values, output)))


def _without(inputs: tuple[Input, ...], key: str) -> tuple[Input, ...]:
    """The inputs without one coefficient."""
    name = f"inertia{key[key.index('[') :]}"
    rest = [
        replace(
            i, parts=tuple(p for p in i.parts if p.symbol != key), terms=tuple(t for t in i.terms if t != name)
        )
        for i in inputs
    ]  # fmt: skip
    return tuple(i for i in rest if i.parts)


def by_conditioned_spectra(equations: Sequence[Equation], dt: float, settings: Settings) -> ReverseSystem:
    """Reverse MI/SO of every equation (the report's Sections 4.2 to 4.5); coefficients of all its inputs at once."""
    channels = [x for equation in equations for x in equation.channels]
    ends = np.cumsum([0, *(len(e.channels) for e in equations)])
    rows = [list(range(a, b)) for a, b in pairwise(ends)]
    matrix, band = spectra.cross_spectra(channels, dt, settings.segments), settings.band
    results, fits = list[EquationResult](), list[coefficients.JointFit]()
    for e, r in zip(equations, rows, strict=True):
        own = replace(matrix, density=matrix.density[:, r][:, :, r])
        analysis = conditioned.analyse(own)
        fits.append(coefficients.fit_jointly(matrix, r, analysis, e.inputs, band))
        found = Identified(e.inputs, analysis, named_parameters(fits[-1].estimate), fits[-1].estimate)
        share = coefficients.independent_share(analysis, own)
        results.append(EquationResult(e.coordinate, e.mass, found, share))
    blocks = [[coefficients.covariance_between_outputs(matrix, a, b, band) for b in fits] for a in fits]
    return ReverseSystem(tuple(results), np.block(blocks))


def linear_alone(equations: Sequence[Equation], dt: float, settings: Settings) -> ReverseSystem:
    """The same as if the structure were linear: what the report's SI/SO analysis sees, equation by equation."""
    return by_conditioned_spectra([_linear(e) for e in equations], dt, settings)


def _linear(equation: Equation) -> Equation:
    kept = [k for k, item in enumerate(equation.inputs) if item.linear]
    channels = tuple(equation.channels[k] for k in (*kept, -1))
    return replace(equation, inputs=tuple(equation.inputs[k] for k in kept), channels=channels)


def by_local_polynomials(equations: Sequence[Equation], dt: float, settings: Settings) -> ReverseSystem:
    """Every equation by local polynomials, with the covariance from the scatter between stretches of time."""
    lines = [transform(equation.channels, dt) for equation in equations]
    fits = [identify_lines(e.inputs, x, settings) for e, x in zip(equations, lines, strict=True)]
    results = [EquationResult(e.coordinate, e.mass, found) for e, (found, _) in zip(equations, fits, strict=True)]
    shifts = np.concatenate([own for _, own in fits], axis=1)
    return ReverseSystem(tuple(results), local_polynomial.covariance_between(shifts, shifts))


STRUCTURE_ESTIMATORS = {"siso": linear_alone, "miso": by_conditioned_spectra, "local_polynomial": by_local_polynomials}


def reverse_system(name: str, equations: Sequence[Equation], dt: float, settings: Settings) -> ReverseSystem:
    """All equations by the estimator of this name."""
    if name not in STRUCTURE_ESTIMATORS:
        raise StudyError(f"there is no estimator {name!r} of structures; known are {', '.join(STRUCTURE_ESTIMATORS)}")
    return STRUCTURE_ESTIMATORS[name](equations, dt, settings)


def exact_responses(result: EquationResult, values: Mapping[str, float]) -> list[Complexes]:
    """The exact A_j(f) of an equation for coefficients of these values, as it finds them: over the own mass."""
    responses, scale = result.found.responses, 1.0 if result.mass is None else values[result.mass]
    assert responses is not None, "estimators of structures have frequency response functions"
    return [item.response(responses.frequency, dict(values)) / scale for item in result.found.inputs]
