"""Trials of structures: what is drawn, written, and counted."""

import numpy as np
import pytest

from study.cli import main
from study.equations.model_file import read_model
from study.structure.modes import modes_of
from study.support.errors import StudyError
from study.trials.structure_draw import HIDDEN, SHARE, make_structure_trial, structure
from study.trials.structure_runs import rates, structure_orders


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
        model = structure(np.random.default_rng(seed), 5)
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


def test_rates_count_what_holds():
    good = {
        "hidden": "a", "noise": 0.0, "effect_first": True, "place_first": True, "tie_holds": True,
        "error_after": 0.1, "error_true": 0.1,
    }  # fmt: skip
    bad = {**good, "effect_first": "False", "error_after": "", "noise": "0.05"}
    found = {
        r["what"]: (r["holds"], r["of"]) for r in rates([good, bad, {"hidden": "none", "verdict": "unknown_effect"}])
    }
    assert found["effect and place first, noise to 1 %"] == (1, 1)
    assert found["effect and place first, noise of 5 %"] == (0, 1)
    assert found["place first"] == (2, 2)
    assert found["nothing missing where nothing is"] == (0, 1)
    assert found["error after adding within 5 % of the true model's"] == (1, 2)
