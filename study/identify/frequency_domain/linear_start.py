"""Where a fit of a structure begins: its linear terms from the frequency response functions at the sensors.

``H(f) = G_yf G_ff^-1`` is the best linear approximation, which noise on the motions does not bias. Where every
coordinate is measured, ``Z(f) H(f) = B`` is linear in masses, dampings and stiffnesses; weighting with the inverse of
the last dynamic stiffness Z makes it the error of H (Sanathanan and Koerner, 1963). Then, or from several drawn
structures where sensors are missing, the error of H itself is minimised.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from study.equations.equations_of_motion import loose_motions
from study.equations.linear_part import acting, linear_keys, matrices, patterns
from study.equations.model import Model
from study.equations.terms import LINEAR
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Record
from study.records.spectra import Segments, cross_spectra_within, segment_length
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares
from study.support.levenberg_marquardt import End, Point, minimise, point_at

FAINT = 1e-3  # share of the strongest line's force below which a line is leakage
CHANCE = 0.01  # probability that noise alone reaches the coherence of a line that the linear start uses
MOST_LINES = 300
LEAST_ERROR = 1e-4  # share of a response that counts as its error at least, where there is no noise
LOCAL_MINIMUM = 0.01  # share of the responses' power: a search that leaves more has ended at one
WEIGHTED_SOLUTIONS, SEARCH_RUNS = 6, 40
DRAWN, STARTED, BATCH = 200, 40, 10  # structures drawn; those that start a search, so many at a time


@dataclass(frozen=True, eq=False)
class SensorResponses:
    """Frequency response functions at the sensors.

    Attributes
    ----------
    omega : array, shape (lines,)
        Angular frequency in rad/s.
    response : complex array, shape (lines, sensors, forces)
        Motion over force.
    error : array, shape (lines, sensors, forces)
        Its standard error.
    """

    omega: Floats
    response: Complexes
    error: Floats


def frequency_responses(prepared: Prepared, model: Model, loose: bool) -> SensorResponses:
    """The best linear approximation of the sensors by the forces on the fitting part; of a ``loose`` model it is said.

    Raises
    ------
    StudyError
        If nothing drives the structure, or forces and motions have nothing in common.
    """
    names = [name for name, _ in model.forces]
    expect(names, f"nothing drives {model.name!r}; expected 'forces' in the model, or values for its linear terms")
    parts = [[p[c] - np.mean(p[c]) for c in (*names, *prepared.outputs.sensors)] for p in _whole_parts(prepared)]
    channels, begins = [np.concatenate(pieces) for pieces in zip(*parts, strict=True)], [len(p[0]) for p in parts]
    cut = Segments(segment_length(len(channels[0]), held=6, fewest=16, most=2048))
    matrix = cross_spectra_within(channels, np.cumsum(begins)[:-1].tolist(), prepared.dt, cut)
    n, g = len(names), matrix.density[1:-1]
    inputs, cross = g[:, :n, :n], g[:, :n, n:]
    power = np.einsum("fii->fi", inputs).real
    driven = np.all(power > FAINT * np.max(power, axis=0), axis=1)
    g, inputs, cross, omega = g[driven], inputs[driven], cross[driven], 2.0 * np.pi * matrix.frequency[1:-1][driven]
    inverse = np.linalg.inv(inputs)
    response = (inverse @ cross).transpose(0, 2, 1)  # y = H f: H^T = G_ff^-1 G_fy
    own = np.einsum("fii->fi", g[:, n:, n:]).real
    explained = np.einsum("fsk,fks->fs", response.conj(), cross).real
    coherence = np.clip(explained / np.where(own > 0.0, own, np.inf), 0.0, 1.0)
    by_chance = 1.0 - CHANCE ** (1.0 / max(matrix.averages - n, 1.0))
    keep = np.any(coherence > by_chance, axis=1)
    if np.count_nonzero(keep) < 4:
        said = f"forces and motions of {prepared.record.name!r} have nothing in common at any frequency"
        floats = f"nothing ties {model.name!r} down and what is measured drifts; expected accelerations, which do not"
        raise StudyError(f"{said}: {floats}" if loose else said)
    noise = own * np.maximum(1.0 - coherence, LEAST_ERROR) / max(matrix.averages - n, 1.0)
    error = np.sqrt(noise[:, :, None] * np.einsum("fkk->fk", inverse).real[:, None, :])
    thin = np.flatnonzero(keep)[:: max(1, np.count_nonzero(keep) // MOST_LINES)]
    return SensorResponses(omega[thin], response[thin], error[thin])


def _whole_parts(prepared: Prepared) -> list[Record]:
    """What is fitted; of blocks between which the motion runs on, each record from the first of them to the last.

    Such blocks are too short for a spectrum by themselves, and the start alone sees what lies between them.
    """
    part = prepared.record.part(*prepared.plan.fit)
    spans: dict[int, tuple[Record, int, int]] = {}
    for stretch in part.stretches:
        source, first, last = spans.get(id(stretch.source), (stretch.source, stretch.first, stretch.last))
        spans[id(stretch.source)] = source, min(first, stretch.first), max(last, stretch.last)
    return [source.part(first, last) for source, first, last in spans.values()] or [part]


@dataclass(frozen=True, eq=False)
class _Linear:
    """The linear structure as the search sees it."""

    omega: Floats
    measured: Complexes  # (lines, sensors, forces)
    error: Floats
    units: Complexes  # (keys, lines, n, n): what a unit of each free key adds to the dynamic stiffness
    held: Complexes  # (lines, n, n)
    force: Floats  # (n, forces)
    rows: list[int]  # coordinate of each sensor
    order: Complexes  # (lines, sensors): its derivative as a factor
    heavy: list[int]  # free keys that are masses

    def stiffness(self, x: Floats) -> Complexes:
        """Dynamic stiffness, shape (lines, n, n)."""
        return self.held + np.einsum("k,kfij->fij", x, self.units)

    def point(self, x: Floats) -> Point | None:
        """Error of the responses and its derivatives in standard errors."""
        if any(x[k] <= 0.0 for k in self.heavy):
            return None
        try:
            inverse = np.linalg.inv(self.stiffness(x))
        except np.linalg.LinAlgError:
            return None
        out = inverse[:, self.rows, :] * self.order[:, :, None]
        moved = inverse @ self.force
        weight = 1.0 / self.error
        residual = (self.measured - out @ self.force) * weight
        slopes = -np.einsum("fsi,kfij,fjm->kfsm", out, self.units, moved, optimize=True) * weight
        jacobian = slopes.reshape(len(x), -1).T
        return point_at(x, _real(residual.ravel()), _real(jacobian), len(x), (0,))

    def rounds(self) -> list[Floats]:
        """Solutions of ``Z H = B``, each weighted with the one before; none where a coordinate has no sensor."""
        n = self.force.shape[0]
        if sorted(self.rows) != list(range(n)):
            return []
        place = np.argsort(self.rows)
        motion = (self.measured / self.order[:, :, None])[:, place]
        weight = (np.abs(self.order)[:, :, None] / self.error)[:, place]
        columns = np.einsum("kfij,fjm->kfim", self.units, motion)
        target = self.force - self.held @ motion
        size = np.sqrt(np.mean(np.abs(columns) ** 2, axis=(0, 2, 3))) * np.mean(
            1.0 / weight / np.abs(motion), axis=(1, 2)
        )
        left: Complexes = np.broadcast_to(np.eye(n), self.held.shape) / size[:, None, None]
        found: list[Floats] = []
        for k in range(WEIGHTED_SOLUTIONS):
            w = weight if k else np.ones_like(weight)
            design = _real(np.einsum("fij,kfjm->kfim", left, columns) * w).reshape(len(columns), -1).T
            x = least_squares(design, _real((left @ target) * w).ravel())
            found.append(np.where([i in self.heavy for i in range(len(x))], np.abs(x), x))
            left = np.asarray(np.linalg.inv(self.stiffness(x)), dtype=np.complex128)
        return found


def _real(values: Complexes) -> Floats:
    """Real and imaginary parts one after the other along the first axis of samples."""
    axis = 0 if values.ndim <= 2 else 1
    return np.concatenate([values.real, values.imag], axis=axis)


def _problem(
    model: Model, prepared: Prepared, held: Mapping[str, float], loose: bool
) -> tuple[_Linear, list[str]]:  # fmt: skip
    responses = frequency_responses(prepared, model, loose)
    orders, own = linear_keys(model), patterns(model)
    s = 1j * responses.omega
    free = [key for key in orders if key not in held]
    n = len(model.coordinates)
    known = np.zeros((len(s), n, n), dtype=np.complex128)
    for key in orders:
        if key in held:
            known += held[key] * s[:, None, None] ** orders[key] * own[key]
    units = np.array([s[:, None, None] ** orders[key] * own[key] for key in free], dtype=np.complex128)
    force = acting(model.with_values({key: held[key] for key in orders if key in held}))
    order = np.stack([s ** MOTIONS.index(x.motion) for x in prepared.sensors], axis=1).astype(np.complex128)
    rows = [model.coordinates.index(x.coordinate) for x in prepared.sensors]
    heavy = [i for i, key in enumerate(free) if orders[key] == 2 and "," not in key]
    return _Linear(
        responses.omega, responses.response, responses.error, units.reshape(len(free), len(s), n, n), known, force,
        rows, order, heavy,
    ), free  # fmt: skip


def lumped_start(model: Model, prepared: Prepared, held: Mapping[str, float]) -> dict[str, float]:
    """Linear coefficients that are not held, from the frequency response functions of the fitting part.

    Raises
    ------
    StudyError
        If nothing drives the structure, or no structure of this kind responds like it.
    """
    linear = replace(model, terms=tuple(t for t in model.terms if t.term.name in LINEAR))
    known = tuple((key, value) for key, value in held.items() if key in linear.values)  # others say nothing of these
    return dict(_of_linear_terms(linear, prepared, known, loose_motions(model) > 0))


@lru_cache(maxsize=4)  # of the records that the threads are working on
def _of_linear_terms(
    model: Model, prepared: Prepared, known: tuple[tuple[str, float], ...], loose: bool
) -> dict[str, float]:  # fmt: skip
    """The same of the linear terms alone; cached, as a fit asks again, and so do others beside other effects."""
    held = dict(known)
    problem, free = _problem(model, prepared, held, loose)
    if not free:
        return {}
    points = [point for x in problem.rounds() if (point := problem.point(x)) is not None]
    nearest = sorted(points, key=lambda point: point.cost)[:2]
    ends = [end for point in nearest for end in _searched(problem, point.x)]
    if not any(_follows(problem, end) for end in ends):
        drawn = [point for x in _drawn(model, problem, free, held) if (point := problem.point(x)) is not None]
        drawn.sort(key=lambda point: point.cost)
        for first in range(0, STARTED, BATCH):
            ends += [end for point in drawn[first : first + BATCH] for end in _searched(problem, point.x)]
            if any(_follows(problem, end) for end in ends):
                break
    if not ends:
        raise StudyError(f"no structure like {model.name!r} responds as {prepared.record.name!r} does")
    structures = [(dict(zip(free, end.point.x.tolist(), strict=True)), end.point.cost) for end in ends]
    return min(structures, key=lambda item: (not _comes_to_rest(model, {**held, **item[0]}), item[1]))[0]


def _comes_to_rest(model: Model, values: Mapping[str, float]) -> bool:
    """Whether the motion dies away when nothing drives it: that of others grows without end in a free run."""
    stiffness, damping, mass = matrices(model, values)
    n, inverse = len(mass), np.asarray(np.linalg.inv(mass), dtype=np.float64)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    roots = np.linalg.eigvals(system)
    return bool(np.all(roots.real <= 1e-6 * np.max(np.abs(roots))))


def _follows(problem: _Linear, end: End) -> bool:
    """Whether a structure responds by and large as measured, as a nonlinear one too does like some linear one."""
    return end.point.cost < LOCAL_MINIMUM * float(np.linalg.norm(problem.measured / problem.error)) ** 2


def _searched(problem: _Linear, x: Floats) -> list[End]:
    point = problem.point(x)
    size = float(np.linalg.norm(problem.measured / problem.error))
    return [] if point is None else [minimise(problem.point, point, size, SEARCH_RUNS, 1e-2)]


def _drawn(model: Model, problem: _Linear, free: list[str], held: Mapping[str, float]) -> list[Floats]:
    """Structures with frequencies in the band that is driven, sized to respond as strongly as was measured."""
    rng = np.random.default_rng(1990)
    orders = linear_keys(model)
    strength = np.sum(np.abs(problem.measured / problem.order[:, :, None]) ** 2, axis=(1, 2))
    found: list[Floats] = []
    for _ in range(DRAWN):
        rate = float(rng.choice(problem.omega, p=strength / np.sum(strength))) * float(np.exp(rng.uniform(0.0, 1.0)))
        base = {2: 1.0, 1: 0.04 * rate, 0: rate**2}
        x = np.array([base[orders[key]] * np.exp(0.7 * rng.standard_normal()) for key in free])
        x = np.where(["," in key for key in free], 0.0, x)
        size = np.abs(np.linalg.inv(problem.stiffness(x))[:, problem.rows] @ problem.force * problem.order[:, :, None])
        found.append(x if held else x * float(np.median(size) / np.median(np.abs(problem.measured))))
    return found
