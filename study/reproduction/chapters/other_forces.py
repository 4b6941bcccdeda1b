"""Recommendation 2: more complicated restoring and damping forces, with the right model and a wrong one.

What is asked of the wrong model is what its user would see: its coherence, whether its coefficients stay when the force
is changed, and what its free run leaves of the motion.
"""

# Matplotlib leaves the **kwargs of its methods untyped, pandas what comes out of a mask or a group.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from study.equations.model import Model, free
from study.equations.model_file import read_model
from study.equations.terms import LINEAR, get
from study.figures import page
from study.figures.labels import term_names
from study.identify.estimators.base import Settings
from study.identify.estimators.in_free_run import free_run_fit
from study.identify.estimators.in_reverse import miso
from study.identify.frequency_domain.conditioned import MisoResult
from study.records.record import Record
from study.reproduction import preliminary
from study.reproduction.cases import make_record
from study.reproduction.chapters.chapter import Chapter, ForcesSettings, Tables, judges
from study.reproduction.claims.judgement import Condition
from study.reproduction.claims.reported import Reported
from study.reproduction.settings import ClaimSettings, RecordSettings
from study.support.document import Block, Text, table
from study.support.numbers import percent

RIGHT, WRONG = "right", "wrong"
DRAWN_POINTS = 1500  # of a pattern that are drawn


def make_forces(study: ClaimSettings, own: ForcesSettings, models: Path) -> Tables:
    """Every system with both models: coherences, coefficients, what a free run leaves, and the patterns of the force.

    ``coherence`` and ``lowest`` are mean and least multiple coherence over the fit band, ``left`` what the free run of
    the fitted model leaves of the displacement, over its rms, ``change`` the largest relative change of a coefficient
    of MI/SO when the force is changed, over the coefficients that its standard errors tell from zero.
    """
    told: list[dict[str, Any]] = []
    values: list[dict[str, Any]] = []
    curves: list[pd.DataFrame] = []
    patterns: list[pd.DataFrame] = []
    settings = Settings(study.segments.segments(), (study.fit_band[0], study.fit_band[1]))
    for name, case in own.cases.items():
        truth = read_model(models / "forces" / f"{name}.yaml")
        first, *others = (_record(truth, study, own, level) for level in own.levels)
        patterns.append(_patterns(truth, first).assign(case=name))
        linear = replace(truth, terms=tuple(t for t in truth.terms if t.term.name in LINEAR))
        wrong = replace(linear, terms=(*linear.terms, *(free(get(term)) for term in case.wrong)))
        for which, model in ((RIGHT, truth), (WRONG, wrong)):
            found, (other,) = miso(model, first, settings), [miso(model, r, settings) for r in others]
            fit = free_run_fit(model.with_values(dict.fromkeys(model.values)), first)
            result = found.responses
            assert isinstance(result, MisoResult)
            keep = (result.frequency >= settings.band[0]) & (result.frequency <= settings.band[1])
            share = result.cumulative[-1][keep]
            curves.append(
                pd.DataFrame({"case": name, "model": which, "frequency": result.frequency[keep], "coherence": share})
            )
            later = {p.name: p.value for p in other.parameters}
            sure = [p for p in found.parameters if abs(p.value) > 3.0 * p.error]
            told.append({
                "case": name, "title": case.title, "model": which, "coherence": float(np.mean(share)),
                "lowest": float(np.min(share)), "left": fit.rms / float(np.std(first["displacement"])),
                "change": max(abs(later[p.name] / p.value - 1.0) for p in sure),
                "changes": max(sure, key=lambda p: abs(later[p.name] / p.value - 1.0)).name,
                "terms": " ".join(t.term.name for t in model.terms if t.term.name not in LINEAR),
                "note": "" if fit.converged else fit.message,
            })  # fmt: skip
            exact = truth.numbers()
            assert found.estimate is not None
            for estimator, estimate in (("miso", found.estimate), ("output_error", fit.estimate)):
                values += [
                    {"case": name, "model": which, "estimator": estimator, "parameter": key,
                     "true": exact.get(key, np.nan), "estimate": estimate[key], "standard_error": estimate.error(key)}
                    for key in estimate.symbols
                ]  # fmt: skip
    return {
        "forces": pd.DataFrame(told), "force_coefficients": pd.DataFrame(values),
        "force_coherences": pd.concat(curves, ignore_index=True),
        "force_patterns": pd.concat(patterns, ignore_index=True),
    }  # fmt: skip


def _record(truth: Model, study: ClaimSettings, own: ForcesSettings, level: float) -> Record:
    drive = RecordSettings(
        case=truth.name, excitation=study.excitation, level=level, noise=own.sensor_noise, sampling=study.sampling,
        integrator=study.integrator,
    )  # fmt: skip
    return make_record(truth, drive, seed=own.seed, noise_seed=own.seed)


def _patterns(truth: Model, record: Record) -> pd.DataFrame:
    """Restoring force over displacement under random excitation and, without a memory, under harmonic motion."""
    random = preliminary.random_pattern(record, truth.numbers()["m"])
    found = [
        pd.DataFrame({"motion": "random", "displacement": random.displacement, "force": random.force})[:DRAWN_POINTS]
    ]
    if not truth.states:
        harmonic = preliminary.harmonic_pattern(truth, *preliminary.harmonic_beside(truth, record))
        found.append(
            pd.DataFrame({"motion": "harmonic", "displacement": harmonic.displacement, "force": harmonic.force})
        )
    return pd.concat(found, ignore_index=True)


# ---- claims


def _by_case(tables: Tables, model: str) -> Iterator["pd.Series[Any]"]:
    t = tables["forces"]
    for _, row in t[t["model"] == model].iterrows():
        yield row


def _values(tables: Tables, estimator: str, allowed: float, because: str = "") -> Iterator[Condition]:
    """Of each system its own model: no coefficient, and no shape parameter that was left open, is farther off."""
    t = tables["force_coefficients"]
    own = t[(t["model"] == RIGHT) & (t["estimator"] == estimator)]
    for row in _by_case(tables, RIGHT):
        found = own[own["case"] == row["case"]].set_index("parameter")
        off = found["estimate"] / found["true"] - 1.0
        at = off.abs().idxmax()
        yield Condition(
            f"{row['title']}: every value within {percent(allowed)}",
            f"{row['title']}: {at} {percent(off[at], '+.2g', found['standard_error'][at] / abs(found['true'][at]))}",
            bool(abs(off[at]) <= allowed), because=because,
        )  # fmt: skip


def forces_in_reverse(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """MI/SO with the right model and its shape parameters known."""
    because = (
        "the sign of a velocity, and a peak of the friction that is narrower than a sample's change of velocity, are "
        "broader in frequency than the samples resolve"
    )
    return _values(tables, "miso", expected.limit("forces_value"), because)


def forces_free_run(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Output error with the right model, shape parameters open."""
    return _values(tables, "output_error", expected.limit("forces_value"))


def forces_coherence_right(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The right model's coherence."""
    limit = expected.limit("forces_coherence")
    for row in _by_case(tables, RIGHT):
        yield Condition(
            f"{row['title']}: mean multiple coherence at least {limit:g}", f"{row['title']}: {row['coherence']:.4f}",
            bool(row["coherence"] >= limit),
        )  # fmt: skip


def forces_coherence_wrong(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The wrong model's coherence."""
    limit = expected.limit("forces_coherence")
    for row in _by_case(tables, WRONG):
        yield Condition(
            f"{row['title']} as {_in_words(row['terms'])}: mean multiple coherence below {limit:g}",
            f"{row['title']} as {_in_words(row['terms'])}: {row['coherence']:.4f}", bool(row["coherence"] < limit),
            because="what is missing is a small part of the force, most of which mass, damper and spring explain",
        )  # fmt: skip


def forces_change(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Whether the wrong model gives itself away when the force is changed."""
    limit = expected.value("forces_change.change")
    for row in _by_case(tables, WRONG):
        yield Condition(
            f"{row['title']} as {_in_words(row['terms'])}: a coefficient changes by more than {percent(limit)}",
            f"{row['title']} as {_in_words(row['terms'])}: {row['changes']} by {percent(row['change'], '.2g')}",
            bool(row["change"] > limit),
            because="a force in proportion to |v| scales with the motion, so that nothing changes with the level",
        )


def forces_constant(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Whether the right model's coefficients stay."""
    limit = expected.value("forces_change.change")
    for row in _by_case(tables, RIGHT):
        yield Condition(
            f"{row['title']}: no coefficient changes by more than {percent(limit)}",
            f"{row['title']}: {row['changes']} by {percent(row['change'], '.2g')}", bool(row["change"] <= limit),
            because="MI/SO has friction and viscous damping mixed up by what the samples do not resolve",
        )  # fmt: skip


def forces_left(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """What the free runs leave."""
    times, right = expected.value("forces_left.times"), {r["case"]: r["left"] for r in _by_case(tables, RIGHT)}
    for row in _by_case(tables, WRONG):
        yield Condition(
            f"{row['title']} as {_in_words(row['terms'])}: left more than {times:g} times what the right model leaves",
            f"{row['title']} as {_in_words(row['terms'])}: {percent(row['left'])} where the right model leaves "
            f"{percent(right[row['case']])}", bool(row["left"] > times * right[row["case"]]),
            because="two laws of friction differ near rest alone, a small part of the time",
        )  # fmt: skip


def _in_words(terms: str) -> str:
    return term_names(terms.replace(" ", " and "))


# ---- figures and words


def _panels(tables: Tables, title: str, subtitle: str, legend: int) -> tuple[Figure, list[Any], list["pd.Series[Any]"]]:
    cases = list(_by_case(tables, RIGHT))
    figure, axes = page.empty_page(
        title, subtitle, rows=-(-len(cases) // 4), columns=4, width=12.6, panel=2.3, legend_rows=legend, share=False
    )
    for panel in axes[len(cases) :]:
        panel.set_axis_off()
    return figure, axes, cases


def force_patterns(tables: Tables) -> Figure:
    """Restoring force over displacement, as the report's Figures 2 to 8."""
    figure, axes, cases = _panels(
        tables, "More complicated forces", "restoring force against displacement, as the report's Figures 2 to 8", 1
    )
    for panel, case in zip(axes, cases, strict=False):
        for motion, rows in tables["force_patterns"].groupby("motion", sort=False):
            own = rows[rows["case"] == case["case"]]
            look = ("0.5", 0.4) if motion == "random" else ("C0", 1.6)
            panel.plot(
                1e3 * own["displacement"], own["force"], color=look[0], linewidth=look[1], label=f"{motion} motion"
            )
        panel.set_xlabel("displacement (mm)")
    for panel in axes[::4]:
        panel.set_ylabel("force (N)")
    page.letter(axes[: len(cases)], [str(case["title"]) for case in cases])
    page.shared_legend(figure, axes)
    return figure


def force_coherences(tables: Tables) -> Figure:
    """Multiple coherence of the right model and of the wrong one."""
    figure, axes, cases = _panels(tables, "What the coherence says of a wrong model", "multiple coherence of MI/SO", 1)
    wrong = {row["case"]: row for row in _by_case(tables, WRONG)}
    lines = {RIGHT: ("C0", "-"), WRONG: ("C1", (0, (5.0, 2.0)))}
    for panel, case in zip(axes, cases, strict=False):
        for which, (colour, dash) in lines.items():
            t = tables["force_coherences"]
            own = t[(t["case"] == case["case"]) & (t["model"] == which)]
            panel.plot(
                own["frequency"], own["coherence"], color=colour, linestyle=dash, linewidth=1.4, label=f"{which} model"
            )
        panel.set_ylim(0.85, 1.003)
        panel.set_xlabel("frequency (Hz)")
        words = _in_words(wrong[case["case"]]["terms"]).replace(" and ", "\nand ")
        panel.text(0.97, 0.06, f"wrong: {words}", transform=panel.transAxes, ha="right", fontsize=7.0)
    for panel in axes[::4]:
        panel.set_ylabel("coherence")
    page.letter(axes[: len(cases)], [str(case["title"]) for case in cases])
    page.shared_legend(figure, axes)
    return figure


def told_forces(tables: Tables) -> list[Block]:
    """Right beside wrong, system by system."""
    wrong = {row["case"]: row for row in _by_case(tables, WRONG)}
    rows: list[list[str]] = []
    for right in _by_case(tables, RIGHT):
        other = wrong[right["case"]]
        for row, model in ((right, "its own"), (other, _in_words(other["terms"]))):
            change = f"{percent(row['change'], '.2g')} ({row['changes']})"
            rows.append([
                str(row["title"]), model, f"{row['coherence']:.4f}", f"{row['lowest']:.3f}", percent(row["left"]),
                change,
            ])  # fmt: skip
    said = (
        "Each system with its own terms and with others in their place: mean and least multiple coherence over the fit "
        "band, what the free run of the fitted model leaves of the displacement (the sensor's noise is 1 %), and the "
        "largest change of a coefficient of MI/SO when the force is halved."
    )
    head = ("system", "model", "coherence", "least", "left by a free run", "largest change")
    return [Text(said), table(head, rows)]


CHAPTER = Chapter(
    judges(
        forces_in_reverse, forces_free_run, forces_coherence_right, forces_coherence_wrong, forces_change,
        forces_constant, forces_left,
    ),
    {"force_patterns": force_patterns, "force_coherences": force_coherences},
    told_forces,
    ("limit.forces_value", "limit.forces_coherence", "forces_change.change", "forces_left.times"),
    make=make_forces,
)  # fmt: skip
