"""The pictures of a fit: each on the axes that are given, or on those of a new figure."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from typing import TYPE_CHECKING

from study.equations import dimensions
from study.interface.showing import LEGEND_ABOVE, drawing_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from study.compare.comparison import Comparison
    from study.compare.prediction import SensorPrediction


class FitPictures:
    """Methods that draw; all take an ``ax`` and give back the axes that were drawn on."""

    comparison: "Comparison"

    def plot(self, ax: "Axes | None" = None, *, closeup: bool = False, sensor: str | None = None) -> "Axes":
        """Measured and predicted response of the judging part, or some cycles where the model misses most.

        Of a structure that of a ``sensor`` by its name, or of the one that the model misses most.
        """
        prediction = self._seen(sensor)
        part = prediction.closeup if closeup else slice(None)
        with drawing_axes(ax) as (axes,):
            from study.compare.panels import response_panel

            response_panel(
                axes, prediction.time[part], prediction.measured[part], prediction.predicted[part],
                self._unit(prediction),
            )  # fmt: skip
            axes.legend(**LEGEND_ABOVE)
            axes.set_title(f"{self.comparison.record.name}: model {self.comparison.model.name}", pad=20.0)
        return axes

    def plot_residual(self, ax: "Axes | None" = None, *, sensor: str | None = None) -> "Axes":
        """What the model misses of the judging part beside twice the noise floor; ``sensor`` as for :meth:`plot`."""
        prediction = self._seen(sensor)
        with drawing_axes(ax) as (axes,):
            from study.compare.panels import residual

            residual(axes, prediction.time, prediction.residual, prediction.noise.rms, self._unit(prediction))
            axes.legend(**LEGEND_ABOVE)
        return axes

    def plot_frf(
        self, ax: "Axes | None" = None, *, part: str = "magnitude", sensor: str | None = None
    ) -> "Axes":  # fmt: skip
        """Response over force by frequency, of the record and of the model's free run under the same force.

        Where the motion is prescribed, force over displacement: the dynamic stiffness.
        ``part`` is ``magnitude``, ``phase`` or ``coherence``; ``sensor`` as for :meth:`plot`.
        """
        from study.compare import fit_panels
        from study.compare.connection_spectra import highest_frequency
        from study.compare.response_functions import drive_of, response_functions
        from study.support.errors import expect

        expect(part in ("magnitude", "phase", "coherence"), f"part is {part!r}; expected magnitude, phase or coherence")
        seen = self._seen(sensor)
        functions = response_functions(self.comparison.prediction, seen.number)
        alone = len(self.comparison.views) == 1 and self.comparison.forces
        highest = self.comparison.forces[0].highest if alone else highest_frequency(self.comparison)
        with drawing_axes(ax) as (axes,):
            if part == "magnitude":
                drive = drive_of(seen)
                unit = f"{self._unit(seen)}/{self.comparison.record.units.get(drive, '')}"
                return fit_panels.response_magnitude(axes, functions, unit, highest)
            return (fit_panels.response_phase if part == "phase" else fit_panels.coherence_panel)(
                axes, functions, highest
            )

    def plot_autocorrelation(self, ax: "Axes | None" = None) -> "Axes":
        """Autocorrelation of the held-out residual with the 99 % band of white noise."""
        from study.compare import fit_panels
        from study.compare.residual_checks import residual_checks

        with drawing_axes(ax) as (axes,):
            return fit_panels.autocorrelation(axes, residual_checks(self.comparison.prediction))

    def plot_force_correlation(self, ax: "Axes | None" = None) -> "Axes":
        """Correlation of the held-out residual with the force, with the 99 % band of independent ones."""
        from study.compare import fit_panels
        from study.compare.residual_checks import residual_checks

        with drawing_axes(ax) as (axes,):
            return fit_panels.with_force(axes, residual_checks(self.comparison.prediction))

    def plot_histogram(self, ax: "Axes | None" = None) -> "Axes":
        """Distribution of the held-out residual beside the normal one."""
        from study.compare import fit_panels
        from study.compare.residual_checks import residual_checks

        with drawing_axes(ax) as (axes,):
            return fit_panels.residual_histogram(axes, residual_checks(self.comparison.prediction))

    def plot_missing_force(self, against: str = "displacement", ax: "Axes | None" = None) -> "Axes":
        """Mean force that the model lacks against ``displacement`` or ``velocity``, with 95 % intervals.

        Of a structure that at the place where most is missing.
        """
        from study.compare.force_map import curve
        from study.support.errors import expect

        expect(against in ("displacement", "velocity"), f"against is {against!r}; expected displacement or velocity")
        lacking, units = self.comparison.missing_force, dict(self.comparison.record.units)
        if self.comparison.model.named:
            units |= self.comparison.missing.units(self.comparison.place.label)
        motion = lacking.displacement if against == "displacement" else lacking.velocity
        with drawing_axes(ax) as (axes,):
            from study.compare.panels import force_curve

            return force_curve(axes, curve(motion[lacking.inner], lacking.force[lacking.inner]), against, units)

    def plot_force_error(self, ax: "Axes | None" = None, *, coordinate: str | None = None) -> "Axes":
        """Unexplained share of the force by frequency.

        Of a structure in the equation of motion of a ``coordinate``, or in the one that leaves most.
        """
        from study.support.errors import expect

        forces = {force.coordinate: force for force in self.comparison.forces}
        known = ", ".join(forces) or "none: the sensors show no equation of motion"
        there = bool(forces) if coordinate is None else coordinate in forces
        expect(there, f"coordinate is {coordinate!r}; expected one of {known}")
        force = max(forces.values(), key=lambda f: f.total) if coordinate is None else forces[coordinate]
        with drawing_axes(ax) as (axes,):
            from study.compare.panels import force_error_panel

            drawn = force_error_panel(axes, force, force.highest)
            drawn.legend(loc="upper right")
        return drawn

    def plot_varying(self, coefficient: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """A coefficient that varies along time or its channel with its 95 % band: by its name, or the first."""
        from study.support.errors import expect

        found = {one.symbol: one for one in self.comparison.varying}
        known = ", ".join(found) or "none: the model has no entry with varies_with"
        there = bool(found) if coefficient is None else coefficient in found
        expect(there, f"no {coefficient or 'coefficient'} varies in this model; expected one of {known}")
        one = found[coefficient or next(iter(found))]
        with drawing_axes(ax) as (axes,):
            from study.compare.varying_pictures import varying_panel

            varying_panel(axes, one)
            axes.legend(loc="best")
            axes.set_title(f"{self.comparison.record.name}: model {self.comparison.model.name}")
        return axes

    def _seen(self, sensor: str | None) -> "SensorPrediction":
        from study.support.errors import expect

        views = {str(view.sensor): view for view in self.comparison.views}
        expect(sensor is None or sensor in views, f"sensor is {sensor!r}; expected one of {', '.join(views)}")
        return self.comparison.worst if sensor is None else views[sensor]

    def _unit(self, seen: "SensorPrediction") -> str:
        return dimensions.pretty(self.comparison.record.units.get(str(seen.sensor), ""))
