"""Which effect is missing: the diagnosis of a fit."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from study.compare.by_estimator import FREE_RUN
from study.diagnose import confirmed_faults, diagnosis_report
from study.diagnose import verdict as verdicts
from study.diagnose.diagnosis_files import diagnosis_in_words
from study.diagnose.ranked import FittedEffect, Ranked
from study.diagnose.user_candidates import check_on, own_candidates, unfitted, unfitted_in_words
from study.equations import terms
from study.faults.fault import Fault
from study.interface.fitted import Fit
from study.interface.showing import LEGEND_ABOVE, TABLES, Words, drawing_axes, html_table
from study.support import work
from study.support.errors import expect
from study.support.extras import needed
from study.support.numbers import percent

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from study.interface.planned import PlannedTest


@dataclass(frozen=True, eq=False, repr=False)
class Candidate:
    """An effect that may be missing, or a set of effects, as it was fitted.

    Attributes
    ----------
    ranked : study.diagnose.ranked.Ranked
        Everything that was found, as the packages below hold it.
    """

    ranked: Ranked

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.ranked.name

    @property
    def effects(self) -> "tuple[Candidate, ...]":
        """Each effect of a set as it was fitted beside the others, with the error of all together; itself of one."""
        ranked = self.ranked
        return tuple(Candidate(replace(ranked, entries=(e.entry,), effects=(e,))) for e in ranked.effects)

    @property
    def _alone(self) -> FittedEffect:
        expect(
            len(self.ranked.effects) == 1,
            f"{self.name!r} is a set of {len(self.ranked.effects)} effects, each with a coefficient of its own; "
            "expected one of its effects",
        )
        return self.ranked.effect

    @property
    def coefficient(self) -> float:
        """Coefficient of one effect; the amplitude, for an effect of any phase. Refused of a set (``effects``)."""
        return self._alone.coefficient

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the coefficient."""
        return self._alone.interval

    @property
    def unit(self) -> str:
        """Unit of the coefficient."""
        return self._alone.unit

    @property
    def explained(self) -> float:
        """Share of the held-out difference that it explains."""
        return self.ranked.gain.explained

    @property
    def error(self) -> float:
        """Held-out error of the response with it."""
        return self.ranked.response_error

    @property
    def p_value(self) -> float:
        """Probability of such a gain if the effect is not there, the number of candidates accounted for."""
        return self.ranked.p_value

    @property
    def tied_with(self) -> tuple[str, ...]:
        """Candidates that this record cannot tell from it."""
        return self.ranked.tied_with

    def __repr__(self) -> str:
        """One line: name, what it explains, coefficient."""
        effects = self.ranked.effects
        amounts = ", ".join(diagnosis_report.shown_coefficient(e.coefficient, 1.96 * e.error, e.unit) for e in effects)
        return f"<Candidate {self.name}: explains {percent(self.explained, '.3g')}, {amounts}>"


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """What :meth:`Fit.diagnose` gives.

    Attributes
    ----------
    result : study.diagnose.verdict.Diagnosis
        Everything that was found, as the packages below hold it.
    faults : tuple of Fault
        Faults of the measurement that the record shows beside the missing effect.
    says : str
        What to tell the engineer, in sentences, with the test that would tell tied candidates apart.
    not_fitted : mapping of str
        Your own candidates that could not be fitted, and why.
    """

    result: verdicts.Diagnosis
    faults: tuple[Fault, ...]
    says: Words
    not_fitted: Mapping[str, str] = field(default_factory=dict[str, str])

    @property
    def verdict(self) -> str:
        """``missing_effect``, ``missing_effects``, ``partly_known``, ``nothing_missing`` or ``unknown_effect``."""
        return self.result.verdict

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All that were tried, best first."""
        return tuple(Candidate(r) for r in self.result.candidates)

    @property
    def best(self) -> Candidate | None:
        """What is missing, an effect or a set of effects; None unless the verdict names one."""
        answer = self.result.answer
        return None if answer is None else Candidate(answer)

    @property
    def sets(self) -> tuple[Candidate, ...]:
        """The answer, and all other effects and sets of effects that the record cannot tell from the best."""
        return tuple(Candidate(r) for r in self.result.sets)

    def __getitem__(self, name: str) -> Candidate:
        """The candidate of this name; a ``StudyError`` if there is none."""
        found = {c.name: c for c in self.candidates}
        expect(name in found, f"{name!r} is no candidate; expected one of {', '.join(found)}")
        return found[name]

    def plan(
        self, *, max_force: float | None = None, max_displacement: float | None = None,
        max_length: float | None = None, precision: Mapping[str, float] | None = None, sensors: Sequence[str] = (),
    ) -> "PlannedTest":  # fmt: skip
        """Which test decides between what is tied, or with ``precision={"k3": 0.05}`` tells k3 to 5 %.

        Parameters
        ----------
        max_force, max_displacement, max_length : float, optional
            What the test may not exceed, in the units of the record and in seconds; by default what this record
            reached.
        precision : mapping of float, optional
            A value that is fitted, and the half width of its 95 % interval over the value that is wanted.
        sensors : sequence of str
            Those that could be added, as ``floor2 acceleration``; any by default.

        Raises
        ------
        StudyError
            If nothing is tied, the limits allow no test, or there is no such sensor.
        """
        from study.interface.planned import planned

        return planned(self.result, (max_force, max_displacement, max_length), precision, sensors)

    def table(self) -> Words:
        """The first candidates as ``study diagnose`` prints them."""
        return Words(diagnosis_report.candidate_table(self.result))

    def to_frame(self) -> "pd.DataFrame":
        """Every candidate, best first, indexed by name."""
        needed(*TABLES)
        import pandas as pd

        rows = [
            {"term": c.name, "explained": c.explained, "explained_error": c.ranked.gain.error, "error": c.error,
             "coefficient": c.coefficient, "low": c.interval[0], "high": c.interval[1], "unit": c.unit,
             "p_value": c.p_value, "changes_by": c.ranked.unsteadiness, "tied_with": ", ".join(c.tied_with)}
            for c in self.candidates
        ]  # fmt: skip
        names = (
            "term", "explained", "explained_error", "error", "coefficient", "low", "high", "unit", "p_value",
            "changes_by", "tied_with",
        )  # fmt: skip
        return pd.DataFrame(rows, columns=list(names)).set_index("term")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Share of the held-out difference that each of the first candidates explains."""
        with drawing_axes(ax) as (axes,):
            from study.diagnose.diagnosis_pictures import ranking

            return ranking(axes, self.result)

    def plot_constancy(self, ax: "Axes | None" = None, *, along: str = "amplitude") -> "Axes":
        """The coefficient of the first candidates along ``amplitude`` or ``frequency``: that of a true term is one.

        Relative to its value, with 95 % intervals.
        """
        expect(along in ("amplitude", "frequency"), f"along is {along!r}; expected amplitude or frequency")
        with drawing_axes(ax) as (axes,):
            from study.diagnose.diagnosis_pictures import CANDIDATES_FOLLOWED, followed

            followed(axes, self.result.candidates[:CANDIDATES_FOLLOWED], along)
            axes.legend(**LEGEND_ABOVE)
        return axes

    def __repr__(self) -> str:
        """One line: verdict, and the best candidate if there is one."""
        best = f": {self.best!r}" if self.best is not None else ""
        return f"<Diagnosis {self.verdict.replace('_', ' ')}{best}>"

    def _repr_html_(self) -> str:
        rows = [
            [str(place), c.name, diagnosis_report.explained_share(c.ranked.gain), percent(c.error),
             diagnosis_report.shown_coefficient(c.coefficient, 1.96 * c.ranked.effect.error, c.unit),
             f"{c.p_value:.1g}"]
            for place, c in ((n, Candidate(row)) for n, row in diagnosis_report.shown_rows(self.result))
        ]  # fmt: skip
        heads = ["", "effect", "explains", "error with it", "coefficient", "p"]
        return html_table(f"Verdict: {self.verdict.replace('_', ' ')}", heads, rows, self.says)


def diagnosed(fit: Fit, own: Mapping[str, str], without: Sequence[str], *, thorough: bool) -> Diagnosis:
    """What :meth:`Fit.diagnose` does; its arguments."""
    by = fit.comparison.estimator
    expect(by == FREE_RUN, f"candidates are fitted in free run; expected a fit by {FREE_RUN}, this one is by {by}")
    for name in without:
        terms.get(name)
    extra = own_candidates([f"{name}={formula}" for name, formula in own.items()], fit.comparison.model)
    check_on(fit.comparison.record, extra)
    asked = replace(fit.asked, comparison=fit.comparison)
    with work.limited_to(math.inf) if thorough else nullcontext():
        found = confirmed_faults.diagnose_accounted(asked, extra=extra, without=tuple(without))
    untried = unfitted(found.diagnosis, extra)
    says = [diagnosis_in_words(found.diagnosis), *unfitted_in_words(untried)]
    return Diagnosis(found.diagnosis, found.faults, Words(" ".join(says)), untried)
