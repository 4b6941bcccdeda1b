"""What docs say of the trials: reach beside its targets, what each constant does, which decays nobody could tell."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import cast

import pandas as pd

from study.equations.common_factor import per_unit_mass
from study.equations.model import free
from study.equations.terms import get
from study.identify.time_domain.fit_model import fit_model
from study.records.prepared import whole
from study.support.document import Block, Image, Text, table
from study.trials import rates
from study.trials.draw import make_trial
from study.trials.effects import VISIBLE_ERRORS
from study.trials.kept import BY_TEST, CHANGES, LIKE_RIGS, NEXT_TESTS, STRUCTURES, TRIALS, Row
from study.trials.runs import WITH, WITHOUT

PAGES: Mapping[str, str] = MappingProxyType(
    {
        TRIALS: "tool.md",
        BY_TEST: "kinds_of_tests.md",
        STRUCTURES: "structures.md",
        LIKE_RIGS: "like_rigs.md",
        NEXT_TESTS: "next_test.md",
        CHANGES: "tool.md",
    }
)
GROUP_HEADINGS: Mapping[str, str] = MappingProxyType({WITHOUT: "without faults", WITH: "with a fault", "": "reached"})
# What was hidden and what was said: pictures of the counts, as ``figures/`` and docs have them, and their titles.
CONFUSIONS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        TRIALS: {"trials_confusion": "What was hidden, and what was said"},
        BY_TEST: {},
        LIKE_RIGS: {},
        NEXT_TESTS: {},
        CHANGES: {},
        STRUCTURES: {
            "trials_of_structures_effects": "Effects: what was hidden and what was said",
            "trials_of_structures_places": "Places: where it was hidden and where it was found",
        },
    }
)
WHAT_SHOWS = (
    f"A record shows an effect if its coefficient in the fit of the true model is {VISIBLE_ERRORS:.1f} standard errors "
    "from zero, or if there is no noise; of weaker effects no test of so many candidates finds 19 of 20."
)


def blocks(trials: pd.DataFrame, name: str, wanted: rates.Wanted | None = None) -> dict[str, list[Block]]:
    """What a page says of a kept table, by the name of the place in it."""
    pictures = [Image(words, f"{path}.png") for path, words in CONFUSIONS[name].items()]
    place = "reach" if name == TRIALS else "trials"
    found: dict[str, list[Block]] = {place: [*reached(trials, name, wanted), *pictures]}
    if name == TRIALS:
        found["constants"] = constants(trials)
    if name == BY_TEST:
        found["laws"] = likelihoods(trials)
    return found


def reached(trials: pd.DataFrame, name: str, wanted: rates.Wanted | None = None) -> list[Block]:
    """Every target in each group, beside what is wanted, from the table of trials."""
    lines = _rows(rates.target_summary(trials, name, wanted))
    cells = {(line["reach"], line["group"]): line for line in lines}
    asked = {line["group"] for line in lines if line["reached"]}
    heading, columns = ["reach"], list[tuple[str, bool]]()
    for group in rates.groups_of(trials, name):
        heading += [GROUP_HEADINGS.get(group, group), *(["wanted"] if group in asked else [])]
        columns += [(group, False), *([(group, True)] if group in asked else [])]
    names = dict.fromkeys(line["reach"] for line in lines)
    rows = [[what, *(_text(cells.get((what, group)), aim) for group, aim in columns)] for what in names]
    return [Text(_about(trials, name)), table(tuple(heading), rows)]


def _about(trials: pd.DataFrame, name: str) -> str:
    failed = trials["trouble"].notna()
    unmade = failed & trials["hidden"].isna() & (name == LIKE_RIGS)  # nothing could be hidden: they belong to no row
    counted = int((failed & ~unmade).sum())
    of_which = [f"{int(unmade.sum())} of which could not be made and are left out"] if unmade.any() else []
    if counted or not of_which:
        of_which.insert(0, f"{counted} of which could not be made or diagnosed and count as failed")
    first, last = int(trials["seed"].min()), int(trials["seed"].max())
    each = " of each test" if trials["seed"].duplicated().any() else ""
    said = (
        f"{len(trials)} trials (seeds {first} to {last}{each}), {' and '.join(of_which)}; in brackets 95 % intervals "
        "(Wilson, 1927) and the number of trials."
    )
    if name == BY_TEST:
        return f"{said} {WHAT_SHOWS}"
    return f"{said} A target is met if the interval reaches it; * marks those that are not met."


def _text(line: Row | None, aim: bool) -> str:
    """What was measured, or what is wanted."""
    if line is None:
        return ""
    size, least, most = "size" in line["reach"], line["least"], line["most"]
    if not aim:
        value, low, high = (_number(line[key], size) for key in ("value", "low", "high"))
        star, unit = " *" if line["reached"] == "no" else "", "" if size else " %"
        return f"{value}{unit} ({low}-{high}; {line['trials']}){star}"
    if math.isnan(most):
        return "" if math.isnan(least) else f"{_number(least, size)} %"
    return f"at most {most:g}" if math.isnan(least) else f"{_number(least, size)} to {_number(most, size)} %"


def _number(value: float, size: bool) -> str:
    return f"{100.0 * value:.3g}" if not size else "-" if math.isinf(value) else f"{value:.2f}"


def constants(trials: pd.DataFrame) -> list[Block]:
    """False alarms against alpha, and tie sets against K, every other value that was asked for."""
    alphas = [
        (f"{row['alpha']:g}", _share(row, "false_alarms"), _share(row, "missed"))
        for row in _rows(rates.against_alpha(trials))[1::2]
    ]
    factors = [
        (f"{row['k']:g}", _share(row, "holds"), "-" if math.isnan(row["size"]) else f"{row['size']:.2f}")
        for row in _rows(rates.against_k(trials))[1::2]
    ]
    return [
        table(("alpha", "false alarms of complete models", "hidden effects missed"), alphas),
        table(("K", "tie sets that hold the truth", "mean size"), factors),
    ]


def _share(row: Row, name: str) -> str:
    if math.isnan(row[name]):
        return "-"
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    return f"{100.0 * row[name]:.3g} % ({100.0 * low:.3g}-{100.0 * high:.3g})"


def _rows(found: pd.DataFrame) -> list[Row]:
    return cast(list[Row], found.to_dict("records"))


def second_places(trials: pd.DataFrame) -> pd.DataFrame:
    """The decays in which another effect came first than the hidden one."""
    named = trials["first"].notna() & (trials["hidden"] != "none") & (trials["first"] != trials["hidden"])
    return trials[(trials["test"] == "free_decay") & named]


def log_likelihood_ratio(seed: int, hidden: str, other: str) -> float:
    """Twice the logarithm of the ratio of two models' likelihoods, each fitted to all samples of a decay.

    They have the same number of unknowns and white noise: where it is negative, the wrong one explains the record
    better, whoever judges; 3.8 is what chance gives a needless unknown once in twenty times.
    """
    trial = make_trial(seed, test="free_decay")
    prepared = whole(trial.record)
    rms = list[float]()
    for name in (hidden, other):
        model, _ = per_unit_mass(trial.believed.with_term(free(get(name))), prepared)
        rms.append(fit_model(model, prepared).rms)
    return 2.0 * len(prepared.record) * math.log(rms[1] / rms[0])


def likelihoods(trials: pd.DataFrame) -> list[Block]:
    """Whether the whole record tells those that came second from those that came first."""
    missed = second_places(trials)[["seed", "hidden", "first"]].itertuples(index=False)
    ratios = [log_likelihood_ratio(int(seed), str(hidden), str(first)) for seed, hidden, first in missed]
    better = sum(ratio < 0.0 for ratio in ratios)
    about = (
        f"In {len(ratios)} decays another effect came first and the hidden one was tied with it: two laws of damping. "
        f"In {better} of them the wrong law fits the whole record better than the true one; the true one is at "
        f"most {math.exp(0.5 * max(ratios, default=0.0)):.2g} times as likely. These records cannot tell more."
    )
    return [Text(about)]
