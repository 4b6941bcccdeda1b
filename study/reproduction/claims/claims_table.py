"""All claims as a table and as a page."""

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
from study.reproduction.claims.judgement import BESIDE, NOT_REPRODUCED, PARTLY, REPRODUCED, Claim, conclude
from study.reproduction.claims.reported import Reported
from study.support.document import unpadded

SECTIONS = (
    simulation, response, preliminary_claims, linear_system, duffing, damping, mathieu, dead_band, levels,
    noise_with_instruments, conclusions,
)  # fmt: skip
CLAIMS = {name: conditions for section in SECTIONS for name, conditions in section.CLAIMS.items()}


def judge(name: str, evidence: Evidence, reported: Reported) -> Claim:
    """One claim, by its id."""
    return conclude(reported, name, *CLAIMS[name](evidence, reported))


def judge_all(
    evidence: Evidence, reported: Reported, progress: Callable[[int, Claim], None] | None = None
) -> pd.DataFrame:
    """Every claim, one row each, in the order of the report."""
    claims: list[Claim] = []
    for name in CLAIMS:
        claims.append(judge(name, evidence, reported))
        if progress is not None:
            progress(len(claims), claims[-1])
    order = list(reported.statements)
    return pd.DataFrame([asdict(claim) for claim in sorted(claims, key=lambda c: order.index(c.id))])


def page(table: pd.DataFrame) -> str:
    """The table as a page: counts, then every claim."""
    verdicts = table.loc[~table["where"].str.startswith(BESIDE), "verdict"]
    counts = ", ".join(f"{(verdicts == verdict).sum()} {verdict}" for verdict in (REPRODUCED, PARTLY, NOT_REPRODUCED))
    rows = unpadded([str(column) for column in table.columns], table.to_numpy().tolist())
    return f"# Claims of the report\n\n{len(verdicts)} statements: {counts}.\n\n{rows}\n"
