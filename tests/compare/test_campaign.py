"""A page of many records: verdicts, coefficients by level, and what is no rig's business of another."""

import pytest

from study.compare import campaign
from study.support import document


def measured(name, rig, level, stiffness, error=1.0, verdict="missing_effect"):
    comparison = {
        "model": {"name": "rig"}, "error": {"response": 0.2}, "noise_floor": {"response": 0.01},
        "rms": {"response": level, "unit": "m"},
        "coefficients": [
            {"key": "m", "term": "inertia", "value": 1.0, "standard_error": None, "unit": "kg", "held": True},
            {"key": "k", "term": "linear_stiffness", "value": stiffness, "standard_error": error, "unit": "N/m",
             "held": False},
        ],
    }  # fmt: skip
    first = {"term": "cubic_stiffness", "tied_with": ["quintic_stiffness"], "explained": 0.98, "response_error": 0.012}
    return campaign.Measured(name, rig, comparison, {"verdict": verdict, "candidates": [first]})


def told(*records):
    tables = [b for b in campaign.campaign_blocks(records) if isinstance(b, document.TableBlock)]
    return tables[0], tables[1:]


def test_records_of_a_rig_stand_in_the_order_of_their_level():
    verdicts, (values,) = told(measured("loud", "beam", 2.0, 355.0), measured("quiet", "beam", 0.5, 355.5))
    assert [row[0] for row in verdicts.rows] == ["quiet", "loud"]
    assert values.heading[1:3] == ("quiet, 500 mm", "loud, 2 m")
    assert values.rows[0] == ("m", "1 (given)", "1 (given)", "kg", "", "")
    assert values.rows[1][:5] == ("k", "355.5 ± 2", "355 ± 2", "N/m", "yes")


@pytest.mark.parametrize(("stiffness", "said"), [(356.0, "yes"), (370.0, "no")])
def test_a_coefficient_that_differs_by_more_than_its_errors_moves(stiffness, said):
    _, (values,) = told(measured("a", "beam", 1.0, 355.0), measured("b", "beam", 2.0, stiffness))
    assert values.rows[1][4] == said


def test_rigs_are_not_held_against_each_other():
    _, values = told(measured("a", "beam", 1.0, 355.0), measured("b", "wing", 2.0, 900.0))
    assert len(values) == 2
    assert all("p" not in table.heading for table in values)


def test_records_of_one_rig_in_other_units_are_not_lost():
    volts = measured("b", "beam", 2.0, 900.0)
    volts = campaign.Measured("b", "beam", {**volts.comparison, "rms": {"response": 2.0, "unit": "V"}}, volts.diagnosis)
    verdicts, values = told(measured("a", "beam", 1.0, 355.0), volts)
    assert [row[:2] for row in verdicts.rows] == [("a", "1 m"), ("b", "2 V")]
    assert len(values) == 2


def test_the_effect_is_named_with_its_ties_where_one_is_missing_and_nowhere_else():
    verdicts, _ = told(measured("a", "beam", 1.0, 355.0), measured("b", "beam", 2.0, 355.0, 1.0, "nothing_missing"))
    assert verdicts.rows[0][4:] == ("an effect is missing", "cubic stiffness or quintic stiffness", "98 %", "1.2 %")
    assert verdicts.rows[1][4:] == ("nothing is missing", "", "", "")


def test_records_that_were_diagnosed_together_are_levels_of_one_rig():
    low, high = (measured("x", "beam", level, 355.0) for level in (1.0, 2.0))
    both = {**low.comparison, "records": [high.comparison, low.comparison]}
    verdicts, (values,) = told(*campaign.measured_of_row("beam", "hall", both, low.diagnosis))
    assert [row[:2] for row in verdicts.rows] == [("beam 2", "1 m"), ("beam 1", "2 m")]
    assert values.rows[1][4] == "yes"


def test_a_comparison_without_one_response_has_no_level():
    whole = measured("x", "frame", 1.0, 355.0)
    comparison = {key: value for key, value in whole.comparison.items() if key not in ("rms", "coefficients")}
    verdicts, values = told(*campaign.measured_of_row("frame", "hall", comparison, whole.diagnosis))
    assert verdicts.rows[0][:3] == ("frame", "", "20 %")
    assert not values


def test_effects_of_a_structure_are_named_with_their_places():
    frame = measured("x", "frame", 1.0, 355.0)
    first = {**frame.diagnosis["candidates"][0], "between": ["low", "top"]}
    first["tied_with"] = [{"term": "cogging", "at": "top"}]
    diagnosis = {**frame.diagnosis, "candidates": [first]}
    verdicts, _ = told(*campaign.measured_of_row("frame", "hall", frame.comparison, diagnosis))
    assert verdicts.rows[0][5] == "cubic stiffness between low and top or cogging at top"


def test_what_differs_is_said_before_the_tables():
    rows = [measured("a", "beam", 1.0, 355.0, verdict="nothing_missing"), measured("b", "beam", 2.0, 370.0)]
    rows.append(measured("c", "beam", 3.0, 340.0, verdict="nothing_missing"))
    (said,) = (b.items for b in campaign.campaign_blocks(rows) if isinstance(b, document.Bullets))
    assert said[0] == (
        "**beam: verdicts differ**: nothing is missing in a, c; an effect is missing (cubic stiffness or quintic "
        "stiffness) in b."
    )
    assert said[1].startswith(
        "**beam: 1 of 1 coefficients differ between the records by more than chance**: k from 340"
    )
    assert said[3].startswith("**beam: 1 of 1 coefficients differ between the 2 records in which nothing is missing")


def test_sets_and_what_is_known_in_part_are_named():
    one = measured("a", "beam", 1.0, 355.0, verdict="missing_effects")
    own = {"effects": [{"term": "cubic_stiffness"}, {"term": "cogging"}], "explained": 0.99, "response_error": 0.01}
    one = campaign.Measured("a", "beam", one.comparison, {**one.diagnosis, "sets": [own, own]})
    verdicts, _ = told(one)
    assert verdicts.rows[0][4:] == (
        "several effects are missing", "cubic stiffness and cogging (or one of 1 other sets)", "99 %", "1 %",
    )  # fmt: skip


@pytest.mark.parametrize(("name", "day"), [("rig_2026-03-01", (2026, 3, 1)), ("20260301b", (2026, 3, 1)), ("r1", None)])
def test_the_day_in_a_name(name, day):
    found = campaign.day_of(name)
    assert (found and (found.year, found.month, found.day)) == day
    assert campaign.day_of("2026-13-01") is None


@pytest.mark.parametrize("by", ["record", "date", "level"])
def test_a_picture_shows_the_coefficients_of_several_records(by):
    rows = [measured(f"rig_2026-0{i}-01", "beam", 4.0 - i, 355.0 + i) for i in (1, 2, 3)]
    images = [b for b in campaign.campaign_blocks(rows, by) if isinstance(b, document.Image)]
    assert [image.words for image in images] == [f"coefficients of beam by {by}"]
    assert images[0].png.startswith(b"\x89PNG")
    assert "data:image/png;base64," in document.fragment(images)
