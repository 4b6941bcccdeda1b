"""A model whose fit is stuck lacks nothing: an effect that only frees it from a side valley is not missing."""

from dataclasses import replace

import numpy as np

from study.compare.comparison import compare
from study.diagnose import candidates, verdict
from study.diagnose.set_screening import SetStart
from study.diagnose.set_search import SetSearch
from study.equations.model import free
from study.equations.terms import get
from study.identify.time_domain.part_fit import fit_part
from study.trials import make_trial
from study.way_in.compare_records import compare_records


def test_the_model_is_judged_from_the_deeper_minimum_that_its_best_candidate_found(monkeypatch):
    trial = make_trial(6, (), 1e-4)
    good = compare_records([trial.record], trial.believed).comparison
    values = dict(zip(good.fit.keys, good.fit.values.tolist(), strict=True))
    fit = fit_part(good.fit.model, good.prepared, good.fit.held, {**values, "k": 0.15 * values["k"]})
    stuck = compare(good.model, good.prepared, fit=fit)
    assert stuck.prediction.error > 0.9
    freeing = [
        candidate
        for name in ("quadratic_damping", "cubic_stiffness")
        if (candidate := candidates.attempt(free(get(name)), verdict.search_base(good))) is not None
    ]
    monkeypatch.setattr(candidates, "try_all", lambda *_: freeing)
    found = verdict.diagnose(stuck)
    assert found.verdict == verdict.NOTHING
    assert found.comparison.prediction.error < 1.01 * good.prediction.error


def test_a_set_grows_from_what_was_fitted_in_segments():
    """Each segment begins with states of its own; the set's free run has one beginning."""
    trial = make_trial(6, ("cubic_stiffness",), 1e-4)
    base = verdict.search_base(compare_records([trial.record], trial.believed).comparison)
    cubic, damping = (free(get(name)) for name in ("cubic_stiffness", "quadratic_damping"))
    begun = candidates.attempt(cubic, base)
    assert begun is not None
    apart = replace(begun.fit, restarts=(300, 600), initial=np.tile(np.atleast_2d(begun.fit.initial), (3, 1)))
    start = SetStart(
        frozenset((cubic.name, damping.name)),
        begun.fit.model.with_term(replace(damping, coefficients=(0.0,))),
        replace(begun, fit=apart),
    )
    found = SetSearch(base, {cubic.name: cubic, damping.name: damping}, {}).fitted(start)
    assert found is not None
    assert found.fit.rms <= 1.01 * begun.fit.rms
