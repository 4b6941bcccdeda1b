"""Of many trials: how often the targets of reach were met, who was taken for whom, and how the error fell.

A tie is scored by whether its set holds the truth and by its size; no size makes up for a truth that is not in it. A
trial that could not be made or diagnosed counts as failed. Every rate has its 95 % interval.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import ndtri

from study.diagnose.next_test import WORTH
from study.diagnose.verdict import MISSING, NOTHING, PARTLY_KNOWN, UNKNOWN
from study.equations.terms import LIBRARY, same_elsewhere
from study.support.thresholds import K
from study.trials.draw import NOISES
from study.trials.effects import VISIBLE_ERRORS
from study.trials.kept import BY_TEST, CHANGES, LIKE_RIGS, NEXT_TESTS, STRUCTURES, TRIALS, Row, rows_of
from study.trials.kinds import TESTS
from study.trials.runs import COMPLETED, PAIR, REMOVED, SINGLE, WITH, WITHOUT
from study.trials.varying import NO_EFFECT

_, FAINT_NOISE, MODEST_NOISE, _ = NOISES  # up to which ties are to be short, and the true effect has to come first
WITHIN = 1.05  # held-out error after adding, over that of the true model
SAME_PLACE, END_IN_COMMON, ANOTHER_PLACE = "the same place", "a place with an end in common", "another place"
NOT_DIAGNOSED = "not_diagnosed"
# Of which a table says what each would do: a run keeps what its verdict rested on.
ALPHAS = (1e-4, 1e-3, 0.005, 0.01, 0.02, 0.05, 0.1)
NORMAL = float(ndtri(0.975))


@dataclass(frozen=True)
class Rate:
    """A value over trials."""

    trials: int
    value: float  # nan without a trial
    low: float  # of the 95 % interval
    high: float


NO_TRIALS = Rate(0, math.nan, math.nan, math.nan)


def proportion(successes: Sequence[float], asked: Sequence[float] | None = None) -> Rate:
    """Share of successes with its interval (Wilson, 1927); of ``asked`` in each trial, one if left out.

    What is asked in one trial is no independent sample: where the trials scatter more than so many independent answers
    would, the interval is that of as many as scatter as they do (Rao and Scott, 1992).
    """
    if not len(successes):
        return NO_TRIALS
    good, all_asked = np.asarray(successes, dtype=np.float64), np.ones(len(successes))
    if asked is not None:
        all_asked = np.asarray(asked, dtype=np.float64)
    total, n = float(np.sum(all_asked)), len(good)
    p = float(np.sum(good)) / total
    binomial = p * (1.0 - p) / total
    excess = 1.0
    if asked is not None and binomial > 0.0 and n > 1:
        excess = max(1.0, n / (n - 1) * float(np.sum((good - p * all_asked) ** 2)) / total**2 / binomial)
    answers, z2 = total / excess, NORMAL**2
    middle = (p + 0.5 * z2 / answers) / (1.0 + z2 / answers)
    half = NORMAL / (1.0 + z2 / answers) * math.sqrt(p * (1.0 - p) / answers + 0.25 * z2 / answers**2)
    return Rate(n, p, max(middle - half, 0.0), min(middle + half, 1.0))


def mean(values: Sequence[float]) -> Rate:
    """Mean with its interval from the scatter; none of a single value."""
    if not len(values):
        return NO_TRIALS
    middle, n = float(np.mean(values)), len(values)
    half = NORMAL * float(np.std(values, ddof=1)) / math.sqrt(n) if n > 1 else math.inf
    return Rate(n, middle, middle - half, middle + half)


Wanted = Mapping[str, Sequence[float]]
Member = Callable[[Row], bool]
Score = Callable[[Row], float]


@dataclass(frozen=True)
class Reach:
    """One target of reach: which trials it is of, and how each is scored."""

    what: str
    member: Member
    score: Score
    key: str = ""  # of what is wanted
    asked: str = ""  # the column of how many answers were asked for in a trial; one where left out
    size: bool = False  # whether it is a mean of numbers, wanted to be small

    def of(self, rows: Iterable[Row]) -> Rate:
        """The rate over those of the rows that it is of."""
        own = [row for row in rows if self.member(row)]
        if self.size:
            return mean([self.score(row) for row in own])
        scores = [0.0 if row["trouble"] else self.score(row) for row in own]
        return proportion(scores, [float(row[self.asked]) for row in own] if self.asked else None)


def first_score(row: Row) -> float:
    """One if the hidden effect is called missing and stands first, or its other form in the same equation does.

    That is the effect with the displacement counted from another place.
    """
    moved = row["response"] != "displacement" and bool(row["first"])
    moved = moved and same_elsewhere(row["first"], row["hidden"], row["known"].split("+"))
    return float(row["verdict"] == MISSING and (row["first"] == row["hidden"] or moved))


def tied_score(row: Row) -> float:
    """One if the hidden effect is among those that the record cannot tell apart."""
    return float(row["hidden"] in row["tie_set"].split("+"))


def nothing_score(row: Row) -> float:
    """One if it is said that nothing is missing, or nothing but what the fault that was found may be instead.

    An offset of the displacement and a constant force are one equation where all else is linear.
    """
    or_the_fault = row["found"] == row["fault"] and row["first"] in row["fault_rivals"].split("+")
    return float(row["verdict"] == NOTHING or (row["verdict"] == MISSING and or_the_fault))


def pair_score(row: Row) -> float:
    """One if the two that are named at once, or were put first one after the other, are the two hidden effects."""
    put_first = [row[column].split("+")[0] for column in ("tie_set", "second_tie_set")]
    put_first = put_first if row["tie_set"] else row["pair"].split("+")
    return float(set(put_first) == set(row["hidden"].split("+")))


def removed_score(row: Row) -> float:
    """One if an effect that is not in the library is called unknown, or is tied, if it may be, with what is named."""
    if row["verdict"] == UNKNOWN:
        return 1.0
    whole = row["whole_tie_set"].split("+")
    return float(row["verdict"] == MISSING and row["first"] in whole and row["hidden"] in whole)


def fault_score(row: Row) -> float:
    """One if the fault is named in its channel with an interval that holds its value."""
    if (row["found"], row["found_channel"]) != (row["fault"], row["fault_channel"]):
        return 0.0
    low, true, high = (float(row[column]) for column in ("found_low", "fault_value", "found_high"))
    counted = low == high and math.isclose(low, true, rel_tol=1e-6)  # has no interval, and no last bit either
    return float(counted or low <= true <= high)


def as_good_as_truth(row: Row) -> float:
    """One if the held-out error after adding is within 5 % of that of the true model, fitted in the same way."""
    rounding = 1e-9  # what the integration leaves where there is no noise
    return float(bool(row["error_after"] <= WITHIN * row["error_true"] + rounding))


def _hidden(test: Member = lambda _: True) -> Member:
    return lambda row: row["hidden"] != NO_EFFECT and test(row)


def _kinds(*kinds: str) -> Member:
    return lambda row: row["kind"] in kinds


def _single(test: Member = lambda _: True, above: float = -1.0, up_to: float = math.inf) -> Member:
    """One effect hidden, behind noise above one level and up to another."""
    return lambda row: row["kind"] == SINGLE and above < row["noise"] <= up_to and test(row)


def _nothing_hidden(row: Row) -> bool:
    return row["hidden"] == NO_EFFECT


def _faulty(row: Row) -> bool:
    return row["fault"] != ""


def _named(row: Row) -> bool:
    return row["tie_set"] != ""


def _stands_out(row: Row) -> bool:
    """Whether the record of a test shows the hidden effect; what could not be diagnosed is taken to."""
    return row["noise"] == 0.0 or row["shown"] >= VISIBLE_ERRORS or row["trouble"] != ""


def _asks(column: str) -> Member:
    """Whether intervals were asked for: without noise they are as wide as rounding."""
    return lambda row: not row["trouble"] and row["noise"] > 0.0 and row[column] > 0


def _is(column: str) -> Score:
    return lambda row: float(str(row[column]) in ("True", "1", "1.0"))


def _is_not(column: str) -> Score:
    return lambda row: 1.0 - _is(column)(row)


def _number(column: str) -> Score:
    return lambda row: float(row[column])


def _effects(*counts: int) -> Member:
    """Of trials like real rigs that could be made: so many effects hidden."""
    return lambda row: row["hidden"] != "" and (row["hidden"] != NO_EFFECT) * (row["hidden"].count("+") + 1) in counts


def _level_with_truth(row: Row) -> bool:
    """Effects are hidden, and the true set leaves no more than the best that was found; asked of failed trials too."""
    return _effects(1, 2, 3, 4)(row) and not row["true_behind"] >= K


def _of_kinds(*tests: str) -> Member:
    """Trials of changes of these kinds."""
    return lambda row: row["test"] in tests


_CHANGING = ("drift", "step", "schedule", "schedule_and_nonlinearity")


def _promised(least: float, most: float = math.inf) -> Member:
    """Of ties that a test was proposed for: promised so much, and less than the other."""
    return lambda row: least <= row["promise"] < most


def _both(row: Row) -> float:
    return _is("effect_first")(row) * _is("place_first")(row)


TARGETS: Mapping[str, tuple[Reach, ...]] = MappingProxyType(
    {
        TRIALS: (
            Reach("true effect first, noise to 5 %", _single(up_to=MODEST_NOISE), first_score, "first"),
            Reach("true effect first, noise 10 %", _single(above=MODEST_NOISE), first_score, "first_in_noise"),
            Reach("tie set holds the truth", _single(), tied_score, "tied"),
            # A constant force behind a high-pass leaves nothing to be seen.
            Reach("... where the true model leaves less than that without the effect",
                  _single(lambda r: not r["error_true"] >= r["error_before"]), tied_score),
            Reach("nothing missing where nothing is, and of completed models", _kinds(NO_EFFECT, COMPLETED),
                  nothing_score, "nothing"),
            Reach("... where nothing is", _kinds(NO_EFFECT), nothing_score),
            Reach("... of completed models", _kinds(COMPLETED), nothing_score),
            Reach("both of two, by diagnose and add", _kinds(PAIR), pair_score, "both"),
            Reach("hidden effect taken out of the library: called unknown, or tied when it is put back",
                  _kinds(REMOVED), removed_score, "removed"),
            Reach("... or what is said leaves as little as the true model", _kinds(REMOVED),
                  lambda r: max(removed_score(r), as_good_as_truth(r))),
            Reach("... or something beside it is said to have no name", _kinds(REMOVED),
                  lambda r: max(removed_score(r), as_good_as_truth(r), float(r["verdict"] == PARTLY_KNOWN))),
            Reach("the fault named, its value within its interval", _faulty, fault_score, "fault"),
            Reach("... of those that the record shows beside the true equation", lambda r: r["fault_shown"] == "yes",
                  fault_score),
            Reach("no fault named where there is none", lambda r: not _faulty(r), lambda r: r["faults_found"] == ""),
            Reach("error after adding within 5 % of the true model's", _single(), as_good_as_truth),
            Reach("mean size of the tie set, noise to 1 %", _single(_named, up_to=FAINT_NOISE), _number("tie_size"),
                  "size", size=True),
            Reach("mean size of the tie set, noise 5 %", _single(_named, FAINT_NOISE, MODEST_NOISE),
                  _number("tie_size"), "size_in_noise", size=True),
            Reach("mean size of the tie set, noise 10 %", _single(_named, MODEST_NOISE), _number("tie_size"),
                  size=True),
            Reach("95 % intervals of coefficients that hold the truth, with noise", _asks("asked"), _number("held"),
                  "held", asked="asked"),
        ),
        BY_TEST: (
            Reach("true effect first", _hidden(), lambda r: _is("right")(r) * (r["first"] == r["hidden"])),
            Reach("first or tied", _hidden(), _is("right")),
            Reach("... of those that the record shows", _hidden(_stands_out), _is("right")),
            Reach("nothing missing where nothing is", _nothing_hidden, _is("right")),
            Reach("95 % intervals of the true model that hold its values", _asks("asked"), _number("held"),
                  asked="asked"),
        ),
        STRUCTURES: (
            Reach("effect and place first, noise to 1 %", _hidden(lambda r: r["noise"] <= FAINT_NOISE), _both, "first"),
            Reach("effect and place first, noise of 5 %", _hidden(lambda r: r["noise"] > FAINT_NOISE), _both,
                  "first_in_noise"),
            Reach("effect first", _hidden(), _is("effect_first")),
            Reach("place first", _hidden(), _is("place_first")),
            Reach("tie set holds the truth", _hidden(), _is("tie_holds"), "tied"),
            Reach("nothing missing where nothing is", _nothing_hidden, lambda r: r["verdict"] == NOTHING, "nothing"),
            Reach("error after adding within 5 % of the true model's", _hidden(), as_good_as_truth, "error"),
            Reach("95 % intervals of the true model that hold its values", _asks("true_keys"), _number("true_inside"),
                  "held", asked="true_keys"),
        ),
        LIKE_RIGS: (
            Reach("the right set, one effect", _effects(1), _is("right")),
            Reach("the right set, two effects", _effects(2), _is("right"), "two"),
            Reach("the right set, three effects", _effects(3), _is("right"), "three"),
            Reach("the right set, four effects", _effects(4), _is("right")),
            Reach("named effects that are truly there", lambda r: r["named_count"] > 0, _number("there"), "there",
                  asked="named_count"),
            Reach("nothing named where nothing is missing", _effects(0), lambda r: r["named"] == "", "nothing"),
            Reach("the true set in the list of those that the record cannot tell apart", _effects(1, 2, 3, 4),
                  _is("holds"), "holds"),
            Reach("... beside a remainder", lambda r: r["remainder"] != "", _is("holds")),
            Reach("... where the record cannot tell it from the best", _level_with_truth, _is("holds")),
            Reach("... and a set is named", lambda r: _level_with_truth(r) and r["named"] != "", _is("holds")),
            Reach("diagnosed within 60 s of one core", _effects(0, 1, 2, 3, 4), lambda r: r["seconds"] <= 60.0),
        ),
        CHANGES: (
            Reach("what is missing named rightly, where a coefficient changes", _of_kinds(*_CHANGING), _is("right"),
                  "right"),
            Reach("... a drift", _of_kinds("drift"), _is("right")),
            Reach("... a step", _of_kinds("step"), _is("right")),
            Reach("... a schedule by a channel", _of_kinds("schedule"), _is("right")),
            Reach("... that beside a nonlinearity", _of_kinds("schedule_and_nonlinearity"), _is("right")),
            Reach("... where a step and a curve along time count as one", _of_kinds(*_CHANGING), _is("alike")),
            Reach("no change named where nothing varies", _of_kinds("nonlinear", "nothing"),
                  lambda r: not _is("changes")(r), "steady"),
            Reach("a nonlinearity alone named as such", _of_kinds("nonlinear"), _is("right")),
            Reach("95 % bands, and moments of steps, that hold the truth", lambda r: r["asked"] > 0, _number("held"),
                  "held", asked="asked"),
            Reach("... with noise", _asks("asked"), _number("held"), asked="asked"),
        ),
        NEXT_TESTS: (
            Reach("ties that end in the right effect, where 95 % or more was promised", _promised(0.95), _is("decided"),
                  "sure"),
            Reach("... where 80 to 95 % was promised", _promised(0.8, 0.95), _is("decided"), "likely"),
            Reach("... where less was promised", _promised(WORTH, 0.8), _is("decided")),
            Reach("ties left undecided, where 80 % or more was promised", _promised(0.8), _is_not("decided")),
            Reach("... after a random test that is allowed and as long", _promised(0.8), _is_not("random_decided")),
            Reach("ties left undecided, of all for which a test is proposed", _promised(WORTH), _is_not("decided")),
            Reach("... after a random test as above", _promised(WORTH), _is_not("random_decided")),
            Reach("ties that one of these two tests decides and the other does not: decided by the proposed one",
                  lambda r: _promised(WORTH)(r) and _is("decided")(r) != _is("random_decided")(r), _is("decided")),
            Reach("ties of which it is said that no allowed test is likely to decide", _promised(0.0),
                  lambda r: float(r["promise"] < WORTH)),
            Reach("mean size of the promise, where 80 to 95 % was promised", _promised(0.8, 0.95), _number("promise"),
                  size=True),
            Reach("mean size of the promise, where less was promised", _promised(WORTH, 0.8), _number("promise"),
                  size=True),
        ),
    }
)  # fmt: skip
# Columns of a page.
GROUPS: Mapping[str, str] = MappingProxyType(
    {TRIALS: "faults", BY_TEST: "test", STRUCTURES: "", LIKE_RIGS: "", NEXT_TESTS: "", CHANGES: ""}
)
WANTED: Mapping[str, Wanted] = MappingProxyType(
    {
        STRUCTURES: {
            "first": (0.9,), "first_in_noise": (0.8,), "tied": (0.95,), "nothing": (0.95,), "error": (0.9,),
            "held": (0.95,),
        },
        CHANGES: {"right": (0.9,), "steady": (0.98,), "held": (0.95,)},
        NEXT_TESTS: {"sure": (0.9,), "likely": (0.8,)},
        LIKE_RIGS: {"two": (0.85,), "three": (0.75,), "there": (0.95,), "nothing": (0.98,), "holds": (0.95,)},
    }
)  # fmt: skip


def target_summary(table: pd.DataFrame, name: str, wanted: Wanted | None = None) -> pd.DataFrame:
    """Each target in each group: what was measured, its 95 % interval, and whether what is wanted was met.

    The trials of a force on mass and spring are grouped by whether they have a fault of the measurement, those of tests
    by test. A target is met if the interval reaches it. ``wanted`` holds one value for each group, in the order of
    ``groups_of``; of the rate ``fault`` that with a fault alone.
    """
    rows, column = rows_of(table), GROUPS[name]
    wanted = WANTED.get(name, {}) if wanted is None else wanted
    found: list[Row] = []
    for place, group in enumerate(groups_of(table, name)):
        own = [row for row in rows if not column or row[column] == group]
        for reach in TARGETS[name]:
            rate = reach.of(own)
            most = _wanted(wanted, reach.key if reach.size else f"{reach.key}_most", place)
            least = math.nan if reach.size else _wanted(wanted, reach.key, place)
            met = not (rate.high < least or rate.low > most)
            asked = rate.trials and not (math.isnan(least) and math.isnan(most))
            line = {"reach": reach.what, "group": group, "trials": rate.trials, "value": rate.value, "low": rate.low}
            line |= {"high": rate.high, "least": least, "most": most}
            found.append(line | {"reached": "" if not asked else "yes" if met else "no"})
    return pd.DataFrame([line for line in found if line["trials"]])


def groups_of(table: pd.DataFrame, name: str) -> tuple[str, ...]:
    """What the trials of a table are grouped by."""
    if not GROUPS[name]:
        return ("",)
    return (WITHOUT, WITH) if name == TRIALS else tuple(test for test in TESTS if test in set(table[GROUPS[name]]))


def _wanted(wanted: Wanted, key: str, place: int) -> float:
    values = wanted.get(key, ())
    if key == "fault":
        values = (math.nan, *values)
    return values[place] if place < len(values) else math.nan


def confusion(table: pd.DataFrame) -> pd.DataFrame:
    """Numbers of trials by what was hidden (rows: each effect alone, none) and what was said (columns)."""
    rows = [row for row in rows_of(table) if row.get("kind", SINGLE) in (SINGLE, NO_EFFECT)]
    return _counted([(row["hidden"] or NO_EFFECT, _said(row)) for row in rows])


def confusion_of_places(table: pd.DataFrame) -> pd.DataFrame:
    """Kinds of the hidden effect's place (rows) and where the first candidate was (columns), numbers of trials."""
    pairs: list[tuple[str, str]] = []
    for row in rows_of(table):
        said, true = _path(row["first_place"]), _path(row["place"])
        kind = "to the ground, or a force on it" if "ground" in true else "between two"
        where = SAME_PLACE if said == true else END_IN_COMMON if (said & true) - {"ground"} else ANOTHER_PLACE
        pairs.append(
            (f"{kind}, {row['coordinates']} coordinates" if true else NO_EFFECT, where if said else _said(row))
        )
    return _counted(pairs)


def _said(row: Row) -> str:
    return NOT_DIAGNOSED if row["trouble"] else row["first"] if row["verdict"] == MISSING else row["verdict"]


def _path(label: str) -> set[str]:
    """What a place lies between; empty if there is none."""
    ends = set(label.split("-")) if label else set[str]()
    return ends | {"ground"} if len(ends) == 1 else ends


def _counted(pairs: Sequence[tuple[str, str]]) -> pd.DataFrame:
    """Effects and places in the order of the library, then those of nobody's, then what is neither."""
    order = (*LIBRARY, SAME_PLACE, END_IN_COMMON, ANOTHER_PLACE, "", NO_EFFECT, NOTHING, UNKNOWN, NOT_DIAGNOSED)

    def ordered(names: Iterable[str]) -> list[str]:
        return sorted(set(names), key=lambda name: (order.index(name if name in order else ""), name))

    hidden = ordered(one for one, _ in pairs)
    said = ordered([*(other for _, other in pairs), *(set(hidden) & set(LIBRARY)), NOTHING, UNKNOWN])
    counts = [[pairs.count((one, other)) for other in said] for one in hidden]
    return pd.DataFrame(counts, index=pd.Index(hidden, name="hidden"), columns=said).reset_index()


def error_by_noise(table: pd.DataFrame) -> pd.DataFrame:
    """Mean held-out response error before and after adding what was found, and that of the true model, by noise."""
    good = table[(table["trouble"].isna() | (table["trouble"] == "")) & (table["faults"] == WITHOUT)]
    rows: list[dict[str, Any]] = []
    for kind, steps in ((SINGLE, ("before", "after", "true")), (PAIR, ("before", "after", "after_two", "true"))):
        for noise, group in good[good["kind"] == kind].groupby("noise"):
            for step in steps:
                column = group[f"error_{step}"]
                if step == "after_two":  # where nothing was added the second time, those after the first
                    column = column.fillna(group["error_after"])
                errors = column.dropna().to_numpy(dtype=np.float64)
                error = np.std(errors, ddof=1) / math.sqrt(len(errors)) if len(errors) > 1 else math.nan
                rows.append(
                    {"kind": kind, "noise": noise, "step": step, "trials": len(errors), "mean_error": np.mean(errors),
                     "standard_error": error, "median_error": np.median(errors)}
                )  # fmt: skip
    columns = ["kind", "noise", "step", "trials", "mean_error", "standard_error", "median_error"]
    return pd.DataFrame(rows, columns=columns)


def against_alpha(table: pd.DataFrame) -> pd.DataFrame:
    """For each alpha and noise or none: ``false_alarms`` of complete models, ``missed`` of hidden effects.

    A false alarm is a candidate that would be believed of a model that lacks nothing; a hidden effect is missed where
    its own p value does not fall below alpha. With 95 % intervals.
    """
    rows = [row for row in rows_of(table) if not row["trouble"]]
    lines: list[dict[str, float]] = []
    for alpha in ALPHAS:
        alarms = proportion([float(r["smallest_p"] < alpha) for r in rows if r["kind"] in (NO_EFFECT, COMPLETED)])
        asked = [r for r in rows if r["kind"] == SINGLE and not math.isnan(r["true_p"])]
        missed = proportion([float(r["true_p"] >= alpha) for r in asked])
        lines.append(
            {"alpha": alpha, "complete_models": alarms.trials, "false_alarms": alarms.value,
             "false_alarms_low": alarms.low, "false_alarms_high": alarms.high, "hidden_effects": missed.trials,
             "missed": missed.value, "missed_low": missed.low, "missed_high": missed.high}
        )  # fmt: skip
    return pd.DataFrame(lines)


def against_k(table: pd.DataFrame) -> pd.DataFrame:
    """For each K: how often the candidates less than K standard errors behind the first hold the truth; their number.

    Of trials with one hidden effect, some noise (without it nothing but rounding stands between two candidates) and
    evidence that something is missing. With 95 % intervals.
    """
    rows = [r for r in rows_of(table) if r["kind"] == SINGLE and not r["trouble"] and r["noise"] > 0.0]
    rows = [r for r in rows if r["smallest_p"] < max(ALPHAS)]
    cells = [str(r["rivals"]) for r in rows]  # ``0.00+1.15``; a cell of one number is a number
    rivals = [[float(part) for part in cell.split("+")] if cell not in ("", "nan") else [] for cell in cells]
    lines: list[dict[str, float]] = []
    for k in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0):
        holds = proportion([float(r["distance"] < k) for r in rows])
        sizes = mean([float(sum(d < k for d in own)) for own in rivals])
        lines.append(
            {"k": k, "trials": holds.trials, "holds": holds.value, "holds_low": holds.low, "holds_high": holds.high,
             "size": sizes.value, "size_low": sizes.low, "size_high": sizes.high}
        )  # fmt: skip
    return pd.DataFrame(lines)
