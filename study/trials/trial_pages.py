"""What docs/tool.md says of the trials: reach beside its targets, and what each constant does."""

import math
from collections.abc import Mapping, Sequence
from typing import cast

import pandas as pd

from study.support.document import Block, Image, Text, table
from study.trials import constants_table, reach
from study.trials.findings import Row
from study.trials.runs import WITH, WITHOUT

CONFUSION = "trials_confusion.png"


def reached(trials: pd.DataFrame, wanted: Mapping[str, Sequence[float]]) -> list[Block]:
    """Every target without and with a fault of the measurement, from the table of trials."""
    lines = _rows(reach.target_summary(trials, wanted))
    cells = {(str(line["reach"]), str(line["faults"])): line for line in lines}
    names = list(dict.fromkeys(name for name, _ in cells))
    rows = [
        [name, *(text for faults in (WITHOUT, WITH) for text in _texts(cells.get((name, faults))))] for name in names
    ]
    heading = ("reach", "without faults", "wanted", "with a fault", "wanted")
    return [Text(_about(trials)), table(heading, rows), Image("What was hidden, and what was said", CONFUSION)]


def constants(trials: pd.DataFrame) -> list[Block]:
    """False alarms against alpha, and tie sets against K."""
    alphas = [
        (f"{row['alpha']:g}", _share(row, "false_alarms"), _share(row, "missed"))
        for row in _rows(constants_table.against_alpha(trials))
    ]
    factors = [
        (f"{row['k']:g}", _share(row, "holds"), "-" if math.isnan(row["size"]) else f"{row['size']:.2f}")
        for row in _rows(constants_table.against_k(trials))
    ]
    return [
        table(("alpha", "false alarms, of complete models", "hidden effects missed by their own p value"), alphas),
        table(("K", "tie sets that hold the truth", "mean size"), factors),
    ]


def _rows(found: pd.DataFrame) -> list[Row]:
    return cast(list[Row], found.to_dict("records"))


def _about(trials: pd.DataFrame) -> str:
    failed = int(trials["trouble"].notna().sum())
    first, last = int(trials["seed"].min()), int(trials["seed"].max())
    return (
        f"Of {len(trials)} trials (seeds {first} to {last}), {failed} of which could not be made or diagnosed and "
        "count as failed; in brackets 95 % intervals and the number of trials. A target is reached if the interval "
        "reaches it; what is not is marked *."
    )


def _texts(line: Row | None) -> tuple[str, str]:
    """What was measured and what is wanted."""
    if line is None:
        return "", ""
    rate = "size" not in str(line["reach"])
    value, low, high = (_number(line[key], rate) for key in ("value", "low", "high"))
    star = " *" if line["reached"] == "no" else ""
    unit = " %" if rate else ""
    return f"{value}{unit} ({low} to {high}; {line['trials']}){star}", _wanted(line, rate)


def _wanted(line: Row, rate: bool) -> str:
    least, most = line["least"], line["most"]
    if math.isnan(most):
        return "" if math.isnan(least) else f"{_number(least, rate)} %"
    return f"at most {most:g}" if math.isnan(least) else f"{_number(least, rate)} to {_number(most, rate)} %"


def _number(value: float, rate: bool) -> str:
    return f"{100.0 * value:.3g}" if rate else "-" if math.isinf(value) else f"{value:.2f}"


def _share(row: Row, name: str) -> str:
    if math.isnan(row[name]):
        return "-"
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    return f"{100.0 * row[name]:.3g} % ({100.0 * low:.3g} to {100.0 * high:.3g})"
