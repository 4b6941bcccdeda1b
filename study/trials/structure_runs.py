"""What diagnose makes of trials of structures: one row each, the hidden effect and its place beside what was found."""

import math
import time
from dataclasses import dataclass

import numpy as np

from study.diagnose.verdict import MISSING, NOTHING
from study.equations.model import ModelTerm
from study.records.prepared import Prepared
from study.structure.placed_ranking import PlacedRanked
from study.structure.prepared_structure import prepare_structure
from study.structure.structure_comparison import compare_structure
from study.structure.structure_fit import fit_structure, settled_structure
from study.structure.structure_verdict import StructureDiagnosis, diagnose_structure
from study.support.errors import StudyError
from study.trials.structure_draw import HIDDEN, NOISES, StructureTrial, make_structure_trial

Row = dict[str, object]
FIRST_SEED, NONE_EVERY = 20_000, 6  # one trial out of so many hides nothing
COLUMNS = (
    "seed", "coordinates", "hidden", "place", "noise", "response", "share", "verdict", "first", "first_place",
    "effect_first", "place_first", "tie_set", "tie_holds", "error_before", "error_after", "error_true", "noise_floor",
    "left", "asked", "p_value", "true_inside", "true_keys", "seconds", "trouble",
)  # fmt: skip
WORDS = (
    "hidden", "place", "response", "verdict", "first", "first_place", "effect_first", "place_first", "tie_set",
    "tie_holds", "trouble",
)  # fmt: skip
LOOSE = ("left", "p_value", "error_true")  # they change with rounding


@dataclass(frozen=True)
class StructureOrder:
    """A trial to be run."""

    seed: int
    hidden: str  # an effect, or ``none``
    noise: float  # mean square of the noise over that of each motion
    response: str
    coordinates: int


def structure_orders(count: int, first_seed: int = FIRST_SEED) -> list[StructureOrder]:
    """So many trials, laid out evenly over effects, noises, motions and sizes."""
    rng = np.random.default_rng(first_seed)
    effects = [str(name) for name in rng.permutation(HIDDEN)]
    return [
        StructureOrder(
            first_seed + i,
            "none" if i % NONE_EVERY == NONE_EVERY - 1 else effects[(i - i // NONE_EVERY) % len(effects)],
            NOISES[i % len(NOISES)], ("displacement", "acceleration")[(i // len(NOISES)) % 2], 2 + (i // 2) % 4,
        )
        for i in range(count)
    ]  # fmt: skip


def run_structure(order: StructureOrder) -> Row:
    """One trial, diagnosed; what goes wrong stands in ``trouble``."""
    begun = time.perf_counter()
    row: Row = {"seed": order.seed, "coordinates": order.coordinates, "hidden": order.hidden, "noise": order.noise}
    try:
        trial = make_structure_trial(order.seed, order.hidden, order.noise, order.response, order.coordinates)
        prepared = prepare_structure(trial.record, trial.believed)
        diagnosis = diagnose_structure(compare_structure(trial.believed, prepared))
    except StudyError as error:
        return row | {"trouble": str(error), "seconds": time.perf_counter() - begun}
    row |= _found(trial, diagnosis) | _true(trial, prepared)
    return row | {"seconds": time.perf_counter() - begun, "trouble": ""}


def _found(trial: StructureTrial, diagnosis: StructureDiagnosis) -> Row:
    prediction, rows = diagnosis.comparison.prediction, diagnosis.candidates
    first = rows[0] if rows and diagnosis.verdict == MISSING else None
    hidden = trial.hidden
    row: Row = {
        "place": hidden.place.label if hidden and hidden.place else "",
        "response": trial.response, "share": trial.share,
        "verdict": diagnosis.verdict, "error_before": prediction.error, "noise_floor": prediction.floor,
        "left": diagnosis.left, "asked": diagnosis.asked, "effect_first": False, "place_first": False,
        "tie_holds": hidden is None and diagnosis.verdict == NOTHING,
    }  # fmt: skip
    if first is None:
        return row
    ties = [r for r in rows if r.name in (first.name, *first.tied_with)]
    return row | {
        "first": first.term.name, "first_place": first.entry.place.label, "error_after": first.prediction.error,
        "p_value": first.p_value, "tie_set": " ".join(r.name for r in ties),
        "effect_first": hidden is not None and first.term.name == hidden.term.name,
        "place_first": hidden is not None and _there(first, hidden),
        "tie_holds": hidden is not None and any(r.term.name == hidden.term.name and _there(r, hidden) for r in ties),
    }  # fmt: skip


def _there(row: PlacedRanked, hidden: ModelTerm) -> bool:
    return row.entry.place.path == hidden.place.path


def _true(trial: StructureTrial, prepared: Prepared) -> Row:
    """Error of the true model, fitted from its true values, and how many of these its 95 % intervals hold.

    Without noise nothing is asked of intervals: what is left is the integration's.
    """
    model, true = trial.completed, trial.truth.numbers()
    try:
        fit = settled_structure(fit_structure(model, prepared, (), true), prepared)
        comparison = compare_structure(model, prepared, fit)
    except StudyError:
        return {"error_true": math.nan}
    spans = [(true[c.key], c.interval) for c in comparison.coefficients if c.interval is not None]
    inside = sum(low <= value <= high for value, (low, high) in spans)
    row: Row = {"error_true": comparison.prediction.error}
    return row | {"true_inside": inside, "true_keys": len(spans)} if trial.noise > 0.0 else row
