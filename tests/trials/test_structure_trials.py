"""Trials of structures: what is drawn, written, and counted."""

import importlib.util
import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from study.cli import main
from study.equations.linear_part import modes_of
from study.equations.model_file import read_model
from study.support.errors import StudyError
from study.trials import HIDDEN, SHARE, make_trial, rates
from study.trials.draw import STRUCTURE
from study.trials.kept import KEPT_TABLES, STRUCTURES, differing_trials
from study.trials.runs import run_trial, structure_orders
from study.trials.structures import random_structure

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs" / "trials_of_structures.csv"
AGAIN = 8  # of the first trials, those of two coordinates are run again


def test_a_trial_is_the_same_for_the_same_seed():
    asked = {"hidden": ("cubic_stiffness",), "noise": 0.01, "response": "displacement", "coordinates": 3}
    one, other = (make_trial(7, test=STRUCTURE, **asked) for _ in range(2))
    for sensor in one.record.sensors:
        np.testing.assert_array_equal(one.record[sensor], other.record[sensor])
    assert one.truth == other.truth
    assert [entry.term.name for entry in one.effects] == ["cubic_stiffness"]
    assert SHARE[0] * 0.85 < one.shares[0] < SHARE[1] * 1.15
    assert one.hidden[0] not in one.believed
    assert set(one.believed.values.values()) == {None}
    assert len(one.record.sensors) == 3


def test_every_mass_of_a_drawn_structure_is_tied_to_the_shaker():
    for seed in range(20):
        model = random_structure(np.random.default_rng(seed), 5)
        reached = {where for _, where in model.forces}
        for _ in range(5):
            reached |= {e for t in model.terms if t.place and reached & set(t.place.moving) for e in t.place.moving}
        assert reached == set(model.coordinates)
        assert modes_of(model).rigid == 0


def test_a_trial_of_a_structure_is_written_and_opened(tmp_path, capsys):
    assert main(["trial", "--seed", "3", "--coordinates", "2", "--hidden", "none", "--out", str(tmp_path)]) == 0
    assert read_model(tmp_path / "structure_3.yaml").coordinates == ("mass1", "mass2")
    assert main(["trial", "--open", str(tmp_path / "structure_3.answer.json")]) == 0
    assert "nothing is hidden" in capsys.readouterr().out
    assert main(["trial", "--seed", "3", "--coordinates", "2", "--fault", "any", "--out", str(tmp_path)]) == 2
    assert main(["trial", "--seed", "3", "--coordinates", "2", "--hidden", "inertia", "--out", str(tmp_path)]) == 2
    with pytest.raises(StudyError, match="expected one of displacement"):
        make_trial(1, response="strain", test=STRUCTURE)


def test_several_effects_are_hidden_at_places_of_their_own_and_each_is_as_strong_as_is_drawn():
    trial = make_trial(5, ("cubic_stiffness", "quadratic_damping"), 0.0, test=STRUCTURE, coordinates=3)
    assert sorted(entry.term.name for entry in trial.effects) == ["cubic_stiffness", "quadratic_damping"]
    assert all(set(entry.place.moving) <= set(trial.believed.coordinates) for entry in trial.effects)
    assert all(SHARE[0] * 0.85 < share < SHARE[1] * 1.15 for share in trial.shares)


def test_orders_cover_effects_sizes_noises():
    orders = structure_orders()
    assert len({o.seed for o in orders}) == 120
    assert {o.hidden for o in orders} == {(), *((name,) for name in HIDDEN)}
    assert {o.coordinates for o in orders} == {2, 3, 4, 5}
    assert sum(o.hidden == () for o in orders) == 20


GOOD = {
    "seed": 1, "coordinates": 3, "hidden": "cubic_stiffness", "place": "mass2-mass1", "first": "cubic_stiffness",
    "first_place": "mass1-mass2", "noise": 0.0, "verdict": "missing_effect", "effect_first": True, "place_first": True,
    "tie_holds": True, "error_after": 0.1, "error_true": 0.1, "trouble": "",
}  # fmt: skip


def read(rows):
    """As the kept table is read."""
    buffer = io.StringIO()
    pd.DataFrame(rows, columns=list(KEPT_TABLES[STRUCTURES].columns)).to_csv(buffer, index=False)
    buffer.seek(0)
    return pd.read_csv(buffer)


def test_rates_count_what_holds():
    bad = {**GOOD, "effect_first": False, "error_after": "", "noise": 0.05, "true_inside": 6, "true_keys": 8}
    none = {**GOOD, "hidden": "none", "verdict": "unknown_effect"}
    found = rates.target_summary(read([GOOD, bad, none]), STRUCTURES).set_index("reach").to_dict("index")
    shares = {what: (row["value"], row["trials"]) for what, row in found.items()}
    assert shares["effect and place first, noise to 1 %"] == (1.0, 1)
    assert shares["effect and place first, noise of 5 %"] == (0.0, 1)
    assert shares["effect first"] == (0.5, 2)
    assert shares["place first"] == (1.0, 2)
    assert shares["nothing missing where nothing is"] == (0.0, 1)
    assert shares["error after adding within 5 % of the true model's"] == (0.5, 2)
    assert shares["95 % intervals of the true model that hold its values"] == (0.75, 1)
    low, high = (float(str(found["place first"][key])) for key in ("low", "high"))
    assert (low, high) == pytest.approx(tuple(binomtest(2, 2).proportion_ci(0.95, method="wilson")))


def test_confusions_count_effects_and_places():
    rows = [
        GOOD, {**GOOD, "first": "dead_band", "first_place": "mass2-mass3"},
        {**GOOD, "place": "mass1", "first_place": "ground-mass1"},
        {**GOOD, "verdict": "unknown_effect", "first": "", "first_place": ""},
        {**GOOD, "hidden": "none", "place": "", "verdict": "nothing_missing", "first": "", "first_place": ""},
        {**GOOD, "first_place": "ground-mass3"},
    ]  # fmt: skip
    effects = rates.confusion(read(rows)).set_index("hidden")
    assert effects.loc["cubic_stiffness"].to_dict() == {
        "cubic_stiffness": 3, "dead_band": 1, "unknown_effect": 1, "nothing_missing": 0,
    }  # fmt: skip
    assert effects.loc["none", "nothing_missing"] == 1
    places = rates.confusion_of_places(read(rows)).set_index("hidden")
    assert places.loc["between two, 3 coordinates"].to_dict() == {
        "the same place": 1, "a place with an end in common": 1, "another place": 1, "unknown_effect": 1,
        "nothing_missing": 0,
    }  # fmt: skip
    assert places.loc["to the ground, or a force on it, 3 coordinates", "the same place"] == 1


@pytest.mark.long
def test_the_kept_table_is_what_this_code_gives():
    """Its first trials again; where this fails, `make trials TABLE=trials_of_structures` is due."""
    table = pd.read_csv(KEPT)
    assert tuple(table.columns) == KEPT_TABLES[STRUCTURES].columns
    orders = {order.seed: order for order in structure_orders()}
    assert list(table["seed"]) == list(orders)[: len(table)], "the first of the run, none left out"
    quick = [order for order in list(orders.values())[:AGAIN] if order.coordinates == 2]
    assert len(quick) == 2
    own = read([run_trial(order) for order in quick])
    assert differing_trials(own, table, STRUCTURES) == []
    assert len(differing_trials(own.assign(first_place="ground-mass9"), table, STRUCTURES)) == 2


def test_the_page_holds_the_numbers_of_the_kept_table(tmp_path):
    spec = importlib.util.spec_from_file_location("trial_docs", ROOT / "scripts" / "trial_docs.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    for name in ("structures.md", KEPT.name):
        (tmp_path / name).write_bytes((ROOT / "docs" / name).read_bytes())
    script.main(tmp_path, STRUCTURES, {})
    assert (tmp_path / "structures.md").read_text() == (ROOT / "docs" / "structures.md").read_text()
    with pytest.raises(StudyError, match="there is no such file"):
        script.main(tmp_path, STRUCTURES, {}, tmp_path / "none.csv")
