"""The linear part of a model: its matrices, the paths from forces to sensors, its modes.

Eigenvalues are those of ``(lambda^2 M + lambda C + K) psi = 0``, mode shapes those without damping. Errors follow from
the covariance of the coefficients by the exact derivatives of eigenvalues and vectors (Fox and Kapoor, 1968). The
matrices are those of the degrees of freedom q, ``u = T q``: of the coordinates, or of modes, whose M is one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.fft import rfftfreq

from study.equations.equations_of_motion import mass_entries
from study.equations.model import Model
from study.equations.place import GROUND, HERE, Place
from study.equations.terms import LINEAR
from study.records.record import MOTIONS, Sensor
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError


def linear_keys(model: Model) -> dict[str, int]:
    """Keys of the linear part of a structure in its matrices, with the order of their derivative."""
    if model.modal:
        return dict.fromkeys(model.modal.stiffness, 0) | dict.fromkeys(model.modal.damping, 1)
    return {entry.symbols[0]: LINEAR[entry.term.name] for entry in model.terms if entry.term.name in LINEAR}


def patterns(model: Model) -> dict[str, Floats]:
    """What a unit of each linear key adds to its matrix, shape (degrees of freedom, degrees of freedom)."""
    found: dict[str, Floats] = {}
    if modal := model.modal:
        each = (*((r, r) for r in range(modal.count)), *modal.pairs)
        for key, (r, s) in zip((*modal.stiffness, *modal.damping), each, strict=True):
            found[key] = np.zeros((modal.count, modal.count))
            found[key][[r, s], [s, r]] = 1.0
        return found
    n = len(model.coordinates)
    for i, j, weight, key in mass_entries(model):
        found.setdefault(key, np.zeros((n, n)))[i, j] += weight
    for entry in model.terms:
        if entry.term.name in LINEAR and entry.term.name != "inertia":
            e = np.array(entry.place.direction(model.coordinates))
            found[entry.symbols[0]] = np.outer(e, e)
    return found


def matrices(model: Model, values: Mapping[str, float]) -> Floats:
    """Stiffness, damping and mass matrix for values by key, shape (3, degrees of freedom, degrees of freedom)."""
    n = model.modal.count if model.modal else len(model.coordinates)
    total = np.zeros((3, n, n))
    total[2] = np.eye(n) if model.modal else 0.0
    orders, own = linear_keys(model), patterns(model)
    for key, order in orders.items():
        total[order] += values[key] * own[key]
    return total


def acting(model: Model) -> Floats:
    """What a unit of each measured force is in each equation, shape (coordinates, forces).

    The acceleration of the ground acts through the masses, which are all known then, on motions relative to it.
    """
    each = [np.array([float(c == where) for c in model.coordinates]) for _, where in model.forces]
    if all(where != GROUND for _, where in model.forces):
        return np.stack(each, axis=1) if each else np.zeros((len(model.coordinates), 0))
    mass = matrices(model, {key: value or 0.0 for key, value in model.values.items()})[2]
    of_ground = -np.sum(mass, axis=1)
    pairs = zip(each, model.forces, strict=True)
    return np.stack([of_ground if where == GROUND else own for own, (_, where) in pairs], axis=1)


def shapes_of(model: Model, values: Mapping[str, float]) -> Floats:
    """T of ``u = T q``, shape (coordinates, degrees of freedom)."""
    if model.modal is None:
        return np.eye(len(model.coordinates))
    return np.array([[values[key] for key in model.modal.shape(c)] for c in model.coordinates])


def checked_mass_matrix(model: Model) -> Floats:
    """The mass matrix of a model whose values are known, shape (degrees of freedom, degrees of freedom).

    Refused unless positive definite: else some motion would have no kinetic energy, or a negative one.
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


def connections(model: Model) -> tuple[Place, ...]:
    """Every pair where an effect may be missing: between the ground and each coordinate, and between neighbours.

    Neighbours are what a term of the model ties together. Two coordinates that inertia couples are motions of one body,
    as heave and pitch: nothing lies between them. A single mass has the one place where all of its terms act. A modal
    linear part does not say which coordinates are neighbours: each two may be.
    """
    if not model.named:
        return (HERE,)
    found: dict[frozenset[str], Place] = {}
    for entry in model.terms:
        if entry.place.kind == "between":
            found.setdefault(entry.place.path, entry.place)
    for name in model.coordinates:
        found.setdefault(frozenset((GROUND, name)), Place("between", (GROUND, name)))
    for ends in combinations(model.coordinates, 2) if model.modal else ():
        found.setdefault(frozenset(ends), Place("between", ends))
    return tuple(found.values())


def transfer(model: Model, sensors: Sequence[Sensor], dt: float, size: int) -> Complexes:
    """From a force on each coordinate to each sensor, shape (lines, sensors, coordinates); all values are known.

    The lines are those of a transform of ``size`` samples.
    """
    omega = np.asarray(2j * np.pi * rfftfreq(size, dt), dtype=np.complex128)
    omega[0] = omega[1]  # a structure that nothing ties down has no response to a constant
    values = model.numbers()
    (stiffness, damping, mass), shapes = matrices(model, values), shapes_of(model, values)
    dynamic = mass * omega[:, None, None] ** 2 + damping * omega[:, None, None] + stiffness
    inverse = np.asarray(np.linalg.inv(dynamic), dtype=np.complex128)
    if model.modal:
        inverse = shapes @ inverse @ shapes.T
    rows = [model.coordinates.index(s.coordinate) for s in sensors]
    order = np.stack([omega ** MOTIONS.index(s.motion) for s in sensors], axis=1)
    return np.asarray(inverse[:, rows] * order[:, :, None], dtype=np.complex128)


def alignment(paths: Complexes, residual: Complexes) -> float:
    """Share of the residuals' power, shape (lines, sensors), that a single force along ``paths`` could make.

    Any force: one number a line. With a single sensor every place explains all.
    """
    power = np.sum(np.abs(paths) ** 2, axis=1)
    along = np.abs(np.sum(paths.conj() * residual, axis=1)) ** 2 / np.where(power > 0.0, power, np.inf)
    total = float(np.sum(np.abs(residual) ** 2))
    return float(np.sum(along)) / total if total > 0.0 else 0.0


RIGID = 1e-6  # of the highest natural frequency: what is below is motion as a rigid body


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of a structure, the slowest first; n of them, with standard errors beside."""

    frequency: Floats  # undamped natural frequencies in hertz; zero for motion as a rigid body; shape (n,)
    frequency_error: Floats
    damping: Floats  # damping ratios; zero for motion as a rigid body; shape (n,)
    damping_error: Floats
    shape: Floats  # each row a mode shape, one at the coordinate that moves most; shape (n, coordinates)
    shape_error: Floats

    @property
    def rigid(self) -> int:
        """How many modes are motion as a rigid body: nothing ties the structure down."""
        return int(np.count_nonzero(self.frequency == 0.0))


def modes_of(model: Model, keys: Sequence[str] = (), covariance: Floats | None = None) -> Modes:
    """Modes of a structure whose values are all known; none of a component, whose motion is prescribed.

    Parameters
    ----------
    model : Model
        Its linear terms count, or its modal part.
    keys : sequence of str
        What was estimated; everything else counts as exact.
    covariance : array, shape (keys, keys)
        Of these.
    """
    if model.prescribed:
        return Modes(*(np.zeros(0) for _ in range(4)), *(np.zeros((0, len(model.coordinates))) for _ in range(2)))
    mass = checked_mass_matrix(model)
    values = model.numbers()
    stiffness, damping, _ = matrices(model, values)
    half = np.linalg.inv(np.linalg.cholesky(mass))
    squares, vectors = np.linalg.eigh(half @ stiffness @ half.T)
    shapes: Floats = np.asarray(half.T @ vectors, dtype=np.float64)  # of unit modal mass, in columns
    omega = np.sqrt(np.maximum(squares, 0.0))
    omega = np.where(omega > RIGID * np.max(omega), omega, 0.0)
    roots = _roots(stiffness, damping, mass, omega)
    orders, units = linear_keys(model), patterns(model)
    covariance = np.zeros((len(keys), len(keys))) if covariance is None else covariance
    n, p = len(omega), len(keys)
    by_square, by_shape, by_ratio = np.zeros((p, n)), np.zeros((p, n, n)), np.zeros((p, n))
    for i, key in enumerate(keys):
        if key in orders:
            by_square[i], by_shape[i] = _changes(units[key], orders[key], squares, shapes)
            by_ratio[i] = _root_changes(units[key], orders[key], roots, damping, mass)
    moving = omega > 0.0
    rate = np.where(moving, omega, 1.0)
    ratio = -roots[0].real / np.abs(roots[0])
    still = roots[0].imag == 0.0  # beyond critical damping nothing oscillates: the ratio is that of the mode's damping
    own = np.einsum("cm,cd,dm->m", shapes, damping, shapes) / (2.0 * rate)
    by_own = np.einsum("pcm,cd,dm->pm", by_shape, damping, shapes) / rate - own * by_square / (2.0 * rate**2)
    for i, key in enumerate(keys):
        if orders.get(key) == 1:
            by_own[i] += np.einsum("cm,cd,dm->m", shapes, units[key], shapes) / (2.0 * rate)
    ratio, by_ratio = np.where(still, own, ratio), np.where(still, by_own, by_ratio)
    errors = [np.sqrt(np.maximum(np.einsum("p...,pq,q...->...", g, covariance, g), 0.0)) for g in (by_square, by_ratio)]
    basis = shapes_of(model, values)
    by_motion = basis @ by_shape
    if model.modal:
        felt = {key: (i, r) for i, c in enumerate(model.coordinates) for r, key in enumerate(model.modal.shape(c))}
        for i, key in enumerate(keys):
            if key in felt:
                by_motion[i, felt[key][0]] += shapes[felt[key][1]]
    shape, shape_error = _normalised(basis @ shapes, by_motion, covariance)
    return Modes(
        omega / (2.0 * np.pi), np.where(moving, errors[0] / (4.0 * np.pi * rate), 0.0), np.where(moving, ratio, 0.0),
        np.where(moving, errors[1], 0.0), shape, shape_error,
    )  # fmt: skip


def _roots(stiffness: Floats, damping: Floats, mass: Floats, omega: Floats) -> tuple[Complexes, Complexes]:
    """The eigenvalue of positive frequency nearest to each undamped mode, shape (n,), and its vectors in columns."""
    n = len(mass)
    inverse = np.linalg.inv(mass)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    values, vectors = (np.asarray(x, dtype=np.complex128) for x in np.linalg.eig(system))
    chosen: list[int] = []
    for w in omega:
        upper = np.where(values.imag >= 0.0, np.abs(values - 1j * w), np.inf)
        upper[chosen] = np.inf
        chosen.append(int(np.argmin(upper)))
    picked = values[chosen]
    return np.where(np.abs(picked) > 0.0, picked, 1.0), vectors[:n, chosen]


def _changes(unit: Floats, order: int, squares: Floats, shapes: Floats) -> tuple[Floats, Floats]:
    """Derivatives of squared frequencies and shapes by one key, shapes in columns: (n,) and (n, n)."""
    if order == 1:
        return np.zeros_like(squares), np.zeros_like(shapes)
    weight = np.ones_like(squares) if order == 0 else -squares
    product = shapes.T @ unit @ shapes  # j, i: of mode i, along mode j
    gap = squares[None, :] - squares[:, None]
    apart = np.abs(gap) > 1e-12 * np.max(np.abs(squares))
    along = np.where(apart, product * weight[None, :] / np.where(apart, gap, 1.0), 0.0)
    if order == 2:
        along = along - 0.5 * np.diag(np.diag(product))
    return np.diag(product) * weight, shapes @ along


def _root_changes(
    unit: Floats, order: int, roots: tuple[Complexes, Complexes], damping: Floats, mass: Floats
) -> Floats:
    """Derivatives of the damping ratios by one key, shape (n,)."""
    values, vectors = roots
    found = np.zeros(len(values))
    for i, (root, psi) in enumerate(zip(values, vectors.T, strict=True)):
        bottom = psi @ (2.0 * root * mass + damping) @ psi
        moved = -(root**order) * (psi @ unit @ psi) / bottom if bottom != 0.0 else 0.0
        size = abs(root)
        found[i] = -moved.real / size + root.real * (root.conjugate() * moved).real / size**3
    return found


def _normalised(shapes: Floats, slopes: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Shapes in rows with one at the coordinate that moves most, and their standard errors."""
    rows, errors = list[Floats](), list[Floats]()
    for i, shape in enumerate(shapes.T):
        top = int(np.argmax(np.abs(shape)))
        row = shape / shape[top]
        change = (slopes[:, :, i] - row * slopes[:, top, i][:, None]) / shape[top]
        rows.append(row)
        errors.append(np.sqrt(np.maximum(np.einsum("pn,pq,qn->n", change, covariance, change), 0.0)))
    return np.stack(rows), np.stack(errors)


def modes_table(modes: Modes, coordinates: Sequence[str]) -> str:
    """The modes as a person reads them."""
    from tabulate import tabulate

    rows = [
        [
            str(i + 1), _with_error(modes.frequency[i], modes.frequency_error[i]),
            _with_error(100.0 * modes.damping[i], 100.0 * modes.damping_error[i]),
            *(_with_error(x, e) for x, e in zip(modes.shape[i], modes.shape_error[i], strict=True)),
        ]
        for i in range(len(modes.frequency))
    ]  # fmt: skip
    return tabulate(rows, ["mode", "Hz", "damping %", *coordinates], tablefmt="simple", disable_numparse=True)


def _with_error(value: float, error: float) -> str:
    return f"{value:.4g}" + (f" +- {1.96 * error:.1g}" if error > 0.0 else "")
