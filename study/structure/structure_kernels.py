"""The compiled loops of a structure: free runs with exact derivatives, and dry friction at several places.

``w[k]`` holds the states (rows: displacements, velocities, own states z) beside their derivatives (columns): w[0] where
a step stands, w[1] to w[3] room for a trial, its slope and their sum, w[4] where a part of a step begins. Numba's disk
cache does not notice a change of what this file calls of :mod:`study.equations.kernels`: change this one with it.

Dry friction makes a force that is linear in the sign s of a relative velocity ``e.v``. While a place moves, s is 1 or
-1 and a step is cut where ``e.v`` vanishes; while it is held, s is whatever keeps ``e.a`` at zero, and it lets go where
that leaves [-1, 1]. What is held follows from all that is held together: ``(e da/ds) s = -e.a`` at s = 0.
"""

import math

import numpy as np

from study.equations.jit import compiled
from study.equations.kernels import copy_state, first_zero, run
from study.support.arrays import Floats, Ints

CUTS = 6  # of a step, for each place with friction
CLOSE = 1e-9  # to one: the sign of a held place at which it lets go


@compiled
def _evaluate(code: Ints, first: int, r: Floats, n: int, time: float, drive: Floats, j: int, w: Floats) -> None:
    """Run the program at the state ``w[1]``."""
    channels = drive.shape[1]
    for i in range(2 * n):
        r[i] = w[1, i, 0]
    r[2 * n] = time
    for c in range(channels):
        r[2 * n + 1 + c] = drive[j, c]
    for i in range(2 * n, w.shape[1]):
        r[1 + channels + i] = w[1, i, 0]
    run(code, first, r)


@compiled
def _eliminate(matrix: Floats, right: Floats) -> None:
    """Solve in place by elimination with the diagonal as pivots; right has several columns.

    Where a pivot vanishes nothing holds the place: twice the sign of what pushes, which lets it go.
    """
    n = matrix.shape[0]
    for k in range(n):
        pivot = matrix[k, k]
        if pivot == 0.0:
            continue
        for i in range(n):
            if i != k and matrix[i, k] != 0.0:
                ratio = matrix[i, k] / pivot
                for m in range(k, n):
                    matrix[i, m] -= ratio * matrix[k, m]
                for c in range(right.shape[1]):
                    right[i, c] -= ratio * right[k, c]
    for k in range(n):
        pivot = matrix[k, k]
        for c in range(right.shape[1]):
            if pivot != 0.0:
                right[k, c] /= pivot
            else:
                right[k, c] = -2.0 * np.sign(right[k, c]) if c == 0 else 0.0


@compiled
def _held_system(
    r: Floats, sides: Ints, by_side: Ints, directions: Floats, held: Ints, matrix: Floats
) -> int:  # fmt: skip
    """Derivatives of the held relative accelerations by their signs into ``matrix``; how many are held."""
    count = 0
    for a in range(len(sides)):
        if held[a] == 0:
            continue
        other = 0
        for b in range(len(sides)):
            if held[b] == 0:
                continue
            total = 0.0
            for i in range(directions.shape[1]):
                total += directions[a, i] * r[by_side[b, i]]
            matrix[count, other] = total
            other += 1
        count += 1
    return count


@compiled
def _hold(
    code: Ints, first: int, r: Floats, slopes: Ints, sides: Ints, by_side: Ints, directions: Floats, held: Ints
) -> None:
    """Signs of the held places at which they stay held; the program has run at this state with any."""
    matrix = np.zeros((len(sides), len(sides)))
    right = np.zeros((len(sides), 1))
    for a in range(len(sides)):
        if held[a] != 0:
            r[sides[a]] = 0.0
    run(code, first, r)
    count = _held_system(r, sides, by_side, directions, held, matrix)
    at = 0
    for a in range(len(sides)):
        if held[a] != 0:
            total = 0.0
            for i in range(directions.shape[1]):
                total -= directions[a, i] * r[slopes[i]]
            right[at, 0] = total
            at += 1
    _eliminate(matrix[:count, :count], right[:count])
    at = 0
    for a in range(len(sides)):
        if held[a] != 0:
            r[sides[a]] = right[at, 0]
            at += 1
    run(code, first, r)


@compiled
def _hold_derivatives(
    r: Floats, sides: Ints, by_side: Ints, directions: Floats, held: Ints, w: Floats, columns: int
) -> None:  # fmt: skip
    """Derivatives of the accelerations with those of the held signs, which keep each held ``e.a`` at zero."""
    n = directions.shape[1]
    matrix = np.zeros((len(sides), len(sides)))
    right = np.zeros((len(sides), columns))
    count = _held_system(r, sides, by_side, directions, held, matrix)
    at = 0
    for a in range(len(sides)):
        if held[a] != 0:
            for i in range(n):
                for c in range(1, columns):
                    right[at, c] -= directions[a, i] * w[2, n + i, c]
            at += 1
    _eliminate(matrix[:count, :count], right[:count])
    at = 0
    for a in range(len(sides)):
        if held[a] != 0:
            for i in range(n):
                push = r[by_side[a, i]]
                if push != 0.0:
                    for c in range(1, columns):
                        w[2, n + i, c] += push * right[at, c]
            at += 1


@compiled
def _variation(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints | None, by_side: Ints,
    directions: Floats, held: Ints, time: float, drive: Floats, j: int, w: Floats, columns: int,
) -> None:  # fmt: skip
    """Derivatives of ``w[1]`` into ``w[2]``: the states in the first column, their sensitivities in the others.

    ``ds/dt = (df/dx) s + df/dp``; columns beyond those of the keys are those of the initial state. Only so many are
    taken as ``columns`` says.
    """
    n = directions.shape[1]
    _evaluate(code, first, r, n, time, drive, j, w)
    holding = False
    if sides is not None:
        for a in range(len(sides)):
            holding = holding or held[a] != 0
        if holding:
            _hold(code, first, r, slopes, sides, by_side, directions, held)
    for i in range(n):
        for c in range(columns):
            w[2, i, c] = w[1, n + i, c]
    for i in range(len(slopes)):
        w[2, n + i, 0] = r[slopes[i]]
        for c in range(1, columns):
            w[2, n + i, c] = 0.0
    if columns == 1:
        return
    for k in range(by_key.shape[0]):
        w[2, n + by_key[k, 0], 1 + by_key[k, 1]] = r[by_key[k, 2]]
    for k in range(by_state.shape[0]):
        partial = r[by_state[k, 2]]
        if partial != 0.0:
            i, m = n + by_state[k, 0], by_state[k, 1]
            for c in range(1, columns):
                w[2, i, c] += partial * w[1, m, c]
    if sides is not None:  # noqa: SIM102 - alone, Numba leaves out what follows where there is no dry friction
        if holding:
            _hold_derivatives(r, sides, by_side, directions, held, w, columns)


@compiled
def _rk4_step(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints | None, by_side: Ints,
    directions: Floats, held: Ints, time: float, h: float, drive: Floats, j: int, w: Floats, columns: int,
) -> None:  # fmt: skip
    """One Runge-Kutta step of ``w[0]`` in place; drive[j], drive[j + 1], drive[j + 2] are half a step apart."""
    for i in range(w.shape[1]):
        for c in range(columns):
            w[1, i, c] = w[0, i, c]
            w[3, i, c] = 0.0
    for stage in range(4):
        late = (stage + 1) // 2
        _variation(
            code, first, r, slopes, by_state, by_key, sides, by_side, directions, held,
            time + 0.5 * h * late, drive, j + late, w, columns,
        )  # fmt: skip
        weight = h / 3.0 if late == 1 else h / 6.0
        ahead = h if stage == 2 else 0.5 * h
        for i in range(w.shape[1]):
            for c in range(columns):
                w[3, i, c] += weight * w[2, i, c]
                w[1, i, c] = w[0, i, c] + ahead * w[2, i, c]
    for i in range(w.shape[1]):
        for c in range(columns):
            w[0, i, c] += w[3, i, c]


@compiled
def _along(directions: Floats, a: int, w: Floats, row: int, offset: int, c: int) -> float:
    """Relative motion of a place: ``offset`` 0 for the displacement, n for the velocity, column c."""
    total = 0.0
    for i in range(directions.shape[1]):
        total += directions[a, i] * w[row, offset + i, c]
    return total


@compiled
def _part(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints, by_side: Ints,
    directions: Floats, held: Ints, time: float, h: float, begin: float, end: float,
    drive: Floats, j: int, local: Floats, w: Floats, columns: int,
) -> None:  # fmt: skip
    """From ``w[4]`` into ``w[0]``: the part of a step between two fractions of it, what is held staying held.

    ``local`` gets the drive at both and between, from the parabola through the step's three points. The program has
    then run at the end, and ``w[2]`` has the slopes of the states there. A search for an event takes one column.
    """
    for i in range(3):
        x = begin + 0.5 * i * (end - begin)
        for c in range(drive.shape[1]):
            outer = (1.0 - x) * drive[j, c] - x * drive[j + 2, c]
            local[i, c] = (1.0 - 2.0 * x) * outer + 4.0 * x * (1.0 - x) * drive[j + 1, c]
    for i in range(w.shape[1]):
        for c in range(columns):
            w[0, i, c] = w[4, i, c]
    _rk4_step(
        code, first, r, slopes, by_state, by_key, sides, by_side, directions, held,
        time + begin * h, (end - begin) * h, local, 0, w, columns,
    )  # fmt: skip
    for i in range(w.shape[1]):
        w[1, i, 0] = w[0, i, 0]
    _variation(
        code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time + end * h, local, 2, w, 1
    )


@compiled
def _next_event(
    r: Floats, sides: Ints, directions: Floats, held: Ints, early: Floats, fresh: Ints, span: float, w: Floats
) -> tuple[int, float]:
    """Place whose friction switches first in a part of a step, and after which fraction of the part; -1 if none does.

    ``early`` are the signs of what is held at the beginning; the registers hold those at the end. What is ``fresh`` set
    off at the beginning, from a velocity of zero but for rounding.
    """
    n = directions.shape[1]
    place, least = -1, 1.0
    for a in range(len(sides)):
        s = r[sides[a]]
        if held[a] == 0:  # the mean velocity is the change of displacement: it shows a dip below zero between two steps
            mean = (_along(directions, a, w, 0, 0, 0) - _along(directions, a, w, 4, 0, 0)) / span
            v0 = 0.0 if fresh[a] != 0 else max(float(s * _along(directions, a, w, 4, n, 0)), 0.0)
            x = first_zero(v0, float(s * _along(directions, a, w, 0, n, 0)), float(s * mean))
        elif abs(early[a]) > 1.0:  # what else switched has set it free
            x = 0.0
        elif abs(s) > 1.0:
            begin = early[a] if s > 0.0 else -early[a]
            x = min(max((1.0 - begin) / (abs(s) - begin), 0.0), 1.0) if abs(s) > begin else 0.0
        else:
            x = 2.0
        if x <= least:
            place, least = a, x
    return place, least


@compiled
def _switch(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints, by_side: Ints,
    directions: Floats, held: Ints, a: int, time: float, h: float, begin: float, x: float,
    drive: Floats, j: int, local: Floats, w: Floats,
) -> float:  # fmt: skip
    """Step to where the relative velocity of a place vanishes and switch there; returns that fraction of the step.

    The guess x, a fraction of what is left of the step, is corrected by Newton. The time at which a velocity passes
    through zero depends on the parameters, and the derivatives of all velocities jump with the accelerations
    (saltation): ``s+ = s- - (a- - a+) (e.s-) / (e.a-)``.
    """
    n, s = directions.shape[1], r[sides[a]]
    span = (1.0 - begin) * h
    end, before = begin, 0.0
    for _ in range(3):
        x = min(max(x, 0.0), 1.0)
        end = begin + x * (1.0 - begin)
        _part(
            code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time, h, begin, end,
            drive, j, local, w, 1,
        )  # fmt: skip
        before = _along(directions, a, w, 2, n, 0)
        if before * s >= 0.0:
            break
        x -= _along(directions, a, w, 0, n, 0) / (before * span)
    _part(
        code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time, h, begin, end,
        drive, j, local, w, w.shape[2],
    )  # fmt: skip
    was = w[2, n : 2 * n, 0].copy()
    left = _along(directions, a, w, 0, n, 0) / before if before != 0.0 else 0.0  # time by which Newton misses
    for i in range(n):
        w[0, i, 0] -= w[0, n + i, 0] * left
        w[0, n + i, 0] -= was[i] * left
    for i in range(w.shape[1]):
        w[1, i, 0] = w[0, i, 0]
    r[sides[a]] = -s
    _variation(
        code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time + end * h, local, 2, w, 1
    )
    if _along(directions, a, w, 2, n, 0) * s >= 0.0:
        held[a] = 1
        _variation(
            code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time + end * h, local, 2, w, 1
        )
    for c in range(1, w.shape[2]):
        rate = _along(directions, a, w, 0, n, c) / before if before != 0.0 else 0.0
        for i in range(n):
            w[0, n + i, c] -= (was[i] - w[2, n + i, 0]) * rate
    return end


@compiled
def _release(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints, by_side: Ints,
    directions: Floats, held: Ints, a: int, time: float, h: float, begin: float, x: float, early: float,
    drive: Floats, j: int, local: Floats, w: Floats,
) -> float:  # fmt: skip
    """Step to where the other forces overcome friction at a held place and let it go; returns that fraction.

    The guess x, a fraction of what is left of the step, is corrected by secants: what is let go too early would turn
    back at once.
    """
    low, at_low = 0.0, abs(early)
    sign = math.copysign(1.0, early if abs(early) > 1.0 else r[sides[a]])
    end = begin
    for _ in range(3):
        end = begin + x * (1.0 - begin)
        _part(
            code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time, h, begin, end,
            drive, j, local, w, 1,
        )  # fmt: skip
        now = float(sign * r[sides[a]])
        if now == at_low or abs(now - 1.0) < CLOSE:
            break
        rise = (now - at_low) / (x - low) if x != low else 0.0
        low, at_low = x, now
        if rise <= 0.0:
            break
        x = min(max(x + (1.0 - now) / rise, 0.0), 1.0)
    _part(
        code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time, h, begin, end,
        drive, j, local, w, w.shape[2],
    )  # fmt: skip
    held[a], r[sides[a]] = 0, sign
    return end


@compiled
def _switching_step(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints, by_side: Ints,
    directions: Floats, held: Ints, time: float, h: float, drive: Floats, j: int, local: Floats, w: Floats,
) -> None:  # fmt: skip
    """One step of a structure with dry friction, cut where a relative velocity changes sign, stops, or sets off."""
    begin = 0.0
    early, fresh = np.zeros(len(sides)), np.zeros(len(sides), dtype=np.int64)
    for cut in range(CUTS * len(sides) + 1):
        copy_state(w, 0, 4)
        for a in range(len(sides)):
            early[a] = r[sides[a]]
        _part(
            code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time, h, begin, 1.0,
            drive, j, local, w, w.shape[2],
        )  # fmt: skip
        a, x = _next_event(r, sides, directions, held, early, fresh, (1.0 - begin) * h, w)
        if a < 0 or cut == CUTS * len(sides):
            return
        for b in range(len(sides)):
            fresh[b] = 0
        if held[a] == 0:
            begin = _switch(
                code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, a, time, h, begin, x,
                drive, j, local, w,
            )  # fmt: skip
        else:
            fresh[a] = 1
            begin = _release(
                code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, a, time, h, begin, x,
                early[a], drive, j, local, w,
            )  # fmt: skip
        if begin >= 1.0:
            return


@compiled
def _set_sides(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints, by_side: Ints,
    directions: Floats, held: Ints, time: float, drive: Floats, w: Floats,
) -> None:  # fmt: skip
    """Which places are held at the first sample, and the signs of the others."""
    n = directions.shape[1]
    for a in range(len(sides)):
        v = _along(directions, a, w, 0, n, 0)
        held[a] = 1 if v == 0.0 else 0
        r[sides[a]] = np.sign(v)
    for _ in range(len(sides)):
        copy_state(w, 0, 1)
        _variation(code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, time, drive, 0, w, 1)
        for a in range(len(sides)):
            if held[a] != 0 and abs(r[sides[a]]) > 1.0:
                held[a], r[sides[a]] = 0, math.copysign(1.0, r[sides[a]])


@compiled
def integrate_structure(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints | None, by_side: Ints,
    directions: Floats, start: float, dt: float, steps: int, drive: Floats, y: Floats, rows: Ints, out: Floats,
) -> int:  # fmt: skip
    """A free run with its exact derivatives by Runge-Kutta, ``steps`` steps a sample.

    ``y``, shape (states, 1 + derivatives), is the state at the first sample and becomes that at the last. ``out``,
    shape (rows, samples, 1 + derivatives), gets the motions ``rows``: displacements, velocities and accelerations are
    counted through. ``drive`` has 2 steps rows a sample. Returns the first sample that is not finite, or -1.
    """
    n, h = directions.shape[1], dt / steps
    w = np.zeros((5, y.shape[0], y.shape[1]))
    local = np.zeros((3, drive.shape[1]))
    held = np.zeros(directions.shape[0], dtype=np.int64)
    for i in range(y.shape[0]):
        for c in range(y.shape[1]):
            w[0, i, c] = y[i, c]
    if sides is not None:
        _set_sides(code, first, r, slopes, by_state, by_key, sides, by_side, directions, held, start, drive, w)
    for sample in range(out.shape[1]):
        j = 2 * steps * sample
        copy_state(w, 0, 1)
        _variation(
            code,
            first,
            r,
            slopes,
            by_state,
            by_key,
            sides,
            by_side,
            directions,
            held,
            start + sample * dt,
            drive,
            j,
            w,
            w.shape[2],
        )
        for i in range(n):
            if not (abs(w[0, i, 0]) < 1e150 and abs(w[0, n + i, 0]) < 1e150 and math.isfinite(w[2, n + i, 0])):
                return sample
        for k in range(len(rows)):
            for c in range(y.shape[1]):
                out[k, sample, c] = w[0, rows[k], c] if rows[k] < 2 * n else w[2, rows[k] - n, c]
        if sample + 1 < out.shape[1]:
            for m in range(steps):
                time = start + sample * dt + m * h
                if sides is None:
                    _rk4_step(
                        code, first, r, slopes, by_state, by_key, sides, by_side, directions, held,
                        time, h, drive, j + 2 * m, w, w.shape[2],
                    )  # fmt: skip
                else:
                    _switching_step(
                        code, first, r, slopes, by_state, by_key, sides, by_side, directions, held,
                        time, h, drive, j + 2 * m, local, w,
                    )  # fmt: skip
    for i in range(y.shape[0]):
        for c in range(y.shape[1]):
            y[i, c] = w[0, i, c]
    return -1
