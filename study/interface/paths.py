"""The reverse analysis of a record: frequency response functions of the inputs, coherences, parameters."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.compare.by_estimator import followed_band
from study.compare.noise import segments_of
from study.identify import estimators
from study.identify.estimators.base import Identified, Settings
from study.identify.frequency_domain.conditioned import MisoResult
from study.interface.data import Record
from study.interface.equation import Model
from study.interface.fitted import records_of
from study.interface.showing import TABLES, drawing_axes, html_table
from study.records.prepared import prepare_record
from study.records.spectra import Segments
from study.support.errors import StudyError, expect
from study.support.extras import needed
from study.way_in.compare_records import driven_alike

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from study.figures.curves import InputResponse
    from study.identify.frequency_domain.coefficients import Responses


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """What :func:`identify` gives.

    Attributes
    ----------
    result : study.identify.estimators.base.Identified
        Everything that was found, as the packages below hold it.
    estimator : str
        What found it.
    record : Record
        Whose part it was found on, with all motions.
    band : pair of float
        Lines that the parameters are fitted to, in hertz.
    heard : float
        Highest frequency in hertz at which force and motion are heard: there the axes end.
    """

    result: Identified
    estimator: str
    record: Record
    band: tuple[float, float]
    heard: float

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters by name, (4.4) to (4.10): m, c, k, f_n, zeta and those of nonlinear terms."""
        return {p.name: p.value for p in self.result.parameters}

    @property
    def errors(self) -> dict[str, float]:
        """Their standard errors; NaN where the recipe gives none."""
        return {p.name: p.error for p in self.result.parameters}

    @property
    def inputs(self) -> tuple[str, ...]:
        """Formula of each input's time history."""
        return tuple(item.shape for item in self.result.inputs)

    def to_frame(self) -> "pd.DataFrame":
        """Parameters, one row a name, with their standard errors."""
        needed(*TABLES)
        import pandas as pd

        rows = [{"parameter": p.name, "value": p.value, "error": p.error} for p in self.result.parameters]
        return pd.DataFrame(rows, columns=["parameter", "value", "error"]).set_index("parameter")

    def responses(self) -> "pd.DataFrame":
        """A_j(f), one row an input and line: real and imaginary part, standard error, and what coherences there are."""
        needed(*TABLES)
        import pandas as pd

        found, analysis = self._responses(), self._coherences()
        parts: list[pd.DataFrame] = []
        for j, shape in enumerate(self.inputs):
            columns = {
                "input": shape, "frequency": found.frequency, "real": found.response[j].real,
                "imag": found.response[j].imag, "error": np.sqrt(found.covariance[:, j, j].real),
            }  # fmt: skip
            if analysis is not None and len(analysis.frequency) == len(found.frequency):
                columns |= {"partial_coherence": analysis.partial[j], "cumulative_coherence": analysis.cumulative[j]}
            parts.append(pd.DataFrame(columns))
        return pd.concat(parts, ignore_index=True)

    def plot(self, number: int = 1, ax: "Axes | None" = None, *, part: str = "magnitude") -> "Axes":
        """A_j(f) of the input of this number, counted from 1, with 95 % bands.

        ``part`` is ``magnitude`` or ``phase``.

        Raises
        ------
        StudyError
            If there is no such input, or the estimator has no frequency response functions.
        """
        from study.figures.labels import formula, response_unit

        expect(part in ("magnitude", "phase"), f"part is {part!r}; expected magnitude or phase")
        curve, units = self._curve(number), self.record.units
        with drawing_axes(ax) as (axes,):
            from study.figures import frequency_response

            if part == "phase":
                frequency_response.phase_panel(axes, curve)
            else:
                unit = response_unit(curve.shape, units.get("force", "N"), units.get("displacement", "m"))
                frequency_response.magnitude_panel(axes, curve, unit)
            axes.set_xlim(0.0, self.heard)
            axes.set_title(f"{self.record.name}: input {formula(curve.shape)} by {self.estimator.replace('_', ' ')}")
        return axes

    def plot_coherence(self, ax: "Axes | None" = None) -> "Axes":
        """Cumulative coherence: what share of the force each input explains, one after the other.

        Raises
        ------
        StudyError
            If the estimator has none.
        """
        from study.figures.curves import InputCoherence

        analysis = self._coherences()
        if analysis is None:
            raise StudyError(f"{self.estimator} has no coherences; expected an estimator such as miso")
        kept = (analysis.frequency > 0.0) & (analysis.frequency <= self.heard)
        shares = [
            InputCoherence(item.shape, " + ".join(item.terms), analysis.frequency[kept], analysis.cumulative[j][kept])
            for j, item in enumerate(self.result.inputs)
        ]
        with drawing_axes(ax) as (axes,):
            from study.figures import coherence

            coherence.cumulative_panel(axes, shares)
            axes.set_xlim(0.0, self.heard)
            axes.set_ylabel("cumulative coherence")
            axes.legend(loc="lower left")
        return axes

    def _responses(self) -> "Responses":
        found = self.result.responses
        if found is None:
            raise StudyError(f"{self.estimator} has no frequency response functions; expected one such as miso")
        return found

    def _coherences(self) -> MisoResult | None:
        found = self.result.analysis or self.result.responses
        return found if isinstance(found, MisoResult) else None

    def _curve(self, number: int) -> "InputResponse":
        from study.figures.curves import InputResponse, ResponseCurve

        count = len(self.inputs)
        expect(1 <= number <= count, f"there is no input {number}; expected 1 to {count}: {', '.join(self.inputs)}")
        found, j = self._responses(), number - 1
        kept = (found.frequency > 0.0) & (found.frequency <= self.heard)
        error = np.sqrt(np.maximum(found.covariance[kept, j, j].real, 0.0))
        curve = ResponseCurve(self.estimator, found.frequency[kept], found.response[j][kept], error)
        return InputResponse(number, self.inputs[j], (curve,), found.frequency[kept], None)

    def __repr__(self) -> str:
        """One line: estimator, record and parameters."""
        shown = ", ".join(f"{name} {value:.4g}" for name, value in self.parameters.items())
        return f"<Identification of {self.record.name} by {self.estimator}: {shown}>"

    def _repr_html_(self) -> str:
        rows = [[p.name, f"{p.value:.6g}", f"{p.error:.2g}"] for p in self.result.parameters]
        low, high = self.band
        note = f"{self.result.note} fitted from {low:.3g} to {high:.3g} Hz".strip()
        caption = f"{self.record.name} by {self.estimator}"
        return html_table(caption, ["parameter", "value", "standard error"], rows, note)


def identify(
    record: Record, model: Model, estimator: str = "miso", *, band: tuple[float, float] | None = None,
    segment: int | None = None, absolute: bool = False,
) -> Identification:  # fmt: skip
    """A_j(f) of every input of the reverse system, and the model's coefficients, from the whole record.

    Parameters
    ----------
    record : Record
        Its motions are completed first.
    model : Model
        Its coefficients are found anew; shape parameters that it gives are used.
    estimator : str
        One of siso, miso, miso_hand_read, local_polynomial, output_error, instrumental, miso_free_shape,
        errors_in_variables.
    band : pair of float, optional
        Lines in hertz that the parameters are fitted to; by default those in which force and motion are heard.
    segment : int, optional
        Samples of Welch's segments.
    absolute : bool
        On a moving base, the response was measured absolutely.

    Raises
    ------
    StudyError
        If there is no such estimator, it cannot work with this model or record, or no force acts.
    """
    given = records_of(record)
    expect(not model.equation.named, "identify reads a single mass in reverse; expected Model.fit for a structure")
    expect(len(given) == 1, f"{len(given)} records are given; expected one, as frequency response functions are of one")
    equation, (driven,), _ = driven_alike(given, model.equation, absolute)
    expect(not driven.unforced, f"{driven.name}: no force acts; expected a driven record, or a fit of this one")
    prepared = prepare_record(driven)
    part = prepared.record.part(*prepared.inner((0, len(record))))
    cut = segments_of(len(part)) if segment is None else Segments(length=segment)
    followed = followed_band(part, prepared.band, cut)
    lines = band or followed
    found = estimators.identify(estimator, equation, part, Settings(cut, lines))
    return Identification(found, estimator, Record.of(part), lines, max(followed[1], lines[1]))
