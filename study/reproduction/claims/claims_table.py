"""All claims as a table and as a page."""

from collections.abc import Callable, Iterable
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
from study.reproduction.claims.judgement import BESIDE, NOT_REPRODUCED, PARTLY, REPRODUCED, Claim
from study.reproduction.claims.reported import Reported

CLAIMS: tuple[Callable[[Evidence, Reported], Claim], ...] = (
    *simulation.CLAIMS,
    *response.CLAIMS,
    *preliminary_claims.CLAIMS,
    *linear_system.CLAIMS,
    *duffing.CLAIMS,
    *damping.CLAIMS,
    *mathieu.CLAIMS,
    *dead_band.CLAIMS,
    *levels.CLAIMS,
    *noise_with_instruments.CLAIMS,
    *conclusions.CLAIMS,
)
COLUMNS = ["id", "where", "claim", "reported", "measured", "criterion", "verdict", "why"]


def judge(evidence: Evidence, reported: Reported, progress: Callable[[int, Claim], None] | None = None) -> pd.DataFrame:
    """Every claim, one row each, in the order of the report."""
    rows: list[Claim] = []
    for claim in CLAIMS:
        rows.append(claim(evidence, reported))
        if progress is not None:
            progress(len(rows), rows[-1])
    order = list(reported.statements)
    rows.sort(key=lambda r: order.index(r.id))
    return pd.DataFrame([asdict(row) for row in rows], columns=COLUMNS)


def page(table: pd.DataFrame) -> str:
    """The table as a page: counts, then every claim."""
    own = table[~table["where"].str.startswith(BESIDE)]
    counts = own["verdict"].value_counts()
    found = [f"{int(counts.get(v, 0))} {v}" for v in (REPRODUCED, PARTLY, NOT_REPRODUCED)]
    lines = ["# Claims of the report", "", f"{len(own)} statements: {', '.join(found)}.", ""]
    lines += [_cells(COLUMNS), _cells(["---"] * len(COLUMNS))]
    lines += [_cells(row) for row in table[COLUMNS].to_numpy()]
    return "\n".join(lines) + "\n"


def _cells(cells: Iterable[object]) -> str:
    return "| " + " | ".join(str(c).replace("|", "\\|") for c in cells) + " |"
