"""All claims as a table."""

from collections.abc import Callable
from dataclasses import asdict

import pandas as pd

from study.reproduction.claims import (
    conclusions,
    damping,
    dead_band,
    duffing,
    levels,
    linear_system,
    mathieu,
    noise_with_instruments,
    preliminary_claims,
    response,
    simulation,
)
from study.reproduction.claims.evidence import Evidence
from study.reproduction.claims.judgement import Claim, conclude
from study.reproduction.claims.reported import Reported

SECTIONS = (
    simulation, response, preliminary_claims, linear_system, duffing, damping, mathieu, dead_band, levels,
    noise_with_instruments, conclusions,
)  # fmt: skip
CLAIMS = {name: conditions for section in SECTIONS for name, conditions in section.CLAIMS.items()}


def judge_claim(name: str, evidence: Evidence, reported: Reported) -> Claim:
    """One claim, by its id."""
    return conclude(reported, name, *CLAIMS[name](evidence, reported))


def judge_all(
    evidence: Evidence, reported: Reported, progress: Callable[[int, Claim], None] | None = None
) -> pd.DataFrame:
    """Every claim, one row each, in the order of the report."""
    claims: list[Claim] = []
    for name in CLAIMS:
        claims.append(judge_claim(name, evidence, reported))
        if progress is not None:
            progress(len(claims), claims[-1])
    order = list(reported.statements)
    return pd.DataFrame([asdict(claim) for claim in sorted(claims, key=lambda c: order.index(c.id))])
