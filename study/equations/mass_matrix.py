"""The linear part of a structure as matrices."""

from collections.abc import Mapping

import numpy as np

from study.equations import formulas
from study.equations.equations_of_motion import mass_entries
from study.equations.model import Model, ModelTerm
from study.support.arrays import Floats
from study.support.errors import StudyError

LINEAR = {"linear_stiffness": 0, "linear_damping": 1, "inertia": 2}  # and the order of their derivative


def linear_keys(model: Model) -> dict[str, int]:
    """Keys of the linear terms of a structure, with the order of their derivative."""
    return {entry.symbols[0]: LINEAR[entry.term.name] for entry in model.terms if entry.term.name in LINEAR}


def patterns(model: Model) -> dict[str, Floats]:
    """What a unit of each linear key adds to its matrix, shape (coordinates, coordinates)."""
    n = len(model.coordinates)
    found: dict[str, Floats] = {}
    for i, j, weight, key in mass_entries(model):
        found.setdefault(key, np.zeros((n, n)))[i, j] += weight
    for entry in model.terms:
        if entry.term.name in LINEAR and entry.term.name != "inertia":
            e = np.array(entry.place.direction(model.coordinates))
            found[entry.symbols[0]] = np.outer(e, e)
    return found


def matrices(model: Model, values: Mapping[str, float]) -> Floats:
    """Stiffness, damping and mass matrix for values by key, shape (3, coordinates, coordinates)."""
    n = len(model.coordinates)
    total = np.zeros((3, n, n))
    orders, own = linear_keys(model), patterns(model)
    for key, order in orders.items():
        total[order] += values[key] * own[key]
    return total


def checked_mass_matrix(model: Model) -> Floats:
    """The mass matrix of a model whose values are known, shape (coordinates, coordinates).

    Raises
    ------
    StudyError
        If it is not positive definite: some motion would have no kinetic energy, or a negative one.
    """
    mass = matrices(model, model.numbers())[2]
    _check_positive(model, mass)
    return mass


def is_positive(model: Model, values: Mapping[str, float]) -> bool:
    """Whether every motion of a model has a kinetic energy, with these values in place of its own."""
    known = {key: value for key, value in model.values.items() if value is not None}
    lowest = np.linalg.eigvalsh(matrices(model, known | dict(values))[2])
    return bool(lowest[0] > len(lowest) * np.finfo(float).eps * lowest[-1])


def check_held_masses(model: Model) -> None:
    """Refuse a mass matrix that no values of what is open could make positive definite.

    The rows and columns of which all is given are a principal minor of it, positive definite as the whole is.
    """
    open_keys = [key for key, value in model.values.items() if value is None]
    known = matrices(model, {key: value or 0.0 for key, value in model.values.items()})[2]
    orders = linear_keys(model)
    unknown = [np.any(p != 0.0, axis=0) for k, p in patterns(model).items() if k in open_keys and orders[k] == 2]
    given = ~np.any(unknown, axis=0) if unknown else np.ones(len(model.coordinates), dtype=np.bool_)
    if np.any(given):
        _check_positive(model, known[np.ix_(given, given)])


def _check_positive(model: Model, mass: Floats) -> None:
    scale = np.sqrt(np.abs(np.diag(mass)))
    lowest = float(np.min(np.linalg.eigvalsh(mass / np.maximum(np.outer(scale, scale), np.finfo(float).tiny))))
    if lowest <= 1e-9 or np.any(np.diag(mass) <= 0.0):
        rows = "; ".join(" ".join(f"{x:.4g}" for x in row) for row in mass)
        raise StudyError(
            f"the mass matrix of {model.name!r}, [{rows}], is not positive definite; expected masses above zero, and "
            "couplings smaller than the root of the product of the two masses that they couple"
        )


def loose_motions(model: Model) -> int:
    """In how many of its motions no spring, joint or anything else that feels a displacement ties a structure down."""
    ties = [
        np.array(entry.place.direction(model.coordinates))
        for entry in model.terms
        if any("u" in formulas.names(text) for text in _texts(entry))
    ]
    return len(model.coordinates) - (int(np.linalg.matrix_rank(np.stack(ties))) if ties else 0)


def _texts(entry: ModelTerm) -> list[str]:
    shapes = [component.shape for component in entry.term.components if component.order == 0]
    return [*shapes, *([entry.term.state] if entry.term.state else [])]
