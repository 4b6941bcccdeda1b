"""Which test would tell two tied candidates apart? Found by simulating both at other levels of excitation."""

from collections.abc import Sequence

import numpy as np

from study.diagnose.ranked import Ranked
from study.equations.free_run import prepare
from study.figures.labels import term_names
from study.records.prepared import Prepared
from study.support.errors import StudyError
from study.support.least_squares import least_squares

LEVELS = (1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0, 5.0, 0.5, 0.25)
DISTINCT = 5.0  # standard errors by which the responses must differ
LONGEST = 16384  # samples simulated


def separating_level(one: Ranked, other: Ranked, prepared: Prepared) -> float | None:
    """The first factor on the force at which the two models would be told apart by a record of this length.

    The second model may adjust all of its coefficients to what the first one does; what it still cannot
    follow is held against the noise of this record, taken as white. None where no tried level separates.
    """
    noise = float(np.mean(one.residual**2))
    record, response, span = prepared.record, prepared.response, prepared.shortened(LONGEST).plan.fit
    for level in LEVELS:
        louder = record.with_channels({"force": level * record["force"]})
        try:
            target = prepare(one.fit.model, louder, response=response, span=span).respond({}, (0.0, 0.0))[0]
            run = prepare(other.fit.model, louder, other.fit.keys, response=response, span=span)
            values = dict(zip(other.fit.keys, (float(v) for v in other.fit.values), strict=True))
            nearest, jacobian = run.respond(values, (0.0, 0.0))
        except StudyError:
            continue
        gap = target - nearest
        gap = gap - jacobian @ least_squares(jacobian, gap, 1e-9)
        # The difference of the two misfits is about |gap|^2, its standard error 2 |gap| sigma.
        if np.sum(gap**2) > (2.0 * DISTINCT) ** 2 * noise:
            return level
    return None


def advice(rows: Sequence[Ranked], prepared: Prepared) -> str:
    """A sentence on the tie of the first candidate, or nothing if there is none."""
    tied = rows[0].tied_with[:1] if rows else ()
    rival = next((r for r in rows if r.name in tied), None)
    if rival is None:
        return ""
    level = separating_level(rows[0], rival, prepared)
    names = f"{term_names(rows[0].name)} and {term_names(rival.name)}"
    if level is None:
        whole = prepared.response == "displacement"
        other = "another kind of test" if whole else "the displacement, its mean included,"
        return f"No level from a quarter to five times this one would tell {names} apart; {other} is needed."
    return f"To tell {names} apart, excite at {level:g} times this level."
