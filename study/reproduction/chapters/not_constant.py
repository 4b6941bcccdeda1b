"""Recommendation 6: coefficients that are not constant.

A coefficient that varies in a known way is one more input of the reverse system: the motion times what it varies with,
time or a measured channel. Where the way has a parameter that nobody knows, the frequency of a Mathieu system or the
moment of a step, that is found from the record: by a fit in free run, or by trying moments.
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

from study.equations.formulas import ExpressionError
from study.equations.model import Model
from study.equations.model_file import parse_model, read_model
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LINEAR
from study.figures import page
from study.identify.estimators.base import Settings, true_parameters
from study.identify.estimators.in_free_run import free_run_fit, miso_free_shape
from study.identify.estimators.in_reverse import miso
from study.identify.frequency_domain.conditioned import MisoResult
from study.records.excitation import displacement_noise, force
from study.records.record import Record
from study.reproduction.chapters.chapter import Chapter, Tables, VaryingSettings, judges
from study.reproduction.claims.judgement import Condition
from study.reproduction.claims.reported import Reported
from study.reproduction.settings import ClaimSettings
from study.support.document import Block, Text, table
from study.support.numbers import percent

CONSTANT, VARYING = "constant", "varying"
SCHEDULING = "support"  # that a stiffness follows, as a test would move it: slowly, and back


def make_varying(study: ClaimSettings, own: VaryingSettings, models: Path) -> Tables:
    """Every system with its own model and with constant coefficients, the Mathieu system, and the moment of a step.

    ``coherence`` is the mean multiple coherence over the fit band, ``left`` what a free run leaves of the displacement
    over its rms. Of the step, ``cost`` is what MI/SO leaves of the force when it is put at each of the moments tried.
    """
    told: list[dict[str, Any]] = []
    values: list[dict[str, Any]] = []
    settings = Settings(study.segments.segments(), (study.fit_band[0], study.fit_band[1]))
    for name, title in own.cases.items():
        truth = read_model(models / "varying" / f"{name}.yaml")
        record = _record(truth, study, own, own.seed)
        linear = replace(truth, terms=tuple(t for t in truth.terms if t.term.name in LINEAR))
        for which, model in ((VARYING, truth), (CONSTANT, linear)):
            found = miso(model, record, settings)
            fit = free_run_fit(model.with_values(dict.fromkeys(model.values)), record)
            told.append({
                "case": name, "title": title, "model": which, "coherence": _coherence(found.responses, settings),
                "left": fit.rms / float(np.std(record["displacement"])), "note": "" if fit.converged else fit.message,
            })  # fmt: skip
            assert found.estimate is not None
            values += [
                {"case": name, "title": title, "model": which, "estimator": estimator, "parameter": key,
                 "true": truth.numbers()[key], "estimate": e[key], "standard_error": e.error(key)}
                for estimator, e in (("miso", found.estimate), ("output_error", fit.estimate)) for key in e.symbols
            ]  # fmt: skip
    return {
        "varying": pd.DataFrame(told), "varying_values": pd.DataFrame(values),
        "mathieu": _mathieu(study, own, models, settings), "moments": _moments(study, own, models, settings),
    }  # fmt: skip


def _record(truth: Model, study: ClaimSettings, own: VaryingSettings, seed: int) -> Record:
    """The motion under the report's force with a sensor's noise; a channel that a formula names goes there and back."""
    n, dt = study.sampling.samples, study.sampling.dt
    drive = force(study.excitation.at_level(1.0), n, dt, seed)
    channels = {SCHEDULING: np.sin(np.pi * np.arange(n) / n) ** 2} if SCHEDULING in truth.channels else {}
    integrator = Integrator(**study.integrator.model_dump())
    record = simulate(truth, drive, dt, integrator, extra=channels)
    motion = record["displacement"]
    return record.with_channels({"displacement": motion + displacement_noise(motion, own.sensor_noise, seed)})


def _coherence(result: Any, settings: Settings) -> float:
    assert isinstance(result, MisoResult)
    keep = (result.frequency >= settings.band[0]) & (result.frequency <= settings.band[1])
    return float(np.mean(result.cumulative[-1][keep]))


def _mathieu(study: ClaimSettings, own: VaryingSettings, models: Path, settings: Settings) -> pd.DataFrame:
    """The Mathieu system, the frequency of its stiffness not told, over several seeds."""
    truth = read_model(models / "mathieu.yaml")
    exact, rows = true_parameters(truth.values), list[dict[str, Any]]()
    for seed in range(own.seed, own.seed + own.mathieu_seeds):
        found = miso_free_shape(truth, _record(truth, study, own, seed), settings)
        rows += [
            {"seed": seed, "parameter": p.name, "true": exact[p.name], "estimate": p.value, "standard_error": p.error}
            for p in found.parameters if p.name in exact
        ]  # fmt: skip
    return pd.DataFrame(rows)


def _moments(study: ClaimSettings, own: VaryingSettings, models: Path, settings: Settings) -> pd.DataFrame:
    """What MI/SO leaves of the force, by the moment at which the step is put."""
    text = (models / "varying" / "step.yaml").read_text(encoding="utf-8")
    truth, told = read_model(models / "varying" / "step.yaml"), f"t - {own.step_at:g}"
    if told not in text:
        raise ExpressionError(f"models/varying/step.yaml has no {told!r}; expected the step of config/part_two.yaml")
    record, rows = _record(truth, study, own, own.seed), list[dict[str, Any]]()
    length = study.sampling.samples * study.sampling.dt
    for moment in np.linspace(0.0, length, own.moments + 2)[1:-1].tolist():
        tried = parse_model(text.replace(told, f"t - {moment:.6g}"), models / "varying" / "step.yaml")
        result = miso(tried, record, settings).responses
        assert isinstance(result, MisoResult)
        keep = (result.frequency >= settings.band[0]) & (result.frequency <= settings.band[1])
        rows.append({"moment": moment, "true": own.step_at, "cost": float(np.sum(result.noise[keep]))})
    return pd.DataFrame(rows)


# ---- claims


def _rows_of(tables: Tables, model: str) -> Iterator["pd.Series[Any]"]:
    t = tables["varying"]
    for _, row in t[t["model"] == model].iterrows():
        yield row


def _recovered(tables: Tables, estimator: str, allowed: float) -> Iterator[Condition]:
    t = tables["varying_values"]
    own = t[(t["model"] == VARYING) & (t["estimator"] == estimator)]
    for title, group in own.groupby("title", sort=False):
        off = group["estimate"] / group["true"] - 1.0
        at = off.abs().idxmax()
        error = percent(off[at], "+.2g", group["standard_error"][at] / abs(group["true"][at]))
        yield Condition(
            f"{title}: every coefficient within {percent(allowed)}", f"{title}: {group['parameter'][at]} {error}",
            bool(abs(off[at]) <= allowed),
            because="the noise of the sensor is part of every input of the reverse system",
        )  # fmt: skip


def varying_in_reverse(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """MI/SO with what the coefficient varies with as an input more."""
    return _recovered(tables, "miso", expected.limit("varying_value"))


def varying_free_run(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Output error with the same terms."""
    return _recovered(tables, "output_error", expected.limit("varying_value"))


def varying_coherence(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Whether the coherence of constant coefficients says that they are not."""
    limit = expected.value("varying_coherence.coherence")
    for row in _rows_of(tables, CONSTANT):
        yield Condition(
            f"{row['title']} taken as constant: mean multiple coherence below {limit:g}",
            f"{row['title']}: {row['coherence']:.4f}", bool(row["coherence"] < limit),
            because="only lines near the resonance feel the damping, the others the mass or the stiffness",
        )  # fmt: skip


def varying_left(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Whether the free run of constant coefficients says so."""
    times, right = expected.value("varying_left.times"), {r["case"]: r["left"] for r in _rows_of(tables, VARYING)}
    for row in _rows_of(tables, CONSTANT):
        yield Condition(
            f"{row['title']} taken as constant: left more than {times:g} times what the right model leaves",
            f"{row['title']}: {percent(row['left'])}, the right model {percent(right[row['case']])}",
            bool(row["left"] > times * right[row["case"]]),
        )  # fmt: skip


def varying_mathieu(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The Mathieu system, its frequency not told."""
    for name in ("f_m", "k_m", "m", "k", "c"):
        limit = expected.value(f"varying_mathieu.{name}")
        own = tables["mathieu"][tables["mathieu"]["parameter"] == name]
        off = own["estimate"] / own["true"] - 1.0
        yield Condition(
            f"{name} within {percent(limit)} in each of {len(own)} records",
            f"{name} at most {percent(off.abs().max(), '.2g')} off",
            bool((off.abs() <= limit).all()),
        )  # fmt: skip


def varying_moment(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """The moment of a step, tried out."""
    limit, t = expected.value("varying_moment.seconds"), tables["moments"]
    best, true = float(t.sort_values("cost")["moment"].iloc[0]), float(t["true"].iloc[0])
    yield Condition(
        f"the moment that leaves least within {limit:g} s of {true:g} s", f"{best:.4g} s", abs(best - true) <= limit
    )


# ---- figures and words


def not_constant_figure(tables: Tables) -> Figure:
    """What constant and varying coefficients leave, and the moment of a step."""
    figure, axes = page.empty_page(
        "Coefficients that are not constant", "what is left, and when the stiffness stepped", columns=2, width=11.0,
        panel=2.8, legend_rows=1, share=False,
    )  # fmt: skip
    titles = [str(row["title"]) for row in _rows_of(tables, VARYING)]
    for shift, (which, colour, hatch) in enumerate(((CONSTANT, "C1", "//"), (VARYING, "C0", ""))):
        left = [100.0 * row["left"] for row in _rows_of(tables, which)]
        axes[0].barh([i + 0.38 * shift - 0.19 for i in range(len(left))], left, 0.36, color=colour, hatch=hatch,
                     edgecolor="white", label=f"{which} coefficients")  # fmt: skip
    axes[0].set_yticks(range(len(titles)), titles)
    axes[0].set_xlabel("left by a free run (% of the rms)")
    figure.subplots_adjust(left=0.22, wspace=0.22)
    t = tables["moments"]
    axes[1].plot(
        t["moment"], t["cost"] / t["cost"].min(), ".-", color="C0", linewidth=1.2, label="step tried at a moment"
    )
    axes[1].axvline(
        float(t["true"].iloc[0]), color="black", linewidth=1.0, linestyle=(0, (5.0, 2.0)), label="true moment"
    )
    axes[1].set_xlabel("moment (s)")
    axes[1].set_ylabel("left of the force, over the least")
    page.letter(axes, ("free run", "moment of a step, MI/SO"))
    page.shared_legend(figure, axes)
    return figure


def told_varying(tables: Tables) -> list[Block]:
    """Constant beside varying, then the Mathieu system."""
    rows = [
        [str(row["title"]), str(row["model"]), f"{row['coherence']:.4f}", percent(row["left"])]
        for _, row in tables["varying"].iterrows()
    ]
    m = tables["mathieu"]
    found = [
        [str(name), f"{own['true'].iloc[0]:.6g}", f"{own['estimate'].mean():.6g}", f"{own['estimate'].std(ddof=1):.2g}"]
        for name, own in m.groupby("parameter", sort=False)
    ]
    said = (
        "Each system as it is and with constant coefficients alone, with 1 % of noise on the displacement: mean "
        "multiple coherence over the fit band, and what the free run of the fitted model leaves of the displacement."
    )
    return [
        Text(said), table(("system", "coefficients", "coherence", "left by a free run"), rows),
        Text(f"The Mathieu system, whose f_m is not told, over {m['seed'].nunique()} records:"),
        table(("parameter", "true", "mean", "scatter"), found),
    ]  # fmt: skip


CHAPTER = Chapter(
    judges(varying_in_reverse, varying_free_run, varying_coherence, varying_left, varying_mathieu, varying_moment),
    {"varying": not_constant_figure}, told_varying,
    ("limit.varying_value", "varying_coherence.coherence", "varying_left.times", "varying_moment.seconds",
     *(f"varying_mathieu.{name}" for name in ("f_m", "k_m", "m", "k", "c"))),
    make=make_varying,
)  # fmt: skip
