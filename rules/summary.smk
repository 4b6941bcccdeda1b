# What all cases give together: one table of parameters, and the pages, of which a reader opens results/summary.md first.
BENCHMARKS = [f"results/benchmarks/{stage}.{case}.tsv" for stage in ("record", "identify", "draw") for case in STUDY.cases]
BENCHMARKS += [f"results/benchmarks/{rule}.tsv" for rule in ("excitation_reading", "integrator_steps", "claims", "estimator_errors")]
# Tables that are pages of the workflow's report as they stand.
TABLE_PAGES = {
    "claims": "Claims of the report",
    "parameters": "Parameters of all cases",
    "estimators": "Errors of the estimators",
    "excitation_reading": "Reading of unit variance",
    "integrator_steps": "Steps of the integrator",
}
# Of results/study.html, in the order of the cases: where a figure is, whose it is, and what it shows.
PICTURES = [
    {"file": f"figures/{stem}.png", "system": case.title, "number": stem.replace("_", " ").capitalize() if stem.startswith("figure_") else "Not in the report", "shows": DESCRIBED[kind]}
    for case in STUDY.cases.values()
    for kind, stem in case.figures.items()
] + STRUCTURE_PICTURES
DOCUMENTS = ("summary", "estimators", "claims", "structures", "integrator_steps")
SUMMARY_RESULTS = [f"results/{name}" for name in ("parameters.csv", *(f"{name}.md" for name in DOCUMENTS), "study.html")]
SUMMARY_RESULTS += [f"results/pages/{name}.html" for name in TABLE_PAGES]


rule parameters:
    input:
        tables=[f"results/{case}/parameters.csv" for case in STUDY.cases],
        code=CODE["join"],
    output:
        table=report(
            "results/parameters.csv",
            caption="captions/parameters.rst",
            category="Tables",
            labels={"table": "Parameters of all cases", "as": "raw CSV"},
        ),
    params:
        without=["note"],
    script:
        "../scripts/join.py"


rule summary:
    input:
        **{name: f"results/{name}.csv" for name in TABLE_PAGES},
        case_parameters=[f"results/{case}/parameters.csv" for case in STUDY.cases],
        structures=STRUCTURE_RESULTS[0],
        structure_claims=STRUCTURE_RESULTS[1],
        benchmarks=BENCHMARKS,
        pictures=[picture["file"] for picture in PICTURES],
        style=[f"study/support/picture_page.{ending}" for ending in ("css", "js")],
        code=CODE["pages"],
    output:
        **{name: f"results/{name}.md" for name in DOCUMENTS},
        study="results/study.html",
        html=report(
            "results/pages/summary.html",
            caption="captions/summary.rst",
            category="Summary",
            labels={"page": "The report, run again"},
        ),
        **{
            f"{name}_table": report(
                f"results/pages/{name}.html",
                caption=f"captions/{name}.rst",
                category="Tables",
                labels={"table": title, "as": "page"},
            )
            for name, title in TABLE_PAGES.items()
        },
    params:
        noise=STUDY.noise,
        setting=STUDY.settings.excitations["report"].reading,
        pictures=PICTURES,
        titles=STRUCTURE_TITLES,
        tables=TABLE_PAGES,
    script:
        "../scripts/pages.py"
