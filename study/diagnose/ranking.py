"""Candidates in order: by what they leave of samples that they were not fitted to, and which of them are a tie."""

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from study.compare.comparison import Comparison
from study.diagnose.candidates import FittedCandidate
from study.diagnose.held_out import HeldOutResidual, alike, held_out_of, residual_held_out
from study.diagnose.ranked import Ranked, ranked_candidate
from study.equations.term import Term
from study.support import statistics
from study.support.autoregression import autoregression
from study.support.cores import cores
from study.support.statistics import Gain
from study.support.thresholds import ALPHA, NEARLY, K

Floats = NDArray[np.float64]


def rank(candidates: Sequence[FittedCandidate], comparison: Comparison) -> list[Ranked]:
    """Candidates by what they leave of the held-out residual, the simplest first of those that this cannot tell apart.

    Residuals are compared as the noise of the record allows: filtered with the autoregressive model of what the best
    candidate leaves, which makes noise white.
    """
    if not candidates:
        return []
    before = comparison.prediction

    def row(candidate: FittedCandidate) -> Ranked:
        return ranked_candidate(candidate, before)

    with ThreadPoolExecutor(cores()) as pool:
        rows = list(pool.map(row, candidates))
    rows.sort(key=lambda r: float(r.residual @ r.residual))
    noise = autoregression(rows[0].fit.residual)
    white = {r.name: r.held_out.white(noise) for r in rows}
    alone = held_out_of(comparison)
    rows, own = [_gained(r, residual_held_out(before, alone)) for r in rows], alone.white(noise)
    free = before.prepared.free

    def chance(row: Ranked) -> float:
        return min(1.0, len(rows) * _p_value(own, white[row.name], _independent(row), free))

    rows = [replace(r, p_value=chance(r)) for r in rows]
    return [replace(r, distance=away, tied_with=tied) for r, away, tied in in_order(rows, white, len(rows))]


class Rankable(Protocol):
    """What the order of candidates rests on."""

    @property
    def name(self) -> str:
        """What it is called among the others."""
        ...

    @property
    def term(self) -> Term:
        """The effect."""
        ...

    @property
    def gain(self) -> Gain:
        """What it explains of the held-out residual."""
        ...

    @property
    def p_value(self) -> float:
        """Of this, all candidates accounted for."""
        ...

    @property
    def residual(self) -> Floats:
        """Held-out residual."""
        ...

    @property
    def numerical(self) -> float:
        """Rms error of the integration itself."""
        ...

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the coefficient."""
        ...

    @property
    def unphysical(self) -> str:
        """Why it is no physical effect as fitted; empty if it is one."""
        ...

    def wanders(self, asked: int) -> bool:
        """Whether its coefficient moves as that of a true term would not."""
        ...


R = TypeVar("R", bound=Rankable)


def in_order(rows: Sequence[R], white: Mapping[str, Floats], asked: int) -> list[tuple[R, float, tuple[str, ...]]]:
    """Candidates best first, each with its distance to the first and the names of those that it is tied with.

    ``white`` holds the whitened held-out residuals by name, ``asked`` is how many candidates there were.
    """
    rows = sorted(rows, key=lambda r: float(np.mean(white[r.name] ** 2)))
    simplest = min(_tie(rows, white), key=lambda r: _complexity(r, white[r.name], asked))
    first = _unimpeached(rows, simplest, asked)
    rows = [first] + [r for r in rows if r is not first]
    return [(r, distance(r, first, white), tuple(_tied(r, rows, white))) for r in rows]


def distance(row: Rankable, other: Rankable, white: Mapping[str, Floats]) -> float:
    """By how many standard errors a candidate leaves more than another of samples that neither was fitted to.

    Zero for two forms of one equation, whose predictions differ by no more than the numbers' own error. ``white`` holds
    the whitened residuals by name.
    """
    apart = float(np.sqrt(np.mean((row.residual - other.residual) ** 2)))
    if row is other or apart <= math.hypot(row.numerical, other.numerical):
        return 0.0
    return statistics.worse(*_common(white[row.name], white[other.name]))


def _gained(row: Ranked, before: HeldOutResidual) -> Ranked:
    """A candidate with what it explains of all that counts of the held-out residual."""
    after = residual_held_out(row.prediction, row.held_out)
    return replace(row, gain=statistics.gain(before.residual, after.residual)) if alike(before, after) else row


def _independent(row: Ranked) -> int | None:
    """How many samples, of those held out, had no part in what was fitted; None where all are such.

    A frequency is where the fitting part has its largest line, by chance if it is noise: its blocks all agree there
    with whatever amplitude the judging part gives that line, so that they bear witness of nothing.
    """
    return len(row.held_out.judged) if row.term.tuned else None


def _p_value(before: Floats, after: Floats, samples: int | None, evenly: bool) -> float:
    one, other = _common(before, after)
    return statistics.gain(one[:samples], other[:samples], evenly=evenly).p_value


def _common(one: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Residuals of the same samples: what a search fitted to less of the record predicts less of."""
    count = min(len(one), len(other))
    return one[:count], other[:count]


def _level(one: Rankable, other: Rankable, white: Mapping[str, Floats]) -> bool:
    """Whether the record cannot tell two candidates apart."""
    return max(distance(one, other, white), distance(other, one, white)) < K


def _tied(row: Rankable, rows: Sequence[Rankable], white: Mapping[str, Floats]) -> Iterator[str]:
    if _believable(row):
        yield from (o.name for o in rows if o is not row and _believable(o) and _level(o, row, white))


def _believable(row: Rankable) -> bool:
    """Whether a candidate explains anything at all with a coefficient that is not zero: others tie with nothing."""
    low, high = row.interval
    return row.gain.explained > 0.0 and row.p_value < ALPHA and not low <= 0.0 <= high


def _tie(rows: Sequence[R], white: Mapping[str, Floats]) -> list[R]:
    """The best candidate and those that the record cannot tell from it."""
    return [r for r in rows if r is rows[0] or (_believable(r) and _level(r, rows[0], white))]


def _complexity(row: Rankable, white: Floats, asked: int) -> tuple[bool, bool, int, float]:
    """Order among candidates that are tied: one that nothing speaks against, and that with fewest unknowns."""
    unknowns = len(row.term.components) + len(row.term.parameters)
    return *_against(row, asked), unknowns, float(np.mean(white**2))


def _against(row: Rankable, asked: int) -> tuple[bool, bool]:
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
