"""An effect that a trial hides: of a drawn shape, grown until it carries a drawn share, and seen in the record."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtri

from study.equations.model import Model, ModelTerm, free
from study.equations.term import ShapeParameter, Term
from study.equations.terms import LIBRARY, LINEAR, get
from study.identify.frequency_domain.inputs import Input, input_history, reverse_inputs
from study.identify.time_domain.part_fit import fit_part, linearise
from study.records.record import MOTIONS, Record
from study.records.record_layout import Layout
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares
from study.support.thresholds import ALPHA
from study.way_in.compare_records import made_ready

# Effects that the library has got since: hidden in trials like real rigs, and in no trial that was published before.
LATER = (
    "stribeck_friction", "load_dependent_friction", "directional_damping", "directional_quadratic_damping",
    "pendulum_stiffness", "cogging",
)  # fmt: skip
HIDDEN = tuple(name for name in LIBRARY if name not in (*LINEAR, *LATER))
SHARE = (0.10, 0.40)  # of the rms restoring force, in every trial
STEEPEST = 3.0  # power of the amount by which a share is taken to grow, or one over it, at most
FORGOTTEN = 1e-3  # share of the motion that a push at the start may still move in the second half
# Standard errors at which 19 of 20 tests of about 20 candidates find an effect.
VISIBLE_ERRORS = float(-ndtri(ALPHA / 20) + ndtri(0.95))
Shares = tuple[float, ...]  # one for each hidden effect


@dataclass(frozen=True)
class Asked:
    """What a trial is to be."""

    seed: int
    hidden: tuple[str, ...]  # effects of the library
    noise: float  # mean square of the noise over that of the response
    response: str  # the motion that is measured
    coordinates: int | None = None  # of a structure; drawn if left out


@dataclass(frozen=True)
class Sizing:
    """How the amount of an effect is sought with which it carries its share."""

    rounds: int  # at most; none: the first estimate is taken as it is
    close: float = 0.05  # relative distance from the wanted share at which it ends
    secant: bool = False  # whether the share is taken for that power of the amount which the last two show


@dataclass(frozen=True)
class Rig:
    """A system without what is to be hidden in it, and how it is tested; what its functions refuse is drawn again."""

    base: Model  # what the owner believes in, with its values
    effect: Callable[[Term], tuple[ModelTerm, float]]  # of unit size, drawn at a place, and the share it is to carry
    motion: Callable[[Model], Any]  # along which an effect is sized that comes on top of a model
    # Rms force of an effect of unit size beyond any linear model, and of what it is to carry a share of.
    strength: Callable[[ModelTerm, Any], tuple[float, float]]
    # What the instruments read of the system with its effects, and from the shares these were grown to, the last ones.
    recorded: Callable[[Model, Shares], tuple[Any, Shares]]
    sizing: Sizing
    about: Mapping[str, Any]  # how it is driven and sampled, as a table says it
    unknown: tuple[str, ...] = ()  # terms of the base that its owner knows nothing of, and no candidate is


def evenly_in_log(rng: np.random.Generator, low: float, high: float) -> float:
    """A number drawn evenly on a logarithmic scale."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def linear_model(values: Mapping[str, float]) -> Model:
    """The model with those linear terms whose coefficients, ``m``, ``c`` and ``k``, are given."""
    terms = [free(get(name)).with_values(values) for name in LINEAR]
    return Model("truth", tuple(t for t in terms if t.coefficients != (None,)))


def linear_oscillator(mass: float, frequency: float, damping: float) -> Model:
    """A linear one by its natural frequency in Hz and its share of the critical damping."""
    omega = 2.0 * np.pi * frequency
    return linear_model({"m": mass, "c": 2.0 * damping * omega * mass, "k": omega**2 * mass})


def drawn_effect(
    rng: np.random.Generator, entry: ModelTerm, along: Record, *, in_units: bool = False
) -> tuple[ModelTerm, float]:
    """An effect of unit size and the share that it is to carry; ``along`` is the motion at its place without it."""
    share = float(rng.uniform(*SHARE))
    parameters = drawn_shape(rng, entry.term, along, in_units=in_units)
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    sign = -1.0 if entry.term.either_sign and angle > np.pi else 1.0
    unit = (float(np.cos(angle)), float(np.sin(angle))) if len(entry.term.components) == 2 else (sign,)
    return replace(entry, coefficients=unit, parameters=parameters), share


def drawn_shape(rng: np.random.Generator, term: Term, along: Record, *, in_units: bool = False) -> tuple[float, ...]:
    """Shape parameters in the range where the effect shows, in the units of the motion at its place.

    With ``in_units`` they are rounded twice, as multiples of a unit that is itself rounded: so the published structures
    were drawn.
    """
    scale = float(np.std(along["displacement"]))
    omega = float(np.std(along["velocity"])) / scale
    values: list[float] = []
    for parameter in term.parameters:
        value = float(rng.uniform(*parameter.drawn))
        if parameter.relative:
            values.append(value * values[-1])
        elif in_units:
            values.append(value * _in_own_unit(1.0, parameter, scale, omega))
        else:
            values.append(_in_own_unit(value, parameter, scale, omega))
    return tuple(values)


def _in_own_unit(value: float, parameter: ShapeParameter, scale: float, omega: float) -> float:
    """A value in the unit of its quantity, from one in units of rms displacement and angular rate (rad/s)."""
    match parameter.quantity:
        case "length":
            return value * scale
        case "1/length":
            return value / scale
        case "time":
            return value / omega
        case "velocity":
            return value * scale * omega
        case _:
            return value * omega / (2.0 * np.pi)


def grown(model: Model, unit: ModelTerm, target: float, rig: Rig) -> tuple[Model, float]:
    """The model with an effect that carries the target share, by iteration on the motion, and the share it reached.

    The coefficients of ``unit`` say in which proportion, and with which sign, they grow. Where the rig's sizing is no
    secant, the share is taken for the square of the amount: slow where damping calms the motion that it acts on.
    """
    amount, before = 0.0, (0.0, 0.0)
    record = rig.motion(model)
    for _ in range(max(rig.sizing.rounds, 1)):
        alone, own = rig.strength(unit, record)
        expect(alone > 0.0 and own > 0.0, f"{unit.name} carries nothing that a linear model could not")
        share = amount * alone / own
        if amount > 0.0 and abs(share / target - 1.0) < rig.sizing.close:
            return model.with_term(_times(amount, unit)), share
        wanted, at = target * own / alone, (amount, share)
        amount = _next(before, at, wanted) if rig.sizing.secant else _between(amount, wanted)
        before = at
        if not rig.sizing.rounds:
            return model.with_term(_times(amount, unit)), target
        record = rig.motion(model.with_term(_times(amount, unit)))
    raise StudyError(f"no amount of {unit.name} carries {100.0 * target:.0f} %")


def _times(amount: float, unit: ModelTerm) -> ModelTerm:
    return replace(unit, coefficients=tuple(amount * (c or 0.0) for c in unit.coefficients))


def _between(amount: float, wanted: float) -> float:
    return wanted if amount == 0.0 else float(np.sqrt(amount * wanted))


def _next(one: tuple[float, float], other: tuple[float, float], wanted: float) -> float:
    """The next amount from the last two with their shares; ``wanted`` if the share grew as the amount does."""
    if not (min(*one, *other) > 0.0 and math.isfinite(other[1]) and one[0] != other[0]):
        return _between(other[0], wanted)
    slope = math.log(other[1] / one[1]) / math.log(other[0] / one[0])
    steps = math.log(wanted / other[0]) / min(max(slope, 1.0 / STEEPEST), STEEPEST)
    return other[0] * math.exp(min(steps, 100.0))  # with far less growth at once the motion escapes


def share_of(model: Model, name: str, record: Record) -> float:
    """Share of the rms restoring force of a single mass that a term carries and no linear model can take over."""
    entry = next(t for t in model.terms if t.name == name)
    restoring = record["force"] - (model.values["m"] or 0.0) * record["acceleration"]
    return beyond_linear(force_along(entry, record), [record[c] for c in MOTIONS]) / float(np.std(restoring))


def beyond_linear(force: Floats, motions: list[Floats]) -> float:
    """Root mean square of a force less its best fit by motions."""
    columns = np.column_stack(motions)
    return float(np.sqrt(np.mean((force - columns @ least_squares(columns, force)) ** 2)))


def force_along(entry: ModelTerm, record: Record, *, differenced: bool = False) -> Floats:
    """The force of one term along a motion, shape (n,).

    Where it is the rate of a shape, that is by the chain rule, or with ``differenced`` from sample to sample: so the
    published structures were drawn.
    """
    total = np.zeros(len(record))
    coefficients = dict(zip(entry.term.symbols, entry.coefficients, strict=True))
    for item in reverse_inputs(Model("alone", (ModelTerm(entry.term, entry.coefficients, entry.parameters),))):
        values = input_history(item, record)
        for part in item.parts:
            rate = values
            if part.order:
                rate = np.gradient(values, record.dt) if differenced else _rate(item, record)
            total = total + (coefficients[part.symbol] or 0.0) * part.factor * rate
    return total


def _rate(item: Input, record: Record) -> Floats:
    """Time derivative of a shape of displacement alone, by the chain rule on a fine difference."""
    u = record["displacement"]
    step = 1e-6 * float(np.std(u))
    ahead = input_history(item, record.with_channels({"displacement": u + step}))
    behind = input_history(item, record.with_channels({"displacement": u - step}))
    return (ahead - behind) / (2.0 * step) * record["velocity"]


def forgets(motion: Callable[[Floats], Floats], force: Floats, samples: int = 20, *, slight: bool = False) -> bool:
    """Whether the motion forgets a push of so many samples: that of a chaotic system does not, and no free run follows.

    A push at the start, of a tenth of the rms force, must have moved in the second half less than ``FORGOTTEN`` of the
    motion. With ``slight`` it is a millionth of the largest force, where that is first loud, and must matter less in
    the second half than in the first: the memory of a test may be as long as its record. Each published trial rests on
    its own of the two. ``motion`` gives that under a force, shape (n,) or (n, coordinates).
    """
    largest = float(np.max(np.abs(force)))
    begin = int(np.argmax(np.abs(force) > 0.5 * largest)) if slight else 0
    pushed = force.copy()
    pushed[begin : begin + samples] += 1e-6 * largest if slight else 0.1 * float(np.std(force))
    one, other = motion(force), motion(pushed)
    early, late = np.array_split((one - other)[begin:], 2)
    return float(np.std(late)) < (float(np.std(early)) if slight else FORGOTTEN * float(np.std(one[-len(late) :])))


def stands_out(clean: Record, truth: Model, name: str, noise: float) -> bool:
    """Whether the coefficient of an effect would stand ``VISIBLE_ERRORS`` standard errors from zero, of white noise.

    This is asked of the true model alone (the bound of Cramer and Rao), so that no property of the search decides which
    trials there are. ``clean`` is the record as measured, without noise, that ``truth`` made; ``noise`` is the standard
    deviation of that on what is predicted, in its unit.
    """
    entry = next(t for t in truth.terms if t.name == name)
    try:
        model, prepared = made_ready([clean], truth.with_values(dict.fromkeys(truth.values)), Layout())
        start = {key: value for key, value in truth.numbers().items() if key not in model.held_keys}
        # From the truth, and without noise: few rounds find the states of the stretches.
        fit = fit_part(model, prepared, model.held_keys, start, max_iterations=6)
        jacobian = linearise(fit, prepared)
    except StudyError:
        return False
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=1e-12, hermitian=True)
    at = fit.keys.index(entry.symbols[0])
    error = noise * float(np.sqrt(max(inverse[at, at], 0.0)) / scale[at])
    return abs(entry.coefficients[0] or 0.0) >= VISIBLE_ERRORS * error
