"""What diagnose makes of trials: one row each, the sealed answer beside what was found.

Those that are driven are of five kinds: one effect hidden, none, a pair (diagnose, add what comes first, diagnose
again), one effect hidden and taken out of the library (``removed``), and one effect that the model has already
(``completed``). Other tests, and structures, hide one effect or none; trials like real rigs up to four.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from types import MappingProxyType

import numpy as np

from study.diagnose.adding import added, added_candidate
from study.diagnose.confirmed_faults import diagnose_accounted
from study.diagnose.verdict import NOTHING, diagnose
from study.equations.terms import LIBRARY
from study.faults.fault import FAULTS, fault_fields
from study.records.record import MOTIONS
from study.reproduction.settings import TrialSettings
from study.support.errors import StudyError
from study.trials import findings
from study.trials.draw import DRIVEN_MASS, FAMILIES, NO_FAULT, STRUCTURE, Trial, make_trial
from study.trials.effect_sets import as_fitted, steady_ones, truth_of
from study.trials.effects import HIDDEN
from study.trials.findings import compared, intervals, tie_set
from study.trials.kept import BY_TEST, CHANGES, KEPT_TABLES, LIKE_RIGS, NEXT_TESTS, STRUCTURES, TRIALS, Row
from study.trials.kinds import TESTS
from study.trials.next_tests import judged_next_test
from study.trials.rigs import RIG_KINDS
from study.trials.varying import KINDS_OF_CHANGES, NO_EFFECT, judged_varying, make_varying_trial

SINGLE, PAIR, REMOVED, COMPLETED = "single", "pair", "removed", "completed"
PLANNED = "planned"  # of a test after a tie
WITHOUT, WITH = "without", "with"  # a fault of the measurement


@dataclass(frozen=True)
class Order:
    """A trial to be run; what is None is drawn."""

    kind: str  # ``single``, ``none``, ``pair``, ``removed`` or ``completed``; empty where that is drawn
    seed: int  # of the trial
    hidden: tuple[str, ...] | None  # effects to hide
    noise: float | None  # mean square of the noise over that of the response
    response: str | None  # what is measured
    faults: str = WITHOUT  # ``with`` or ``without`` one of the measurement
    test: str = DRIVEN_MASS  # one of ``draw.FAMILIES``
    coordinates: int | None = None  # of a structure


def orders(table: str, settings: TrialSettings) -> list[Order]:
    """Every trial of a kept table; ``settings`` are those of ``trials``."""
    if table == TRIALS:
        return driven_orders(settings)
    return {
        STRUCTURES: structure_orders,
        BY_TEST: orders_of_tests,
        LIKE_RIGS: rig_orders,
        NEXT_TESTS: next_test_orders,
        CHANGES: change_orders,
    }[table]()


def driven_orders(settings: TrialSettings) -> list[Order]:
    """Every trial of a force on mass and spring, each with a seed of its own: those without a fault, then with one.

    Each kind is laid out evenly over effects, noises and responses; then the order is shuffled, so that the first few
    are a fair sample of all.
    """
    rng = np.random.default_rng(settings.first_seed)
    every: list[Order] = []
    for faults in (WITHOUT, WITH):
        wanted = _wanted(settings, rng, faults)
        first = settings.first_seed + len(every)
        shuffled = [wanted[int(i)] for i in rng.permutation(len(wanted))]
        every += [Order(kind, first + i, *rest, faults=faults) for i, (kind, rest) in enumerate(shuffled)]
    return every


def _wanted(
    settings: TrialSettings, rng: np.random.Generator, faults: str
) -> list[tuple[str, tuple[tuple[str, ...], float, str]]]:
    """Kind, hidden effects, noise and response of each trial with, or without, a fault."""
    couples = list(combinations(HIDDEN, 2))
    drawn = [couples[int(i)] for i in rng.permutation(len(couples))[: settings.pairs]]
    kinds = {
        SINGLE: [(name,) for _ in range(settings.rounds * len(settings.noises)) for name in HIDDEN],
        NO_EFFECT: [()] * (settings.none * len(settings.noises)),
        COMPLETED: [(name,) for _ in range(settings.completed) for name in HIDDEN],
        PAIR: drawn,
        REMOVED: [(name,) for _ in range(settings.removed) for name in HIDDEN if faults == WITHOUT],
    }
    return [
        (kind, (hidden, settings.noises[at % len(settings.noises)], MOTIONS[at % len(MOTIONS)]))
        for kind, all_hidden in kinds.items()
        for i, hidden in enumerate(all_hidden)
        for at in [i // len(HIDDEN) + i % len(HIDDEN)]  # so each effect meets each noise, round by round
    ]


def orders_of_tests(first: int = 630_001, each: int = 50) -> list[Order]:
    """So many trials of each kind of test, effects and noises as they are drawn."""
    return [Order("", seed, None, None, None, test=test) for seed in range(first, first + each) for test in TESTS]


def structure_orders(count: int = 120, first: int = 20_000) -> list[Order]:
    """So many trials of structures, laid out evenly over effects, noises, motions and sizes; every sixth hides none."""
    effects = [str(name) for name in np.random.default_rng(first).permutation(HIDDEN)]
    noises, motions = FAMILIES[STRUCTURE].noises, FAMILIES[STRUCTURE].motions
    every: list[Order] = []
    for i in range(count):
        none = i % 6 == 5
        hidden = () if none else (effects[(i - i // 6) % len(effects)],)
        noise, motion = noises[i % len(noises)], motions[(i // len(noises)) % len(motions)]
        kind, size = NO_EFFECT if none else SINGLE, 2 + (i // 2) % 4
        every.append(Order(kind, first + i, hidden, noise, motion, test=STRUCTURE, coordinates=size))
    return every


def rig_orders(first: int = 780_001, each: int = 26) -> list[Order]:
    """So many trials like real rigs of each kind of test, twice as many of structures."""
    kinds = (*RIG_KINDS, list(RIG_KINDS)[-1])
    return [Order("", first + i, None, None, None, test=kinds[i % len(kinds)]) for i in range(each * len(kinds))]


def next_test_orders(count: int = 120, first: int = 640_001, settled: int = 13) -> list[Order]:
    """So many trials of tests whose ties are of equals, for a test that is to end them: a damper is hidden.

    Where one effect is the limit of another, as a steady force of a soft contact, no test ends a tie. The first ones,
    on which it was settled how a promise is reckoned, prove nothing of it and are left out.
    """
    tests, dampers = ("base", "blows", "free_decay"), [name for name in HIDDEN if name.endswith("_damping")]
    noises = FAMILIES[tests[0]].noises[1:]
    return [
        Order(
            PLANNED, first + i, (dampers[(i // len(tests)) % len(dampers)],), noises[i % len(noises)], None,
            test=tests[i % len(tests)],
        )
        for i in range(settled, count)
    ]  # fmt: skip


def change_orders(first: int = 660_001, each: int = 20) -> list[Order]:
    """So many trials of each kind in which a coefficient changes, or nothing does, the kinds in turns."""
    kinds = KINDS_OF_CHANGES
    return [Order("", first + i, None, None, None, test=kinds[i % len(kinds)]) for i in range(each * len(kinds))]


def run_trial(order: Order) -> Row:
    """Make a trial, diagnose it and compare with the answer; a fault a user would be told of is kept in ``trouble``.

    ``seconds`` are of processor time, of all cores together: other work beside a trial does not count.
    """
    judged = _judged_planned if order.kind == PLANNED else JUDGES.get(order.test, _judged_test)
    nothing = "" if order.test == DRIVEN_MASS else NO_EFFECT
    row: Row = {
        "kind": order.kind, "seed": order.seed, "test": order.test, "faults": order.faults, "noise": order.noise,
        "response": order.response, "coordinates": order.coordinates,
        "hidden": "" if order.hidden is None else "+".join(order.hidden) or nothing,
    }  # fmt: skip
    begun = time.process_time()
    try:
        fault = FAULTS[order.seed % len(FAULTS)] if order.faults == WITH else NO_FAULT
        trial = _made(order, fault)
        shares = sum(trial.shares) if trial.test == STRUCTURE else "+".join(f"{share:.3f}" for share in trial.shares)
        row |= {
            **trial.about, "noise": trial.noise, "response": trial.response, "share": shares,
            "place": "+".join(entry.place.label for entry in trial.effects), "fault": trial.fault.get("fault", ""),
            **{f"fault_{key}": trial.fault.get(key, "") for key in ("channel", "value", "unit")},
            "hidden": "+".join(e.term.name for e in trial.effects) or nothing,
        }  # fmt: skip
        begun = time.process_time()
        row |= judged(order, trial)
    except StudyError as error:
        row["trouble"] = str(error)
    row["seconds"] = round(time.process_time() - begun, 1)
    return {column: row.get(column, "") for column in KEPT_TABLES[table_of(order)].columns}


def _made(order: Order, fault: str) -> Trial:
    if order.test in KINDS_OF_CHANGES:
        return make_varying_trial(order.test, order.seed)
    return make_trial(order.seed, order.hidden, order.noise, order.response, fault, order.test, order.coordinates)


def table_of(order: Order) -> str:
    """The kept table that a trial belongs to."""
    if order.kind == PLANNED:
        return NEXT_TESTS
    own = {DRIVEN_MASS: TRIALS, STRUCTURE: STRUCTURES, **dict.fromkeys(RIG_KINDS, LIKE_RIGS)}
    return (own | dict.fromkeys(KINDS_OF_CHANGES, CHANGES)).get(order.test, BY_TEST)


def _judged_driven(order: Order, trial: Trial) -> Row:
    begun = compared(trial, trial.completed if order.kind == COMPLETED else trial.believed)
    found = diagnose_accounted(begun, without=order.hidden or () if order.kind == REMOVED else ())
    diagnosis, before = found.diagnosis, found.diagnosis.comparison
    named = tie_set(diagnosis)
    together = diagnosis.answer if diagnosis.answer is not None and not named else None
    after = added(before, diagnosis.candidates[0].term) if named else before
    after = after if together is None else added_candidate(before, together)
    seen = [fault_fields(fault) for fault in found.faults]
    row: Row = {
        "fault_shown": findings.fault_shown(trial, [str(field["fault"]) for field in seen]),
        "verdict": diagnosis.verdict, "first": next((c.name for c in diagnosis.candidates), ""),
        "tie_set": "+".join(named), "tie_size": len(named), "pair": "+".join(together.names if together else ()),
        "left": diagnosis.left,
        "error_before": before.prediction.error, "error_after": after.prediction.error,
        "error_true": findings.error_of_truth(trial, before.prepared, after.fit.steps_per_sample),
        "noise_floor": before.prediction.floor,
    }  # fmt: skip
    row |= findings.evidence_row(diagnosis, trial.hidden) | findings.measurement(seen, trial.fault)
    row |= intervals(after, trial.truth)
    if named and order.kind == PAIR:
        second = diagnose(after)
        ties = tie_set(second)
        last = added(after, second.candidates[0].term) if ties else after
        row |= {"second_verdict": second.verdict, "second_tie_set": "+".join(ties)}
        row |= {"error_after_two": last.prediction.error, **intervals(last, trial.truth)}
    if named and order.kind == REMOVED:
        row["whole_tie_set"] = "+".join(tie_set(diagnose(before)))
    return row


def _judged_test(_: Order, trial: Trial) -> Row:
    """With the true model's intervals, and how far the hidden effect stands out: its coefficient over its error.

    Of a record without noise nothing is asked: there an interval is as wide as rounding.
    """
    diagnosis = diagnose_accounted(compared(trial, trial.believed)).diagnosis
    named = tie_set(diagnosis)
    right = bool(named) and set(named) >= set(trial.hidden) if trial.hidden else diagnosis.verdict == NOTHING
    row: Row = {
        "verdict": diagnosis.verdict, "first": named[0] if named else "", "tied": "+".join(named[1:]),
        "right": int(right), "error_before": diagnosis.comparison.prediction.error,
        "error_after": diagnosis.candidates[0].prediction.error if named else "",
    }  # fmt: skip
    if trial.noise > 0.0:
        true = compared(trial, trial.completed).comparison
        standing = [abs(c.value) / c.error for c in true.coefficients if c.term in trial.hidden and c.error]
        row |= {"shown": round(standing[0], 1) if standing else ""} | intervals(true, trial.truth)
    return row


def _judged_planned(order: Order, trial: Trial) -> Row:
    return judged_next_test(trial, order.seed)


def _judged_structure(_: Order, trial: Trial) -> Row:
    diagnosis = findings.diagnosed_structure(trial)
    before, rows = diagnosis.comparison.prediction, diagnosis.candidates
    hidden = next(iter(trial.effects), None)
    ties = [r for r in rows if r.name in tie_set(diagnosis)]
    first = ties[0] if ties else None
    there = [hidden is not None and r.entry.place.path == hidden.place.path for r in ties]
    same = [hidden is not None and r.term.name == hidden.term.name for r in ties]
    row: Row = {
        "verdict": diagnosis.verdict, "error_before": before.error,
        "noise_floor": before.floor, "left": diagnosis.left, "asked": diagnosis.asked,
        "effect_first": bool(same and same[0]), "place_first": bool(there and there[0]),
        "tie_holds": any(a and b for a, b in zip(same, there, strict=True)) if hidden else diagnosis.verdict == NOTHING,
    }  # fmt: skip
    if first is not None:
        row |= {
            "first": first.term.name, "first_place": first.entry.place.label, "error_after": first.prediction.error,
            "p_value": first.p_value, "tie_set": " ".join(r.name for r in ties),
        }  # fmt: skip
    try:
        true = findings.true_comparison(trial, diagnosis)
    except StudyError:
        return row | {"error_true": math.nan}
    held = intervals(true, trial.truth) if trial.noise > 0.0 else {"held": "", "asked": ""}
    return row | {"error_true": true.prediction.error, "true_inside": held["held"], "true_keys": held["asked"]}


def _judged_rig(_: Order, trial: Trial) -> Row:
    """Which set is named, whether it and each of its effects are the true ones, and whether the list has these."""
    unknown = str(trial.about.get("remainder", ""))
    found = diagnose_accounted(compared(trial, trial.believed), without=(unknown,) if unknown in LIBRARY else ())
    diagnosis, faults = found.diagnosis, [fault.fault for fault in found.faults]
    before, answer = diagnosis.comparison.prediction, diagnosis.answer
    named = () if answer is None else answer.names
    row: Row = {
        "verdict": diagnosis.verdict, "faults_found": "+".join(faults), "named": "+".join(named),
        "sets": " ".join("+".join(s.names) for s in diagnosis.sets), "named_count": len(named),
        "error_before": before.error, "error_after": "" if answer is None else answer.prediction.error,
        "noise_floor": before.floor,
    }  # fmt: skip
    truth = truth_of(trial)
    elsewhere = steady_ones(trial) if "offset" in faults else ()
    hits = [truth.found(as_fitted(s), elsewhere) for s in diagnosis.sets]
    whole = [(len(s.names), 0) == hit for s, hit in zip(diagnosis.sets, hits, strict=True)]
    right = (answer is not None and whole[0]) or (not trial.hidden and diagnosis.verdict == NOTHING)
    return row | {
        "there": 0 if answer is None else hits[0][0], "right": int(right), "holds": int(right or any(whole)),
        "error_true": truth.prediction.error, "true_behind": round(truth.behind(diagnosis), 2),
    }  # fmt: skip


def _judged_change(_: Order, trial: Trial) -> Row:
    return judged_varying(trial)


JUDGES: Mapping[str, Callable[[Order, Trial], Row]] = MappingProxyType(
    {
        DRIVEN_MASS: _judged_driven,
        STRUCTURE: _judged_structure,
        **dict.fromkeys(RIG_KINDS, _judged_rig),
        **dict.fromkeys(KINDS_OF_CHANGES, _judged_change),
    }
)
