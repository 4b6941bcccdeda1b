"""Recommendation 1: forces with other spectra on all seven systems, and where the method breaks down.

Every force goes through every system without noise and with that of a good sensor; bands of noise about the natural
frequency grow narrower. Without noise what is left of an error is leakage, a band that drives too little, or a path
that its neighbour imitates. How near the breakdown is, without knowing the truth: the multiple coherence, the share of
each input that the other inputs do not determine, and the standard errors.
"""

# Matplotlib leaves the **kwargs of its methods untyped, pandas what comes out of a mask or a group.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.equations.model import Model
from study.equations.model_file import read_model
from study.figures import page
from study.figures.labels import term_names
from study.figures.styles import look
from study.identify import estimators
from study.identify.estimators.base import Identified, Settings, true_parameters
from study.identify.estimators.in_reverse import identify_spectra, reverse_spectra
from study.identify.frequency_domain.coefficients import independent_share
from study.identify.frequency_domain.conditioned import MisoResult, analyse
from study.identify.frequency_domain.inputs import reverse_inputs
from study.records.excitation import displacement_noise
from study.records.record import Record
from study.records.spectra import SpectralMatrix
from study.reproduction.cases import make_record
from study.reproduction.chapters.chapter import Chapter, DrivenSettings, Tables, judges
from study.reproduction.claims.judgement import Condition, explained
from study.reproduction.claims.reported import COMBINED, SYSTEMS, Reported
from study.reproduction.ensemble import NOISE_OFFSET
from study.reproduction.settings import AllowedErrors, ClaimSettings, ExcitationSettings, RecordSettings
from study.reproduction.tables import judge_estimate
from study.support.cores import side_by_side
from study.support.document import Block, Text, table
from study.support.errors import DivergenceError, StudyError
from study.support.numbers import percent

DRIVEN_LINES = "miso_driven_lines"
REVERSE_ESTIMATORS = ("miso", DRIVEN_LINES, "local_polynomial")
LABELS = {DRIVEN_LINES: "MI/SO, driven lines"}
FORCE_NAMES = {
    "report": "report's noise", "calm": "slight sea", "moderate": "moderate sea", "rough": "rough sea",
    "multisine": "multisine", "sweep": "swept sine", "stepped": "stepped sine", "blows": "blows",
}  # fmt: skip
OCTAVES = "octaves"  # ends the names of forces that are bands of noise
SEAS = ("calm", "moderate", "rough")
WITHOUT_FORCE = (
    "lines without a force hold what segments leak from those with one, and their small residual gives them the "
    "largest weight: a mass of zero explains them best"
)
Driven = tuple[str, ExcitationSettings, float]  # a force: its name, its settings, its mean square


def make_excitations(study: ClaimSettings, own: DrivenSettings, models: Path) -> Tables:
    """Every system under every force, without noise and with a sensor's: one row a parameter and estimator.

    ``over_tolerance`` is the size of the error over the tolerance of Part I, ``surprise`` the same over the standard
    error, ``over_good`` over an error that many a user would take, ``width`` that of a band in octaves. Of MI/SO,
    ``coherence`` is the mean multiple coherence over the fit band,
    ``independent`` the median over its lines of the smallest share of an input that the others do not determine, and
    ``driven`` the share of lines with a force.
    """
    seeds = range(own.first_seed, own.first_seed + own.seeds)
    asked = [(system, driven, seed) for system in SYSTEMS for driven in _forces(study, own) for seed in seeds]
    every = {system: read_model(models / f"{system}.yaml") for system in SYSTEMS}
    found = list(side_by_side(lambda one: _of_record(one[0], every[one[0]], study, own, *one[1:]), asked))
    return {"excitations": pd.DataFrame([row for rows in found for row in rows])}


def _forces(study: ClaimSettings, own: DrivenSettings) -> Iterator[Driven]:
    yield "report", study.excitation, 1.0
    for name, excitation in own.forces.items():
        yield name, excitation, own.levels.get(name, own.level)
    for width in own.widths:
        half = 2.0 ** (width / 2.0)
        ends = {"start_frequency": own.centre / half, "stop_frequency": own.centre * half}
        yield f"{width:g} {OCTAVES}", ExcitationSettings(kind="gaussian_band", **ends), own.level


def _of_record(
    system: str, model: Model, study: ClaimSettings, own: DrivenSettings, driven: Driven, seed: int
) -> list[dict[str, Any]]:  # fmt: skip
    name, excitation, level = driven
    drive = RecordSettings(
        case=system, excitation=excitation, level=level, noise=0.0, sampling=study.sampling,
        integrator=study.integrator,
    )  # fmt: skip
    clean, rows = make_record(model, drive, seed=seed), list[dict[str, Any]]()
    for noise in (0.0, own.sensor_noise):
        motion = clean["displacement"]
        record = clean.with_channels(
            {"displacement": motion + displacement_noise(motion, noise, NOISE_OFFSET + seed)}
        ) if noise else clean  # fmt: skip
        # A free run takes ten times as long; without noise it is off by its integrator's error alone.
        free = ("output_error",) if seed == own.first_seed else ()
        used = ("miso", DRIVEN_LINES, *free) if noise else ("siso", *REVERSE_ESTIMATORS)
        about = {
            "system": system, "force": name, "width": float(name.split()[0]) if name.endswith(OCTAVES) else np.nan,
            "noise": noise, "seed": seed,
        }  # fmt: skip
        rows += [{**about, **row} for row in _estimates(model, record, study, own, used)]
    return rows


def _estimates(
    model: Model, record: Record, study: ClaimSettings, own: DrivenSettings, used: Sequence[str]
) -> Iterator[dict[str, Any]]:  # fmt: skip
    exact = true_parameters(model.values)
    allowed = AllowedErrors(
        relative={**study.tolerances.relative, **study.tolerances.of_case.get(record.name, {})},
        absolute=study.tolerances.absolute,
    )  # fmt: skip
    settings = Settings(study.segments.segments(), (study.fit_band[0], study.fit_band[1]), curves=False)
    matrix = reverse_spectra(reverse_inputs(model), record, settings.segments)
    result = analyse(matrix)
    for estimator in used:
        try:
            found = _identified(estimator, model, record, settings, matrix, result, own.driven)
        except (DivergenceError, StudyError):  # too few lines, or a fit that leaves the range of numbers
            yield {
                "estimator": estimator,
                "parameter": "",
                "over_tolerance": np.inf,
                "over_good": np.inf,
                "surprise": np.inf,
            }
            continue
        seen = _seen(result, matrix, settings, own.driven) if estimator == "miso" else {}
        for p in found.parameters:
            if p.name not in exact:
                continue  # a system without stiffness has neither f_n nor zeta
            true = exact[p.name]
            judged = judge_estimate(p.name, true, p.value, allowed)
            size = abs(judged["relative_error"] if true else p.value)
            yield {
                "estimator": estimator, "parameter": p.name, "true": true, "estimate": p.value,
                "standard_error": p.error, "relative_error": judged["relative_error"],
                "over_tolerance": size / judged["tolerance"], "over_good": size / own.good if true else np.nan,
                "surprise": abs(p.value - true) / p.error if p.error > 0.0 else np.nan, **seen,
            }  # fmt: skip


def _identified(
    estimator: str, model: Model, record: Record, settings: Settings, matrix: SpectralMatrix, result: MisoResult,
    least: float,
) -> Identified:  # fmt: skip
    """What an estimator finds; ``result`` is the analysis of the record's spectra that MI/SO of any lines rests on."""
    if estimator == DRIVEN_LINES:
        settings = replace(settings, band=_driven_band(matrix, settings, least))
    if estimator in ("miso", DRIVEN_LINES):
        return identify_spectra(reverse_inputs(model), result, settings)
    if estimator == "output_error":  # begun at the truth, as a search ends there too
        model = replace(model, terms=tuple(entry.opened() for entry in model.terms))
    return estimators.identify(estimator, model, record, settings)


def _driven_band(matrix: SpectralMatrix, settings: Settings, least: float) -> tuple[float, float]:
    """From the first line of the fit band that the force drives to the last, in hertz."""
    frequency, density = matrix.frequency, matrix.density[:, -1, -1].real
    inside = frequency[(density > least * np.max(density)) & (frequency > 0.0)]
    return max(settings.band[0], float(inside[0])), min(settings.band[1], float(inside[-1]))


def _seen(result: MisoResult, matrix: SpectralMatrix, settings: Settings, least: float) -> dict[str, float]:
    """What a user sees of a record's excitation, the truth unknown."""
    keep = (result.frequency >= settings.band[0]) & (result.frequency <= settings.band[1])
    force = matrix.density[:, -1, -1].real
    return {
        "coherence": float(np.mean(result.cumulative[-1][keep])),
        "independent": float(np.median(np.min(independent_share(result, matrix)[keep], axis=1))),
        "driven": float(np.mean(force[keep] > least * np.max(force))),
    }


# ---- claims


def worst_by_system(table: pd.DataFrame) -> pd.DataFrame:
    """Of each system, force, noise and estimator the parameter that is farthest off its tolerance, over the seeds."""
    keys = ["system", "force", "noise", "estimator"]
    return table.loc[table.groupby(keys, sort=False)["over_tolerance"].idxmax()].reset_index(drop=True)


def _recovered(
    tables: Tables, estimator: str, forces: Sequence[str], *, noisy: bool = False
) -> Iterator[Condition]:  # fmt: skip
    """For every force and system: no parameter is beyond its tolerance of Part I."""
    worst = worst_by_system(tables["excitations"])
    own = worst[(worst["estimator"] == estimator) & ((worst["noise"] > 0.0) == noisy)]
    for name in forces:
        rows = own[own["force"] == name]
        failed = rows[~(rows["over_tolerance"] <= 1.0)]
        words = _words(name)
        at = rows.sort_values("over_tolerance").iloc[-1]
        most = f"most {at['parameter']} of {named(str(at['system']))}, {ratio(at['over_tolerance'])} its tolerance"
        yield Condition(
            f"{words}: every parameter of all {len(rows)} systems within its tolerance",
            f"{words}: {len(rows) - len(failed)} of {len(rows)} systems, {most}", failed.empty,
        )  # fmt: skip


def named(system: str) -> str:
    """A system as a table or a picture has room for it."""
    return "combined" if system == COMBINED else term_names(system)


def ratio(value: float) -> str:
    """A multiple with two digits: ``0.23 times``."""
    return f"{value:.2g} times" if value < 99.5 else f"{value:.0f} times" if np.isfinite(value) else "no estimate"


def spectra_seas(tables: Tables, _: Reported) -> list[Condition]:
    """Three seas of one family."""
    return explained(WITHOUT_FORCE, _recovered(tables, "miso", SEAS))


def spectra_seas_driven(tables: Tables, _: Reported) -> Iterator[Condition]:
    """The same, fitted to the lines that the force drives."""
    return _recovered(tables, DRIVEN_LINES, SEAS)


def spectra_multisine(tables: Tables, _: Reported) -> Iterator[Condition]:
    """A multisine over the report's band."""
    return _recovered(tables, "miso", ("multisine",))


def spectra_sines(tables: Tables, _: Reported) -> list[Condition]:
    """One frequency after the other: within a segment there is hardly more than one."""
    because = "a segment sees a frequency come or go, which no average makes stationary: leakage of the sweep"
    return explained(because, _recovered(tables, "miso", ("sweep", "stepped")))


def spectra_blows(tables: Tables, _: Reported) -> list[Condition]:
    """A hammer."""
    because = "the motion dies away between blows, and segments cut through decays: leakage of free vibration"
    return explained(because, _recovered(tables, "miso", ("blows",)))


def spectra_without_leakage(tables: Tables, _: Reported) -> Iterator[Condition]:
    """One transform of the whole record, its leakage estimated along, under forces that drive the whole fit band."""
    return _recovered(tables, "local_polynomial", ("multisine", "sweep", "stepped", "blows"))


def spectra_bands(tables: Tables, _: Reported) -> list[Condition]:
    """Bands of noise in which MI/SO is fitted to the lines that are driven."""
    because = (
        "within a narrow band u^3 is nearly a multiple of u and m (2 pi f)^2 nearly a constant: what one path has, the "
        "other may take, and leakage decides"
    )
    return explained(because, _recovered(tables, DRIVEN_LINES, _bands(tables)))


def spectra_output_error(tables: Tables, _: Reported) -> Iterator[Condition]:
    """A free run under every force, the sensor's noise on the displacement."""
    return _recovered(tables, "output_error", tuple(FORCE_NAMES), noisy=True)


def spectra_bands_output_error(tables: Tables, _: Reported) -> Iterator[Condition]:
    """A free run in bands that grow narrower."""
    return _recovered(tables, "output_error", _bands(tables), noisy=True)


def _bands(tables: Tables) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(f) for f in tables["excitations"]["force"] if str(f).endswith(OCTAVES)))


def _far_off(tables: Tables, expected: Reported) -> pd.DataFrame:
    """MI/SO where it breaks down: worst parameters beyond so many tolerances."""
    worst = worst_by_system(tables["excitations"])
    return worst[(worst["estimator"] == "miso") & (worst["over_tolerance"] > expected.limit("spectra_broken"))]


def spectra_coherence_warns(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Whether the coherence shows a breakdown, force by force."""
    limit = expected.value("spectra_coherence_warns.coherence")
    for name, rows in _far_off(tables, expected).groupby("force", sort=False):
        at = rows.sort_values("coherence").iloc[-1]
        words = _words(str(name))
        yield Condition(
            f"{words}: multiple coherence below {limit:g} wherever MI/SO breaks down",
            f"{words}: highest {at['coherence']:.4f} ({named(str(at['system']))}, {at['parameter']} off by "
            f"{ratio(at['over_tolerance'])} its tolerance)",
            bool(at["coherence"] < limit), because="leakage of a sweep or a decay is coherent with what it leaks from",
        )  # fmt: skip


def spectra_error_warns(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Whether the standard error shows it."""
    limit = expected.value("spectra_error_warns.errors")
    for name, rows in _far_off(tables, expected).groupby("force", sort=False):
        at = rows.sort_values("surprise").iloc[-1]
        words = _words(str(name))
        yield Condition(
            f"{words}: the error of the worst parameter within {limit:g} standard errors wherever MI/SO breaks down",
            f"{words}: {at['surprise']:.2g} ({named(str(at['system']))}, {at['parameter']})",
            bool(at["surprise"] <= limit),
            because="the standard errors are those of noise, and this is leakage or bias",
        )  # fmt: skip


def spectra_siso_changes(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The linear stiffness of the Duffing system by the ordinary analysis, force by force."""
    t = tables["excitations"]
    rows = t[(t["system"] == "duffing") & (t["estimator"] == "siso") & (t["parameter"] == "k") & t["width"].isna()]
    own = rows.groupby("force", sort=False)["estimate"].mean()
    share = (own.max() - own.min()) / abs(own.mean())
    allowed = expected.value("spectra_siso_changes.change")
    yield Condition(
        f"k of the forces differs by more than {percent(allowed)} of its mean",
        f"k from {own.min():.4g} ({FORCE_NAMES[str(own.idxmin())]}) to "
        f"{own.max():.4g} N/m ({FORCE_NAMES[str(own.idxmax())]})",
        bool(share > allowed),
    )


# ---- figures and words


def spectra_map(tables: Tables) -> Figure:
    """The worst parameter of every force and system, in tolerances, by each estimator."""
    worst = worst_by_system(tables["excitations"])
    panels = [("miso", False), (DRIVEN_LINES, False), ("local_polynomial", False), ("output_error", True)]
    forces = [*FORCE_NAMES, *_bands(tables)]
    figure, axes = page.empty_page(
        "Forces with other spectra",
        "error of the worst parameter over its tolerance; above 1 it is not recovered", rows=2, columns=2, width=13.0,
        panel=4.4, legend_rows=0, share=False,
    )  # fmt: skip
    figure.subplots_adjust(left=0.11, bottom=0.08, top=0.92, wspace=0.3, hspace=0.3)
    for panel, (estimator, noisy) in zip(axes, panels, strict=True):
        own = worst[(worst["estimator"] == estimator) & ((worst["noise"] > 0.0) == noisy)]
        _map_of(panel, own.pivot_table(index="force", columns="system", values="over_tolerance", sort=False), forces)
    page.letter(
        axes, [_label(e) + (", 1 % noise on the displacement" if noisy else ", no noise") for e, noisy in panels]
    )
    return figure


def _label(estimator: str) -> str:
    return LABELS.get(estimator) or look(estimator).label


def _map_of(panel: Axes, values: pd.DataFrame, forces: Sequence[str]) -> None:
    cells = values.reindex(index=list(forces), columns=list(SYSTEMS)).to_numpy(dtype=np.float64)
    shade = np.clip(np.log10(np.where(np.isfinite(cells), np.maximum(cells, 1e-2), 1e3)), -1.0, 3.0)
    panel.imshow(shade, cmap="Greys", vmin=-1.0, vmax=5.0, aspect="auto")
    for (i, j), value in np.ndenumerate(cells):
        words = (
            "none"
            if not np.isfinite(value)
            else "<0.01"
            if value < 0.01
            else f"{value:.2g}"
            if value < 99.5
            else f"{value:.0f}"
        )
        weight = "bold" if not value <= 1.0 else "normal"
        panel.text(j, i, words, ha="center", va="center", fontsize=7.5, fontweight=weight)
    page.frame_cells(panel, [_words(f) for f in forces], [named(s) for s in SYSTEMS], 30.0)


def spectra_bands_figure(tables: Tables) -> Figure:
    """The worst parameter against the width of the band, by system."""
    worst = worst_by_system(tables["excitations"][tables["excitations"]["width"].notna()])
    shown = (("miso", "s"), (DRIVEN_LINES, "v"), ("output_error", "o"))
    figure, axes = page.empty_page(
        "How narrow may my band be", "1 % noise on the displacement; worst parameter over its tolerance", rows=2,
        columns=4, width=12.0, panel=2.4, legend_rows=1, share=False,
    )  # fmt: skip
    widths = sorted(worst["width"].unique())
    for panel, system in zip(axes, SYSTEMS, strict=False):
        for estimator, marker in shown:
            own = worst[(worst["system"] == system) & (worst["estimator"] == estimator) & (worst["noise"] > 0.0)]
            line = look(estimator)
            values = np.where(np.isfinite(own["over_tolerance"]), own["over_tolerance"], np.nan)
            panel.plot(own["width"], values, marker=marker, markersize=4.5, linestyle=line.dash, color=line.colour,
                       linewidth=1.2, label=_label(estimator))  # fmt: skip
        panel.axhline(1.0, color="black", linewidth=0.9)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_ylim(3e-3, 3e4)
        panel.set_xticks(widths, [f"{width:g}" for width in widths])
        panel.minorticks_off()
        panel.set_xlabel("band about 3 Hz (octaves)")
    for panel in axes[::4]:
        panel.set_ylabel("error over tolerance")
    axes[-1].set_axis_off()
    page.letter(axes[:-1], [named(system) for system in SYSTEMS])
    page.shared_legend(figure, axes[:-1], columns=len(shown))
    return figure


def told_excitations(tables: Tables) -> list[Block]:
    """How narrow a band may be, and how far every force is from a breakdown."""
    found, worst = tables["excitations"], worst_by_system(tables["excitations"])
    rows: list[list[str]] = []
    for system in SYSTEMS:
        own = found[(found["system"] == system) & found["width"].notna()]
        cells = [_narrowest(own[(own["estimator"] == e) & ((own["noise"] > 0.0) == n)]) for e, n in NARROWED]
        rows.append([named(system), *cells])
    noise = percent(float(np.sqrt(found["noise"].max())))
    said = (
        "**How narrow may my band be.** In octaves about the natural frequency, the narrowest band of noise, of those "
        "tried, in which and in all wider ones every parameter is within its tolerance of Part I, and after the stroke "
        f"within 5 %; none where the widest of {found['width'].max():g} octaves (0.75 to 12 Hz) is too narrow already. "
        f"The report's force reaches from zero to 12.5 Hz. Noise is {noise} of the displacement's rms. MI/SO on driven "
        "lines is fitted to lines with a force alone."
    )
    near = (
        "**How near a breakdown is.** What MI/SO shows without the truth: mean multiple coherence over the fit band, "
        "the share of lines that the force drives, and the smallest share of an input that the others do not determine "
        "(median over the lines). Beside them the error of the worst parameter, in tolerances."
    )
    miso = worst[(worst["estimator"] == "miso") & (worst["noise"] == 0.0)]
    seen = [
        [_words(str(r["force"])), named(str(r["system"])), f"{r['coherence']:.4f}", percent(r["driven"]),
         percent(r["independent"]), f"{r['over_tolerance']:.3g} ({r['parameter']})"]
        for _, r in miso.iterrows()
    ]  # fmt: skip
    heads = [f"{_label(e)}, {'with noise' if n else 'without'}" for e, n in NARROWED]
    return [
        Text(said), table(("system", *heads), rows), Text(near),
        table(("force", "system", "coherence", "driven lines", "independent", "error over tolerance"), seen),
    ]  # fmt: skip


NARROWED = (
    ("miso", False),
    (DRIVEN_LINES, False),
    ("local_polynomial", False),
    (DRIVEN_LINES, True),
    ("output_error", True),
)


def _narrowest(rows: pd.DataFrame) -> str:
    """In tolerance, and good: of each the narrowest band down to which it holds."""
    reached = {"over_tolerance": "none", "over_good": "none"}
    for column in reached:
        for width, worst in sorted(rows.groupby("width")[column].max().items(), reverse=True):
            if not worst <= 1.0:
                break
            reached[column] = f"{width:g}"
    return " / ".join(reached.values())


def _words(force: str) -> str:
    return FORCE_NAMES.get(force) or f"{force.split()[0]}-octave noise"


CHAPTER = Chapter(
    judges(
        spectra_seas, spectra_seas_driven, spectra_multisine, spectra_sines, spectra_blows, spectra_without_leakage,
        spectra_bands, spectra_output_error, spectra_bands_output_error, spectra_coherence_warns, spectra_error_warns,
        spectra_siso_changes,
    ),
    {"spectra_map": spectra_map, "spectra_bands": spectra_bands_figure},
    told_excitations,
    ("limit.spectra_broken", "spectra_coherence_warns.coherence", "spectra_error_warns.errors",
     "spectra_siso_changes.change"),
    make=make_excitations,
)  # fmt: skip
