"""Starting values for a free run: the best linear approximation, and the reverse system's coefficients.

The best linear approximation ``H(f) = G_Fy / G_FF`` is not biased by noise on the response, but covers linear terms
alone. The reverse system (the report's estimate) gives every coefficient at once and is biased by noise; but it has
no local minima, in which a fit from a linear model ends where the system is far from linear.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import rfft, rfftfreq

from study.equations.free_run import needed_steps, prepare
from study.equations.linear_part import linear_keys
from study.equations.model import Model, free
from study.equations.terms import get
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.inputs import histories, reverse_inputs, without_inertia
from study.identify.frequency_domain.linear_start import CHANCE, FAINT, lumped_start
from study.identify.time_domain.free_decay import free_decay_start
from study.identify.time_domain.told_alone import is_alone, model_alone, prepared_alone
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record
from study.records.spectra import Segments, cross_spectra, cross_spectra_within, segment_length
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares, normal_inverse

LINEAR_ORDERS = {"k": 0, "c": 1, "m": 2}
FEWEST_LINES = 4  # two more than mass, damping and stiffness need
LONG_ENOUGH = 512  # samples: below, coherence may be missing because the record is short
PADDED = 4  # times as many lines as samples show, for the peak of a short decay
FEWEST_WINDOWS = 3  # of a period each, from which a decay is read


@dataclass(frozen=True)
class LinearApproximation:
    """Best linear approximation on the lines of the fitting part where force and response have something in common."""

    omega: Complexes  # 2 pi j f, shape (lines,)
    receptance: Complexes  # displacement over force, shape (lines,)
    weight: Floats  # over the standard error of 1 / receptance, to a common factor; shape (lines,)
    neighbours: int  # lines from the first to the last: a window alone makes some of a single frequency

    @property
    def single(self) -> bool:
        """Whether the lines are as few and as near as those that a Hann window makes of one frequency."""
        # lines that a Hann window makes of one frequency, those above FAINT beside its main lobe included
        return self.neighbours <= 5

    def around(self, frequency: float) -> "LinearApproximation":
        """The lines within half an octave of a frequency in hertz."""
        keep = np.abs(np.log2(np.abs(self.omega) / (2.0 * np.pi * frequency))) < 0.5
        return replace(
            self, omega=self.omega[keep], receptance=self.receptance[keep], weight=self.weight[keep],
            neighbours=int(np.count_nonzero(keep)),
        )  # fmt: skip


def coherent_lines(prepared: Prepared) -> LinearApproximation:
    """The lines by the usual segments; by longer ones where too few lines of those are driven, as in slow records."""
    record, response = prepared.record, prepared.response
    part = record.part(*prepared.plan.fit)
    length = segment_length(len(part), held=8, fewest=16, most=1024)
    found, _ = _lines(part, response, length)
    if prepared.near:
        found = _lines(part, response, _resolving(prepared.near, part, length))[0].around(prepared.near)
        beside = f"force and {response} of {record.name!r} have too little in common near {prepared.near:g} Hz"
        expect(len(found.omega) >= FEWEST_LINES, f"{beside}; expected the frequency of a mode that the record shows")
        return found
    if len(found.omega) >= FEWEST_LINES and found.single:  # as few as short segments have of a wide band, too
        longer, _ = _lines(part, response, min(2 * length, len(part) // 2))
        return replace(found, neighbours=max(found.neighbours, longer.neighbours))
    if len(found.omega) >= FEWEST_LINES:
        return found
    while len(part) >= LONG_ENOUGH and length < len(part) // 2:
        length = min(2 * length, len(part) // 2)
        found, chance = _lines(part, response, length)
        if len(found.omega) > max(1.0, chance):  # two lines are four equations
            return found
    if len(part) < LONG_ENOUGH:
        raise StudyError(
            f"the part to fit of {record.name!r} has {len(part)} samples, too few to see what force and {response} "
            f"have in common; fit a longer part, {LONG_ENOUGH} samples or more"
        )
    raise StudyError(
        f"force and {response} of {record.name!r} have nothing in common at any frequency; expected a response to this "
        "force (are the columns and the samples of one measurement?)"
    )


def _resolving(frequency: float, part: Record, length: int) -> int:
    """Samples in a segment that has lines enough around a frequency, as far as the part is long enough."""
    wanted = 4.0 * FEWEST_LINES / (frequency * part.dt)
    return int(min(max(length, 2 ** np.ceil(np.log2(wanted))), len(part) // 2))


def _lines(part: Record, response: str, length: int) -> tuple[LinearApproximation, float]:
    """The lines by segments of a length, and how many of those driven may be coherent by chance."""
    force, motion = (part[name] - np.mean(part[name]) for name in ("force", response))
    if part.joints:
        matrix = cross_spectra_within([force, motion], part.joints, part.dt, Segments(length=length))
    else:
        matrix = cross_spectra([force, motion], part.dt, Segments(length=length))
    g, f = matrix.density[1:-1], matrix.frequency[1:-1]
    power = g[:, 0, 0].real * g[:, 1, 1].real
    coherence = np.abs(g[:, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
    coherence = np.clip(coherence, 0.0, 1.0 - 1e-6)
    by_chance = 1.0 - CHANCE ** (1.0 / max(matrix.averages - 1.0, 1.0))
    driven = g[:, 0, 0].real > FAINT * np.max(g[:, 0, 0].real)
    keep = (coherence > by_chance) & driven
    omega = np.asarray(2j * np.pi * f[keep], dtype=np.complex128)
    receptance = g[keep, 0, 1] / g[keep, 0, 0] / omega ** MOTIONS.index(response)
    weight = np.abs(receptance) * np.sqrt(coherence[keep] / (1.0 - coherence[keep]))
    places = np.flatnonzero(keep)
    neighbours = int(places[-1] - places[0]) + 1 if len(places) else 0
    expected = CHANCE * float(np.count_nonzero(driven))
    return LinearApproximation(omega, receptance, weight, neighbours), expected + 3.0 * float(np.sqrt(expected))


def solved(lines: LinearApproximation, wanted: Sequence[str]) -> tuple[Floats, Floats]:
    """Those of k, c and m that are wanted, and their standard errors from what the lines leave; shapes (wanted,)."""
    design = np.stack([lines.omega ** LINEAR_ORDERS[key] for key in wanted], axis=1) * lines.weight[:, None]
    target = lines.weight / lines.receptance
    columns, goal = np.concatenate([design.real, design.imag]), np.concatenate([target.real, target.imag])
    solution = least_squares(columns, goal)
    variance = float(np.sum((goal - columns @ solution) ** 2)) / max(len(goal) - len(wanted), 1)
    return solution, np.sqrt(np.diag(normal_inverse(columns.T @ columns)).clip(0.0) * variance)


def _mode_among_others(lines: LinearApproximation) -> Floats:
    """k, c and m of one mode, beside which all others count as a constant flexibility R over the lines.

    ``H = 1/(m (s^2 + 2 zeta w s + w^2)) + R``, multiplied out, is linear in what it holds; shape (3,).
    """
    size = float(np.mean(np.abs(lines.omega)))
    s, h = lines.omega / size, lines.receptance / np.mean(np.abs(lines.receptance))
    weight = lines.weight / np.abs(h) ** 2
    design = np.stack([h, h * s, -np.ones_like(s), -s, -(s**2)], axis=1) * weight[:, None]
    target = -(s**2) * h * weight
    columns, goal = np.concatenate([design.real, design.imag]), np.concatenate([target.real, target.imag])
    a0, a1, b0, _, b2 = least_squares(columns, goal)
    m = 1.0 / ((b0 - b2 * a0) * np.mean(np.abs(lines.receptance)) * size**2)
    return m * np.array([a0 * size**2, a1 * size, 1.0])


def linear_start(model: Model, prepared: Prepared) -> dict[str, float]:
    """Masses, dampings and stiffnesses of the best linear approximation; zero for everything else.

    Those that a structure holds are as it has them.
    """
    if is_alone(model):
        alone = linear_start(model_alone(model), prepared_alone(prepared))
        return dict(zip(model.values, alone.values(), strict=True))
    if prepared.response == FORCE:
        linear = [key for key in linear_keys(model) if key in model.values]
        known = replace(model, terms=tuple(t for t in model.terms if None not in t.parameters))  # others count as zero
        return dict.fromkeys(model.values, 0.0) | along_the_motion(known, prepared, linear)
    if model.named:
        given = {key: value for key, value in model.values.items() if value is not None}
        start = free_decay_start if prepared.free else lumped_start
        known = {key: given[key] for key in linear_keys(model) if key in given}
        return dict.fromkeys(model.values, 0.0) | known | start(model, prepared, given)
    if prepared.free:
        return decay_start(model, prepared)
    if prepared.record.joints and "k" not in model.values:
        return drift_start(model, prepared)
    lines = coherent_lines(prepared)
    wanted = [key for key in LINEAR_ORDERS if key in model.values]
    solution, _ = solved(lines, wanted)
    if prepared.near and len(wanted) == len(LINEAR_ORDERS):
        solution = _mode_among_others(lines)
    start = dict.fromkeys(model.values, 0.0) | dict(zip(wanted, solution.tolist(), strict=True))
    if start["m"] <= 0.0:
        target = lines.weight / lines.receptance
        start["m"] = float(np.linalg.norm(target)) / float(np.linalg.norm(lines.omega**2 * lines.weight))
    return start


def oscillator(prepared: Prepared) -> dict[str, float]:
    """m, c and k of the best linear oscillator, whatever the model's terms are."""
    names = ("linear_damping", "linear_stiffness")
    names = names if prepared.response == FORCE else ("inertia", *names)
    model = Model("linear", tuple(free(get(name)) for name in names))
    try:
        return linear_start(model, prepared)
    except StudyError:
        if not prepared.record.joints:
            raise
    drifting = drift_start(model.without_term("linear_stiffness"), prepared)
    first, last = prepared.plan.fit
    return drifting | {"k": drifting["m"] * (2.0 * np.pi / ((last - first) * prepared.dt)) ** 2}


def reverse_start(model: Model, prepared: Prepared) -> dict[str, float]:
    """Coefficients by reverse MI/SO on the fitting part; those of the model are ignored, its shape parameters used."""
    if prepared.response == FORCE:
        for coordinate in model.coordinates:
            _ = reverse_inputs(model, coordinate)  # refuses shape parameters that are not known
        return along_the_motion(model, prepared, [s for t in model.terms for s in t.symbols])
    part = prepared.record.part(*prepared.inner(prepared.plan.fit))
    inputs = reverse_inputs(model)
    if prepared.free:  # the inertia force takes the place of the measured one
        part = part.with_channels({FORCE: -part["acceleration"]})
        inputs = without_inertia(inputs)
    cut = Segments(segment_length(len(part), held=12, fewest=64, most=1024))
    channels = [*histories(inputs, part), part["force"]]
    if part.joints:
        matrix = cross_spectra_within(channels, part.joints, part.dt, cut)
        cut = matrix.segments
    else:
        matrix = cross_spectra(channels, part.dt, cut)
    force = matrix.density[:, -1, -1].real
    driven = matrix.frequency[(force > FAINT * np.max(force)) & (matrix.frequency > 1.5 / (cut.length * part.dt))]
    if driven.size < len(inputs):
        raise StudyError(f"the force of {part.name!r} drives too few frequencies for {len(inputs)} inputs")
    band = (max(float(driven[0]), prepared.band[0]), min(float(driven[-1]), prepared.band[1]))
    if not np.any(coefficients.lines_in(matrix.frequency, band)):
        raise StudyError(f"no frequency that the force of {part.name!r} drives is one at which all motions are valid")
    estimate = coefficients.fit_coefficients(conditioned.analyse(matrix), inputs, band, cut.line_inflation())
    if not np.all(np.isfinite(estimate.values)) or not (prepared.free or estimate["m"] > 0.0):
        raise StudyError(f"the reverse system of {model.name!r} and {part.name!r} has no solution")
    found = dict(zip(estimate.symbols, estimate.values.tolist(), strict=True))
    return with_given_value({"m": 1.0} | found, model) if prepared.free else found


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
    """
    symbols, outputs = [s for t in model.terms for s in t.symbols], prepared.outputs
    begun = model.with_values(dict.fromkeys(symbols, 0.0))
    steps = needed_steps(begun, prepared.record, outputs)
    run = prepare(
        begun, prepared.record, symbols, sensors=outputs.sensors, span=prepared.plan.fit, steps_per_sample=max(steps, 2)
    )
    zeros = np.zeros((len(run.cuts) + 1, run.states))
    shapes = outputs.stacked(run.respond(dict.fromkeys(symbols, 0.0), zeros)[1])
    shapes = prepared.known(shapes, prepared.plan.fit)
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
        raise StudyError(
            f"force and {prepared.response} of {part.name!r} show no mass: their integrals give m = "
            f"{start.get('m', 0.0):.3g}; expected both positive in the same direction, a force that moves the body, or "
            "a model that gives the mass"
        )
    return start
