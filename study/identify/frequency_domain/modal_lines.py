"""Where the fit of a modal linear part begins: its modes from the lines of a record.

Forces and the terms' forces along the measured motions are inputs, the sensors outputs (Adams and Allemang, Mechanical
Systems and Signal Processing 14, 2000). Poles come from a subspace, amplitudes from least squares, and both are refined
to the smallest error of the lines.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import rfft

from study.equations.modal_part import ModalPart, rates_of
from study.equations.model import Model
from study.identify.frequency_domain.inputs import input_history, placed_inputs
from study.identify.frequency_domain.linear_start import FAINT
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Record
from study.support.arrays import Complexes, Floats, Ints
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares
from study.support.levenberg_marquardt import Point, minimise, point_at


@dataclass(frozen=True, eq=False)
class Observability:
    """What the lines say of a system's order: a subspace and its weights."""

    basis: Floats  # left singular vectors, shape (blocks outputs, blocks outputs)
    singular: Floats  # how much of the outputs each direction holds, shape (blocks outputs,)
    outputs: int  # how many
    period: float  # T of the bilinear transformation ``s = 2/T (z - 1)/(z + 1)``, in seconds

    def poles(self, order: int) -> Complexes:
        """Eigenvalues in rad/s of the system of this order, reflected to the left where they are unstable."""
        left = self.basis[:, :order]
        shifted = np.linalg.lstsq(left[: -self.outputs], left[self.outputs :], rcond=None)[0]
        z = np.asarray(np.linalg.eigvals(shifted), dtype=np.complex128)
        s = 2.0 / self.period * (z - 1.0) / (z + 1.0)
        return np.asarray(-np.abs(s.real) + 1j * s.imag, dtype=np.complex128)


def observability(omega: Floats, inputs: Complexes, outputs: Complexes, blocks: int, stretch: Ints) -> Observability:
    """The extended observability matrix's column space.

    Parameters
    ----------
    omega : array, shape (lines,)
        Angular frequency in rad/s.
    inputs, outputs : complex array, shape (lines, inputs) and (lines, outputs)
        Spectra; each output is scaled to unit power.
    blocks : int
        Block rows: more than the order of the system.
    stretch : int array, shape (lines,)
        Of which stretch each line is: one that is cut has a transient of its own.
    """
    period = 2.0 / float(np.sqrt(np.min(omega) * np.max(omega)))
    turn = np.exp(2j * np.arctan(omega * period / 2.0))
    transient = (stretch[:, None] == np.unique(stretch)) * np.sqrt(np.mean(np.abs(inputs[:, :1]) ** 2))
    driven = _unit(np.concatenate([inputs, transient * turn[:, None]], axis=1))
    rows = [_stack(driven, turn, blocks), _stack(_unit(outputs), turn, blocks)]
    data = np.concatenate(rows)
    real = np.concatenate([data.real, data.imag], axis=1)
    triangle = np.asarray(np.linalg.qr(real.T)[1], dtype=np.float64).T
    first = len(rows[0])
    basis, singular, _ = np.linalg.svd(triangle[first:, first:])
    return Observability(basis, singular, outputs.shape[1], period)


def _unit(values: Complexes) -> Complexes:
    size = np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    return values / np.where(size > 0.0, size, 1.0)


def _stack(values: Complexes, turn: Complexes, blocks: int) -> Complexes:
    """Block rows ``z^p values``, shape (blocks channels, lines)."""
    powers: Sequence[Complexes] = [turn**p for p in range(blocks)]
    return np.concatenate([(values * power[:, None]).T for power in powers])


BLOCK_ROWS, MOST_MODES = 24, 8  # of the subspace
REAL_POLES = 4  # beside those of the modes, at most: of the record's ends, and of what no mode is
MOST_DRIVEN_LINES = 1200
MODAL_TRIALS = 60


@dataclass(frozen=True, eq=False)
class DrivenLines:
    """Lines of a record in the band that its forces drive.

    Attributes
    ----------
    s : complex array, shape (lines,)
        j 2 pi f.
    forces : complex array, shape (lines, forces)
        Measured forces.
    unit : complex array, shape (lines, coefficients)
        Force of each coefficient of the terms with value one, along the measured motion.
    outputs : complex array, shape (lines, sensors)
        Sensors in shares of their size, as displacements times ``order``.
    order : complex array, shape (lines, sensors)
        ``s^r / size`` of each sensor's motion.
    stretch : int array, shape (lines,)
        Of which stretch each is.
    """

    s: Complexes
    forces: Complexes
    unit: Complexes
    outputs: Complexes
    order: Complexes
    stretch: Ints


def lines_of(model: Model, prepared: Prepared) -> DrivenLines:
    """Lines of the fitting part, through a Hann window; of several stretches those of each, one after the other.

    Raises
    ------
    StudyError
        If no force drives the structure, or a term's place has no sensor.
    """
    blind = [c for t in model.terms for c in t.place.moving if c not in prepared.coordinates]
    expect(not blind, f"no sensor is at {', '.join(blind)}; expected terms of a modal model between sensors")
    motion = np.stack([prepared.record.motion(c) for c in model.coordinates], axis=2)
    forces = prepared.record.columns([name for name, _ in model.forces])
    unit = np.array(unit_forces(model, prepared.record, motion)).reshape(-1, len(forces)).T
    channels: Floats = np.hstack([forces, unit, prepared.measured])
    ends = forces.shape[1], forces.shape[1] + unit.shape[1]
    spectra, frequency = list[Complexes](), list[Floats]()
    for first, last in prepared.record.runs(prepared.plan.fit):
        n = last - first
        part: Floats = (channels[first:last] - np.mean(channels[first:last], axis=0)) * np.hanning(n + 1)[:-1, None]
        spectra.append(np.asarray(rfft(part, axis=0)[1 : n // 2], np.complex128))
        frequency.append(np.arange(1, n // 2) / (n * prepared.dt))
    powers = [np.sum(np.abs(lines[:, : ends[0]]) ** 2, axis=1) / len(lines) for lines in spectra]
    smooth = [np.convolve(power, np.ones(9) / 9.0, "same") for power in powers]
    strongest = max(float(np.max(power)) for power in smooth)
    driven = [np.flatnonzero(power > FAINT * strongest) for power in smooth]
    count = sum(map(len, driven))
    expect(count > 4 * BLOCK_ROWS, f"the forces of {prepared.record.name!r} drive {count} lines; expected more")
    kept = [lines[:: max(1, count // MOST_DRIVEN_LINES)] for lines in driven]
    found = np.concatenate([lines[keep] for lines, keep in zip(spectra, kept, strict=True)])
    s = 2j * np.pi * np.concatenate([f[keep] for f, keep in zip(frequency, kept, strict=True)])
    order = np.stack([s ** MOTIONS.index(x.motion) for x in prepared.sensors], axis=1) / prepared.scale
    shown = found[:, ends[1] :] / prepared.scale
    return DrivenLines(
        s.astype(np.complex128), found[:, : ends[0]], found[:, ends[0] : ends[1]], shown.astype(np.complex128),
        order.astype(np.complex128), np.repeat(np.arange(len(kept)), [len(keep) for keep in kept]),
    )  # fmt: skip


def unit_forces(model: Model, record: Record, motion: Floats) -> list[Floats]:
    """Force of each coefficient with value one along a motion, in the order of the model's symbols.

    ``motion`` is displacement, velocity and so on of the coordinates along the record, shape (orders, n, coordinates).
    """
    found: list[Floats] = []
    for entry in model.terms:
        relative = record.relative(motion @ np.array(entry.place.direction(model.coordinates)))
        by_symbol: dict[str, Floats] = {}
        for item in placed_inputs(entry):
            values = input_history(item, relative)
            for part in item.parts:
                unit = part.factor * (np.gradient(values, record.dt) if part.order else values)
                by_symbol[part.symbol] = by_symbol.get(part.symbol, 0.0) + unit
        found += [by_symbol[symbol] for symbol in entry.term.symbols]
    return found


@dataclass(frozen=True, eq=False)
class _Modal:
    """The error of the lines for modes without coupling by damping.

    Unknown are w2 and g of each mode, amplitudes by point, then coefficients.
    """

    lines: DrivenLines
    modal: ModalPart
    at: Floats  # (points, sensors): which point each sensor is at
    drives: Floats  # (points, forces)
    ways: Floats  # (points, coefficients): direction of each coefficient's place
    fastest: float  # rad/s: a mode beyond stands for the stiffness of all that lie above the band

    def split(self, x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """w2, g, amplitudes (points, modes) and coefficients."""
        n, points = self.modal.count, len(self.modal.points)
        return x[:n], x[n : 2 * n], x[2 * n : 2 * n + n * points].reshape(points, n), x[2 * n + n * points :]

    def point(self, x: Floats) -> Point | None:
        """Residual of all sensors and its derivatives."""
        w2, g, shape, amount = self.split(x)
        if np.any(w2 <= 0.0) or np.any(g <= 0.0) or np.any(rates_of(w2, g) > self.fastest):
            return None
        lines = self.lines
        acting = lines.forces @ self.drives.T - (lines.unit * amount) @ self.ways.T  # (lines, points)
        bend = 1.0 / (w2 + g * lines.s[:, None] + lines.s[:, None] ** 2)  # (lines, modes)
        pushed, felt = acting @ shape, self.at.T @ shape  # (lines, modes), (sensors, modes)
        residual = lines.outputs - lines.order * ((pushed * bend) @ felt.T)
        moved = -(pushed * bend**2)[:, None, :] * felt * lines.order[:, :, None]  # by w2: (lines, sensors, modes)
        columns = [moved, moved * lines.s[:, None, None]]
        for p in range(len(self.modal.points)):
            own = self.at[p][:, None] * (pushed * bend)[:, None, :] + felt * (acting[:, p : p + 1] * bend)[:, None, :]
            columns.append(own * lines.order[:, :, None])
        along = self.ways.T @ shape  # (coefficients, modes)
        through = (felt[:, None, :] * along).reshape(len(felt) * len(along), bend.shape[1])  # each sensor, coefficient
        pulled = (bend @ through.T).reshape(len(bend), len(felt), len(along)) * lines.unit[:, None, :]
        columns.append(-pulled * lines.order[:, :, None])
        jacobian = np.concatenate(columns, axis=2).reshape(-1, len(x))
        return point_at(x, _real(residual.ravel()), _real(jacobian), len(x), (0,))

    def from_poles(self, poles: Complexes) -> Floats:
        """Amplitudes and coefficients for poles, by least squares of every sensor on what acts through each mode."""
        w2, g = np.abs(poles) ** 2, -2.0 * poles.real
        lines, n = self.lines, self.modal.count
        bend = 1.0 / (w2 + g * lines.s[:, None] + lines.s[:, None] ** 2)
        inputs = np.concatenate([lines.forces, lines.unit], axis=1)
        amounts = np.zeros((self.at.shape[1], n, inputs.shape[1]))
        for k in range(self.at.shape[1]):
            design = (bend[:, :, None] * inputs[:, None, :]).reshape(len(bend), -1) * lines.order[:, k : k + 1]
            amounts[k] = least_squares(_real(design), _real(lines.outputs[:, k])).reshape(n, -1)
        at = [int(np.flatnonzero(row)[0]) if np.any(row) else -1 for row in self.at]
        (p, j), *_ = [
            (p, j) for j in range(self.drives.shape[1]) for p in np.flatnonzero(self.drives[:, j]) if at[p] >= 0
        ]
        own = amounts[at[p], :, j]
        driven = np.sqrt(np.maximum(np.abs(own), 1e-3 * float(np.max(np.abs(own)))))
        shape = np.stack([amounts[k, :, j] / driven if k >= 0 else driven for k in at])
        along, count = self.ways.T @ shape, lines.forces.shape[1]
        pulled = -amounts[at[p], :, count:].T  # coefficient times amplitude along its place times that of the force
        products = along * driven
        amount = np.sum(pulled * products, axis=1) / np.sum(products**2, axis=1)
        return np.concatenate([w2, g, shape.ravel(), amount])


def _real(values: Complexes) -> Floats:
    return np.concatenate([values.real, values.imag])


@dataclass(frozen=True, eq=False)
class LineFit:
    """Modes and coefficients with the smallest error of the lines."""

    model: Model  # with their values
    modal: ModalPart  # of it
    left: float  # power of the lines that it leaves, over that of all
    criterion: float  # of Bayes, for white noise in proportion to each sensor (Schwarz, 1978)


def line_fits(model: Model, prepared: Prepared, most: int = MOST_MODES) -> Iterator[LineFit]:
    """For one mode, two and so on up to ``most``, modes and coefficients with the smallest error of the lines.

    Raises
    ------
    StudyError
        If no sensor is where a force acts, or a term's place has none.
    """
    lines, sensors = lines_of(model, prepared), [x.coordinate for x in prepared.sensors]
    where = ", ".join(dict.fromkeys(w for _, w in model.forces))
    driven = any(w in sensors for _, w in model.forces)
    expect(driven, f"no sensor is at {where}, where the force acts; 'linear: modal' needs one there")
    points = model.coordinates
    directions = [t.place.direction(points) for t in model.terms for _ in t.term.symbols]
    ways = np.array(directions).reshape(-1, len(points)).T
    at = np.array([[float(c == s) for s in sensors] for c in points])
    drives = np.array([[float(c == w) for _, w in model.forces] for c in points])
    inputs = np.concatenate([lines.forces, lines.unit], axis=1)
    shown = lines.outputs / lines.order * np.abs(lines.order)
    space = observability(lines.s.imag, inputs, shown, BLOCK_ROWS, lines.stretch)
    power = float(np.sum(np.abs(lines.outputs) ** 2))
    for modes in range(1, most + 1):
        modal = ModalPart(points).of(modes)
        problem = _Modal(lines, modal, at, drives, ways, np.pi / prepared.dt)
        starts = (
            _searched(problem, space.poles(order), modes) for order in range(2 * modes, 2 * modes + REAL_POLES + 1)
        )
        found = next((point for point in starts if point is not None), None)
        if found is not None:
            left = float(found.residual @ found.residual) / power
            criterion = len(found.residual) * np.log(left) + len(found.x) * np.log(len(found.residual))
            known = _named(model, modal, problem.split(found.x))
            yield LineFit(known, modal, left, float(criterion))


def left_of_lines(model: Model, prepared: Prepared) -> float:
    """Share of the lines' power that a model leaves with no more modes than it has; infinite where it has no fit.

    With as many of them as the Bayesian criterion asks for. A fit takes hundredths of a second, and no free run.
    """
    try:
        fits = list(line_fits(model, prepared, model.modal.count if model.modal else MOST_MODES))
    except StudyError:
        return np.inf
    return min(fits, key=lambda f: f.criterion).left if fits else np.inf


def _searched(problem: _Modal, poles: Complexes, modes: int) -> Point | None:
    """The smallest error of the lines from the pairs of poles; None if there are too few."""
    pairs = poles[poles.imag > 0.0]
    if len(pairs) < modes:
        return None
    pairs = pairs[np.argsort(-pairs.real / np.abs(pairs))][:modes]
    pairs = pairs * np.minimum(0.9 * problem.fastest / np.abs(pairs), 1.0)
    point = problem.point(problem.from_poles(pairs))
    if point is None:
        return None
    size = float(np.linalg.norm(problem.lines.outputs))
    return minimise(problem.point, point, size, MODAL_TRIALS, 1e-2).point


def _named(model: Model, modal: ModalPart, parts: tuple[Floats, Floats, Floats, Floats]) -> Model:
    """The model with the numbers of its modes, which damping does not couple, and its coefficients."""
    w2, g, shape, amount = parts
    values = dict(zip(modal.stiffness, w2.tolist(), strict=True))
    values |= {key: float(g[r]) if r == s else 0.0 for (r, s), key in zip(modal.pairs, modal.damping, strict=True)}
    for point, row in zip(modal.points, shape, strict=True):
        values |= dict(zip(modal.shape(point), row.tolist(), strict=True))
    values |= dict(zip([s for t in model.terms for s in t.symbols], amount.tolist(), strict=True))
    return replace(model, modal=modal).with_values(values)
