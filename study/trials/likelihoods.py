"""Decays with another effect first than the hidden one: whether the whole record would tell the two apart at all."""

import math
from collections.abc import Sequence

import pandas as pd

from study.equations.common_factor import per_unit_mass
from study.equations.model import free
from study.equations.terms import get
from study.identify.time_domain.fit_model import fit_model
from study.records.prepared import whole
from study.support.document import Block, Text, table
from study.trials.kinds import make_test

HEADING = ("trial", "noise", "hidden", "first", "2 ln (likelihood of the hidden over that of the first)")


def second_places(trials: pd.DataFrame) -> pd.DataFrame:
    """The decays in which another effect came first than the hidden one."""
    named = trials["first"].notna() & (trials["hidden"] != "none") & (trials["first"] != trials["hidden"])
    return trials[(trials["test"] == "free_decay") & named]


def log_likelihood_ratio(seed: int, hidden: str, other: str) -> float:
    """Twice the logarithm of the ratio of two models' likelihoods, each fitted to all samples of a decay.

    They have the same number of unknowns and white noise: where it is negative, the wrong one explains the record
    better, whoever judges; 3.8 is what chance gives a needless unknown once in twenty times.
    """
    trial = make_test("free_decay", seed)
    prepared = whole(trial.record)
    rms: list[float] = []
    for name in (hidden, other):
        model, _ = per_unit_mass(trial.believed.with_term(free(get(name))), prepared)
        rms.append(fit_model(model, prepared).rms)
    return 2.0 * len(prepared.record) * math.log(rms[1] / rms[0])


def likelihood_blocks(trials: pd.DataFrame) -> list[Block]:
    """The table of all of them, and what it says."""
    missed: Sequence[tuple[int, float, str, str]] = [
        (int(s), float(n), str(h), str(f))
        for s, n, h, f in second_places(trials)[["seed", "noise", "hidden", "first"]].itertuples(index=False)
    ]
    ratios = [log_likelihood_ratio(seed, hidden, first) for seed, _, hidden, first in missed]
    better = sum(ratio < 0.0 for ratio in ratios)
    about = (
        f"Of the {len(missed)} decays with another effect first than the hidden one, and it in the tie set, the wrong "
        f"law fits the whole record better than the true one in {better}; the largest ratio for the true one is "
        f"{math.exp(0.5 * max(ratios, default=0.0)):.2g} to 1. No test of these records could put it first more often."
    )
    rows = [
        [str(seed), f"{100.0 * noise:g} %", hidden, first, f"{ratio:.2f}"]
        for (seed, noise, hidden, first), ratio in zip(missed, ratios, strict=True)
    ]
    return [Text(about), table(HEADING, rows)]
