"""What the constants of a diagnosis do: false alarms against alpha, tie sets against K, after the fact.

A run keeps what each verdict rested on (``findings.evidence_row``), so that no trial has to be run again.
"""

import math

import pandas as pd

from study.trials.rates import mean, proportion
from study.trials.reach import rows_of
from study.trials.runs import COMPLETED, NONE, SINGLE

ALPHAS = (1e-4, 1e-3, 0.005, 0.01, 0.02, 0.05, 0.1)
FACTORS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)


def against_alpha(table: pd.DataFrame) -> pd.DataFrame:
    """For each alpha and noise or none: ``false_alarms`` of complete models, ``missed`` of hidden effects.

    A false alarm is a candidate that would be believed of a model that lacks nothing; a hidden effect is missed where
    its own p value does not fall below alpha. With 95 % intervals.
    """
    rows = [row for row in rows_of(table) if not row["trouble"]]
    lines: list[dict[str, float]] = []
    for alpha in ALPHAS:
        alarms = proportion([float(r["smallest_p"] < alpha) for r in rows if r["kind"] in (NONE, COMPLETED)])
        asked = [r for r in rows if r["kind"] == SINGLE and not math.isnan(r["true_p"])]
        missed = proportion([float(r["true_p"] >= alpha) for r in asked])
        lines.append(
            {"alpha": alpha, "complete_models": alarms.trials, "false_alarms": alarms.value,
             "false_alarms_low": alarms.low, "false_alarms_high": alarms.high, "hidden_effects": missed.trials,
             "missed": missed.value, "missed_low": missed.low, "missed_high": missed.high}
        )  # fmt: skip
    return pd.DataFrame(lines)


def against_k(table: pd.DataFrame) -> pd.DataFrame:
    """For each K: how often the candidates less than K standard errors behind the first hold the truth; their number.

    Of trials with one hidden effect, some noise (without it nothing but rounding stands between two candidates) and
    evidence that something is missing. With 95 % intervals.
    """
    rows = [r for r in rows_of(table) if r["kind"] == SINGLE and not r["trouble"] and r["noise"] > 0.0]
    rows = [r for r in rows if r["smallest_p"] < max(ALPHAS)]
    lines: list[dict[str, float]] = []
    for k in FACTORS:
        holds = proportion([float(r["distance"] < k) for r in rows])
        sizes = mean([float(sum(d < k for d in _distances(r["rivals"]))) for r in rows])
        lines.append(
            {"k": k, "trials": holds.trials, "holds": holds.value, "holds_low": holds.low, "holds_high": holds.high,
             "size": sizes.value, "size_low": sizes.low, "size_high": sizes.high}
        )  # fmt: skip
    return pd.DataFrame(lines)


def _distances(rivals: object) -> list[float]:
    """From ``0.00+1.15``; a cell of one number is a number."""
    return [float(part) for part in str(rivals).split("+")] if str(rivals) not in ("", "nan") else []
