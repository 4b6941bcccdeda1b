"""The study's pages, made of the tables that it wrote: sections of words and tables, and which page shows which."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import pandas as pd

from study.figures.styles import look
from study.reproduction import ensemble
from study.reproduction.claims.judgement import BESIDE, NOT_REPRODUCED, PARTLY, REPRODUCED, SEPARATOR
from study.support import document
from study.support.document import Block, Bullets, Fold, Heading, Image, Text, table
from study.support.numbers import percent

Row = Mapping[str, Any]
TITLE = "The report, run again"
TABLE_WIDTH = 110  # characters of a measured number in a table
WANTED_SHARE = 0.99  # of the seeds, for each noise-free parameter
INTRODUCTION = (
    "Bendat, Palo and Coppolino identify nonlinear systems with one degree of freedom from force and response: "
    "reverse the two, and every term of the equation of motion is a linear path of its own (reverse dynamic MI/SO). "
    "This page sets what their report states beside what this study finds. Every number on it is computed by this run."
)
WHO = (
    "MI/SO is the report's estimator, SI/SO the ordinary analysis that it is held against. The others are ours: a "
    "local polynomial fit without leakage, a fit of the model in free run (output error), and A_j(f) with that run as "
    "instrument. When to use which: [docs/estimators.md](../docs/estimators.md)."
)
ABOUT_STRUCTURES = (
    "The report's fourth recommendation: identify terms in systems with several degrees of freedom. These cases are no "
    "part of the report; what is claimed of them, and every tolerance, was set before looking."
)
STRUCTURE_COLUMNS = ("estimator", "parameter", "true", "estimate", "standard_error", "relative_error", "tolerance")
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


@dataclass(frozen=True, eq=False)
class Results:
    """What the pages are made of."""

    tables: Mapping[
        str, pd.DataFrame
    ]  # by the stem of their file in results/; case_parameters have notes, times the seconds of each stage
    noise: Mapping[str, float]  # of each case, by name, in the order of the page
    setting: str = ""  # the reading of unit variance that the study runs with
    titles: Mapping[str, str] = field(default_factory=dict[str, str])  # of structures by case, in the order of the page

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]


def each_row(rows: pd.DataFrame) -> list[Row]:
    """Rows of a table, each by the names of its columns."""
    return cast(list[Row], rows.to_dict("records"))


# ---- the verdict and the claims


def verdict_blocks(results: Results) -> list[Block]:
    """How many claims and parameters hold, in sentences, and what the study is."""

    def met(own: pd.DataFrame) -> str:
        return f"{int(own['within_tolerance'].astype(bool).sum())} of {len(own)}"

    own = results["case_parameters"][results["case_parameters"]["estimator"] == "miso"]
    quiet, noisy = (own[keep] for keep in (own["case"].map(results.noise) == 0.0, own["case"].map(results.noise) > 0.0))
    lines = [
        f"{verdict_sentence(results['claims'])} Each that is not has its reason below.",
        f"Without noise, MI/SO recovers {met(quiet)} parameters of {quiet['case'].nunique()} cases within "
        "tolerances that were set before looking.",
    ]
    if len(noisy):
        lines.append(
            f"With noise on the displacement, {met(noisy)} parameters of {noisy['case'].nunique()} cases are "
            "within the same tolerances; the claims of Section 5.4 say why."
        )
    placed = results["structures"][results["structures"]["estimator"] == "miso"]
    held = results["structure_claims"]["verdict"] == "holds"
    lines.append(
        f"Of structures of several coordinates, {int(held.sum())} of {len(held)} claims hold; MI/SO recovers "
        f"{met(placed)} coefficients of {placed['case'].nunique()} cases within tolerances that were set before "
        "looking."
    )
    return [Bullets(tuple(lines)), Text(INTRODUCTION)]


def verdict_sentence(claims: pd.DataFrame) -> str:
    """How many statements were reproduced, in one sentence; places beside the report are not counted."""
    verdicts = claims.loc[~claims["where"].str.startswith(BESIDE), "verdict"]
    whole, part, none = (int((verdicts == name).sum()) for name in (REPRODUCED, PARTLY, NOT_REPRODUCED))
    return f"**{whole} of {len(verdicts)} statements are reproduced**, {part} partly, {none} not."


def failing_claims(results: Results) -> list[Block]:
    """What is not reproduced, or partly, and why; claims on structures follow where one does not hold."""
    failed = results["claims"][results["claims"]["verdict"] != REPRODUCED].sort_values("verdict", kind="stable")
    placed = results["structure_claims"][results["structure_claims"]["verdict"] != "holds"]
    found = ((failed, ["verdict", "where", "claim", "why"]), (placed, ["verdict", "case", "claim"]))
    return [table(names, rows[names].to_numpy().tolist()) for rows, names in found if rows is failed or len(rows)]


def numbers(results: Results) -> list[Block]:
    """Every statement with a number: reported, measured, verdict."""
    note = (
        "Ours: mean over the seeds of an ensemble with its standard error, and the study's own record in brackets. "
        "Of statements with several conditions as many are shown as the report gives numbers, those that fail first; "
        "[claims.md](claims.md) has them all."
    )
    claims = results["claims"]
    return [Text(note), statements(claims[~claims["reported"].isin(["as stated", "as tabulated"])])]


def statements(claims: pd.DataFrame) -> Block:
    """One row a claim; of what was measured as many parts as the report gives numbers, those that fail first."""
    rows = [[r["where"], r["claim"], r["reported"], shortened(r), r["verdict"]] for r in each_row(claims)]
    return table(["where", "what", "report", "ours", "verdict"], rows)


def claim_blocks(results: Results) -> list[Block]:
    """The verdict, then one line a claim; its conditions stand below, folded, where the line leads."""
    claims = each_row(results["claims"])
    rows = [
        [f"[{row['where']}](#{row['id']})", row["claim"], row["reported"], shortened(row), row["verdict"]]
        for row in claims
    ]
    said = "Each line leads to its conditions: what must hold, what was measured and, where it does not hold, why."
    return [
        Text(verdict_sentence(results["claims"])), Text(said),
        table(["where", "claim", "report", "ours", "verdict"], rows), Heading("What each verdict rests on"),
        *claim_folds(results["claims"]),
    ]  # fmt: skip


def claim_folds(claims: pd.DataFrame) -> list[Block]:
    """Every claim, folded."""
    return [conditions(row) for row in each_row(claims.astype(str))]


def conditions(row: Row) -> Fold:
    """One claim: its reason if it fails, then each condition with what was measured."""
    measured, criteria = (row[name].split(SEPARATOR) for name in ("measured", "criterion"))
    if len(measured) == len(criteria):
        lines = [f"{criterion}: {found}" for criterion, found in zip(criteria, measured, strict=True)]
    else:  # a part of one of them has the separator within
        lines = [*(f"must hold: {c}" for c in criteria), *(f"measured: {m}" for m in measured)]
    why = [Text(f"Why: {row['why']}")] if row["why"] else []
    where = f"{row['where']}: " if row["where"] else ""
    said = f" (report: {row['reported']})" if row["reported"] else ""
    title = f"**{row['verdict']}** {where}{row['claim']}{said}"
    return Fold(title, (*why, Bullets(tuple(lines))), row["id"])


def shortened(row: Row) -> str:
    """What was measured, as many parts as the report gives numbers and a line holds."""
    parts = row["measured"].split(SEPARATOR)
    kept = parts[: len(row["reported"].split(", "))]  # "as stated" counts as one number
    while len(kept) > 1 and len(SEPARATOR.join(kept)) > TABLE_WIDTH:
        kept = kept[:-1]
    text = SEPARATOR.join(kept)
    if len(text) > TABLE_WIDTH:
        return text[: text.rfind(" ", 0, TABLE_WIDTH)].rstrip(",;") + " …"
    return text if len(kept) == len(parts) else f"{text} …"


# ---- parameters, and how far each estimator is off


def by_estimator(
    shown: pd.DataFrame, keys: Sequence[str], names: Sequence[str], cell: Callable[[Row], str],
    label: Callable[[str], str] = lambda name: look(name).label,
) -> Block:  # fmt: skip
    """One row for each value of the keys, one cell an estimator; it is empty where the table has no such row."""
    rows: list[list[str]] = []
    for key, group in shown.groupby(list(keys), sort=False):
        cells = {str(row["estimator"]): cell(row) for row in each_row(group)}
        rows.append([*(str(part) for part in key), *(cells.get(name, "") for name in names)])
    return table([*keys, *map(label, names)], rows)


def parameter_blocks(results: Results) -> list[Block]:
    """One row a parameter, one column an estimator: estimate, standard error, error, verdict."""

    def estimate(row: Row) -> str:
        error = "" if pd.isna(row["standard_error"]) else f" ± {row['standard_error']:.2g}"
        relative = "" if pd.isna(row["relative_error"]) else f" ({percent(row['relative_error'], '+.2g')})"
        text = f"{row['estimate']:.5g}{error}{relative}"
        text = text if row["within_tolerance"] else f"**{text}**"
        note = row.get("note", "")
        return f"{text}; {note}" if isinstance(note, str) and note else text

    def tolerance(row: "pd.Series[Any]") -> str:
        if pd.isna(row["tolerance"]):
            return "none"
        return percent(row["tolerance"]) if row["true"] != 0.0 else f"{row['tolerance']:g}"

    own = results["case_parameters"]
    worded = own.assign(true=own["true"].map("{:.6g}".format), tolerance=own.apply(tolerance, axis=1))
    note = (
        "In SI units (kg, N s/m, N/m, Hz, N/m^3, N s/m^3, rad); with its standard error, and the error against the "
        "true value. In bold what lies outside the tolerance. The standard errors of SI/SO and MI/SO are Bendat and "
        "Piersol's for random noise, with the effective number of averages under overlap (claims.md, `averages`). "
        "Without noise MI/SO leaves leakage, which they overrate: `snakemake -j2 monte_carlo` sets them against the "
        "scatter over seeds. The other estimators' come from what they leave, as noise; output error adds what the "
        "steps of its free run cut off. Without noise local polynomials leave next to nothing, and underrate "
        "what sampling cuts off up to fiftyfold ([docs](../docs/estimators.md))."
    )
    names = ensemble.estimator_names(own)
    keys = ("case", "parameter", "true", "tolerance")
    return [Text(note), by_estimator(worded, keys, names, estimate, lambda name: name.replace("_", " "))]


def estimator_blocks(results: Results) -> list[Block]:
    """How far each estimator is off: in sentences, by case and parameter, then bias and scatter under noise."""
    errors, noise = results["estimators"], results.noise
    note = (
        f"Median over {int(errors['seeds'].max())} seeds of the error in %, every estimator on the very same records; "
        "in brackets the gain, the error of MI/SO over this one. Where the true value is zero the error is in the "
        "parameter's own unit. `snakemake -j2 estimators` does it with more seeds: `docs/estimators.md`."
    )
    names = ensemble.estimator_names(errors)
    blocks: list[Block] = [
        Text(WHO), Bullets(error_sentences(errors, noise)),
        Image("Errors of the estimators by parameter and case", "../figures/estimators.png"), Text(note),
        by_estimator(errors, ("case", "parameter"), names, _error_and_gain),
    ]  # fmt: skip
    noisy = errors[(errors["case"].map(noise) > 0.0) & (errors["seeds"] >= 5)]  # of fewer a scatter means nothing
    if not len(noisy):
        return blocks

    def bias(row: Row) -> str:
        return f"{two_digits(100.0 * row['bias'])} ± {two_digits(100.0 * row['scatter'])}"

    relative = noisy[noisy["kind"] == "relative"]
    told = Text("Under noise on the displacement, bias ± scatter of one estimate, both in %:")
    return [
        *blocks, told, by_estimator(relative, ("case", "parameter"), ensemble.estimator_names(noisy), bias)
    ]  # fmt: skip


def error_sentences(errors: pd.DataFrame, noise: Mapping[str, float]) -> tuple[str, ...]:
    """For each estimator but MI/SO, without noise and with it: how often it is nearer, and by how much."""
    noisy = errors["case"].map(noise) > 0.0
    lines: list[str] = []
    for name in ensemble.estimator_names(errors[errors["estimator"] != ensemble.BASIS]):
        words: list[str] = []
        for where, keep in (("without noise", ~noisy), ("with noise on the displacement", noisy)):
            gains = errors.loc[keep & (errors["estimator"] == name), "gain"].dropna()
            if len(gains):
                nearer = f"nearer than MI/SO in {int((gains > 1.0).sum())} of {len(gains)} parameters"
                words.append(f"{where} {nearer}, with a median gain of {factor(gains.median())}")
        lines.append(f"**{look(name).label}**: {'; '.join(words)}.")
    return tuple(lines)


def about_errors(errors: pd.DataFrame) -> str:
    """What the numbers of :func:`error_overview` are, and from how many records they come."""
    seeds, noted = int(errors["seeds"].max()), errors[errors["noted"] > 0].groupby(["case", "estimator"])["noted"].max()
    trouble = f"{int(noted.sum())} searches did not converge" if len(noted) else "every search converged"
    return f"Median error in % over {seeds} seeds, then over the parameters of a case. Of these runs {trouble}."


def error_overview(errors: pd.DataFrame) -> Block:
    """One row a case, one column an estimator: the median of its parameters' errors."""
    relative = errors[errors["kind"] == "relative"].groupby(["case", "estimator"], sort=False)
    middles = relative[["median_error"]].median().reset_index()

    def error(row: Row) -> str:
        size = 100.0 * row["median_error"]
        return two_digits(size) if math.isfinite(size) else "none"

    return by_estimator(middles, ("case",), ensemble.estimator_names(errors), error)


def _error_and_gain(row: Row) -> str:
    scale, unit = (100.0, " %") if row["kind"] == "relative" else (1.0, "")
    size = f"{two_digits(scale * row['median_error'])}{unit}" if math.isfinite(row["median_error"]) else "none"
    return size if row["estimator"] == ensemble.BASIS else f"{size} ({factor(row['gain'])})"


def factor(gain: float) -> str:
    """A gain as ``x 3.2``; a dash where there is none to compare with."""
    return "-" if math.isnan(gain) else f"x {two_digits(gain)}"


def two_digits(number: float) -> str:
    """Two digits, without an exponent from 0.01 to 9999: ``0.034``, ``1600``, ``2e4``."""
    if not 99.5 <= abs(number) < 9950.0:
        return f"{number:.2g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")
    return f"{float(f'{number:.2g}'):.0f}"


def tolerance_blocks(results: Results) -> list[Block]:
    """Which MI/SO estimates of noise-free cases meet their tolerance too seldom."""
    quiet = results["monte_carlo"]
    quiet = quiet[quiet["case"].map(results.noise) == 0.0]
    own = quiet[quiet["estimator"] == "miso"]
    low = own[own["within_tolerance"] < WANTED_SHARE].sort_values("within_tolerance")
    lines = [
        f"{row['case']}: {row['parameter']} in {100.0 * row['within_tolerance']:.1f} ± "
        f"{100.0 * row['rate_error']:.1f} %"
        for row in each_row(low)
    ]
    for name, group in quiet[quiet["estimator"] != "miso"].groupby("estimator", sort=False):
        met = int((group["within_tolerance"] >= WANTED_SHARE).sum())
        lines.append(f"beside it, {str(name).replace('_', ' ')}: {met} of {len(group)} do")
    said = (
        f"{len(own) - len(low)} of {len(own)} MI/SO estimates of noise-free cases meet their tolerance in at least "
        f"{100.0 * WANTED_SHARE:g} % of {int(results['monte_carlo']['seeds'].max())} seeds."
    )
    return [Text(said), Bullets(tuple(lines))]


# ---- structures, and what the report leaves open


def structure_blocks(results: Results) -> list[Block]:
    """What is claimed of each case with its conditions, and every parameter."""
    made: list[Block] = [Text(ABOUT_STRUCTURES)]
    for case, title in results.titles.items():
        claims, found = (
            results[name][results[name]["case"] == case] for name in ("structure_claims", "structures")
        )  # fmt: skip
        made.append(Heading(title, 3))
        for row in each_row(claims):
            pairs = zip(str(row["criterion"]).split(SEPARATOR), str(row["measured"]).split(SEPARATOR), strict=True)
            lines = tuple(f"{criterion}: {measured}" for criterion, measured in pairs)
            made += [Text(f"**{row['verdict']}**: {row['claim']}"), Bullets(lines)]
        rows = [
            [f"{v:.5g}" if isinstance(v, float) else str(v) for v in row]
            for row in found[[*STRUCTURE_COLUMNS]].itertuples(index=False)
        ]
        made.append(table(STRUCTURE_COLUMNS, rows))
    return made


def reading(results: Results) -> list[Block]:
    """Both readings of unit variance beside the numbers that the report quotes."""
    found = results["excitation_reading"]

    def mean(row: Row, which: str) -> str:
        return f"{row[f'{which}_mean']:.4g} ± {row[f'{which}_standard_error']:.1g}"

    rows = [
        [row["quantity"], f"{row['reported']:g}", mean(row, "raw"), mean(row, "filtered"), row["nearer"]]
        for row in each_row(found)
    ]
    raw, filtered = (int((found["nearer"] == name).sum()) for name in ("raw", "filtered"))
    note = (
        f"The variance of the white sequence before its low-pass (raw) comes nearer in {raw} of {len(rows)} numbers, "
        f"that of the applied force (filtered) in {filtered}; the rest are ties. The study runs with "
        f"`{results.setting}`."
    )
    return [Text(note), table(["number", "report", "raw", "filtered", "nearer"], rows)]


def integrator_blocks(results: Results) -> list[Block]:
    """What the integrator's setting does: one table a system, relative errors in percent."""

    def worded(row: Row) -> str:
        true, error, spread = abs(row["true"]), row["mean_error"], row["standard_error"]
        return percent(error / true, "+.2g", spread / true) if true != 0.0 else f"{error:+.2g} +- {spread:.1g}"

    said = (
        "Mean error of each MI/SO estimate against the same records integrated finely "
        f"({ensemble.FINELY.method}, {ensemble.FINELY.steps_per_sample} steps a sample), with its standard error; "
        "relative in percent, in the parameter's own unit where the true value is zero. "
        "The report's own setting is abm4 with one step a sample (Section 2.2)."
    )
    made: list[Block] = [Text(said)]
    for (system, variance), block in results["integrator_steps"].groupby(["system", "reading"], sort=False):
        names = [str(name) for name in block["parameter"].dropna().unique() if name]
        rows: list[list[object]] = []
        for (method, steps), group in block.groupby(["method", "steps_per_sample"], sort=False):
            errors = {str(row["parameter"]): worded(row) for row in each_row(group)}
            lost = f"{group['diverged'].iloc[0]} of {group['seeds'].iloc[0]}"
            rows.append([method, steps, *(errors.get(name, "") for name in names), lost])
        made.append(Heading(f"{system}, unit variance {variance}"))
        made.append(table(["integrator", "steps a sample", *names, "diverged"], rows))
    return made


def run_times(results: Results) -> list[Block]:
    """Seconds by stage."""
    seconds = results["times"]["seconds"]
    rows = [
        [str(stage).replace("_", " "), len(group), f"{group.sum():.1f}", f"{group.max():.1f}"]
        for stage, group in seconds.groupby(results["times"]["stage"], sort=False)
    ]
    rows.append(["all", len(seconds), f"{seconds.sum():.1f}", ""])
    note = "Wall time of each stage's jobs on the machine that made these results, start-up of Python included."
    return [Text(note), table(["stage", "jobs", "seconds together", "longest"], rows)]


# ---- pages: a chapter more is a line more

SECTIONS: tuple[tuple[str, str, Callable[[Results], list[Block]], str], ...] = (  # anchor, title, blocks, on which page
    ("verdict", "Verdict", verdict_blocks, "study"),
    ("failing", "What is not reproduced, or only partly, and why", failing_claims, "summary study"),
    ("numbers", "The report's numbers beside ours", numbers, "summary study"),
    ("claims", "Every claim", lambda results: claim_folds(results["claims"]), "study"),
    ("parameters", "Parameters by case", parameter_blocks, "summary study"),
    ("structures", "Structures of several coordinates", structure_blocks, "summary"),
    ("estimators", "How far each estimator is off", estimator_blocks, "study"),
    ("reading", 'What "unit variance" refers to', reading, "summary study"),
    ("files", "Where everything is", lambda _: [table(["where", "what"], FILES)], "summary"),
    ("times", "Run times", run_times, "summary study"),
)
DOCUMENTS: Mapping[str, tuple[str, Callable[[Results], list[Block]]]] = {  # results/<name>.md: its title and its blocks
    "summary": (TITLE, lambda results: summary_blocks(results)),
    "claims": ("Claims of the report", claim_blocks),
    "structures": ("Structures of several coordinates", structure_blocks),
    "estimators": ("How far each estimator is off", estimator_blocks),
    "integrator_steps": ("What the integrator's setting does to the recovered parameters", integrator_blocks),
    "monte_carlo": ("How often each tolerance is met", tolerance_blocks),
}


def summary_blocks(results: Results) -> list[Block]:
    """What a reader opens first, below its title."""
    page = verdict_blocks(results)
    for _, title, make, pages in SECTIONS:
        if "summary" in pages:
            page += [Heading(title), *make(results)]
    return page


def titled(name: str, results: Results) -> list[Block]:
    """A page of ``DOCUMENTS`` with its title."""
    title, make = DOCUMENTS[name]
    return [Heading(title, 1), *make(results)]


def table_page(title: str, rows: pd.DataFrame) -> str:
    """A table, its cells as they stand, as a page for a browser."""
    blocks = [Heading(title, 1), table([str(c) for c in rows.columns], rows.to_numpy().tolist())]
    return document.document_page(title, blocks)
