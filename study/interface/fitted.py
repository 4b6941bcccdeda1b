"""A model fitted to one part of a record and judged on the other."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from study.compare.comparison import Comparison, compare, distinct
from study.compare.each_record import Separate, levels_by_record, rows, separated
from study.compare.fitted_coefficients import Coefficient
from study.compare.residual_checks import ResidualChecks
from study.compare.response_functions import ResponseFunctions
from study.equations.model import ModelTerm
from study.faults.accounting import Accounted
from study.faults.fault import Fault, Given, settings_asked
from study.interface.data import Record
from study.interface.equation import Model, Samples, Times
from study.interface.forces import Force, simulate
from study.interface.pictures import FitPictures
from study.interface.showing import TABLES, Words, html_table
from study.records import record as measured
from study.records.record_layout import Layout
from study.support.errors import StudyError, expect
from study.support.extras import needed
from study.support.files import replace_file
from study.support.numbers import percent
from study.support.yaml_text import shown
from study.way_in.compare_records import compare_records

if TYPE_CHECKING:
    import pandas as pd

    from study.interface.found import Candidate, Diagnosis
    from study.interface.side_by_side import Across


@dataclass(frozen=True)
class Number:
    """An estimate that follows from coefficients, with its standard error."""

    value: float
    error: float  # NaN where the coefficients were held
    unit: str = ""

    def __repr__(self) -> str:
        """Value, half of its 95 % interval as everything that is printed has it, and unit."""
        return f"{self.value:.5g} +- {1.96 * self.error:.2g} {self.unit}".rstrip()

    def __float__(self) -> float:
        """The value."""
        return self.value


@dataclass(frozen=True, eq=False, repr=False)
class Fit(FitPictures):
    """What :meth:`Model.fit` gives.

    Attributes
    ----------
    comparison : study.compare.comparison.Comparison
        Everything that was found, as the packages below hold it.
    asked : Accounted
        The record before it was corrected, what was asked of it, and what it is corrected for.
    separate : tuple of Separate
        Coefficients that may differ between the records.
    """

    comparison: Comparison
    asked: Accounted
    separate: tuple[Separate, ...] = ()

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Faults of the measurement that the record is corrected for, or may have."""
        return self.asked.faults

    @property
    def model(self) -> Model:
        """The model with its fitted values, from which a fit to another record begins; what was held is held."""
        return Model.of(self.comparison.fit.model.opened(self.comparison.fit.held))

    @property
    def given(self) -> Model:
        """The model as it was given: what it leaves open was fitted."""
        return Model.of(self.comparison.model)

    @property
    def record(self) -> Record:
        """The record as it was fitted: completed, in consistent units, corrected; several strung together."""
        return Record.of(self.comparison.record)

    @property
    def coefficients(self) -> dict[str, Coefficient]:
        """Every coefficient and shape parameter by key: ``value``, ``error``, ``interval`` (95 %), ``unit``."""
        return {c.key: c for c in self.comparison.coefficients}

    @property
    def f_n(self) -> Number | None:
        """Natural frequency of the linear part in hertz, (4.4); of a structure the lowest.

        None without mass, or stiffness above zero.
        """
        return self._natural(0)

    @property
    def zeta(self) -> Number | None:
        """Damping ratio of that mode, (4.5); None without mass, damping, or stiffness above zero."""
        return self._natural(1)

    def _natural(self, which: int) -> Number | None:
        found = self.comparison.natural[which]
        return None if found is None else Number(*found)

    def modes(self) -> "pd.DataFrame":
        """The modes of the linear part, one row each: frequency in hertz, damping and shape with standard errors."""
        needed(*TABLES)
        import pandas as pd

        found = self.comparison.modes
        table: dict[str, Any] = {
            "frequency": found.frequency, "frequency_error": found.frequency_error,
            "damping": found.damping, "damping_error": found.damping_error,
        }  # fmt: skip
        for i, name in enumerate(self.given.coordinates):
            table |= {f"shape at {name}": found.shape[:, i], f"error at {name}": found.shape_error[:, i]}
        return pd.DataFrame(table, index=pd.RangeIndex(1, len(found.frequency) + 1, name="mode"))

    @property
    def errors(self) -> dict[str, float]:
        """The same by sensor."""
        found = self.comparison.prediction
        return {str(s): float(e) for s, e in zip(found.prepared.outputs.sensors, found.errors, strict=True)}

    @property
    def error(self) -> float:
        """Rms of the held-out difference over that of the response; over all sensors, if there are several."""
        return self.comparison.prediction.error

    @property
    def floor(self) -> float:
        """The part of the error that no model could explain, as far as this residual shows."""
        return self.comparison.prediction.floor

    @property
    def force_error(self) -> float:
        """Share of the force's power that the model does not explain in reverse."""
        return self.comparison.force_error

    @property
    def fit_percent(self) -> float:
        """100 (1 - error): the measure of fit of MATLAB's ``compare``, in per cent."""
        return 100.0 * (1.0 - self.error)

    @property
    def says(self) -> Words:
        """What to know of it, in two or three sentences."""
        from study.compare.comparison_sentences import comparison_in_words

        return Words(comparison_in_words(self.comparison))

    def response_functions(self) -> ResponseFunctions:
        """Response over force by frequency, measured and predicted, with coherences.

        Of a structure those of its first sensor and force.
        """
        from study.compare.response_functions import response_functions

        return response_functions(self.comparison.prediction)

    def residual_checks(self) -> ResidualChecks:
        """Correlations of the held-out residual with itself and with the force, with 99 % bands, and its histogram.

        Of a structure those of its first sensor and force.
        """
        from study.compare.residual_checks import residual_checks

        return residual_checks(self.comparison.prediction)

    def summary(self) -> Words:
        """The lines that ``study compare`` prints."""
        from study.compare.comparison_report import comparison_summary

        return Words(comparison_summary([self.comparison]))

    def to_frame(self) -> "pd.DataFrame":
        """The coefficients, one row a key: term, value, standard error, 95 % interval, unit, held or not."""
        needed(*TABLES)
        import pandas as pd

        rows = [
            {"key": c.key, "term": c.term, "value": c.value, "error": np.nan if c.error is None else c.error,
             "low": (c.interval or (np.nan,))[0], "high": (c.interval or (np.nan,))[-1], "unit": c.unit,
             "held": c.held} for c in self.comparison.coefficients
        ]  # fmt: skip
        return pd.DataFrame(rows).set_index("key")

    def by_record(self) -> "pd.DataFrame":
        """The coefficients that may differ (``each_record``), one row a coefficient and record.

        With the standard error, and the p value that it is the same in all of them (Wald, 1943).
        """
        needed(*TABLES)
        import pandas as pd

        records = list({id(s.source): s.source for s in self.comparison.record.stretches}.values())
        fitted_keys = set(self.comparison.fit.keys)
        kept = [s for s in self.separate if fitted_keys.issuperset((s.symbol, *s.differences))]
        table = [
            {"key": row["key"], "record": name, "value": value, "error": error, "unit": row["unit"],
             "p_value": row["p_value"], "differs": row["differs"]}
            for row in rows(levels_by_record(self.comparison, kept, records), records)
            for name, value, error in zip(row["records"], row["value"], row["standard_error"], strict=True)
        ]  # fmt: skip
        columns = ["key", "record", "value", "error", "unit", "p_value", "differs"]
        return pd.DataFrame(table, columns=columns).set_index(["key", "record"])

    def predict(self, force: "Force | Record | ArrayLike", *, initial: Sequence[float] = (0.0, 0.0)) -> Record:
        """The response of the fitted model to a force.

        Parameters
        ----------
        force : Force, Record or array of shape (n,)
            An array has the sampling interval of the record that was fitted.
        initial : sequence of float
            Displacement of every coordinate at the first sample, then the velocities.

        Raises
        ------
        StudyError
            If a force is missing, or the response does not stay finite.
        """
        if not isinstance(force, Force | Record):
            values = np.asarray(force, dtype=np.float64)
            expect(values.ndim == 1 and len(values) > 1, f"force has the shape {values.shape}; expected one row")
            force = Force(values, self.comparison.record.dt)
        return simulate(self.model, force, initial=initial, name=f"{self.model.name}_predicted")

    def diagnose(
        self, candidates: Mapping[str, str] | None = None, without: Sequence[str] = (), *, thorough: bool = False
    ) -> "Diagnosis":  # fmt: skip
        """Which effect is missing: every effect of the library is tried, and formulas of your own.

        Parameters
        ----------
        candidates : mapping of str, optional
            Name to formula: ``{"bushing": "u*abs(u)"}``.
        without : sequence of str
            Effects of the library to leave out.
        thorough : bool
            Whether to search to the end, instead of for about a minute.

        Raises
        ------
        StudyError
            If a formula is refused, there is no such effect, or another estimator than the free run found the fit.
        """
        from study.interface.found import diagnosed

        return diagnosed(self, candidates or {}, without, thorough=thorough)

    def add(
        self, added: "Candidate | str | ModelTerm | None", *, at: str | None = None,
        between: Sequence[str] | None = None,
    ) -> "Fit":  # fmt: skip
        """The fit of the model with an effect more.

        A candidate of its diagnosis begins where its fit ended, at the place that was found; of an effect of the
        library by name, or a :func:`term`, what it gives is held and the rest is fitted as a diagnosis would. In a
        structure it acts ``at`` a coordinate or ``between`` two.

        Raises
        ------
        StudyError
            If the model has that force already, or has no finite response with it.
        """
        from study.diagnose.adding import added as grown
        from study.diagnose.adding import added_candidate
        from study.interface.found import Candidate

        if isinstance(added, Candidate):
            return replace(self, comparison=added_candidate(self.comparison, added.ranked))
        larger = self.given.add(added, at=at, between=between)
        entry = larger.equation.terms[-1]
        if any(value is not None for value in entry.values.values()):
            return replace(self, comparison=compare(larger.equation, self.comparison.prepared))
        return replace(self, comparison=grown(self.comparison, entry))

    def drop(self, name: str, *, at: str | None = None, between: Sequence[str] | None = None) -> "Fit":
        """The fit of the model without one of its terms, of a structure that at its place or by its full name.

        A ``StudyError`` if it cannot go.
        """
        from study.diagnose.dropping import compared_without

        placed = bool(self.given.coordinates)
        kept = self.given.drop(name, at=at, between=between).terms if placed else ()
        gone = next(t for t in self.given.terms if t not in kept) if placed else name
        return replace(self, comparison=compared_without(self.comparison, gone))

    def across(self, records: "Sequence[Record]", **options: Any) -> "Across":
        """The same model fitted to several records: do its coefficients move with the level?

        Parameters
        ----------
        records : sequence of Record
            Two or more.
        **options
            As for :meth:`Model.fit`, the same for all records.

        Raises
        ------
        StudyError
            If there are fewer than two records, or their units differ.
        """
        from study.interface.side_by_side import across

        return across([self.given.fit(record, **options) for record in records_of(records)])

    def export(self, path: str | Path, *, step: float | None = None) -> None:
        """Write the fitted model for another program as :meth:`Model.export` does, with the units of the record.

        A ``StudyError`` if something cannot be said in that way.
        """
        from study.export.ways import exported_file, way_of

        content = exported_file(self.model.equation, way_of(Path(path)), self.comparison.record, step)
        replace_file(Path(path), content)

    def page(self) -> bytes:
        """The page of ``study compare`` as one HTML file; a ``StudyError`` says what is to be installed for it."""
        needed("bokeh", "the page", "explore")
        from study.explore.saved import of_comparison

        return of_comparison(self.comparison)

    def __repr__(self) -> str:
        """One line: record, model and errors."""
        return f"<Fit of {self.given.name} to {self.record.name}: {self._errors()}>"

    def _errors(self) -> str:
        return f"held-out error {percent(self.error)}, noise floor {percent(self.floor)}"

    def _repr_html_(self) -> str:
        rows = [
            [c.key, c.term, f"{c.value:.5g}", "held" if c.error is None else f"± {1.96 * c.error:.2g}", c.unit]
            for c in self.comparison.coefficients
        ]
        caption = f"{self.given.name} fitted to {self.record.name}: {self._errors()}"
        return html_table(caption, ["", "term", "value", "95 %", "unit"], rows, self.says)


def fitted(
    model: Model, record: Record | Sequence[Record], *, fit: Samples | None,
    judge: Samples | Literal["every-other-block"] | None, use: Sequence[Times], response: str | None,
    cutoff: float | None, near: float | None, up_to: float | None, estimator: str,
    measurement: Given | bool | None, as_sampled: bool,
    absolute: bool, each_record: Sequence[str], horizon: float | None,
) -> Fit:  # fmt: skip
    """What :meth:`Model.fit` does; its arguments."""
    records, separate = records_of(record), tuple[Separate, ...]()
    settings = settings_asked(records[0].source, measurement)
    expect(cutoff is None or 0.0 < cutoff < math.inf, f"cutoff is {cutoff!r}; expected a frequency above 0 Hz")
    for name, given in (("near", near), ("up_to", up_to)):
        expect(given is None or 0.0 < given < math.inf, f"{name} is {given!r}; expected a frequency above 0 Hz")
    expect(horizon is None or 0.0 < horizon < math.inf, f"horizon is {horizon!r}; expected a time above 0 s")
    alternate = judge == "every-other-block"
    layout = Layout(
        tuple(_stretch(pair) for pair in use), _samples("fit", fit, records[0]),
        None if alternate else _samples("judge", judge, records[0]), alternate, response, cutoff, near, up_to,
        as_sampled, horizon,
    )  # fmt: skip
    equation, asked = model.equation, list[measured.Record](distinct(records))
    if each_record:
        names = [each_record] if isinstance(each_record, str) else each_record
        equation, asked, separate = separated(equation, asked, names)
    found = compare_records(asked, equation, layout, settings, absolute=absolute, estimator=estimator)
    prepared = found.comparison.prepared
    of_all = replace(prepared.record, name=", ".join(one.name for one in asked))
    return Fit(replace(found.comparison, prepared=replace(prepared, record=of_all)), found, separate)


def records_of(given: object) -> list[Record]:
    """The one record that is given, or those of a list; a ``StudyError`` where it is none."""
    several = cast("Sequence[object]", given) if isinstance(given, list | tuple) else [given]
    expect(several, "no record is given; expected one or more")
    for one in several:
        expect(
            isinstance(one, measured.Record),
            f"{shown(one)} is no record; expected what st.read or st.record gives, or a list of these",
        )
    return [Record.of(one) for one in several if isinstance(one, measured.Record)]


def _samples(part: str, given: object, record: Record) -> tuple[int, int] | None:
    """The samples of a part: a pair of whole numbers, the last of which may be left open."""
    if given is None:
        return None
    match given:
        case (int(first), int() | None as last):
            return first, len(record) if last is None else last
        case _:
            turns = " or 'every-other-block'" if part == "judge" else ""
            raise StudyError(f"{part} is {shown(given)}; expected a pair of samples such as (0, 4096){turns}")


def _stretch(given: object) -> Times:
    """A stretch to use: a pair of times, the last of which may be left open."""
    match given:
        case (int() | float() as first, int() | float() | None as last):
            if math.isfinite(first) and (last is None or (math.isfinite(last) and last > first)):
                return first, last
        case _:
            pass
    raise StudyError(f"use names {shown(given)}; expected pairs of times in seconds such as [(2.0, 9.5)]")
