"""The tables of trials that are kept in docs: their columns, and whether this code still gives them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, cast

import numpy as np
import pandas as pd

from study.support.numbers import SAME_RUN

Row = dict[str, Any]
TRIALS, BY_TEST, STRUCTURES = "trials", "trials_by_test", "trials_of_structures"
LIKE_RIGS = "trials_like_rigs"
NEXT_TESTS = "trials_of_next_tests"
CHANGES = "trials_of_changes"
TIMES = ("seconds",)  # of another machine, or another hour
COLUMNS_OF_WORDS = (  # the others hold numbers
    "kind", "test", "hidden", "place", "response", "known", "faults", "fault", "fault_channel", "faults_found",
    "fault_rivals", "fault_shown", "found", "found_channel", "verdict", "first", "first_place", "effect_first",
    "place_first", "tied", "tie_set", "tie_holds", "second_verdict", "second_tie_set", "whole_tie_set", "pair",
    "remainder", "named", "sets", "design", "band", "sensor", "ends_in", "random_design", "random_band", "of",
    "trouble",
)  # fmt: skip


@dataclass(frozen=True)
class KeptTable:
    """What the rows of a table hold."""

    columns: tuple[str, ...]
    loose: tuple[str, ...]  # those that change with rounding, as whatever lies at the edge of a tie


KEPT_TABLES: Mapping[str, KeptTable] = MappingProxyType(
    {
        TRIALS: KeptTable(
            (
                "kind", "seed", "hidden", "noise", "faults", "response", "samples_a_period", "samples", "damping",
                "excitation", "known", "share", "fault", "fault_channel", "fault_value", "fault_unit", "faults_found",
                "fault_rivals", "fault_shown", "found", "found_channel", "found_value", "found_low", "found_high",
                "verdict", "first", "tie_set", "tie_size", "pair", "second_verdict", "second_tie_set", "whole_tie_set",
                "error_before", "error_after", "error_after_two", "error_true", "noise_floor", "left", "held", "asked",
                "smallest_p", "true_p", "distance", "rivals", "seconds", "trouble",
            ),
            ("left", "smallest_p", "true_p", "distance", "rivals", "error_true"),
        ),
        BY_TEST: KeptTable(
            (
                "test", "seed", "noise", "hidden", "verdict", "first", "tied", "right", "shown", "error_before",
                "error_after", "held", "asked", "seconds", "trouble",
            ),
            ("tied", "shown", "error_after", "held", "asked", "trouble"),
        ),
        STRUCTURES: KeptTable(
            (
                "seed", "coordinates", "hidden", "place", "noise", "response", "share", "verdict", "first",
                "first_place", "effect_first", "place_first", "tie_set", "tie_holds", "error_before", "error_after",
                "error_true", "noise_floor", "left", "asked", "p_value", "true_inside", "true_keys", "seconds",
                "trouble",
            ),
            ("left", "p_value", "error_true"),
        ),
        LIKE_RIGS: KeptTable(
            (
                "test", "seed", "hidden", "place", "share", "remainder", "remainder_error", "noise", "response",
                "verdict", "named", "named_count", "there", "right", "sets", "holds", "faults_found", "error_before",
                "error_after", "error_true", "true_behind", "noise_floor", "seconds", "trouble",
            ),
            ("sets", "holds", "error_after", "error_true", "true_behind", "trouble"),
        ),
        CHANGES: KeptTable(
            (
                "test", "seed", "of", "change", "hidden", "noise", "verdict", "named", "right", "alike", "changes",
                "held", "asked", "error_before", "error_after", "noise_floor", "seconds", "trouble",
            ),
            ("alike", "held", "asked", "error_after", "trouble"),
        ),
        NEXT_TESTS: KeptTable(
            (
                "test", "seed", "noise", "hidden", "verdict", "tie_set", "asked", "design", "band", "level",
                "length", "sensor", "promise", "promise_as_was", "decided", "ends_in", "random_design", "random_band",
                "random_decided", "seconds", "trouble",
            ),
            (
                "tie_set", "asked", "design", "band", "level", "length", "sensor", "promise",
                "promise_as_was", "decided", "ends_in", "random_design", "random_band", "random_decided", "trouble",
            ),
        ),
    }
)  # fmt: skip


def rows_of(table: pd.DataFrame) -> list[Row]:
    """The rows of a table as it is read, empty cells as empty words."""
    filled = {c: _text(table[c]) for c in table.columns if c in COLUMNS_OF_WORDS}
    return cast(list[Row], table.assign(**filled).to_dict("records"))


def differing_trials(own: pd.DataFrame, kept: pd.DataFrame, name: str) -> list[str]:
    """What came out otherwise than in a kept table: ``"seed 7: verdict"`` and so on; both as their file reads.

    ``kept`` may hold trials that ``own`` lacks. What was drawn and what was said must be the same word by word, errors
    to ``SAME_RUN``; what is loose is not compared.
    """
    table = KEPT_TABLES[name]
    keys = [key for key in ("test", "seed") if key in table.columns]
    before = own[keys].merge(kept, on=keys, how="left")
    differing: list[str] = []
    for column in (c for c in table.columns if c not in (*keys, *TIMES, *table.loose)):
        both = own[column], before[column]
        if column in COLUMNS_OF_WORDS:
            same = np.equal(*(_text(c).to_numpy() for c in both))
        else:
            numbers = (pd.to_numeric(c, errors="coerce").to_numpy(dtype=np.float64) for c in both)
            floor = 1e-6 if column.startswith("error") else 0.0  # what the integration leaves where there is no noise
            same = np.isclose(*numbers, rtol=SAME_RUN, atol=floor, equal_nan=True)
        differing += [f"seed {int(seed)}: {column}" for seed in own["seed"].to_numpy()[~same]]
    return differing


def _text(column: "pd.Series[Any]") -> "pd.Series[Any]":
    return column.astype(object).where(column.notna(), "").astype(str)
