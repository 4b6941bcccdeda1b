"""Figures of Section 3 of a case, and those of its force: from its record and model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from study.equations.model_file import read_model
from study.figures import labels, page
from study.records import spectra
from study.records.record import read_csv
from study.reproduction import preliminary
from study.reproduction.pictures import distribution, force_patterns

HIGHEST = 10.0  # hertz, as in the figures of A_j


@dataclass(frozen=True)
class Source:
    """Files of a case, and its title."""

    record: Path
    model: Path
    title: str


def pattern(source: Source) -> Figure:
    """Restoring force against displacement (Figures 2 to 7): as large a harmonic motion as the random one."""
    record, model = read_csv(source.record), read_model(source.model)
    random = preliminary.random_pattern(record, model.numbers()["m"])
    amplitude, frequency = preliminary.harmonic_beside(model, record)
    cycles = preliminary.closing_cycles(model, frequency)
    harmonic = preliminary.harmonic_pattern(model, amplitude, frequency, cycles)
    figure, axes = page.empty_page(
        source.title, "Restoring force against displacement", columns=2, width=7.6, panel=3.1
    )
    left, right = axes
    force_patterns.pattern_panels(left, right, harmonic, random, record.units)
    size = labels.quantity(amplitude, record.units["displacement"])
    page.letter(axes, (f"harmonic motion, {size} at {frequency:.3g} Hz", "random excitation"))
    page.shared_legend(figure, axes)
    return figure


def periodic_lines(source: Source, segments: spectra.Segments) -> Figure:
    """Autospectrum of a Mathieu system's response (Figure 8), its lines marked."""
    record, values = read_csv(source.record), read_model(source.model).numbers()
    natural = preliminary.natural_frequency(values)
    lines = preliminary.mathieu_lines(natural, values["periodic_stiffness.f_m"])
    figure, axes = page.empty_page(source.title, "Autospectrum of the displacement", panel=2.9, legend_rows=1)
    frequency, density = spectra.autospectrum(record["displacement"], record.dt, segments)
    force_patterns.autospectrum_panel(axes[0], frequency, density, record.units["displacement"], HIGHEST)
    force_patterns.frequency_marks(axes[0], lines)
    return figure


def force_history(source: Source, segments: spectra.Segments) -> Figure:
    """A stretch of the force as long as a segment, the report's subrecord, and its autospectrum (Figure 16)."""
    record = read_csv(source.record)
    figure, axes = page.empty_page(
        "Excitation", "Force history (segment) and autospectrum", rows=2, legend_rows=0, share=False
    )
    shown = record.part(0, segments.length)
    force_patterns.history_panel(axes[0], shown.time, shown["force"], "force", record.units["force"])
    frequency, density = spectra.autospectrum(record["force"], record.dt, segments)
    force_patterns.autospectrum_panel(axes[1], frequency, density, record.units["force"], float(frequency[-1]))
    page.letter(axes, ("history", "autospectrum"))
    return figure


def force_histogram(source: Source) -> Figure:
    """Histogram of the force (Figure 17)."""
    record = read_csv(source.record)
    figure, axes = page.empty_page("Excitation", "Histogram of the force", panel=2.7)
    distribution.histogram_panel(axes[0], preliminary.histogram(record["force"]), "force", record.units["force"])
    page.shared_legend(figure, axes)
    return figure


def draw_preliminary(
    source: Source, outputs: Mapping[str, Sequence[Path]], *, style: Path, segments: spectra.Segments
) -> None:
    """Draw figures of the preliminary analysis of a case.

    Parameters
    ----------
    source : Source
        The case.
    outputs : mapping
        For each of ``pattern, autospectrum, force_history, force_histogram`` that is wanted the files to
        write, PNG or SVG.
    style : Path
        The style sheet.
    segments : Segments
        Of the spectra.

    Raises
    ------
    StudyError
        If a kind of picture is asked for that there is not.
    """
    kinds = {
        "pattern": lambda: pattern(source),
        "autospectrum": lambda: periodic_lines(source, segments),
        "force_history": lambda: force_history(source, segments),
        "force_histogram": lambda: force_histogram(source),
    }
    page.write_each(kinds, outputs, style)
