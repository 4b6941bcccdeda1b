"""Starting values where no force acts: from the frequency and the decay of the motion; and where it is given."""

import numpy as np
from scipy.fft import rfft, rfftfreq

from study.equations.free_run import prepare
from study.equations.model import Model
from study.equations.substeps import needed_steps
from study.records.outputs import alone
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares

PADDED = 4  # times as many lines as samples show, for the peak of a short decay
FEWEST_WINDOWS = 3  # of a period each, from which a decay is read


def decay_start(model: Model, prepared: Prepared) -> dict[str, float]:
    """Mass, damping and stiffness of a linear oscillator that decays as the record does; zero for everything else.

    The record gives them but for one common factor: the mass that the model gives, or its stiffness or damping, or one.
    """
    part = prepared.record.part(*prepared.plan.fit)
    omega, rate = frequency_and_rate(part, prepared.response)
    unit = {"m": 1.0, "c": 2.0 * rate, "k": omega**2 + rate**2}
    return dict.fromkeys(model.values, 0.0) | with_given_value(
        {k: v for k, v in unit.items() if k in model.values}, model
    )


def with_given_value(unit: dict[str, float], model: Model) -> dict[str, float]:
    """Values per unit mass, times the common factor that a value given by the model fixes; the mass first."""
    for key in sorted(unit, key=lambda k: k != "m"):
        given = model.values.get(key)
        if given is not None and unit[key] != 0.0 and given / unit[key] > 0.0:
            return {k: v * given / unit[key] for k, v in unit.items()}
    return unit


def frequency_and_rate(part: Record, response: str) -> tuple[float, float]:
    """Angular frequency in rad/s at which decays swing, and the rate at which their logarithm falls, in 1/s.

    The frequency is that of the highest line of the longest stretch; the rate a regression over windows of a period,
    loud ones weighing more, each stretch from a level of its own.
    """
    spans = list(zip((0, *part.joints), (*part.joints, len(part)), strict=True))
    pieces = [part[response][a:b] - np.mean(part[response][a:b]) for a, b in spans]
    longest = max(pieces, key=len)
    lines = PADDED * len(longest)
    power = np.abs(rfft(longest * np.hanning(len(longest)), lines))
    first = 2 * PADDED  # below, the window shows the mean
    peak = first + int(np.argmax(power[first:]))
    omega = 2.0 * np.pi * float(rfftfreq(lines, part.dt)[peak])
    window = max(round(2.0 * np.pi / (omega * part.dt)), 4)
    products, squares = 0.0, 0.0
    for piece in pieces:
        count = len(piece) // window
        if count < FEWEST_WINDOWS:
            continue
        level = np.maximum(np.mean(piece[: count * window].reshape(count, window) ** 2, axis=1), 1e-300)
        at = window * part.dt * np.arange(count)
        weight = level / np.sum(level)
        at = at - np.sum(weight * at)
        products += float(np.sum(weight * at * 0.5 * np.log(level)))
        squares += float(np.sum(weight * at**2))
    rate = -products / squares if squares > 0.0 else 0.0
    return omega, max(rate, 1e-4 * omega)


def along_the_motion(model: Model, prepared: Prepared, wanted: list[str]) -> dict[str, float]:
    """Coefficients of a model without inertia by least squares along the prescribed motion; zero for those not wanted.

    Shape parameters keep the model's values.

    Raises
    ------
    StudyError
        If a shape parameter is not known, or nothing of the force is explained.
    """
    symbols = [s for t in model.terms for s in t.term.symbols]
    begun = model.with_values(dict.fromkeys(symbols, 0.0))
    steps = needed_steps(begun, prepared.record, alone(FORCE))
    run = prepare(
        begun, prepared.record, symbols, sensors=alone(FORCE).sensors, span=prepared.plan.fit,
        steps_per_sample=max(steps, 2),
    )  # fmt: skip
    zeros = np.zeros((len(run.cuts) + 1, run.states))
    shapes = prepared.known(run.respond(dict.fromkeys(symbols, 0.0), zeros)[1][:, 0], prepared.plan.fit)
    columns = [symbols.index(s) for s in wanted]
    if not np.all(np.isfinite(shapes)):
        raise StudyError(f"the forces of {model.name!r} are no numbers all along {prepared.record.name!r}")
    held = np.array([model.values[s] or 0.0 if s not in wanted else 0.0 for s in symbols])
    target: Floats = prepared.known(prepared.fitted, prepared.plan.fit) - shapes @ held
    return dict.fromkeys(symbols, 0.0) | dict(
        zip(wanted, least_squares(shapes[:, columns], target, 1e-9).tolist(), strict=True)
    )


def drift_start(model: Model, prepared: Prepared) -> dict[str, float]:
    """Mass and damping of a body without a spring from integrals of the force, which noise on the motion hardly moves.

    ``m u + c int u = double int F + a + b t`` along each stretch (one integral less of a velocity, two of an
    acceleration), by least squares. Zero for everything else.
    """
    part, wanted = prepared.record.part(*prepared.plan.fit), [key for key in ("m", "c") if key in model.values]
    values, order = part[prepared.response], MOTIONS.index(prepared.response)
    spans = list(zip((0, *part.joints), (*part.joints, len(part)), strict=True))
    rows, targets = list[Floats](), list[Floats]()
    for a, b in spans:
        at = np.linspace(-1.0, 1.0, b - a)
        target = part[FORCE][a:b]
        for _ in range(2 - order):
            target = part.dt * np.cumsum(target)
        own = {"m": values[a:b], "c": part.dt * np.cumsum(values[a:b])}
        columns = np.column_stack([*(own[key] for key in wanted), target])
        unknown = np.vander(at, 3 - order)  # where the motion began, and how fast
        left = columns - unknown @ np.linalg.lstsq(unknown, columns, rcond=None)[0]
        rows.append(left[:, :-1])
        targets.append(left[:, -1])
    found = least_squares(np.concatenate(rows), np.concatenate(targets), 1e-9)
    start = dict.fromkeys(model.values, 0.0) | dict(zip(wanted, found.tolist(), strict=True))
    if not start.get("m", 0.0) > 0.0:
        raise StudyError(f"force and {prepared.response} of {part.name!r} show no mass")
    return start
