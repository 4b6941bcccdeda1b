"""From conditions to a verdict.

The criterion of a claim is a list of conditions that follow from the report's wording. All met:
``reproduced``; some: ``partly``; none: ``not reproduced``.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample

REPRODUCED, PARTLY, NOT_REPRODUCED = "reproduced", "partly", "not reproduced"
SEPARATOR = "; "  # between the parts of what was measured, one a condition
BESIDE = "beside"  # begins the place of what is no statement of the report: judged, but not counted among them


@dataclass(frozen=True)
class Condition:
    """One thing that must hold.

    Attributes
    ----------
    criterion : str
        What must hold, with its numbers.
    measured : str
        What was found.
    met : bool
        Whether it holds.
    why : str
        The reason, for when it does not hold.
    """

    criterion: str
    measured: str
    met: bool
    why: str = ""


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


def verdict(met: list[bool]) -> str:
    """``reproduced`` if all hold, ``not reproduced`` if none does, else ``partly``."""
    return REPRODUCED if all(met) else PARTLY if any(met) else NOT_REPRODUCED


def conclude(reported: Reported, name: str, *conditions: Condition, because: str = "") -> Claim:
    """The claim of this id in ``reported.tsv`` with the verdict that its conditions give.

    ``because`` is what is behind every condition that fails.
    """
    statement = reported[name]
    conditions = tuple(sorted(conditions, key=lambda c: c.met))  # what fails decides, and stands first
    failed = list(dict.fromkeys(reason(c) for c in conditions if not c.met))
    return Claim(
        id=name,
        where=statement.where,
        claim=statement.what,
        reported=reported.numbers(name),
        measured=_joined([c.measured for c in conditions]),
        criterion=_joined([c.criterion for c in conditions]),
        verdict=verdict([c.met for c in conditions]),
        why=_sentence(failed, because) if failed else "",
    )


def _sentence(failed: list[str], because: str) -> str:
    """Why a claim fails; of many conditions with one reason the first, as all of them stand under ``measured``."""
    if not because:
        return _joined(failed)
    more = len(failed) - 1
    return f"{failed[0]}{f' ({more} more like it)' if more else ''}: {because}"


def reason(condition: Condition) -> str:
    """Why a condition is not met."""
    return condition.why or f"{condition.measured}, where the criterion is {condition.criterion}"


def together(label: str, conditions: Sequence[Condition]) -> Condition:
    """Several conditions on one thing as one, met when all are."""
    failed = [reason(c) for c in conditions if not c.met]
    return Condition(
        f"{label}: {', '.join(c.criterion for c in conditions)}",
        f"{label}: {', '.join(c.measured for c in conditions)}",
        not failed,
        f"{label}: {', '.join(failed)}" if failed else "",
    )


def _joined(parts: list[str]) -> str:
    return SEPARATOR.join(dict.fromkeys(p for p in parts if p))


def close(label: str, found: Sample, target: float, relative: float, why: str = "") -> Condition:
    """The mean over seeds lies within a share of a number."""
    return Condition(
        f"mean {label} within {100.0 * relative:g} % of {target:.6g}",
        f"{label} {found}",
        abs(found.mean - target) <= relative * abs(target),
        why,
    )


def near(label: str, found: Sample, target: float, distance: float, why: str = "") -> Condition:
    """The mean over seeds lies within a distance of a number."""
    met = abs(found.mean - target) <= distance
    return Condition(f"mean {label} within {target:.6g} +- {distance:g}", f"{label} {found}", met, why)


def one_record(label: str, found: Sample, target: float, why: str = "") -> Condition:
    """A number that the report read off one record is one that a single record may well show."""
    return Condition(
        f"{target:.6g} within two standard deviations of a single record's {label}",
        f"{label} {found}, scatter of a record {found.scatter:.2g}",
        abs(found.mean - target) <= 2.0 * found.scatter,
        why,
    )


def at_least(label: str, found: Sample, bound: float, why: str = "") -> Condition:
    """The mean over seeds is not below a bound."""
    return Condition(f"mean {label} at least {bound:g}", f"{label} {found}", found.mean >= bound, why)


def at_most(label: str, found: Sample, bound: float, why: str = "") -> Condition:
    """The mean over seeds is not above a bound."""
    return Condition(f"mean {label} at most {bound:g}", f"{label} {found}", found.mean <= bound, why)


def significant(label: str, found: Sample, why: str = "", errors: float = 3.0) -> Condition:
    """The mean over seeds is above zero by several of its standard errors."""
    met = found.mean > errors * found.error
    return Condition(f"mean {label} above zero by {errors:g} standard errors", f"{label} {found}", met, why)
