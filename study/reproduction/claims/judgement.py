"""From conditions to a verdict.

The criterion of a claim is a list of conditions that follow from the report's wording. All met:
``reproduced``; some: ``partly``; none: ``not reproduced``.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from study.reproduction.claims.evidence import Evidence
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample
from study.support.numbers import percent

REPRODUCED, PARTLY, NOT_REPRODUCED = "reproduced", "partly", "not reproduced"
SEPARATOR = "; "  # between the parts of what was measured, one for each condition
BESIDE = "beside"  # first word of a place that is no statement of the report: it is judged, but not counted


@dataclass(frozen=True)
class Condition:
    """One thing that must hold."""

    criterion: str  # what must hold, with its numbers
    measured: str
    met: bool
    why: str = ""  # the reason, in case it does not hold
    because: str = ""  # what lies behind that reason, the same for every condition of a claim

    @property
    def reason(self) -> str:
        return self.why or f"{self.measured}, where the criterion is {self.criterion}"


@dataclass(frozen=True)
class Claim:
    """A row of ``results/claims.csv``."""

    id: str
    where: str
    claim: str
    reported: str
    measured: str
    criterion: str
    verdict: str
    why: str


Conditions = Callable[[Evidence, Reported], Iterable[Condition]]


def claims(*functions: Conditions) -> dict[str, Conditions]:
    """Conditions of the claims of a section by the claim's id, the function's name."""
    return {function.__name__: function for function in functions}


def verdict(met: Sequence[bool], words: tuple[str, str, str] = (REPRODUCED, PARTLY, NOT_REPRODUCED)) -> str:
    """``reproduced`` if all hold, ``not reproduced`` if none does, else ``partly``."""
    return words[0 if all(met) else 1 if any(met) else 2]


def conclude(
    reported: Reported, name: str, *conditions: Condition,
    words: tuple[str, str, str] = (REPRODUCED, PARTLY, NOT_REPRODUCED),
) -> Claim:  # fmt: skip
    """The claim of this id with the verdict, one of three words, that its conditions give."""
    statement = reported[name]
    conditions = tuple(sorted(conditions, key=lambda c: c.met))  # what fails decides, and stands first
    failed = [c for c in conditions if not c.met]
    reasons = list(dict.fromkeys(c.reason for c in failed))
    why = _joined(reasons)
    if failed and failed[0].because:  # of many conditions with one cause the first: all stand under ``measured``
        more = f" ({len(reasons) - 1} more like it)" if len(reasons) > 1 else ""
        why = f"{reasons[0]}{more}: {failed[0].because}"
    return Claim(
        id=name, where=statement.where, claim=statement.what, reported=reported.numbers(name),
        measured=_joined(c.measured for c in conditions), criterion=_joined(c.criterion for c in conditions),
        verdict=verdict([c.met for c in conditions], words), why=why,
    )  # fmt: skip


def _joined(parts: Iterable[str]) -> str:
    return SEPARATOR.join(dict.fromkeys(part for part in parts if part))


def explained(because: str, conditions: Iterable[Condition]) -> list[Condition]:
    """The conditions of a claim with what lies behind each that fails."""
    return [replace(c, because=because) for c in conditions]


def together(label: str, conditions: Iterable[Condition]) -> Condition:
    """Several conditions on one thing as one, met when all are."""
    all_of_them = list(conditions)
    failed = ", ".join(c.reason for c in all_of_them if not c.met)
    return Condition(
        f"{label}: {', '.join(c.criterion for c in all_of_them)}",
        f"{label}: {', '.join(c.measured for c in all_of_them)}",
        not failed,
        f"{label}: {failed}" if failed else "",
    )


# ---- conditions on the mean over the seeds


def within_share(label: str, sample: Sample, target: float, relative: float, why: str = "") -> Condition:
    """It lies within a share of a number."""
    met = abs(sample.mean - target) <= relative * abs(target)
    return Condition(f"mean {label} within {percent(relative)} of {target:.6g}", f"{label} {sample}", met, why)


def far(label: str, sample: Sample, target: float, relative: float, why: str = "") -> Condition:
    """It is off a number by more than a share of it."""
    met = abs(sample.mean - target) > relative * abs(target)
    return Condition(f"mean {label} more than {percent(relative)} off", f"{label} {sample}", met, why)


def near(label: str, sample: Sample, target: float, distance: float, why: str = "") -> Condition:
    """It lies within a distance of a number."""
    met = abs(sample.mean - target) <= distance
    return Condition(f"mean {label} within {target:.6g} +- {distance:g}", f"{label} {sample}", met, why)


def one_record(label: str, sample: Sample, target: float, why: str = "") -> Condition:
    """A number that the report read off one record is one that a single record may well show."""
    return Condition(
        f"{target:.6g} within two standard deviations of a single record's {label}",
        f"{label} {sample}, scatter of a record {sample.scatter:.2g}",
        abs(sample.mean - target) <= 2.0 * sample.scatter,
        why,
    )


def at_least(label: str, sample: Sample, bound: float, why: str = "") -> Condition:
    """It is not below a bound."""
    return Condition(f"mean {label} at least {bound:g}", f"{label} {sample}", sample.mean >= bound, why)


def at_most(label: str, sample: Sample, bound: float, why: str = "") -> Condition:
    """It is not above a bound."""
    return Condition(f"mean {label} at most {bound:g}", f"{label} {sample}", sample.mean <= bound, why)


def surely_above_zero(label: str, sample: Sample, why: str = "") -> Condition:
    """It is above zero by three of its standard errors."""
    met = sample.mean > 3.0 * sample.error
    return Condition(f"mean {label} above zero by 3 standard errors", f"{label} {sample}", met, why)
