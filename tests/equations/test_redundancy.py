"""A user's own term that no record could tell from others is refused with their names."""

from pathlib import Path

import pytest

from study.equations.model_file import parse_model
from study.support.errors import StudyError

LINEAR = "  - inertia\n  - linear_damping\n  - linear_stiffness\n"


def model(force: str, more: str = "", value: str = "") -> str:
    return f'terms:\n{LINEAR}{more}  - {{term: mine, force: "{force}"{value}}}\n'


@pytest.mark.parametrize(
    ("force", "more", "names"),
    [
        ("2*u", "", "linear_stiffness"),
        ("v", "", "linear_damping"),
        ("max(u, 0) - max(-u, 0)", "", "linear_stiffness"),
        ("u + 1e7*u**3", "  - cubic_stiffness\n", "linear_stiffness and cubic_stiffness"),
        ("u**2*v", "  - van_der_pol_damping\n", "van_der_pol_damping"),
        ("-4", "  - constant_force\n", "constant_force"),
        ("3*wind*v", '  - {term: breeze, force: "wind*v"}\n', "mine"),
    ],
)
def test_what_others_say_already_is_refused(force: str, more: str, names: str) -> None:
    with pytest.raises(StudyError, match=r"rig\.yaml: the force of '\w+' is no other than that of " + names):
        parse_model(model(force, more), Path("rig.yaml"))


@pytest.mark.parametrize("force", ["0*u", "u - u", "1e-300*u**2"])
def test_a_force_that_is_zero_is_refused(force: str) -> None:
    with pytest.raises(StudyError, match="the force of 'mine' is zero at every motion"):
        parse_model(model(force), Path("rig.yaml"))


@pytest.mark.parametrize(
    ("force", "more", "value"),
    [
        ("u*abs(u)", "", ""),
        ("u + 1e-9*u**3", "", ""),
        ("u + 1e7*u**3", "", ""),  # one stiffness more than the linear one: told apart by its cube
        ("2*u", "", ", value: 3.0"),  # held, so that nothing is to be told apart
        ("max(u, 0)", "  - {term: one_sided_contact, gap: 0.001}\n", ""),
        ("log(u)", "", ""),
        ("exp(1000*u)", "", ""),
        ("sin(t)", "  - constant_force\n", ""),
        ("wind*v", "", ""),
    ],
)
def test_what_is_new_is_taken(force: str, more: str, value: str) -> None:
    assert "mine" in parse_model(model(force, more, value), Path("rig.yaml"))
