"""Of trials with several effects: the sets that a diagnosis names, and which of their effects are truly there.

Along one motion some effects are one: an effect counts as a true one if, along this very motion, what it adds to the
response is what that adds, beside all that the believed model's own coefficients can change.
"""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from study.compare.prediction import Prediction, predict
from study.diagnose.candidates import FittedCandidate
from study.diagnose.held_out import HeldOut, held_out, held_out_of
from study.diagnose.verdict import Diagnosis
from study.equations.model import ModelTerm
from study.equations.terms import get
from study.identify.time_domain.part_fit import fit_part, linearise, with_states
from study.identify.time_domain.shape_search import Baseline, baseline, explained_by, sensitivity
from study.identify.time_domain.weighted_fit import noise_left
from study.records.record_layout import Layout
from study.support import statistics
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import length_or_one
from study.trials.draw import Trial
from study.way_in.compare_records import made_ready


def as_fitted(candidate: FittedCandidate) -> tuple[ModelTerm, ...]:
    """The effects of a set with their values."""
    return tuple(entry for entry in candidate.fit.model.terms if entry.name in candidate.names)


@dataclass(frozen=True, eq=False)
class Truth:
    """The true model, fitted from its true values, and what its effects add along its motion."""

    base: Baseline  # beside the coefficients that the believed model has
    added: Mapping[str, Floats]  # to the response by each hidden effect, beside these, shape (n s,)
    remainder: Mapping[str, Floats]  # the same of a force that nothing asked for has; empty without any
    prediction: Prediction  # of what it was not fitted to
    held_out: HeldOut  # what the hidden effects leave of both parts of the record, fitted without the remainder

    def found(self, named: Sequence[ModelTerm], found_elsewhere: Collection[str] = ()) -> tuple[int, int]:
        """How many of some named effects are each there, and how many hidden ones they leave.

        ``found_elsewhere`` are hidden ones that a fault of the measurement stands for where they are not named. What
        is the remainder along this motion is there as well, but need not be named.
        """
        names = [entry.name for entry in named]
        hidden = [name for name in self.added if name in names or name not in found_elsewhere]
        there = [*hidden, *self.remainder]
        pairs = [self.same(entry, name) for entry in named for name in there]
        first = np.array([2.0 if name in hidden else 1.0 for name in there])  # what is hidden is to be found
        weighted = np.array(pairs, dtype=float).reshape(len(named), len(there)) * first
        rows, columns = linear_sum_assignment(weighted, maximize=True)
        met = [there[c] for r, c in zip(rows, columns, strict=True) if weighted[r, c] > 0.0]
        return len(met), sum(name not in met for name in hidden)

    def behind(self, diagnosis: Diagnosis) -> float:
        """Standard errors by which the true set leaves more than the best that a diagnosis has found.

        As the diagnosis compares: on both parts of the record, white as what the best leaves. Zero where a fault that
        was found has left other samples to judge.
        """
        rows = [*diagnosis.sets, *diagnosis.candidates]
        found = [(row.held_out, row.fit) for row in rows] or [
            (held_out_of(diagnosis.comparison), diagnosis.comparison.fit)
        ]
        best, fit = min(found, key=lambda one: float(np.mean(one[0].judged ** 2)))
        if len(best.judged) != len(self.held_out.judged):
            return 0.0
        outputs, noise = self.prediction.prepared.outputs, noise_left(fit.residual, len(fit.outputs))
        own, other = (np.concatenate(one.white(outputs, noise)) for one in (self.held_out, best))
        count = min(len(own), len(other))
        return statistics.worse(own[:count], other[:count])

    def same(self, entry: ModelTerm, name: str, alike: float = 0.98) -> bool:
        """Whether a named effect is one that is there, or correlates with it so much along this motion."""
        if entry.name in self.added:
            return entry.name == name
        columns = sensitivity(entry, tuple(float(p or 0.0) for p in entry.parameters), self.base)
        added = {**self.added, **self.remainder}[name]
        return columns is not None and explained_by(columns, added, ()).share > alike**2


def truth_of(trial: Trial) -> Truth:
    """The true model along its motion; a ``StudyError`` if it cannot be fitted."""
    model, prepared = made_ready([trial.record], trial.completed, Layout())
    start = {key: value for key, value in trial.truth.numbers().items() if key not in model.held_keys}
    fit = fit_part(model, prepared, model.held_keys, start, steps=8, max_iterations=30)
    jacobian = with_states(fit, prepared)
    known = [i for i in range(jacobian.shape[1]) if i >= len(fit.keys) or fit.keys[i] in trial.believed.values]
    basis = np.linalg.qr(jacobian[:, known] / length_or_one(jacobian[:, known]))[0]
    added: dict[str, Floats] = {}
    for entry in (e for e in fit.model.terms if e.name not in trial.believed):
        amounts = np.array([c or 0.0 for c in entry.coefficients])
        column = jacobian[:, [fit.keys.index(key) for key in entry.symbols]] @ amounts
        added[entry.name] = column - basis @ (basis.T @ column)
    hidden = {name: column for name, column in added.items() if name in trial.hidden}
    remainder = {name: column for name, column in added.items() if name not in hidden}
    prediction, left = predict(fit, prepared), fit
    if remainder:  # which nothing that is asked for has
        alone = replace(fit.model, terms=tuple(entry for entry in fit.model.terms if entry.name not in remainder))
        known = [key for key in fit.held if key in alone.values]
        with suppress(StudyError):
            left = fit_part(alone, prepared, known, steps=fit.steps_per_sample, max_iterations=30)
    held = held_out(left, predict(left, prepared), linearise(left, prepared), prepared)
    return Truth(replace(baseline(fit, prepared), basis=basis), hidden, remainder, prediction, held)


def steady_ones(trial: Trial) -> tuple[str, ...]:
    """Hidden effects that an offset of a sensor may be instead."""
    return tuple(entry.name for entry in trial.effects if get(entry.term.name).steady)
