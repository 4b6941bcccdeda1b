"""Two effects that explain together what none does alone: those that ``preselect`` puts first, fitted in free run."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.diagnose import pair_screening
from study.diagnose.candidates import SHORT, THREADS
from study.diagnose.pair_screening import PairStart
from study.diagnose.ranking import Ranked
from study.identify.time_domain import held_out
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.shape_search import Baseline
from study.records.plan import Plan
from study.records.record import Record
from study.support.errors import StudyError

Floats = NDArray[np.float64]
SAME = 1e-4  # of the unexplained power: pairs that leave less than this leave nothing


@dataclass(frozen=True)
class Pair:
    """Two candidates fitted together.

    Attributes
    ----------
    names : pair of str
        The one that explains more alone comes first.
    found : FreeRunFit
        The model with both.
    residual : array, shape (samples to judge,)
        Held-out residual.
    """

    names: tuple[str, str]
    found: FreeRunFit
    residual: Floats


def best_pair(
    rows: Sequence[Ranked], base: Baseline, record: Record, how: Plan, held: tuple[str, ...]
) -> Pair | None:  # fmt: skip
    """The pair that explains most for its number of unknowns, of those preselected.

    Parameters
    ----------
    rows : sequence of Ranked
        The candidates, best first, with their shape parameters.
    base : Baseline
        The fitted model without them.
    record, how
        The record and which parts of it are fitted and judged.
    held : tuple of str
        Keys that keep the model's value.
    """
    order = {row.name: i for i, row in enumerate(rows)}

    def one(start: PairStart) -> Pair | None:
        first, second = sorted(start.names, key=lambda name: order[name])
        values = {key: v for key, v in start.model.values.items() if v is not None}
        try:
            found = held_out.fit(start.model, record, how, held, values, SHORT)
            return Pair((first, second), found, held_out.held_out_residual(found, record, how))
        except StudyError:
            return None

    with ThreadPoolExecutor(THREADS) as pool:
        starts = pair_screening.promising(rows, base, record, how, held)
        fits = [pair for pair in pool.map(one, starts) if pair is not None]
    power = float(np.mean(base.found.residual**2))
    return min(fits, key=lambda pair: _misfit(pair, power), default=None)


def _misfit(pair: Pair, before: float) -> float:
    """Both parts of the record together, with the price of each unknown (Schwarz, 1978); lower is better."""
    left = np.concatenate([pair.found.residual, pair.residual])
    return len(left) * math.log(float(np.mean(left**2)) + SAME * before) + len(pair.found.keys) * math.log(len(left))
