"""Which sets of effects are worth a fit: what the search over columns finds is what trying every set finds."""

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from study.diagnose import set_screening
from study.diagnose.set_screening import best_subsets
from study.equations.model import Model, free
from study.equations.simulate import simulate
from study.equations.terms import get
from study.identify.time_domain.part_fit import fit_part
from study.identify.time_domain.shape_search import baseline
from study.records.prepared import prepare_record
from study.records.record_layout import in_turns
from study.support.arrays import Floats

SIZES = (1, 2, 3, 4)
WIDTHS = {"a": 1, "b": 2, "c": 1, "d": 1, "e": 3, "f": 1, "g": 1}  # an effect of any phase has two columns


def columns_of(rng: np.random.Generator) -> dict[str, Floats]:
    shared = rng.normal(size=(80, 1))  # effects resemble each other
    return {name: rng.normal(size=(80, width)) + 0.8 * shared for name, width in WIDTHS.items()}


def explained(columns: dict[str, Floats], names: tuple[str, ...], target: Floats) -> float:
    design = np.hstack([columns[name] for name in names])
    left = target - design @ np.linalg.lstsq(design, target, rcond=None)[0]
    return float(target @ target - left @ left)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_sets_are_those_of_exhaustive_enumeration_in_their_order(seed: int):
    rng = np.random.default_rng(seed)
    columns, target = columns_of(rng), rng.normal(size=80)
    found = best_subsets(columns, target, SIZES)
    for size in SIZES:
        every = sorted(combinations(columns, size), key=lambda names: -explained(columns, names, target))
        assert found[size] == [frozenset(names) for names in every]


def test_sets_of_simple_effects_are_worth_a_fit_beside_flexible_ones_that_imitate_them():
    rng = np.random.default_rng(8)
    shapes = rng.normal(size=(80, 4))
    target = shapes @ np.ones(4)
    columns = {name: shapes[:, [i]] for i, name in enumerate("abcd")}
    columns |= {name: shapes + 0.01 * rng.normal(size=(80, 4)) for name in "efg"}
    offered: Any = {
        name: SimpleNamespace(
            term=SimpleNamespace(variation=None, components=(name,), parameters=(name,) * (column.shape[1] - 1))
        )
        for name, column in columns.items()
    }
    started: Any = set_screening._chosen(columns, target, (2,), 4, offered, lambda names: names)[2]
    assert all(names & set("efg") for names in started[:4])
    assert len(started) == 6
    assert all(names <= set("abcd") for names in started[4:])


def test_effects_that_explain_only_together_are_found():
    rng = np.random.default_rng(4)
    columns, apart = columns_of(rng), rng.normal(size=80)
    columns["c"] = columns["d"] + 0.01 * apart[:, None]  # their difference is the target, and neither resembles it
    found = best_subsets(columns, apart, (1, 2))
    assert found[1][0] not in ({"c"}, {"d"})
    assert found[2][0] == {"c", "d"}


def test_the_size_of_a_column_does_not_matter():
    rng = np.random.default_rng(5)
    columns, target = columns_of(rng), rng.normal(size=80)
    scaled = {name: 10.0 ** (6 * (i % 3) - 6) * column for i, (name, column) in enumerate(columns.items())}
    assert best_subsets(scaled, target, (3,)) == best_subsets(columns, target, (3,))


def test_the_same_column_twice_explains_no_more_than_once():
    rng = np.random.default_rng(6)
    columns, target = columns_of(rng), rng.normal(size=80)
    first = next(iter(best_subsets(columns, target, (1,))[1][0]))
    best = best_subsets({**columns, "again": columns[first]}, target, (2,))[2][0]
    assert best != {first, "again"}


def test_a_narrow_beam_still_begins_with_the_best(monkeypatch: pytest.MonkeyPatch):
    rng = np.random.default_rng(7)
    columns = columns_of(rng)
    target = columns["a"][:, 0] + 2.0 * columns["d"][:, 0] - columns["g"][:, 0]
    monkeypatch.setattr(set_screening, "BEAM", 5)
    found = best_subsets(columns, target, (3,))[3]
    assert len(found) == 5
    assert found[0] == {"a", "d", "g"}


def test_a_blow_whose_last_sample_begins_a_stretch_drives_no_line():
    rng = np.random.default_rng(9)
    terms = {"inertia": {"m": 1.0}, "linear_damping": {"c": 4.0}, "linear_stiffness": {"k": 355.0}}
    model = Model("mass", tuple(free(get(name)) for name in terms))
    values = {key: value for own in terms.values() for key, value in own.items()}
    prepared = in_turns(prepare_record(simulate(model.with_values(values), rng.normal(size=8192), 0.02)))
    fit = fit_part(model, prepared, (), values)
    first, last = prepared.record.runs(prepared.inner(prepared.plan.fit))[2]
    force = prepared.record["force"].copy()
    force[first + 1 : last] = 0.0
    silent = replace(prepared, record=prepared.record.with_channels({"force": force}))
    columns, target = set_screening._spectra(fit.model, baseline(fit, silent))
    whole = set_screening._spectra(fit.model, baseline(fit, prepared))[1]
    assert 0 < len(target) < len(whole)
    assert all(len(lines) == len(target) and np.all(np.isfinite(lines)) for lines in columns.values())
