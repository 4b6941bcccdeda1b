"""What the study says of structures, in words and tables: beside the report's systems, of which it states nothing."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from study.reproduction.claims.judgement import SEPARATOR
from study.support import document
from study.support.document import Block

HOLDS = "holds"
SHOWN = ("estimator", "parameter", "true", "estimate", "standard_error", "relative_error", "tolerance")
ABOUT = (
    "The report's fourth recommendation: identify terms in systems with several degrees of freedom. These cases are no "
    "part of the report; what is claimed of them, and every tolerance, was set before looking."
)


@dataclass(frozen=True)
class Structures:
    """What the cases of structures gave, each table as the study wrote it."""

    parameters: pd.DataFrame  # results/structures.csv
    claims: pd.DataFrame  # columns case, claim, criterion, measured, verdict
    titles: Mapping[str, str]  # of each case by name, in the order of the page


def structure_blocks(found: Structures) -> list[Block]:
    """What is claimed of each case with its conditions, and every parameter."""
    made: list[Block] = [document.Text(ABOUT)]
    for case, title in found.titles.items():
        made.append(document.Heading(title, 3))
        for row in found.claims[found.claims["case"] == case].to_dict("records"):
            pairs = zip(str(row["criterion"]).split(SEPARATOR), str(row["measured"]).split(SEPARATOR), strict=True)
            lines = tuple(f"{criterion}: {measured}" for criterion, measured in pairs)
            made += [document.Text(f"**{row['verdict']}**: {row['claim']}"), document.Bullets(lines)]
        own = found.parameters[found.parameters["case"] == case]
        rows = [
            [f"{v:.5g}" if isinstance(v, float) else str(v) for v in row]
            for row in own[[*SHOWN]].itertuples(index=False)
        ]
        made.append(document.table(SHOWN, rows))
    return made


def count(found: Structures) -> str:
    """How many claims and parameters of structures hold, in a sentence."""
    held = int((found.claims["verdict"] == HOLDS).sum())
    own = found.parameters[found.parameters["estimator"] == "miso"]
    met = int(own["within_tolerance"].astype(bool).sum())
    return (
        f"Of structures of several coordinates, {held} of {len(found.claims)} claims hold; MI/SO recovers {met} of "
        f"{len(own)} coefficients of {own['case'].nunique()} cases within tolerances that were set before looking."
    )


def failing_structures(found: Structures) -> list[Block]:
    """The claims on structures that do not hold, or partly; empty if all do."""
    rest = found.claims[found.claims["verdict"] != HOLDS]
    if not len(rest):
        return []
    return [document.table(("verdict", "case", "claim"), rest[["verdict", "case", "claim"]].to_numpy().tolist())]
