"""The table of trials that is published, and whether this code still gives it."""

from collections.abc import Collection, Sequence

import numpy as np
import pandas as pd

from study.trials.reach import WORDS
from study.trials.runs import COLUMNS

TIMES = ("seconds",)  # of another machine, or another hour
LOOSE = ("left", "smallest_p", "true_p", "distance", "rivals", "error_true")  # they change with rounding
ALIKE = 0.01  # relative: numbers of two runs of the same code on two machines


def differing_trials(
    own: pd.DataFrame, kept: pd.DataFrame, columns: Sequence[str] = COLUMNS, words: Collection[str] = WORDS,
    loose: Collection[str] = LOOSE,
) -> list[str]:  # fmt: skip
    """What came out otherwise than in a kept table: ``"seed 7: verdict"`` and so on; both as ``trials.csv`` has them.

    ``kept`` may hold trials that ``own`` lacks. What was drawn and what was said must be the same word by word, errors
    to ``ALIKE``; those of the ``columns`` that are ``words`` are no numbers, and what is ``loose`` is not compared.
    """
    before = kept.set_index("seed").reindex(own["seed"]).reset_index()
    strict = [c for c in columns if c not in (*TIMES, *loose)]
    return [f"seed {seed}: {column}" for column in strict for seed in _apart(column, own, before, words)]


def _apart(column: str, own: pd.DataFrame, before: pd.DataFrame, words: Collection[str]) -> Sequence[int]:
    one, other = own[column], before[column]
    if column in words:
        first, second = (c.astype(object).where(c.notna(), "").astype(str).to_numpy() for c in (one, other))
        same = first == second
    else:
        numbers = [pd.to_numeric(c, errors="coerce").to_numpy(dtype=np.float64) for c in (one, other)]
        floor = 1e-6 if column.startswith("error") else 0.0  # what the integration leaves where there is no noise
        same = np.isclose(*numbers, rtol=ALIKE, atol=floor, equal_nan=True)
    return [int(seed) for seed in own["seed"].to_numpy()[~same]]
