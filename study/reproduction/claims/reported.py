"""What the report states: ``config/reported.tsv``; a ``StudyError`` names the row or the value that is at fault."""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

from pydantic import BeforeValidator, Field, model_validator

from study.support.config_files import TableRow, Text, read_rows
from study.support.errors import StudyError

MANY = 8  # numbers that still read well in one cell


def _names(text: str) -> tuple[str, ...]:
    return tuple(text.split())


# Every row that the claims ask for, so that one deleted or misspelt is named before any job starts. A claim of your
# own joins one of the two lists.
WITH_A_VALUE = _names("""
    table_1.m table_1.linear.k table_1.linear.c table_1.linear.f_n table_1.linear.zeta table_1.duffing.k
    table_1.duffing.c table_1.duffing.f_n table_1.duffing.zeta table_1.duffing.k3 table_1.duffing.c3
    table_1.van_der_pol.k table_1.van_der_pol.c table_1.van_der_pol.f_n table_1.van_der_pol.zeta
    table_1.van_der_pol.k3 table_1.van_der_pol.c3 table_1.duffing_van_der_pol.k table_1.duffing_van_der_pol.c
    table_1.duffing_van_der_pol.f_n table_1.duffing_van_der_pol.zeta table_1.duffing_van_der_pol.k3
    table_1.duffing_van_der_pol.c3 table_1.mathieu.k table_1.mathieu.c table_1.mathieu.f_n table_1.mathieu.zeta
    table_1.mathieu.k_m table_1.mathieu.f_m table_1.dead_band.k table_1.dead_band.c table_1.dead_band.f_n
    table_1.dead_band.zeta table_1.dead_band.u_g table_1.extreme.k table_1.extreme.c table_1.extreme.f_n
    table_1.extreme.zeta table_1.extreme.k3 table_1.extreme.c3 nyquist nyquist.dt lowpass below_10_hz error_free
    dead_band_pattern mathieu_lines.f_n mathieu_lines.f_m mathieu_fast.f_m mathieu_fast.low mathieu_fast.middle
    mathieu_fast.high averages resolution resolution.length resolution.seconds resolution.samples resolution.total
    overlap exact_stiffness siso_stiffness siso_frequency duffing_cubic duffing_share van_der_pol_damping
    van_der_pol_share mathieu_side_resonances.low mathieu_side_resonances.high mathieu_stiffness dead_band_stiffness
    dead_band_error dead_band_error.low dead_band_error.high dead_band_share levels_invariant.lowest
    levels_invariant.second levels_invariant.third levels_invariant.highest noise_random_only.low
    noise_random_only.middle noise_random_only.high
""")
IN_WORDS = _names("""
    system_stiffness_gap amplitude_nonlinear force_gaussian noise_uncorrelated table_1 linear_is_gaussian
    nonlinear_is_not narrow_band harmonics oval_width oval_slope patterns_alike duffing_pattern van_der_pol_pattern
    combined_pattern mathieu_pattern mathieu_lines mathieu_fast coherence_forms added_terms hanning linear_same
    linear_coherence linear_leakage linear_histogram hand_read duffing_linear siso_wrong siso_varies duffing_coherence
    duffing_histogram van_der_pol_linear van_der_pol_coherence van_der_pol_histogram combined_linear combined_cubic
    combined_histogram combined_nearly_linear mathieu_third mathieu_side_resonances mathieu_siso_coherence
    mathieu_linear mathieu_coherence mathieu_share mathieu_histogram dead_band_as_duffing dead_band_not_invariant
    dead_band_linear dead_band_coherence dead_band_histogram linear_dominates extreme_siso extreme_linear
    extreme_cubic levels_invariant levels_siso levels_similar levels_coherence noise_random_only noise_output
    noise_random noise_linear noise_cubic noise_coherence noise_instruments conclusion_3 conclusion_4
    conclusion_5_level conclusion_5_noise conclusion_6 conclusion_7
""")


class Statement(TableRow):
    """One row: a statement, with its number where it has one."""

    id: Annotated[
        str,
        Field(pattern=r"^[a-z0-9_]+([.][a-z0-9_]+)*\Z", description="names of a to z, 0 to 9 and _ with dots between"),
    ]  # a claim's name; further numbers of the same claim are ``<claim>.<name>``
    where: Text  # section, figure or table
    what: Text  # the statement in a sentence, or what the number is
    value: Annotated[float | None, BeforeValidator(lambda cell: None if cell == "" else cell)]  # the number
    unit: str  # its unit

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        """What a number means bounds it: by its unit, and a share, an error or a noise, which have none, by the id."""
        value = 0.5 if self.value is None else self.value  # which no bound refuses
        if not self.unit and re.search("_(share|error)$|^noise_", self.id):
            holds, expected = 0.0 < value < 1.0, "a number above 0 and below 1"
        elif self.unit in ("kg", "m", "s", "samples", "N^2"):
            holds, expected = value > 0.0, "a number above 0"
        else:
            holds, expected = value >= 0.0, "0 or more"
            holds |= self.unit != "Hz" and not re.search("[.]zeta$|^averages$", self.id)
        if not holds:
            raise ValueError(f"value is {value:g}; expected {expected}")
        return self

    def __str__(self) -> str:
        """The number with its unit."""
        return "" if self.value is None else f"{self.value:.6g} {self.unit}".strip()


@dataclass(frozen=True)
class Reported:
    """All statements by id."""

    statements: Mapping[str, Statement]

    def __getitem__(self, name: str) -> Statement:
        """One statement."""
        if name not in self.statements:
            raise StudyError(f"config/reported.tsv has no row {name!r}")
        return self.statements[name]

    def value(self, name: str) -> float:
        """The number of one statement."""
        value = self[name].value
        if value is None:
            raise StudyError(f"config/reported.tsv gives no value for {name!r}")
        return value

    def table_1(self, system: str, name: str) -> float:
        """A parameter of a system by Table 1; zero where the system has no such term."""
        if name == "m":
            return self.value("table_1.m")
        key = {"k_dead_band": "k"}.get(name, name)
        row = self.statements.get(f"table_1.{system}.{key}")
        return 0.0 if row is None or row.value is None else row.value

    def numbers(self, name: str) -> str:
        """Every number of a claim, for the column ``reported``."""
        rows = [s for s in self.statements.values() if s.id == name or s.id.startswith(f"{name}.")]
        found = [str(s) for s in rows if s.value is not None]
        return "as tabulated" if len(found) > MANY else ", ".join(found) or "as stated"


def check_complete(reported: Reported, path: Path) -> None:
    """Whether the rows are those that the claims ask for, ``WITH_A_VALUE`` and ``IN_WORDS``."""
    known = [*WITH_A_VALUE, *IN_WORDS]
    for name in reported.statements:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            expected = f"{near[0]!r} is near it" if near else f"a new claim's row is listed in {__name__}"
            raise StudyError(f"{path}: no claim asks for {name!r}; {expected}")
    for name in known:
        if name not in reported.statements:
            raise StudyError(f"{path} has no row {name!r}, which the claims ask for")
    for name in WITH_A_VALUE:
        if reported[name].value is None:
            raise StudyError(f"{path}: {name!r} has no value; expected the number that the report states")


def check_systems(reported: Reported, models: Path) -> None:
    """Whether each system of Table 1 has its model."""
    for name in reported.statements:
        where, _, rest = name.partition(".")
        system, _, parameter = rest.partition(".")
        if where == "table_1" and parameter and not (models / f"{system}.yaml").is_file():
            raise StudyError(f"config/reported.tsv: {name!r} names a system that is not in {models.name}/")


def load_reported(path: Path) -> Reported:
    """Read and check the table."""
    statements: dict[str, Statement] = {}
    for _, statement in read_rows(path, Statement):
        if statement.id in statements:
            raise StudyError(f"{path}: the id {statement.id!r} stands twice; expected each once")
        statements[statement.id] = statement
    return Reported(statements)
