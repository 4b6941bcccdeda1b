"""An effect acts within the motion, or is not named: a gap never reached is no stop, a band never left no dead band."""

import numpy as np
import pytest

from study.equations.terms import get
from study.identify.time_domain.motion_range import MotionRange

DT, N, REACH, OMEGA = 0.01, 1000, 0.01, 20.0  # ten seconds within +-10 mm, at up to 0.2 m/s
TIME = DT * np.arange(N)
ONE = np.array([1.0])


def motion(*sizes: float) -> MotionRange:
    """Coordinates that swing in step with so many times the reach."""
    u = np.stack([size * REACH * np.sin(OMEGA * TIME) for size in sizes], axis=1)
    v = np.stack([size * REACH * OMEGA * np.cos(OMEGA * TIME) for size in sizes], axis=1)
    return MotionRange(np.stack([u, v]), DT)


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("one_sided_contact", {"gap": 0.011}, "displacement at which contact begins, 0.011, is outside"),
        ("one_sided_contact", {"gap": -0.011}, "outside of what this motion reaches (-0.01 to 0.01)"),
        ("dead_band", {"u_g": 0.011}, "half width of the dead band, 0.011, is outside"),
        ("relaxation", {"tau": 11.0}, "relaxation time, 11, is outside of what this motion reaches (0.01 to 10)"),
        ("relaxation", {"tau": 0.005}, "relaxation time, 0.005, is outside"),
        ("hysteresis", {"beta": 4.9, "gamma": 0.0}, "rate at which the loop closes, 4.9, is outside"),
        ("stribeck_friction", {"v_s": 0.21}, "Stribeck velocity"),
        ("cogging", {"pitch": 0.011}, "distance after which the force repeats itself, 0.011, is outside"),
    ],
)
def test_an_effect_that_needs_more_than_the_motion_reaches_is_idle(name: str, values: dict[str, float], said: str):
    why = motion(1.0).idle(get(name), ONE, values, {})
    assert said in why
    assert why.startswith("its ")
    assert not why.endswith(".")  # a clause: others finish the sentence


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("one_sided_contact", {"gap": 0.009}),
        ("one_sided_contact", {"gap": -0.009}),  # contact at rest
        ("dead_band", {"u_g": 0.009}),
        ("relaxation", {"tau": 9.0}),
        ("relaxation", {"tau": 0.02}),
        ("hysteresis", {"beta": 5.2, "gamma": -300.0}),
        ("hysteresis", {"beta": 3000.0, "gamma": 0.0}),
        ("stribeck_friction", {"v_s": 0.19}),
        ("cogging", {"pitch": 0.009}),
        ("coulomb_friction", {}),
        ("cubic_stiffness", {}),
    ],
)
def test_one_that_acts_is_not(name: str, values: dict[str, float]):
    errors = {parameter: 0.01 * abs(value) for parameter, value in values.items()}
    assert motion(1.0).idle(get(name), ONE, values, errors) == ""


def test_a_parameter_that_the_record_does_not_resolve_may_be_anything():
    term, near = get("relaxation"), motion(1.0)
    assert near.idle(term, ONE, {"tau": 1.0}, {"tau": 0.5}) == ""
    assert near.idle(term, ONE, {"tau": 1.0}, {"tau": 0.52}) == "the record does not tell its relaxation time (1 +- 1)"
    assert "does not tell" in near.idle(get("dead_band"), ONE, {"u_g": 0.005}, {"u_g": 0.003})


def test_contact_at_zero_is_contact_however_well_it_is_known():
    assert motion(1.0).idle(get("one_sided_contact"), ONE, {"gap": 0.0}, {"gap": 1e-4}) == ""


def test_between_two_masses_their_relative_motion_counts():
    of_two, between = motion(1.0, 0.8), np.array([-1.0, 1.0])  # a fifth of the reach between them
    assert of_two.idle(get("dead_band"), np.array([1.0, 0.0]), {"u_g": 0.005}, {}) == ""
    assert "(0 to 0.002)" in of_two.idle(get("dead_band"), between, {"u_g": 0.005}, {})
    assert of_two.idle(get("dead_band"), between, {"u_g": 0.001}, {}) == ""


def test_the_zero_about_which_a_motion_lies_on_one_side_counts_for_contact():
    swing = motion(1.0).motion.copy()
    swing[0] += 0.02  # 10 to 30 mm
    one_side = MotionRange(swing, DT)
    assert one_side.idle(get("one_sided_contact"), ONE, {"gap": 0.025}, {}) == ""
    assert "outside" in one_side.idle(get("one_sided_contact"), ONE, {"gap": 0.005}, {})
