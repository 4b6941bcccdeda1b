"""All claims as a table: the verdict on each row of ``config/reported.tsv`` that states one."""

from collections.abc import Callable
from dataclasses import asdict

import pandas as pd

from study.reproduction.claims.conditions import stated
from study.reproduction.claims.dead_band import DEAD_BAND_CLAIMS
from study.reproduction.claims.evidence import Evidence
from study.reproduction.claims.identification import IDENTIFICATION_CLAIMS
from study.reproduction.claims.judgement import Claim, Conditions, conclude
from study.reproduction.claims.levels import LEVEL_CLAIMS
from study.reproduction.claims.preliminary_claims import PRELIMINARY_CLAIMS
from study.reproduction.claims.reported import INPUT_VARIANCES, LIMIT, NOISE_LEVELS, Reported
from study.reproduction.claims.simulation import SIMULATION_CLAIMS

CLAIMS: dict[str, Conditions] = (
    SIMULATION_CLAIMS | PRELIMINARY_CLAIMS | IDENTIFICATION_CLAIMS | DEAD_BAND_CLAIMS | LEVEL_CLAIMS
)
# Rows whose value the claims in code and the reading of unit variance ask for.
TABLE_1 = {
    "linear": "k c f_n zeta", "duffing": "k c f_n zeta k3 c3", "van_der_pol": "k c f_n zeta k3 c3",
    "duffing_van_der_pol": "k c f_n zeta k3 c3", "mathieu": "k c f_n zeta k_m f_m", "dead_band": "k c f_n zeta u_g",
    "extreme": "k c f_n zeta k3 c3",
}  # fmt: skip
STATED = """
    table_1.m nyquist nyquist.dt lowpass below_10_hz error_free mathieu_lines.f_n mathieu_lines.f_m mathieu_fast.f_m
    mathieu_fast.low mathieu_fast.middle mathieu_fast.high averages resolution resolution.length resolution.seconds
    resolution.samples resolution.total overlap exact_stiffness siso_stiffness siso_frequency duffing_cubic
    duffing_share van_der_pol_damping van_der_pol_share mathieu_side_resonances.low mathieu_side_resonances.high
    mathieu_stiffness
    dead_band_stiffness dead_band_error dead_band_error.low dead_band_error.high dead_band_share dead_band_pattern
"""
LIMITS = """
    error_free rounded tests_wrong read_off by_eye line near_unity near_unity_lowest nearby low_coherence negligible
    excellent same_order significant_bias strong_below slight
"""
NUMBERS = (
    *(f"table_1.{system}.{name}" for system, names in TABLE_1.items() for name in names.split()), *STATED.split(),
    *(f"levels_invariant.{name}" for name in INPUT_VARIANCES), *(f"noise_random_only.{name}" for name in NOISE_LEVELS),
    *(LIMIT + name for name in LIMITS.split()),
)  # fmt: skip


def claim_names(reported: Reported) -> list[str]:
    """Ids of the rows that state a claim, in the order of the report."""
    return [name for name, row in reported.statements.items() if name in CLAIMS or row.holds_if]


def judge_claim(name: str, evidence: Evidence, reported: Reported) -> Claim:
    """One claim by its id: on the conditions that code gives, or on those of its row."""
    found = CLAIMS[name](evidence, reported) if name in CLAIMS else stated(evidence, reported, reported[name])
    return conclude(reported, name, *found)


def judge_all(
    evidence: Evidence, reported: Reported, progress: Callable[[int, Claim], None] | None = None
) -> pd.DataFrame:
    """Every claim, one row each, in the order of the report."""
    claims: list[Claim] = []
    for name in claim_names(reported):
        claims.append(judge_claim(name, evidence, reported))
        if progress is not None:
            progress(len(claims), claims[-1])
    return pd.DataFrame([asdict(claim) for claim in claims])
