"""Claims on pages: the verdict in a sentence, one line a claim, and what it rests on, folded."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from study.reproduction.claims.judgement import BESIDE, NOT_REPRODUCED, PARTLY, REPRODUCED, SEPARATOR
from study.support.document import Block, Bullets, Fold, Heading, Text, table

LONGEST = 110  # characters of a measured number in a table
MARKS = {REPRODUCED: "yes", PARTLY: "partly", NOT_REPRODUCED: "no"}


def verdict_sentence(claims: pd.DataFrame) -> str:
    """How many statements were reproduced, in one sentence; places beside the report are not counted."""
    verdicts = claims.loc[~claims["where"].str.startswith(BESIDE), "verdict"]
    whole, part, none = (int((verdicts == name).sum()) for name in (REPRODUCED, PARTLY, NOT_REPRODUCED))
    return f"**{whole} of {len(verdicts)} statements are reproduced**, {part} partly, {none} not."


def by_claim(claims: pd.DataFrame) -> list[Block]:
    """The verdict, then one line a claim; its conditions stand below, folded, where the line leads."""
    rows = [
        [f"[{row['where']}](#{row['id']})", row["claim"], row["reported"], shortened(row), row["verdict"]]
        for row in _rows(claims)
    ]
    said = "Each line leads to its conditions: what must hold, what was measured and, where it does not hold, why."
    return [
        Text(verdict_sentence(claims)), Text(said), table(["where", "claim", "report", "ours", "verdict"], rows),
        Heading("What each verdict rests on"), *(conditions(row) for row in _rows(claims)),
    ]  # fmt: skip


def conditions(row: Mapping[str, str]) -> Fold:
    """One claim: its reason if it fails, then each condition with what was measured."""
    measured, criteria = (row[name].split(SEPARATOR) for name in ("measured", "criterion"))
    if len(measured) == len(criteria):
        lines = [f"{criterion}: {found}" for criterion, found in zip(criteria, measured, strict=True)]
    else:  # a part of one of them has the separator within
        lines = [*(f"must hold: {c}" for c in criteria), *(f"measured: {m}" for m in measured)]
    why = [Text(f"Why: {row['why']}")] if row["why"] else []
    title = f"**{row['verdict']}** {row['where']}: {row['claim']} (report: {row['reported']})"
    return Fold(title, (*why, Bullets(tuple(lines))), row["id"])


def shortened(row: Mapping[str, str]) -> str:
    """What was measured, as many parts as the report gives numbers and a line holds."""
    parts = row["measured"].split(SEPARATOR)
    kept = parts[: len(row["reported"].split(", "))]  # "as stated" counts as one number
    while len(kept) > 1 and len(SEPARATOR.join(kept)) > LONGEST:
        kept = kept[:-1]
    text = SEPARATOR.join(kept)
    if len(text) > LONGEST:
        return text[: text.rfind(" ", 0, LONGEST)].rstrip(",;") + " …"
    return text if len(kept) == len(parts) else f"{text} …"


def _rows(claims: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(key): value for key, value in row.items()} for row in claims.to_dict("records")]
