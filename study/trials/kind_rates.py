"""Of trials by kind of test: how often the true effect came first, nothing was invented, and intervals held."""

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import pandas as pd

from study.support import document
from study.support.document import Block, Text, table
from study.support.numbers import percent
from study.trials.kind_runs import Row
from study.trials.kinds import TESTS
from study.trials.rates import Rate, proportion
from study.trials.visible import VISIBLE

HEADING = (
    "test", "true effect first", "first or tied", "of those that the record shows", "nothing missing where nothing is",
    "coefficients in their 95 % intervals",
)  # fmt: skip
EXACT = ("test", "seed", "noise", "hidden", "verdict", "first", "right")  # whatever lies at the edge of a tie


def write_rates(page: Path, trials: pd.DataFrame) -> None:
    """Write the rates into a page."""
    document.put(page, "trials", rate_blocks(trials))


def rate_blocks(trials: pd.DataFrame) -> list[Block]:
    """The rates by kind of test, and what they are of."""
    kinds = [kind for kind in TESTS if kind in set(trials["test"])]
    failed, noisy = int(trials["trouble"].notna().sum()), f"{100.0 * float(trials['noise'].max()):g} %"
    about = (
        f"{len(trials)} trials, seeds {int(trials['seed'].min())} to {int(trials['seed'].max())}, noise of 0 to "
        f"{noisy} of the response's mean square; {failed} could not be diagnosed and count as failed. In brackets 95 % "
        "intervals (Wilson, 1927) and the number of trials. An effect is shown by a record without noise, and by one "
        f"with noise if its coefficient in the fit of the true model stands {VISIBLE:.1f} standard errors from zero: "
        "of less, a test that asks for so many candidates finds fewer than 19 of 20, however it is made."
    )
    return [Text(about), table(HEADING, [[kind, *_cells(trials[trials["test"] == kind])] for kind in kinds])]


def _cells(trials: pd.DataFrame) -> list[str]:
    rows = cast(list[Row], trials.to_dict("records"))
    hidden, none = [r for r in rows if r["hidden"] != "none"], [r for r in rows if r["hidden"] == "none"]
    asked = [r for r in rows if r["asked"] > 0]
    rates: Sequence[Rate] = (
        proportion([_right(r) * (r["first"] == r["hidden"]) for r in hidden]), proportion([_right(r) for r in hidden]),
        proportion([_right(r) for r in hidden if _shown(r)]), proportion([_right(r) for r in none]),
        proportion([float(r["held"]) for r in asked], [float(r["asked"]) for r in asked]),
    )  # fmt: skip
    return [_cell(rate) for rate in rates]


def _right(row: Row) -> float:
    """One if the verdict is right; what could not be diagnosed is not."""
    return float(row["right"] == 1)


def _shown(row: Row) -> bool:
    """Whether the record shows the hidden effect; what could not be diagnosed is taken to."""
    return row["noise"] == 0.0 or row["shown"] >= VISIBLE or isinstance(row["trouble"], str)


def _cell(rate: Rate) -> str:
    if not rate.trials:
        return "-"
    return f"{percent(rate.value, '.0f')} ({percent(rate.low, '.0f')} to {percent(rate.high, '.0f')}; {rate.trials})"
