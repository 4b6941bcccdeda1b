"""Snakemake step: records and models -> the figures of Section 3, and those of the force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import style as styles
from matplotlib.figure import Figure

from study import preliminary, spectra
from study.figures import distribution, labels, motion, page
from study.modelfile import read_model
from study.record import read_csv

HIGHEST = 10.0  # hertz, as in the figures of A_j
STRETCH = 512  # samples of the force that are shown: the report's subrecord


@dataclass(frozen=True)
class Source:
    """A case's files and its title."""

    record: Path
    model: Path
    title: str


def pattern(source: Source) -> Figure:
    """Restoring force against displacement (Figures 2 to 7): as large a harmonic motion as the random one."""
    record, model = read_csv(source.record), read_model(source.model)
    values = model.numbers()
    random = preliminary.random_pattern(record, values["m"])
    frequency = preliminary.natural_frequency(values)
    cycles = preliminary.closing_cycles(model, frequency)
    amplitude = float(np.abs(random.displacement).max())
    harmonic = preliminary.harmonic_pattern(model, amplitude, frequency, cycles)
    figure, axes = page.page(source.title, "Restoring force against displacement", columns=2, width=7.6, panel=3.1)
    left, right = axes
    motion.patterns(left, right, harmonic, random, record.units)
    size = labels.quantity(amplitude, record.units["displacement"])
    page.letter(axes, (f"harmonic motion, {size} at {frequency:.3g} Hz", "random excitation"))
    page.legend(figure, axes)
    return figure


def periodic_lines(source: Source, segments: spectra.Segments) -> Figure:
    """Autospectrum of a Mathieu system's response (Figure 8), its lines marked."""
    record, values = read_csv(source.record), read_model(source.model).numbers()
    natural = preliminary.natural_frequency(values)
    lines = preliminary.mathieu_lines(natural, values["periodic_stiffness.f_m"])
    figure, axes = page.page(source.title, "Autospectrum of the displacement", panel=2.9, legend_rows=1)
    frequency, density = spectra.autospectrum(record["displacement"], record.dt, segments)
    motion.autospectrum(axes[0], frequency, density, record.units["displacement"], HIGHEST)
    motion.marked(axes[0], lines)
    return figure


def force_history(source: Source, segments: spectra.Segments) -> Figure:
    """A stretch of the force and its autospectrum (Figure 16)."""
    record = read_csv(source.record)
    figure, axes = page.page(
        "Excitation", "Force history (segment) and autospectrum", rows=2, legend_rows=0, share=False
    )
    shown = record.part(0, STRETCH)
    motion.history(axes[0], shown.time, shown["force"], "force", record.units["force"])
    frequency, density = spectra.autospectrum(record["force"], record.dt, segments)
    motion.autospectrum(axes[1], frequency, density, record.units["force"], float(frequency[-1]))
    page.letter(axes, ("history", "autospectrum"))
    return figure


def force_histogram(source: Source) -> Figure:
    """Histogram of the force (Figure 17)."""
    record = read_csv(source.record)
    figure, axes = page.page("Excitation", "Histogram of the force", panel=2.7)
    distribution.histogram(axes[0], preliminary.histogram(record["force"]), "force", record.units["force"])
    page.legend(figure, axes)
    return figure


def draw(
    sources: Mapping[str, Source], outputs: Mapping[str, Sequence[Path]],
    *, style: Path, segments: Mapping[str, Any], periodic: str = "mathieu", force: str = "linear",
) -> None:  # fmt: skip
    """Draw the figures of the preliminary analysis.

    Parameters
    ----------
    sources : mapping
        The cases, by name.
    outputs : mapping
        Files to write (PNG or SVG): for a case's name its force/displacement patterns, for
        ``autospectrum, force_history, force_histogram`` those of the cases below.
    style : Path
        The style sheet.
    segments : mapping
        Length, overlap and window of the spectra.
    periodic, force : str
        The case whose response, and the case whose force, is shown.
    """
    cut = spectra.Segments(**segments)
    with styles.context(style):
        for kind, paths in outputs.items():
            match kind:
                case "autospectrum":
                    figure = periodic_lines(sources[periodic], cut)
                case "force_history":
                    figure = force_history(sources[force], cut)
                case "force_histogram":
                    figure = force_histogram(sources[force])
                case _:
                    figure = pattern(sources[kind])
            for path in paths:
                path.write_bytes(page.rendered(figure, path.suffix[1:]))


if "snakemake" in globals():
    step = globals()["snakemake"]
    rows = zip(step.params.cases, step.input.records, step.input.models, step.params.titles, strict=True)
    draw(
        {name: Source(Path(record), Path(model), title) for name, record, model, title in rows},
        {kind: [Path(p) for p in paths] for kind, paths in step.output.items()},
        style=Path(step.input.style), segments=step.params.segments,
    )  # fmt: skip
