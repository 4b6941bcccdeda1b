"""Recommendation 3: noise on force and response, every level of one with every level of the other.

Theory, where there is one. Least squares of noisy inputs tends to what the expected spectra give (``noisy_inputs``):
that is the bias of SI/SO and MI/SO. An estimator on a free run is driven by the measured force; the true one is that
times ``G_FF / (G_FF + G_nn)`` and a remainder that goes with neither, so every coefficient comes out too large by
``G_nn / G_FF``, and what is a ratio of coefficients does not. Several periods of one force have no bias.

Fits on a free run begin at the true coefficients: a search from nothing ends at the same minimum after twice as long.
"""

# Matplotlib leaves the **kwargs of its methods untyped, pandas what comes out of a mask or a group.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import stdtrit

from study.equations.model import Model
from study.equations.model_file import read_model
from study.figures import page
from study.figures.styles import look
from study.identify import estimators
from study.identify.estimators.base import Settings, named_parameters, true_parameters
from study.identify.frequency_domain.coefficients import fit_coefficients
from study.identify.frequency_domain.conditioned import analyse
from study.identify.frequency_domain.inputs import Input, reverse_inputs
from study.identify.frequency_domain.noisy_inputs import expected_spectra, with_force_noise
from study.records.excitation import displacement_noise, theoretical_autospectrum
from study.records.record import Record
from study.records.spectra import Segments, SpectralMatrix
from study.reproduction.cases import make_record
from study.reproduction.chapters.chapter import (
    Chapter,
    NoiseSettings,
    Tables,
    chance_bound,
    judges,
)
from study.reproduction.claims.judgement import Condition, explained
from study.reproduction.claims.reported import COEFFICIENTS, Reported
from study.reproduction.ensemble import NOISE_OFFSET
from study.reproduction.settings import ClaimSettings, RecordSettings
from study.support.cores import side_by_side
from study.support.document import Block, Text, table
from study.support.numbers import percent

BY_LEAST_SQUARES, ON_A_FREE_RUN = ("siso", "miso"), ("instrumental", "output_error")
PERIODIC = "errors_in_variables"
RANDOM, PERIODIC_FORCE = "random", "repeated"  # forces
CELL = ["force", "force_noise", "displacement_noise"]
BY_ESTIMATE = [*CELL, "estimator", "parameter"]
UNTOLD = (
    "the remainder of the true force, which the measured one does not tell, moves the mass as well: to the motion that "
    "the model follows, the cubic spring and damper add k and c in proportion to the remainder's own motion"
)


def make_noise(study: ClaimSettings, own: NoiseSettings, models: Path) -> Tables:
    """Bias, scatter and theory of every coefficient, estimator and pair of levels: one row each.

    ``bias`` and ``scatter`` are mean and standard deviation of the relative error over the seeds, ``predicted`` the
    mean standard error that the estimator itself gives, ``theory`` the bias that is to be expected, empty where there
    is no theory. ``rms`` is the root mean square error with its standard error. Beside it the best estimators of each
    pair of levels.
    """
    model = read_model(models / f"{own.system}.yaml")
    begun = replace(model, terms=tuple(entry.opened() for entry in model.terms))
    settings = Settings(study.segments.segments(), (study.fit_band[0], study.fit_band[1]), curves=False)

    def rows_of(asked: tuple[str, int]) -> list[dict[str, Any]]:
        force, seed = asked
        used = own.periodic_estimators if force == PERIODIC_FORCE else own.estimators
        if force == PERIODIC_FORCE and seed >= own.first_seed + own.free_runs:
            used = tuple(name for name in used if name not in ON_A_FREE_RUN)
        cells = _noisy_records(model, study, own, force, seed)
        return [
            {"force": force, "seed": seed, **row}
            for cell in cells
            for row in _found(model, begun, cell, settings, used)
        ]

    seeds = range(own.first_seed, own.first_seed + own.seeds)
    found = side_by_side(rows_of, list(product((RANDOM, PERIODIC_FORCE), seeds)))
    table = _over_seeds(pd.DataFrame([row for rows in found for row in rows]), true_parameters(model.values))
    return {"noise": table, "noise_best": best_estimators(table, own)}


@dataclass(frozen=True)
class _Noisy:
    """A record with noise on both sides, and what theory needs."""

    clean: Record
    noisy: Record
    force_noise: float
    displacement_noise: float
    attenuation: float  # G_nn / G_FF
    expected: Mapping[str, SpectralMatrix]  # of the noise on the displacement, by the estimator ``BY_LEAST_SQUARES``


def _noisy_records(
    model: Model, study: ClaimSettings, own: NoiseSettings, force: str, seed: int
) -> Iterator[_Noisy]:  # fmt: skip
    """One motion under every pair of levels; each pair has noise of its own, so that no two go wrong together."""
    excitation, level = (own.periodic, own.level) if force == PERIODIC_FORCE else (study.excitation, 1.0)
    drive = RecordSettings(
        case=f"{own.system} {force}", excitation=excitation, level=level, noise=0.0, sampling=study.sampling,
        integrator=study.integrator,
    )  # fmt: skip
    n, dt, periods = study.sampling.samples, study.sampling.dt, excitation.periods
    clean = replace(make_record(model, drive, seed=seed), period=n // periods if periods else None)
    lines = np.linspace(study.fit_band[0], study.fit_band[1], n // 64)
    density = theoretical_autospectrum(excitation.at_level(level), lines, n, dt)
    ratio = 2.0 * dt * float(np.mean(clean["force"] ** 2)) / float(np.mean(density))
    expected = {on_motion: _expected(model, clean, on_motion, study.segments.segments()) for on_motion in own.levels}
    for number, (on_force, on_motion) in enumerate(product(own.levels, repeat=2)):
        stream = NOISE_OFFSET + 2 * (seed * len(own.levels) ** 2 + number)
        changed = {
            channel: clean[channel] + displacement_noise(clean[channel], share, stream + side)
            for side, (channel, share) in enumerate((("force", on_force), ("displacement", on_motion)))
        }
        yield _Noisy(
            clean, clean.with_channels(changed), on_force, on_motion, on_force * ratio, expected[on_motion]
        )  # fmt: skip


def _expected(model: Model, clean: Record, on_motion: float, segments: Segments) -> dict[str, SpectralMatrix]:
    """Spectra that least squares sees in expectation, but for noise on the force, of which there is any beside it."""
    variance = on_motion * float(np.mean(clean["displacement"] ** 2))
    return {
        name: expected_spectra(_inputs_of(model, name), clean, variance, 0.0, segments) for name in BY_LEAST_SQUARES
    }


def _inputs_of(model: Model, estimator: str) -> list[Input]:
    return [i for i in reverse_inputs(model) if i.linear or estimator == "miso"]


def _found(
    model: Model, begun: Model, cell: _Noisy, settings: Settings, used: tuple[str, ...]
) -> Iterator[dict[str, Any]]:
    """Estimates of each parameter by each estimator, with what theory has them tend to; ``begun`` has the starts."""
    exact = true_parameters(model.values)
    for name in used:
        theory: Mapping[str, float] = {}
        if name in BY_LEAST_SQUARES:
            theory = _tends_to(model, cell, settings, name)
        elif name in ON_A_FREE_RUN:
            theory = {key: exact[key] * (1.0 + cell.attenuation * (key in COEFFICIENTS)) for key in exact}
        elif name == PERIODIC:
            theory = exact
        for p in estimators.identify(name, begun, cell.noisy, settings).parameters:
            if p.name in exact:
                yield {
                    "force_noise": cell.force_noise, "displacement_noise": cell.displacement_noise, "estimator": name,
                    "parameter": p.name, "estimate": p.value, "standard_error": p.error,
                    "theory": theory.get(p.name, math.nan),
                }  # fmt: skip


def _tends_to(model: Model, cell: _Noisy, settings: Settings, name: str) -> dict[str, float]:
    inputs, variance = _inputs_of(model, name), cell.force_noise * float(np.mean(cell.clean["force"] ** 2))
    matrix = with_force_noise(cell.expected[name], variance, cell.clean.dt)
    estimate = fit_coefficients(analyse(matrix), inputs, settings.band, settings.segments.line_inflation())
    return {p.name: p.value for p in named_parameters(estimate)}


def _over_seeds(found: pd.DataFrame, exact: Mapping[str, float]) -> pd.DataFrame:
    rows: list[dict[str, Any]] = []
    for key, group in found.groupby(BY_ESTIMATE, sort=False):
        true, count = exact[str(key[-1])], len(group)
        error = group["estimate"].to_numpy(dtype=np.float64) / true - 1.0
        scatter, squares = float(np.std(error, ddof=1)), error**2
        rms = math.sqrt(float(np.mean(squares)))
        rows.append({
            **dict(zip(BY_ESTIMATE, key, strict=True)), "true": true, "bias": float(np.mean(error)),
            "bias_error": scatter / math.sqrt(count), "scatter": scatter,
            "predicted": float(group["standard_error"].mean()) / true,
            "theory": float(group["theory"].mean()) / true - 1.0,
            "rms": rms, "rms_error": float(np.std(squares, ddof=1)) / (2.0 * rms * math.sqrt(count)), "seeds": count,
        })  # fmt: skip
    return pd.DataFrame(rows)


# ---- which estimator where


def worst_errors(table: pd.DataFrame) -> pd.DataFrame:
    """Of each record and estimator the coefficient that is farthest off: root mean square error and its own error."""
    own = table[table["parameter"].isin(COEFFICIENTS)]
    return own.loc[own.groupby([*CELL, "estimator"], sort=False)["rms"].idxmax()].reset_index(drop=True)


def best_estimators(table: pd.DataFrame, own: NoiseSettings) -> pd.DataFrame:
    """For each force and pair of levels the estimators whose worst coefficient is least off, ties together.

    Level with the best are those within ``tie`` standard errors of the difference, and all that are off by no more than
    the ``negligible``.
    """
    rows: list[dict[str, Any]] = []
    for key, group in worst_errors(table).groupby(CELL, sort=False):
        first = group.sort_values("rms").iloc[0]
        apart = (group["rms"] - first["rms"]) / np.hypot(group["rms_error"], first["rms_error"])
        level = group[(apart <= own.tie) | (group["rms"] <= own.negligible)].sort_values("rms")
        rows.append({**dict(zip(CELL, key, strict=True)), "best": " ".join(level["estimator"]), "rms": first["rms"]})
    return pd.DataFrame(rows)


# ---- claims


def _rows(
    tables: Tables, estimator: str, force: str = RANDOM, parameters: tuple[str, ...] = COEFFICIENTS
) -> pd.DataFrame:  # fmt: skip
    t = tables["noise"]
    return t[(t["estimator"] == estimator) & (t["force"] == force) & t["parameter"].isin(parameters)]


def _biases(rows: pd.DataFrame, allowed: float, *, unbiased: bool) -> Iterator[Condition]:
    """For each pair of levels: no bias differs from zero, or else from theory, by more than is allowed or chance makes.

    Chance is shared among all biases that are looked at.
    """
    limit = chance_bound(len(rows), float(rows["seeds"].iloc[0]) - 1.0)
    for (on_force, on_motion), group in rows.groupby(["force_noise", "displacement_noise"], sort=False):
        told = 0.0 * group["bias"] if unbiased else group["theory"]
        off = group["bias"] - told
        excess = off.abs() / np.maximum(limit * group["bias_error"], allowed)
        at = excess.idxmax()
        name, beside = group["parameter"][at], "" if not told[at] else f", theory {percent(told[at], '+.2g')}"
        yield Condition(
            f"{_pair(on_force, on_motion)}: every bias within {percent(allowed)} or {limit:.1f} standard errors of "
            f"{'zero' if unbiased else 'theory'}",
            f"{_pair(on_force, on_motion)}: {name} "
            f"{percent(group['bias'][at], '+.2g', group['bias_error'][at])}{beside}",
            bool(excess[at] <= 1.0),
        )  # fmt: skip


def _pair(on_force: Any, on_motion: Any) -> str:
    return f"{percent(on_force)} on force, {percent(on_motion)} on displacement"


def noise_k3_instrumental(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The issue's own example: 10 % on both sides."""
    level = expected.value("noise_k3_instrumental.level")
    rows = _rows(tables, "instrumental", parameters=("k3",))
    row = rows[(rows["force_noise"] == level) & (rows["displacement_noise"] == level)].iloc[0]
    share = expected.value("noise_k3_instrumental.interval")
    limit = float(stdtrit(row["seeds"] - 1.0, 0.5 + share / 2.0))
    yield Condition(
        f"mean error of k3 within its {percent(share)} interval, {limit:.1f} standard errors",
        f"k3 {percent(row['bias'], '+.2g', row['bias_error'])}, theory {percent(row['theory'], '+.2g')}",
        bool(abs(row["bias"]) <= limit * row["bias_error"]),
    )


def noise_instrumental(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The same of every coefficient: of one alone chance may hide what theory expects."""
    level, share = (expected.value(f"noise_k3_instrumental.{name}") for name in ("level", "interval"))
    rows = _rows(tables, "instrumental")
    for _, row in rows[(rows["force_noise"] == level) & (rows["displacement_noise"] == level)].iterrows():
        limit = float(stdtrit(row["seeds"] - 1.0, 0.5 + share / 2.0))
        yield Condition(
            f"mean error of {row['parameter']} within its {percent(share)} interval",
            f"{row['parameter']} {percent(row['bias'], '+.2g', row['bias_error'])}, theory "
            f"{percent(row['theory'], '+.2g')}",
            bool(abs(row["bias"]) <= limit * row["bias_error"]),
            because="the instrument runs under the measured force and goes with its noise: G_ZF has what G_ZX lacks",
        )


def noise_force_unbiased(tables: Tables, expected: Reported) -> list[Condition]:
    """MI/SO with noise on its output alone; its leakage, which is there without noise too, is within a tolerance."""
    rows = _rows(tables, "miso")
    rows = rows[(rows["displacement_noise"] == 0.0) & (rows["force_noise"] > 0.0)]
    because = "lines are weighted by errors that are estimated along with A_j(f), which goes with them"
    return explained(because, _biases(rows, expected.limit("noise_exact"), unbiased=True))


def noise_force_scatter(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The standard errors of MI/SO under noise on its output, over all coefficients together."""
    rows = _rows(tables, "miso")
    for level, group in rows[(rows["displacement_noise"] == 0.0) & (rows["force_noise"] > 0.0)].groupby("force_noise"):
        ratio = math.sqrt(float(np.mean((group["scatter"] / group["predicted"]) ** 2)))
        allowed = expected.limit("noise_scatter")
        label = f"{percent(cast(float, level))} on the force: scatter over standard error"
        yield Condition(
            f"{label} within {percent(allowed)} of one", f"{label} {ratio:.2f}", abs(ratio - 1.0) <= allowed
        )


def noise_bias_theory(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """MI/SO at every pair of levels."""
    return _biases(_rows(tables, "miso"), expected.limit("noise_theory"), unbiased=False)


def noise_free_run_unbiased(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Output error with noise on the response alone."""
    rows = _rows(tables, "output_error")
    rows = rows[(rows["force_noise"] == 0.0) & (rows["displacement_noise"] > 0.0)]
    return _biases(rows, expected.limit("noise_exact"), unbiased=True)


def noise_free_run_attenuated(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Output error with noise on the force alone, coefficient by coefficient, at the highest level."""
    rows = _rows(tables, "output_error")
    rows = rows[(rows["displacement_noise"] == 0.0) & (rows["force_noise"] == rows["force_noise"].max())]
    allowed, limit = expected.limit("noise_theory"), chance_bound(len(rows), float(rows["seeds"].iloc[0]) - 1.0)
    for _, row in rows.iterrows():
        off, bound = abs(row["bias"] - row["theory"]), max(allowed, limit * row["bias_error"])
        yield Condition(
            f"{row['parameter']} within {percent(allowed)} or {limit:.1f} standard errors of "
            f"{percent(row['theory'], '+.2g')}",
            f"{row['parameter']} {percent(row['bias'], '+.2g', row['bias_error'])}", bool(off <= bound),
            because=UNTOLD,
        )  # fmt: skip


def noise_free_run_ratios(tables: Tables, expected: Reported) -> list[Condition]:
    """Natural frequency and damping ratio, whose coefficients are too large together."""
    rows = _rows(tables, "output_error", parameters=("f_n", "zeta"))
    rows = rows[(rows["displacement_noise"] == 0.0) & (rows["force_noise"] > 0.0)]
    return explained(UNTOLD, _biases(rows, expected.limit("noise_theory"), unbiased=True))


def noise_repeated_unbiased(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Periods of one force at every pair of levels."""
    return _biases(_rows(tables, PERIODIC, PERIODIC_FORCE), expected.limit("noise_exact"), unbiased=True)


def noise_in_reverse_best(tables: Tables, _: Reported) -> Iterator[Condition]:
    """A quiet displacement: an analysis in reverse is best, or level with the best, whatever the force's noise."""
    best = tables["noise_best"]
    keep = (best["force"] == RANDOM) & (best["displacement_noise"] == 0.0) & (best["force_noise"] > 0.0)
    return _best(best[keep], ("miso", "local_polynomial"))


def noise_output_error_best(tables: Tables, _: Reported) -> Iterator[Condition]:
    """A quiet force and a noisy displacement."""
    best = tables["noise_best"]
    keep = (best["force"] == RANDOM) & (best["force_noise"] == 0.0) & (best["displacement_noise"] > 0.0)
    return _best(best[keep], ("output_error",))


def noise_repeated_best(tables: Tables, _: Reported) -> Iterator[Condition]:
    """Both noisy, and a force that repeats."""
    best = tables["noise_best"]
    keep = (best["force"] == PERIODIC_FORCE) & (best["force_noise"] > 0.0) & (best["displacement_noise"] > 0.0)
    return _best(best[keep], (PERIODIC,))


def _best(rows: pd.DataFrame, wanted: tuple[str, ...]) -> Iterator[Condition]:
    labels = " or ".join(look(name).label for name in wanted)
    for _, row in rows.iterrows():
        pair, names = _pair(row["force_noise"], row["displacement_noise"]), str(row["best"]).split()
        yield Condition(
            f"{pair}: {labels} best, or level with the best",
            f"{pair}: {', '.join(look(n).label for n in names)} ({percent(row['rms'], '.2g')})",
            bool(set(names) & set(wanted)),
        )


# ---- figures and words


def noise_map(tables: Tables) -> Figure:
    """The estimators whose worst coefficient is least off, by the noise on force and displacement."""
    worst, best = worst_errors(tables["noise"]), tables["noise_best"]
    names = {RANDOM: "a random force", PERIODIC_FORCE: "a force that repeats"}
    figure, axes = page.empty_page(
        "Which estimator for my noise",
        "those with the least root mean square error of the worst of m, c, k, k3, c3; several are level", columns=2,
        width=11.0, panel=4.4, legend_rows=0, share=False,
    )  # fmt: skip
    for panel, force in zip(axes, names, strict=True):
        _map_panel(panel, worst[worst["force"] == force], best[best["force"] == force])
    page.letter(axes, list(names.values()))
    return figure


def _map_panel(panel: Axes, worst: pd.DataFrame, best: pd.DataFrame) -> None:
    levels = sorted(best["force_noise"].unique())
    sizes = np.zeros((len(levels), len(levels)))
    for _, cell in best.iterrows():
        i, j = levels.index(cell["force_noise"]), levels.index(cell["displacement_noise"])
        own = worst[
            (worst["force_noise"] == cell["force_noise"]) & (worst["displacement_noise"] == cell["displacement_noise"])
        ].set_index("estimator")
        sizes[i, j] = cell["rms"]
        told = [f"{look(name).label}\n{_size(own.loc[name])}" for name in str(cell["best"]).split()]
        panel.text(j, i, "\n".join(told), ha="center", va="center", fontsize=6.5)
    panel.imshow(np.sqrt(sizes), cmap="Greys", vmin=0.0, vmax=1.2, origin="lower", aspect="auto")
    words = [percent(level) for level in levels]
    page.frame_cells(panel, words, words)
    panel.set_xlabel("noise on the displacement")
    panel.set_ylabel("noise on the force")


def _size(row: "pd.Series[Any]") -> str:
    return f"{percent(row['rms'], '.2g')} ({row['parameter']})" if row["rms"] >= 5e-5 else "below 0.01 %"


def noise_bias(tables: Tables) -> Figure:
    """Bias with the scatter of a record, by the noise on the displacement: a row a noise on the force."""
    own = tables["noise"][(tables["noise"]["force"] == RANDOM) & (tables["noise"]["estimator"] != "siso")]
    repeated = tables["noise"][tables["noise"]["estimator"] == PERIODIC]
    own, levels = pd.concat([own, repeated]), sorted(own["force_noise"].unique())
    shown = [levels[0], levels[-2]]
    used = list(dict.fromkeys(str(e) for e in own["estimator"]))
    figure, axes = page.empty_page(
        "Bias of each coefficient", "mean error with the scatter of one record; crosses: theory", rows=len(shown),
        columns=len(COEFFICIENTS), width=13.0, panel=2.4, legend_rows=1,
    )  # fmt: skip
    for place, panel in enumerate(axes):
        on_force, name = shown[place // len(COEFFICIENTS)], COEFFICIENTS[place % len(COEFFICIENTS)]
        rows = own[(own["force_noise"] == on_force) & (own["parameter"] == name)]
        for k, estimator in enumerate(used):
            _bias_marks(panel, rows[rows["estimator"] == estimator], estimator, k - (len(used) - 1) / 2.0)
        panel.set_xticks([100.0 * level for level in levels])
        panel.set_ylim(-70.0, 60.0)
        panel.axhline(0.0, color="0.6", linewidth=0.8)
        if place >= len(axes) - len(COEFFICIENTS):
            panel.set_xlabel("noise on displacement (%)")
        if place % len(COEFFICIENTS) == 0:
            panel.set_ylabel("error (%)")
    page.letter(axes, [f"{name}, {percent(on_force)} on the force" for on_force in shown for name in COEFFICIENTS])
    page.shared_legend(figure, axes, columns=len(used))
    return figure


def _bias_marks(panel: Axes, rows: pd.DataFrame, estimator: str, shift: float) -> None:
    shown, at = look(estimator), 100.0 * rows["displacement_noise"] + 0.6 * shift
    panel.errorbar(
        at, 100.0 * rows["bias"], 100.0 * rows["scatter"], fmt=BIAS_MARKERS.get(estimator, "v"), color=shown.colour,
        markersize=4.5, elinewidth=1.0, label=shown.label, markerfacecolor="white" if "in" in estimator[:2] else None,
    )  # fmt: skip
    panel.plot(at, 100.0 * rows["theory"], "x", color="black", markersize=4.5, zorder=6.0)


BIAS_MARKERS = {"miso": "s", "local_polynomial": "^", "instrumental": "D", "output_error": "o"}


def told_noise(tables: Tables) -> list[Block]:
    """The map in words: of every pair of levels the worst coefficient of each estimator."""
    worst = worst_errors(tables["noise"])
    used = list(dict.fromkeys(str(e) for e in worst["estimator"]))
    rows: list[list[str]] = []
    for (force, on_force, on_motion), group in worst.groupby(CELL, sort=False):
        cells = {str(r["estimator"]): _size(r) for _, r in group.iterrows()}
        least = min(group["rms"])
        best = {str(r["estimator"]) for _, r in group.iterrows() if r["rms"] == least}
        marked = [f"**{cells[e]}**" if e in best else cells.get(e, "") for e in used]
        rows.append([str(force), percent(cast(float, on_force)), percent(cast(float, on_motion)), *marked])
    said = (
        "**Which estimator for my noise.** Noise is the mean square on a channel over that of the channel. Each number "
        "is the root mean square error over the seeds of the coefficient (m, c, k, k3, c3) that is farthest off, the "
        "least of a row in bold. The record is as long as the report's; a force that repeats has eight periods in it, "
        "of which the first settles."
    )
    head = ("force", "noise on force", "noise on displacement", *(look(e).label for e in used))
    return [Text(said), table(head, rows)]


CHAPTER = Chapter(
    judges(
        noise_k3_instrumental, noise_instrumental, noise_force_unbiased, noise_force_scatter, noise_bias_theory,
        noise_free_run_unbiased,
        noise_free_run_attenuated, noise_free_run_ratios, noise_repeated_unbiased, noise_in_reverse_best,
        noise_output_error_best, noise_repeated_best,
    ),
    {"noise_map": noise_map, "noise_bias": noise_bias},
    told_noise,
    ("noise_k3_instrumental.level", "noise_k3_instrumental.interval", "limit.noise_exact", "limit.noise_theory",
     "limit.noise_scatter"),
    make=make_noise,
)  # fmt: skip
