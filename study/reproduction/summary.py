"""``results/summary.md``: the page that a reader opens first, made of the tables that the study wrote."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from study.reproduction import error_pages, structure_pages
from study.reproduction.claims.claim_pages import shortened, verdict_sentence
from study.reproduction.claims.judgement import REPRODUCED
from study.reproduction.structure_pages import Structures
from study.support.document import Block, Bullets, Heading, Text, table
from study.support.numbers import percent

INTRODUCTION = (
    "Bendat, Palo and Coppolino identify nonlinear systems with one degree of freedom from force and response: "
    "reverse the two, and every term of the equation of motion is a linear path of its own (reverse dynamic MI/SO). "
    "This page sets what their report states beside what this study finds. Every number on it is computed by this run."
)
FILES = (
    ("`results/<case>/record.csv`", "the record: time, force, displacement, velocity, acceleration"),
    ("`results/<case>/frequency_response.csv`", "A_j(f) by estimator with its standard error, and the exact function"),
    ("`results/<case>/coherence.csv`", "ordinary, partial and cumulative coherences"),
    ("`results/<case>/noise.csv`", "G_nn, the spectrum of what each estimator's inputs leave of the force"),
    ("`results/<case>/parameters.csv`", "parameters of the case; `results/parameters.csv` holds those of all cases"),
    ("`figures/figure_<number>.png`, `.svg`", "the report's Figures 2 to 8 and 16 to 61, by its numbers"),
    ("`results/estimators.csv`, `figures/estimators.png`", "error of each estimator, and its gain over MI/SO"),
    ("`results/study.html`", "all of it for a browser, in one file: pictures by system, tables that sort, claims"),
    ("`results/estimators.md`", "how far each estimator is off, by parameter and case"),
    ("`results/claims.md`, `claims.csv`", "every checkable statement: reported, measured, criterion, verdict"),
    (
        "`results/structures.md`, `structures.csv`, `structure_claims.csv`",
        "structures: what is claimed, every coefficient",
    ),
    ("`results/excitation_reading.csv`", 'both readings of "unit variance" against the numbers that the report quotes'),
    ("`results/integrator_steps.md`, `.csv`", "what the report's one step a sample does to each recovered parameter"),
    ("`results/monte_carlo.csv`", "how often each tolerance is met over many seeds: `snakemake -j2 monte_carlo`"),
    ("`report.html`", "all of it on one page that needs no network: `snakemake --report report.html`"),
)


@dataclass(frozen=True)
class Tables:
    """What the page is made of, each table as the study wrote it."""

    parameters: pd.DataFrame  # results/parameters.csv
    claims: pd.DataFrame  # results/claims.csv
    reading: pd.DataFrame  # results/excitation_reading.csv
    errors: pd.DataFrame  # results/estimators.csv
    times: pd.DataFrame  # columns stage, case, seconds: one row a job
    noise: dict[str, float]  # of each case, by name, in the order of the page
    setting: str  # the reading of unit variance that the study runs with
    structures: Structures


def summary_blocks(tables: Tables) -> list[Block]:
    """The whole page."""
    sections: list[tuple[str, Callable[[Tables], list[Block]]]] = [
        ("What is not reproduced, or only partly, and why", failing_claims),
        ("The report's numbers beside ours", numbers),
        ("Parameters by case", parameter_blocks),
        ("Structures of several coordinates", lambda t: structure_pages.structure_blocks(t.structures)),
        ('What "unit variance" refers to', reading),
        ("Where everything is", lambda _: [table(["where", "what"], FILES)]),
        ("Run times", run_times),
    ]
    page: list[Block] = [Heading("The report, run again", 1), *counts(tables), Text(INTRODUCTION)]
    for title, section in sections:
        page += [Heading(title), *section(tables)]
    return page


def estimator_blocks(tables: Tables) -> list[Block]:
    """The page of the estimators: how far each is off."""
    return [Heading("How far each estimator is off", 1), *error_pages.opening(tables.errors, tables.noise)]


def counts(tables: Tables) -> list[Block]:
    """How many claims and parameters hold, in sentences."""
    own = tables.parameters[tables.parameters["estimator"] == "miso"]
    quiet = own[own["case"].map(tables.noise) == 0.0]
    noisy = own[own["case"].map(tables.noise) > 0.0]
    lines = [
        f"{verdict_sentence(tables.claims)} Each that is not has its reason below.",
        f"Without noise, MI/SO recovers {_met(quiet)} parameters of {quiet['case'].nunique()} cases within "
        "tolerances that were set before looking.",
    ]
    if len(noisy):
        lines.append(
            f"With noise on the displacement, {_met(noisy)} parameters of {noisy['case'].nunique()} cases are "
            "within the same tolerances; the claims of Section 5.4 say why."
        )
    return [Bullets((*lines, structure_pages.count(tables.structures)))]


def _met(table: pd.DataFrame) -> str:
    return f"{int(table['within_tolerance'].sum())} of {len(table)}"


def numbers(tables: Tables) -> list[Block]:
    """Every statement with a number: reported, measured, verdict."""
    stated = tables.claims[~tables.claims["reported"].isin(["as stated", "as tabulated"])]
    note = (
        "Ours: mean over the seeds of an ensemble with its standard error, and the study's own record in brackets. "
        "Of statements with several conditions as many are shown as the report gives numbers, those that fail first; "
        "[claims.md](claims.md) has them all."
    )
    return [Text(note), statements(stated)]


def statements(claims: pd.DataFrame) -> Block:
    """One row a claim; of what was measured as many parts as the report gives numbers, those that fail first."""
    ours = [
        shortened({"reported": r, "measured": m}) for r, m in zip(claims["reported"], claims["measured"], strict=True)
    ]
    columns = claims.assign(ours=ours)[["where", "claim", "reported", "ours", "verdict"]]
    return table(["where", "what", "report", "ours", "verdict"], columns.to_numpy().tolist())


def parameter_blocks(tables: Tables) -> list[Block]:
    """One row a parameter, one column an estimator: estimate, standard error, error, verdict."""
    names = list(dict.fromkeys(tables.parameters["estimator"]))
    worded = {
        "value": tables.parameters["true"].map("{:.6g}".format), "limit": tables.parameters.apply(_tolerance, axis=1),
    }  # fmt: skip
    keys = ["case", "parameter", "value", "limit"]
    rows = error_pages.by_estimator(tables.parameters.assign(**worded), keys, names, _estimate)
    note = (
        "In SI units (kg, N s/m, N/m, Hz, N/m^3, N s/m^3, rad); with its standard error, and the error against the "
        "true value. In bold what lies outside the tolerance. The standard errors of SI/SO and MI/SO are Bendat and "
        "Piersol's for random noise, with the effective number of averages under overlap (claims.md, `averages`). "
        "Without noise MI/SO leaves leakage, which they overrate: `snakemake -j2 monte_carlo` sets them against the "
        "scatter over seeds. The other estimators' come from what they leave, as noise; output error adds what the "
        "steps of its free run cut off. Without noise local polynomials leave next to nothing, and underrate "
        "what sampling cuts off up to fiftyfold ([docs](../docs/estimators.md))."
    )
    heading = ["case", "parameter", "true", "tolerance", *(name.replace("_", " ") for name in names)]
    return [Text(note), table(heading, rows)]


def _estimate(row: "pd.Series[Any]") -> str:
    error = "" if pd.isna(row["standard_error"]) else f" ± {row['standard_error']:.2g}"
    relative = "" if pd.isna(row["relative_error"]) else f" ({percent(row['relative_error'], '+.2g')})"
    text = f"{row['estimate']:.5g}{error}{relative}"
    text = text if row["within_tolerance"] else f"**{text}**"
    note = row.get("note", "")
    return f"{text}; {note}" if isinstance(note, str) and note else text


def _tolerance(row: "pd.Series[Any]") -> str:
    if pd.isna(row["tolerance"]):
        return "none"
    return percent(row["tolerance"]) if row["true"] != 0.0 else f"{row['tolerance']:g}"


def failing_claims(tables: Tables) -> list[Block]:
    """What is not reproduced, or partly, and why."""
    failed = tables.claims[tables.claims["verdict"] != REPRODUCED].sort_values("verdict", kind="stable")
    return [
        _columns(failed, "verdict", "where", "claim", "why"),
        *structure_pages.failing_structures(tables.structures),
    ]


def _columns(frame: pd.DataFrame, *names: str) -> Block:
    return table(names, frame[list(names)].to_numpy().tolist())


def reading(tables: Tables) -> list[Block]:
    """Both readings of unit variance beside the numbers that the report quotes."""
    rows = [
        [row["quantity"], f"{row['reported']:g}", _mean(row, "raw"), _mean(row, "filtered"), row["nearer"]]
        for _, row in tables.reading.iterrows()
    ]
    raw, filtered = (int((tables.reading["nearer"] == name).sum()) for name in ("raw", "filtered"))
    note = (
        f"The variance of the white sequence before its low-pass (raw) comes nearer in {raw} of {len(rows)} numbers, "
        f"that of the applied force (filtered) in {filtered}; the rest are ties. The study runs with "
        f"`{tables.setting}`."
    )
    return [Text(note), table(["number", "report", "raw", "filtered", "nearer"], rows)]


def _mean(row: "pd.Series[Any]", which: str) -> str:
    return f"{row[f'{which}_mean']:.4g} ± {row[f'{which}_standard_error']:.1g}"


def run_times(tables: Tables) -> list[Block]:
    """Seconds by stage."""
    seconds = tables.times["seconds"]
    rows = [
        [str(stage).replace("_", " "), len(group), f"{group.sum():.1f}", f"{group.max():.1f}"]
        for stage, group in seconds.groupby(tables.times["stage"], sort=False)
    ]
    rows.append(["all", len(seconds), f"{seconds.sum():.1f}", ""])
    note = "Wall time of each stage's jobs on the machine that made these results, start-up of Python included."
    return [Text(note), table(["stage", "jobs", "seconds together", "longest"], rows)]
