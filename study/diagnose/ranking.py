"""Candidates in order: by what they leave of samples that they were not fitted to, and which of them are a tie."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from study.compare.comparison import Comparison
from study.diagnose.candidates import FittedCandidate
from study.diagnose.held_out import HeldOutResidual, alike, evidence, held_out_of, held_out_test
from study.diagnose.ranked import Ranked, ranked_candidate
from study.identify.time_domain.weighted_fit import noise_left
from study.support import statistics
from study.support.arrays import Floats
from study.support.cores import side_by_side
from study.support.thresholds import ALPHA, NEARLY, K

R = TypeVar("R", bound=Ranked)


def rank(candidates: Sequence[FittedCandidate], comparison: Comparison, asked: int | None = None) -> list[Ranked]:
    """Candidates by what they leave of the held-out residual, the simplest first of those that this cannot tell apart.

    Residuals are compared as the noise of the record allows: filtered with the autoregressive model of what the best
    candidate leaves, which makes noise white. ``asked`` is how many effects at places were asked for, those that were
    not worth a fit among them; as many as there are candidates if left out. Those that were ranked beside others by the
    same comparison are not measured again.
    """
    if not candidates:
        return []
    before, asked = comparison.prediction, asked or len(candidates)

    def measured(candidate: FittedCandidate) -> Ranked:
        return candidate if isinstance(candidate, Ranked) else ranked_candidate(candidate, before)

    rows = list(side_by_side(measured, candidates))
    rows.sort(key=lambda r: float(r.residual @ r.residual))
    outputs, fit = before.prepared.outputs, rows[0].fit
    noise = noise_left(fit.residual, len(fit.outputs))
    alone = evidence(before, held_out_of(comparison))
    test = held_out_test(comparison.fit, before, noise)
    rows = [
        replace(
            _gained(r, alone), p_value=min(1.0, asked * test.p_value(r.held_out, any(e.term.tuned for e in r.entries)))
        )
        for r in rows
    ]
    del test  # before as much is made for every row
    white = {r.name: np.concatenate(r.held_out.white(outputs, noise)) for r in rows}
    return in_order(rows, white, asked)


def in_order(rows: Sequence[R], white: Mapping[str, Floats], asked: int) -> list[R]:
    """Candidates best first, each with its distance to the first and the names of those that it is tied with.

    ``white`` holds the whitened held-out residuals by name, ``asked`` is how many candidates there were.
    """
    left = _beside_the_longest(white)
    rows = sorted(rows, key=lambda r: left[r.name])
    simplest = min(_tie(rows, white), key=lambda r: (*_against(r, asked), r.unknowns, left[r.name]))
    first = _unimpeached(rows, simplest, asked)
    rows = [first] + [r for r in rows if r is not first]
    return [replace(r, distance=distance(r, first, white), tied_with=tuple(_tied(r, rows, white))) for r in rows]


def _beside_the_longest(white: Mapping[str, Floats]) -> dict[str, float]:
    """Mean square of each residual over that of the longest on the same samples: one part is louder than the other."""
    longest = max(white.values(), key=len)
    tiny = np.finfo(float).tiny
    return {k: float(np.mean(x**2) / max(float(np.mean(longest[: len(x)] ** 2)), tiny)) for k, x in white.items()}


def distance(row: Ranked, other: Ranked, white: Mapping[str, Floats]) -> float:
    """By how many standard errors a candidate leaves more than another of samples that neither was fitted to.

    Zero for two forms of one equation. ``white`` holds the whitened residuals by name.
    """
    if row.predicts_as(other):
        return 0.0
    return statistics.worse(*_common(white[row.name], white[other.name]))


def _gained(row: Ranked, before: HeldOutResidual) -> Ranked:
    """A candidate with what it explains of all that counts of the held-out residual."""
    after = evidence(row.prediction, row.held_out)
    return replace(row, gain=statistics.gain(before.residual, after.residual)) if alike(before, after) else row


def _common(one: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Residuals of the same samples: what a search fitted to less of the record predicts less of."""
    count = min(len(one), len(other))
    return one[:count], other[:count]


def _level(one: Ranked, other: Ranked, white: Mapping[str, Floats]) -> bool:
    """Whether the record cannot tell two candidates apart."""
    return max(distance(one, other, white), distance(other, one, white)) < K


def _tied(row: Ranked, rows: Sequence[Ranked], white: Mapping[str, Floats]) -> Iterator[str]:
    if _believable(row):
        yield from (o.name for o in rows if o is not row and _believable(o) and _level(o, row, white))


def _believable(row: Ranked) -> bool:
    """Whether a candidate explains anything at all with a coefficient that is not zero: others tie with nothing."""
    low, high = row.effect.interval
    return row.gain.explained > 0.0 and row.p_value < ALPHA and not low <= 0.0 <= high


def _tie(rows: Sequence[R], white: Mapping[str, Floats]) -> list[R]:
    """The best candidate and those that the record cannot tell from it."""
    return [r for r in rows if r is rows[0] or (_believable(r) and _level(r, rows[0], white))]


def _against(row: Ranked, asked: int) -> tuple[bool, bool]:
    """What speaks against a candidate: values outside of what makes it physical, and a coefficient that wanders."""
    return bool(row.unphysical), row.wanders(asked)


def _unimpeached(rows: Sequence[R], first: R, asked: int) -> R:
    """The first candidate, or one against which less speaks, if there is one that explains nearly as much.

    A Bouc-Wen element of negative stiffness, say, is a hardening spring in disguise; and what imitates another effect
    needs a coefficient that changes with the level.
    """
    enough = NEARLY * first.gain.explained
    better = [r for r in rows if r is first or (_believable(r) and r.gain.explained >= enough)]
    return min(better, key=lambda r: (*_against(r, asked), r is not first))
