"""The compiled loops: running a program, and integrating an equation of motion with it.

All kernels are in this one file, because Numba's disk cache notices a change of the file that holds
a function but not of one it calls. A state is ``(u, v, z...)``; the program computes its derivatives
``(v, a, dz...)`` from registers (see ``model.forward_program``): 0 u, 1 v, 2 t, 3 force, then the extra
channels, the states z, coefficients and shape parameters. Free runs with sensitivities call machine code.
"""

import math
from typing import Any

import numpy as np

from study.equations.jit import builders, compiled, inlined, intrinsic
from study.support.arrays import Floats, Ints

Native = tuple[int, int]  # addresses of a Runge-Kutta step and of the slopes, with sensitivities (``machine_code``)


@compiled
def run(code: Ints, first: int, r: Floats) -> None:
    """Run a program: one instruction after the other, each into the next register.

    Registers are looked up by unsigned numbers: signed ones would be tested for counting from the end.
    """
    for i in range(code.shape[0]):
        op = code[i, 0]
        a = r[np.uint64(code[i, 1])]
        b = r[np.uint64(code[i, 2])]
        if op == 2:
            y = a * b
        elif op == 0:
            y = a + b
        elif op == 1:
            y = a - b
        elif op == 3:
            y = a / b
        elif op == 4:
            y = -a
        elif op == 5:
            y = abs(a)
        elif op == 6:
            y = 1.0 if a > 0.0 else (-1.0 if a < 0.0 else 0.0)
        elif op == 7:
            y = a if a > b else b
        elif op == 8:
            y = a if a < b else b
        elif op == 9:
            y = 1.0 if a > b else 0.0
        elif op == 10:
            y = math.sin(a)
        elif op == 11:
            y = math.cos(a)
        elif op == 12:
            y = np.exp(a)
        elif op == 13:
            y = np.log(a)
        elif op == 14:
            y = np.sqrt(a)
        elif op == 15:
            y = math.tanh(a)
        else:
            y = np.power(a, b)
        r[np.uint64(first + i)] = y


@compiled
def evaluate(code: Ints, first: int, r: Floats, columns: Ints, data: Floats, outputs: Ints, out: Floats) -> None:
    """Run a program for every sample: ``data[i]`` into registers ``columns``, results into ``out[i]``."""
    for i in range(data.shape[0]):
        for c in range(columns.shape[0]):
            r[columns[c]] = data[i, c]
        run(code, first, r)
        for k in range(outputs.shape[0]):
            out[i, k] = r[outputs[k]]


@inlined
def _slope(
    code: Ints, first: int, r: Floats, outputs: Ints, time: float, drive: Floats, j: int, w: Floats, at: int, to: int
) -> None:  # fmt: skip
    """Derivative of the state ``w[at]`` into ``w[to]``: outputs[0] is the acceleration, the rest those of z.

    Rows are passed by number, not as views: making a view costs as much as three instructions. All are in one
    array, because every array passed to a function costs as much as an instruction.
    """
    channels = drive.shape[1]
    r[0] = w[at, 0]
    r[1] = w[at, 1]
    r[2] = time
    for c in range(channels):
        r[3 + c] = drive[j, c]
    for i in range(2, w.shape[1]):
        r[1 + channels + i] = w[at, i]
    run(code, first, r)
    w[to, 0] = w[at, 1]
    for i in range(1, w.shape[1]):
        w[to, i] = r[outputs[i - 1]]


@inlined
def _rk4_step(
    code: Ints, first: int, r: Floats, outputs: Ints, time: float, h: float, drive: Floats, j: int, w: Floats
) -> None:  # fmt: skip
    """One classical Runge-Kutta step of ``w[0]`` in place; drive[j], drive[j+1], drive[j+2] are half a step apart.

    ``w[1]`` to ``w[3]`` are room for trial, slope and their sum.
    """
    n = w.shape[1]
    for i in range(n):
        w[1, i] = w[0, i]
        w[3, i] = w[0, i]
    for stage in range(4):
        late = (stage + 1) // 2
        _slope(code, first, r, outputs, time + 0.5 * h * late, drive, j + late, w, 1, 2)
        weight = h / 3.0 if late == 1 else h / 6.0
        ahead = h if stage == 2 else 0.5 * h
        for i in range(n):
            w[3, i] += weight * w[2, i]
            w[1, i] = w[0, i] + ahead * w[2, i]
    for i in range(n):
        w[0, i] = w[3, i]


@compiled
def integrate_rk4(
    code: Ints, first: int, r: Floats, outputs: Ints, start: float, dt: float,
    steps: int, drive: Floats, x: Floats, out: Floats,
) -> int:  # fmt: skip
    """Classical Runge-Kutta, ``steps`` steps a sample; ``drive`` has 2 steps rows a sample.

    ``out`` gets (u, v, a, z...) of each sample. Returns the first non-finite sample, or -1.
    """
    h = dt / steps
    w = np.zeros((4, x.shape[0]))
    for i in range(x.shape[0]):
        w[0, i] = x[i]
    for sample in range(out.shape[0]):
        j = 2 * steps * sample
        _slope(code, first, r, outputs, start + sample * dt, drive, j, w, 0, 2)
        if not _write(w, 2, out, sample):
            return sample
        if sample + 1 < out.shape[0]:
            for s in range(steps):
                time = start + sample * dt + s * h
                _rk4_step(code, first, r, outputs, time, h, drive, j + 2 * s, w)
    return -1


@compiled
def _write(w: Floats, slope: int, out: Floats, sample: int) -> bool:
    """Keep one sample; False where it is not finite (1e150 squared still is, its cube is not)."""
    out[sample, 0] = w[0, 0]
    out[sample, 1] = w[0, 1]
    out[sample, 2] = w[slope, 1]
    for i in range(2, w.shape[1]):
        out[sample, i + 1] = w[0, i]
    return bool(abs(w[0, 0]) < 1e150 and abs(w[0, 1]) < 1e150 and math.isfinite(w[slope, 1]))


@compiled
def integrate_abm4(
    code: Ints, first: int, r: Floats, outputs: Ints, start: float, dt: float,
    steps: int, drive: Floats, x: Floats, out: Floats,
) -> int:  # fmt: skip
    """Adams-Bashforth predictor, Adams-Moulton corrector of order 4 (PECE), started by Runge-Kutta.

    Arguments and result as in :func:`integrate_rk4`.
    """
    n = x.shape[0]
    h = dt / steps
    w = np.zeros((8, n))  # state, trial, slope, room; then the slopes of this step and the three before it, a ring
    for i in range(x.shape[0]):
        w[0, i] = x[i]
    total = (out.shape[0] - 1) * steps
    for step in range(total + 1):
        time = start + step * h
        f0, f1, f2, f3 = 4 + (step & 3), 4 + ((step + 3) & 3), 4 + ((step + 2) & 3), 4 + ((step + 1) & 3)
        _slope(code, first, r, outputs, time, drive, 2 * step, w, 0, f0)
        if step % steps == 0 and not _write(w, f0, out, step // steps):
            return step // steps
        if step == total:
            break
        if step < 3:
            _rk4_step(code, first, r, outputs, time, h, drive, 2 * step, w)
            continue
        for i in range(n):
            past = -59.0 * w[f1, i] + 37.0 * w[f2, i] - 9.0 * w[f3, i]
            w[1, i] = w[0, i] + h / 24.0 * (55.0 * w[f0, i] + past)
        _slope(code, first, r, outputs, time + h, drive, 2 * step + 2, w, 1, 2)
        for i in range(n):
            past = 19.0 * w[f0, i] - 5.0 * w[f1, i] + w[f2, i]
            w[0, i] += h / 24.0 * (9.0 * w[2, i] + past)
    return -1


@intrinsic
def _call(_: Any, address: Any, r: Any, w: Any, numbers: Any, drive: Any, j: Any) -> Any:
    """Call the function at an address (``machine_code``) with r, w, each of the numbers, and row j of the drive."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        kinds = signature.args
        registers, states, driven = (builders.make_array(kinds[i])(context, builder, given[i]) for i in (1, 2, 4))
        values = builders.unpack_tuple(builder, given[3], kinds[3].count)
        channels = builders.unpack_tuple(builder, driven.shape, 2)[1]
        row = builder.gep(driven.data, [builder.mul(given[5], channels)])
        passed = [registers.data, states.data, *values, row]
        function = builders.function_type(builders.nothing, [value.type for value in passed])
        builder.call(builder.inttoptr(given[0], function.as_pointer()), passed)
        return context.get_dummy_value()

    return builders.void(address, r, w, numbers, drive, j), generate


@compiled
def copy_state(w: Floats, source: int, target: int) -> None:
    """``w[source]`` into ``w[target]``; number by number, as an assignment of views takes Numba seconds to compile."""
    for i in range(w.shape[1]):
        for c in range(w.shape[2]):
            w[target, i, c] = w[source, i, c]


@compiled
def _pull(
    native: Native, r: Floats, side: int, sign: float, time: float, drive: Floats, j: int, w: Floats, row: int
) -> float:  # fmt: skip
    """Acceleration at the state ``w[row]`` if sgn v is ``sign``, which the register of the side then holds."""
    r[side] = sign
    copy_state(w, row, 1)
    _call(native[1], r, w, (time,), drive, j)
    return float(w[2, 1, 0])


@compiled
def _substep(
    native: Native, r: Floats, time: float, h: float, begin: float, end: float,
    drive: Floats, j: int, local: Floats, w: Floats,
) -> None:  # fmt: skip
    """From ``w[3]`` into ``w[0]``: the part of a step between two fractions of it, sgn v held.

    ``local`` gets the drive at both and between, from the parabola through the step's three points.
    """
    for i in range(3):
        x = begin + 0.5 * i * (end - begin)
        for c in range(drive.shape[1]):
            outer = (1.0 - x) * drive[j, c] - x * drive[j + 2, c]
            local[i, c] = (1.0 - 2.0 * x) * outer + 4.0 * x * (1.0 - x) * drive[j + 1, c]
    copy_state(w, 3, 0)
    _call(native[0], r, w, (time + begin * h, (end - begin) * h), local, 0)


@compiled
def first_zero(v0: float, v1: float, mean: float) -> float:
    """First zero in (0, 1) of the parabola with these ends and mean, v0 >= 0; 2 if it has none."""
    c = 3.0 * (v0 + v1) - 6.0 * mean
    b = v1 - v0 - c
    square = b * b - 4.0 * c * v0
    dips = v0 > 0.0 and c > 0.0 and -2.0 * c < b < 0.0 and square > 0.0
    if v1 > 0.0 and not dips:
        return 2.0
    root = math.sqrt(max(square, 0.0))
    return 2.0 * v0 / (root - b) if b < 0.0 else (b + root) / (-2.0 * c)


@compiled
def _to_crossing(
    native: Native, r: Floats, side: int, time: float, h: float,
    begin: float, x: float, drive: Floats, j: int, local: Floats, w: Floats,
) -> float:  # fmt: skip
    """Step to where v vanishes and switch there; returns that fraction of the step.

    The guess x, a fraction of what is left of the step, is corrected by Newton. Where v passes through
    zero, the time at which it does so depends on the parameters, and the derivative of v jumps with the
    acceleration (saltation): ``s_v+ = s_v- a+ / a-``. Where friction holds the mass, v = 0 whatever they are.
    """
    sign = r[side]
    span = (1.0 - begin) * h
    end, before = begin, 0.0
    for _ in range(3):
        x = min(max(x, 0.0), 1.0)
        end = begin + x * (1.0 - begin)
        _substep(native, r, time, h, begin, end, drive, j, local, w)
        before = _pull(native, r, side, sign, time + end * h, local, 2, w, 0)
        if before * sign >= 0.0:
            break
        x -= w[0, 1, 0] / (before * span)
    after = _pull(native, r, side, -sign, time + end * h, local, 2, w, 0)
    through = after * sign < 0.0
    r[side] = -sign if through else 0.0
    w[0, 1, 0] = 0.0
    for i in range(1, w.shape[2]):
        w[0, 1, i] = w[0, 1, i] * after / before if through and before != 0.0 else 0.0
    return end


@compiled
def _to_release(
    native: Native, r: Floats, side: int, time: float, h: float,
    begin: float, drive: Floats, j: int, local: Floats, w: Floats,
) -> float:  # fmt: skip
    """Step to where the other forces overcome friction; returns that fraction of the step, 1 if they do not."""
    sign = 1.0
    late = _pull(native, r, side, sign, time + h, local, 2, w, 0)
    if late <= 0.0:
        sign = -1.0
        late = _pull(native, r, side, sign, time + h, local, 2, w, 0)
    if sign * late <= 0.0:
        r[side] = 0.0
        return 1.0
    early = _pull(native, r, side, sign, time + begin * h, local, 0, w, 3)
    x = min(max(early / (early - late), 0.0), 1.0)
    r[side] = 0.0
    end = begin + x * (1.0 - begin)
    _substep(native, r, time, h, begin, end, drive, j, local, w)
    r[side] = sign
    return end


@compiled
def _switching_step(
    native: Native, r: Floats, side: int, time: float, h: float,
    drive: Floats, j: int, local: Floats, w: Floats,
) -> None:  # fmt: skip
    """One step of a model with sgn v in it, cut where v changes sign, stops, or sets off again.

    Register ``side`` stands for sgn v: 1 or -1 while the mass moves, 0 while friction holds it. A step
    across the switch would be of order 1 only, and its derivative without the jump that the true one has.
    """
    begin = 0.0
    for _ in range(6):
        copy_state(w, 0, 3)
        _substep(native, r, time, h, begin, 1.0, drive, j, local, w)
        if r[side] == 0.0:
            begin = _to_release(native, r, side, time, h, begin, drive, j, local, w)
        else:  # the mean velocity is the change of displacement: it shows a dip below zero between two steps
            mean = (w[0, 0, 0] - w[3, 0, 0]) / ((1.0 - begin) * h)
            x = first_zero(r[side] * w[3, 1, 0], r[side] * w[0, 1, 0], r[side] * mean)
            if x > 1.0:
                return
            begin = _to_crossing(native, r, side, time, h, begin, x, drive, j, local, w)
        if begin >= 1.0:
            return
    if r[side] * w[0, 1, 0] < 0.0:
        r[side] = -r[side]


@compiled
def integrate_variation(
    native: Native, r: Floats, side: int, start: float, dt: float,
    steps: int, drive: Floats, y: Floats, row: int, out: Floats,
) -> int:  # fmt: skip
    """A free run with its exact derivatives by Runge-Kutta; ``y`` is the state beside its sensitivities.

    It becomes that at the last sample. ``out`` gets response ``row`` (0 displacement, 1 velocity,
    2 acceleration) of each sample beside its derivatives. ``side`` is the register that stands for sgn v, -1 if
    the model has none. ``native`` is the machine code of step and
    slopes. Other arguments and result as in :func:`integrate_rk4`.
    """
    h = dt / steps
    w = np.zeros((4, y.shape[0], y.shape[1]))
    local = np.zeros((3, drive.shape[1]))
    for i in range(y.shape[0]):
        for c in range(y.shape[1]):
            w[0, i, c] = y[i, c]
    if side >= 0:
        if y[1, 0] != 0.0:
            r[side] = math.copysign(1.0, y[1, 0])
        elif _pull(native, r, side, 1.0, start, drive, 0, w, 0) <= 0.0:
            held = _pull(native, r, side, -1.0, start, drive, 0, w, 0) >= 0.0
            r[side] = 0.0 if held else -1.0
    for sample in range(out.shape[0]):
        j = 2 * steps * sample
        copy_state(w, 0, 1)
        _call(native[1], r, w, (start + sample * dt,), drive, j)
        if not (abs(w[0, 0, 0]) < 1e150 and abs(w[0, 1, 0]) < 1e150 and math.isfinite(w[2, 1, 0])):
            return sample
        for c in range(y.shape[1]):
            out[sample, c] = w[0, row, c] if row < 2 else w[2, 1, c]
        if sample + 1 < out.shape[0]:
            for m in range(steps):
                time = start + sample * dt + m * h
                if side < 0:
                    _call(native[0], r, w, (time, h), drive, j + 2 * m)
                else:
                    _switching_step(native, r, side, time, h, drive, j + 2 * m, local, w)
    for i in range(y.shape[0]):
        for c in range(y.shape[1]):
            y[i, c] = w[0, i, c]
    return -1


@compiled
def integrate_segments(
    native: Native, r: Floats, side: int, starts: Floats, dt: float,
    steps: int, drive: Floats, bounds: Ints, states: Floats, row: int, out: Floats,
) -> int:  # fmt: skip
    """:func:`integrate_variation` of one segment after the other, between neighbouring ``bounds``, each from its state.

    ``starts`` are the times at which they begin. A segment runs on to the first sample of the next, which overwrites
    it; the last one does not write that sample, which another thread may own.
    """
    for i in range(bounds.shape[0] - 1):
        begin, end = bounds[i], bounds[i + 1]
        ahead = drive[2 * steps * begin :]
        if i + 2 < bounds.shape[0]:
            target = out[begin : end + 1]
        else:
            target = np.empty((min(end + 1, out.shape[0]) - begin, out.shape[1]))
        failed = integrate_variation(native, r, side, starts[i], dt, steps, ahead, states[i], row, target)
        if failed >= 0:
            return int(begin + failed)
        if i + 2 == bounds.shape[0]:
            for sample in range(begin, end):
                for c in range(out.shape[1]):
                    out[sample, c] = target[sample - begin, c]
    return -1


@compiled
def _known_slopes(
    code: Ints, first: int, r: Floats, slots: Ints, time: float, drive: Floats, j: int, w: Floats
) -> None:
    """Registers along a known motion at the states ``w[1]``, and the derivatives of these into ``w[2]``."""
    channels = drive.shape[1] - 2
    r[0] = drive[j, 0]
    r[1] = drive[j, 1]
    r[2] = time
    for c in range(channels):
        r[4 + c] = drive[j, 2 + c]
    for i in range(w.shape[1]):
        r[4 + channels + i] = w[1, i, 0]
    run(code, first, r)
    for i in range(w.shape[1]):
        _chain(r, slots, i + 1, w, w[2, i])


@inlined
def _chain(r: Floats, slots: Ints, row: int, w: Floats, out: Floats) -> None:
    """What row ``row`` of ``slots`` computes into ``out``, beside its derivatives by keys and initial states."""
    n = w.shape[1]
    out[0] = r[slots[row, 0]]
    for c in range(1, out.shape[0]):
        out[c] = r[slots[row, n + c]] if n + c < slots.shape[1] else 0.0
        for m in range(n):
            out[c] += r[slots[row, 1 + m]] * w[1, m, c]


@compiled
def integrate_known(
    code: Ints, first: int, r: Floats, slots: Ints, starts: Floats, dt: float,
    steps: int, drive: Floats, bounds: Ints, states: Floats, out: Floats,
) -> int:  # fmt: skip
    """A force along a known motion, with its exact derivatives; the terms' own states alone are integrated.

    ``drive`` has displacement, velocity and channels, 2 steps rows a sample. Row 0 of ``slots`` names the registers of
    the force and of its derivatives by states and keys, the others those of the states' slopes. ``states`` has, of each
    segment between neighbouring ``bounds``, the states beside their sensitivities. Result as :func:`integrate_rk4`.
    """
    h = dt / steps
    for k in range(bounds.shape[0] - 1):
        w = np.zeros((4, states.shape[1], states.shape[2]))
        for i in range(w.shape[1]):
            for c in range(w.shape[2]):
                w[0, i, c] = states[k, i, c]
        for sample in range(bounds[k], bounds[k + 1]):
            time = starts[k] + (sample - bounds[k]) * dt
            copy_state(w, 0, 1)
            _known_slopes(code, first, r, slots, time, drive, 2 * steps * sample, w)
            _chain(r, slots, 0, w, out[sample])
            if not math.isfinite(out[sample, 0]):
                return int(sample)
            if w.shape[1] == 0 or sample + 1 == bounds[k + 1]:
                continue
            for s in range(steps):
                copy_state(w, 0, 1)
                copy_state(w, 0, 3)
                for stage in range(4):
                    late = (stage + 1) // 2
                    j = 2 * (steps * sample + s) + late
                    _known_slopes(code, first, r, slots, time + (s + 0.5 * late) * h, drive, j, w)
                    w[3] += (h / 3.0 if late == 1 else h / 6.0) * w[2]
                    w[1] = w[0] + (h if stage == 2 else 0.5 * h) * w[2]
                copy_state(w, 3, 0)
    return -1


@compiled
def integrate_state(
    code: Ints, first: int, r: Floats, columns: Ints, state: int, output: int, h: float,
    steps: int, data: Floats, out: Floats,
) -> None:  # fmt: skip
    """State z of a term under a known motion by Runge-Kutta, from rest; ``data`` has 2 steps rows a sample.

    ``columns`` are the registers of the data, ``state`` and ``output`` those of z and dz/dt.
    """
    z = 0.0
    slopes = np.zeros(4)
    shift = np.array([0.0, 0.5, 0.5, 1.0])
    for sample in range(out.shape[0]):
        out[sample] = z
        if sample + 1 == out.shape[0]:
            break
        for s in range(steps):
            j = 2 * (steps * sample + s)
            for stage in range(4):
                row = j + (stage + 1) // 2
                for c in range(columns.shape[0]):
                    r[columns[c]] = data[row, c]
                r[state] = z + shift[stage] * h * slopes[stage - 1] if stage > 0 else z
                run(code, first, r)
                slopes[stage] = r[output]
            z += h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
