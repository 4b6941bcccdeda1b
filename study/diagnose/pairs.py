"""Two effects that explain together what none does alone: those that ``preselect`` puts first, fitted in free run."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from study.compare.prediction import Prediction, predict
from study.diagnose import pair_screening
from study.diagnose.pair_screening import PairStart
from study.diagnose.ranked import Ranked
from study.identify.time_domain.fit_model import TRIED
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part
from study.identify.time_domain.shape_search import Baseline
from study.support.cores import cores
from study.support.errors import StudyError

SAME = 1e-4  # of the unexplained power: pairs that leave less than this leave nothing


@dataclass(frozen=True)
class Pair:
    """Two candidates fitted together."""

    names: tuple[str, str]  # the one that explains more alone comes first
    fit: FreeRunFit  # the model with both
    prediction: Prediction  # its free run along the judging part


def best_pair(rows: Sequence[Ranked], base: Baseline) -> Pair | None:
    """The pair that explains most for its number of unknowns, of those that the screening puts first.

    ``rows`` are the candidates, best first, with their shape parameters; ``base`` is the fitted model without them.
    """
    prepared, order = base.prepared, {row.name: i for i, row in enumerate(rows)}

    def fitted(start: PairStart) -> Pair | None:
        first, second = sorted(start.names, key=lambda name: order[name])
        try:
            fit = fit_part(start.model, prepared, base.fit.held, max_iterations=TRIED)
            prediction = predict(fit, prepared)
        except StudyError:
            return None
        return None if prediction.diverged else Pair((first, second), fit, prediction)

    with ThreadPoolExecutor(cores()) as pool:
        pairs = [pair for pair in pool.map(fitted, pair_screening.promising_pairs(rows, base)) if pair is not None]
    power = float(np.mean(base.fit.residual**2))
    return min(pairs, key=lambda pair: _misfit(pair, power), default=None)


def _misfit(pair: Pair, before: float) -> float:
    """Both parts of the record together, with the price of each unknown (Schwarz, 1978); lower is better."""
    left = np.concatenate([pair.fit.residual, pair.prediction.residual])
    return len(left) * math.log(float(np.mean(left**2)) + SAME * before) + len(pair.fit.keys) * math.log(len(left))
