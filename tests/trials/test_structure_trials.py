"""Trials of structures: what is drawn, written, and counted."""

import importlib.util
import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from study.cli import main
from study.equations.model_file import read_model
from study.structure.modes import modes_of
from study.support.errors import StudyError
from study.trials import kept
from study.trials.structure_draw import HIDDEN, SHARE, make_structure_trial, random_structure
from study.trials.structure_rates import confusion_of_effects, confusion_of_places, structure_rates
from study.trials.structure_runs import COLUMNS, LOOSE, WORDS, run_structure, structure_orders

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs" / "trials_of_structures.csv"
AGAIN = 8  # of the first trials, those of two coordinates are run again


def test_a_trial_is_the_same_for_the_same_seed():
    one, other = (make_structure_trial(7, "cubic_stiffness", 0.01, "displacement", 3) for _ in range(2))
    np.testing.assert_array_equal(one.record.measured, other.record.measured)
    assert one.truth == other.truth
    assert one.hidden is not None
    assert one.hidden.term.name == "cubic_stiffness"
    assert SHARE[0] * 0.85 < one.share < SHARE[1] * 1.15
    assert one.hidden.name not in one.believed
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
        make_structure_trial(1, response="strain")


def test_orders_cover_effects_sizes_noises():
    orders = structure_orders(120)
    assert len({o.seed for o in orders}) == 120
    assert len({o.hidden for o in orders}) == 1 + len(HIDDEN)
    assert {o.coordinates for o in orders} == {2, 3, 4, 5}
    assert sum(o.hidden == "none" for o in orders) == 20


GOOD = {
    "seed": 1, "coordinates": 3, "hidden": "cubic_stiffness", "place": "mass2-mass1", "first": "cubic_stiffness",
    "first_place": "mass1-mass2", "noise": 0.0, "verdict": "missing_effect", "effect_first": True, "place_first": True,
    "tie_holds": True, "error_after": 0.1, "error_true": 0.1, "trouble": "",
}  # fmt: skip


def test_rates_count_what_holds():
    bad = {
        **GOOD, "effect_first": "False", "error_after": "", "noise": "0.05", "true_inside": "6", "true_keys": "8",
    }  # fmt: skip
    none = {**GOOD, "hidden": "none", "verdict": "unknown_effect"}
    found = {str(r["what"]): r for r in structure_rates([GOOD, bad, none])}
    shares = {what: (row["share"], row["trials"]) for what, row in found.items()}
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
    effects = confusion_of_effects(rows).set_index("hidden")
    assert effects.loc["cubic_stiffness"].to_dict() == {
        "cubic_stiffness": 3, "dead_band": 1, "unknown effect": 1, "nothing missing": 0,
    }  # fmt: skip
    assert effects.loc["none", "nothing missing"] == 1
    places = confusion_of_places(rows).set_index("hidden")
    assert places.loc["between two, 3 coordinates"].to_dict() == {
        "the same place": 1, "a place with an end in common": 1, "another place": 1, "unknown effect": 1,
        "nothing missing": 0,
    }  # fmt: skip
    assert places.loc["to the ground, or a force on it, 3 coordinates", "the same place"] == 1


@pytest.mark.long
def test_the_kept_table_is_what_this_code_gives():
    """Its first trials again; where this fails, `make structure_trials` is due."""
    table = pd.read_csv(KEPT, keep_default_na=False, na_values=["nan", ""])
    assert list(table.columns) == list(COLUMNS)
    orders = {order.seed: order for order in structure_orders(120)}
    assert list(table["seed"]) == list(orders)[: len(table)], "the first of the run, none left out"
    quick = [order for order in list(orders.values())[:AGAIN] if order.coordinates == 2]
    assert len(quick) == 2
    buffer = io.StringIO()
    pd.DataFrame([run_structure(order) for order in quick], columns=list(COLUMNS)).to_csv(buffer, index=False)
    buffer.seek(0)
    own = pd.read_csv(buffer, keep_default_na=False, na_values=["nan", ""])
    assert kept.differing_trials(own, table, COLUMNS, WORDS, LOOSE) == []
    other = own.assign(first_place="ground-mass9")
    assert len(kept.differing_trials(other, table, COLUMNS, WORDS, LOOSE)) == 2


def test_the_page_holds_the_numbers_of_the_kept_table(tmp_path):
    spec = importlib.util.spec_from_file_location("structure_trial_docs", ROOT / "scripts" / "structure_trial_docs.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    for name in ("structures.md", KEPT.name):
        (tmp_path / name).write_bytes((ROOT / "docs" / name).read_bytes())
    script.main(tmp_path / "structures.md")
    assert (tmp_path / "structures.md").read_text() == (ROOT / "docs" / "structures.md").read_text()
    with pytest.raises(StudyError, match="there is no such file"):
        script.main(tmp_path / "structures.md", [tmp_path / "none.csv"])
