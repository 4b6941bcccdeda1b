"""Which test would tell two tied candidates apart? Found by simulating both at other levels of excitation."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from study.diagnose.ranked import Ranked
from study.equations.free_run import prepare
from study.figures.labels import term_names
from study.identify.time_domain.part_fit import STEPS
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record, Sensor, Stretch
from study.records.states import starting_states
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares
from study.support.numbers import enumerated, percent

LEVELS = (1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0, 5.0, 0.5, 0.25)
DISTINCT = 5.0  # standard errors by which the responses must differ
SIMULATED = 16384  # samples at most
APART = 2.0  # times the error of the prediction by which two places must differ at a sensor that would tell them


def separating_level(one: Ranked, other: Ranked, prepared: Prepared) -> float | None:
    """The first factor on the excitation at which the two models would be told apart by a record of this length.

    That is the force, the prescribed motion of a component, or the state from which a decay is let go.

    The second model may adjust all of its coefficients to what the first one does; what it still cannot
    follow is held against the noise of this record, taken as white. None where no tried level separates.
    """
    noise = float(np.mean(one.residual**2))
    values = dict(zip(other.fit.keys, (float(v) for v in other.fit.values), strict=True))
    for level in LEVELS:
        louder, span, begin = _at_level(prepared, level)
        fine = prepared.free or prepared.response == FORCE
        steps = max(one.fit.steps_per_sample, other.fit.steps_per_sample) if fine else STEPS
        ready = partial(prepare, record=louder, sensors=prepared.outputs.sensors, span=span, steps_per_sample=steps)
        try:
            runs = ready(one.fit.model), ready(other.fit.model, keys=other.fit.keys)
            rest = (np.zeros((len(run.cuts) + 1, run.moving)) if begin is None else begin for run in runs)
            target, (nearest, jacobian) = runs[0].respond({}, next(rest))[0], runs[1].respond(values, next(rest))
        except StudyError:
            continue
        gap, jacobian = (prepared.outputs.stacked(x) for x in (target - nearest, jacobian))
        gap = gap - jacobian @ least_squares(jacobian, gap, 1e-9)
        # The difference of the two misfits is about |gap|^2, its standard error 2 |gap| sigma.
        if np.sum(gap**2) > (2.0 * DISTINCT) ** 2 * noise:
            return level
    return None


def _at_level(prepared: Prepared, level: float) -> tuple[Record, tuple[int, int], Floats | None]:
    """A record of the same test with more of what excites it, the samples to run along, and the state to begin from.

    That state is None where each of the record's stretches begins from rest.
    """
    record, response, span = prepared.record, prepared.response, prepared.shortened(SIMULATED).plan.fit
    if response == FORCE:
        return record.with_channels({m: level * record[m] for m in MOTIONS if m in record}), span, None
    if prepared.free:
        stretch = (*record.stretches, Stretch(record, *span))[0]
        last = min(len(stretch.source), stretch.first + SIMULATED)
        begin = starting_states(stretch.source, prepared.outputs, (stretch.first,))
        return stretch.source, (stretch.first, last), level * begin
    return record.with_channels({name: level * record[name] for name in record.forces}), span, None


def advice(rows: Sequence[Ranked], prepared: Prepared) -> str:
    """A sentence on the tie of the first candidate, or nothing if there is none."""
    tied = rows[0].tied_with[:1] if rows else ()
    rival = next((r for r in rows if r.name in tied), None)
    if rival is None:
        return ""
    if {e.place.path for e in rival.entries} != {e.place.path for e in rows[0].entries}:
        return separating_sensor(rows[0], rival)
    level = separating_level(rows[0], rival, prepared)
    one, other = (
        enumerated([term_names(e.term.name) for e in row.entries if e.name not in without.names])
        for row, without in ((rows[0], rival), (rival, rows[0]))
    )
    asked = f"tell {one} and {other} apart" if one and other else f"tell whether {one or other} acts as well"
    if level is None:
        whole = prepared.response == "displacement"
        needed = "another kind of test" if whole else "the displacement, its mean included,"
        return f"No level from a quarter to five times this one would {asked}; {needed} is needed."
    how = "move it by" if prepared.response == FORCE else "let it go at" if prepared.free else "excite at"
    return f"To {asked}, {how} {level:g} times this level."


def separating_sensor(first: Ranked, tied: Ranked) -> str:
    """A sentence on the sensor that would tell two places apart."""
    prepared = first.prediction.prepared
    seen = {s.coordinate for s in prepared.outputs.sensors}
    wanted = tuple(Sensor(c, "displacement") for c in first.fit.model.coordinates if c not in seen)
    if not wanted:
        return (
            "Every coordinate is measured: a larger force, or one at another coordinate, may tell these places apart."
        )
    one, other = (r.prediction.motions(wanted) for r in (first, tied))
    apart = np.sqrt(np.mean((one - other) ** 2, axis=0)) / np.std(one, axis=0)
    best = int(np.argmax(apart))
    differ = percent(float(apart[best]))
    if apart[best] < APART * first.prediction.error:
        return f"No further sensor would show them {differ} apart: try a force at another coordinate."
    return f"A sensor at {wanted[best].coordinate} would tell the places apart: there they differ by {differ}."
