# What all cases give together: one table of parameters, and the page that a reader opens first.
BENCHMARKS = [f"results/benchmarks/{stage}.{case}.tsv" for stage in ("record", "identify", "draw") for case in STUDY.cases]
BENCHMARKS += [f"results/benchmarks/{rule}.tsv" for rule in ("excitation_reading", "integrator_steps", "claims", "estimator_errors")]
PAGES = {
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
SUMMARY_RESULTS = [f"results/{name}" for name in ("parameters.csv", "summary.md", "estimators.md", "study.html")]
SUMMARY_RESULTS += [f"results/pages/{name}.html" for name in PAGES]


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
        parameters=[f"results/{case}/parameters.csv" for case in STUDY.cases],
        claims="results/claims.csv",
        reading="results/excitation_reading.csv",
        errors="results/estimators.csv",
        structures=STRUCTURE_RESULTS[0],
        structure_claims=STRUCTURE_RESULTS[1],
        benchmarks=BENCHMARKS,
        pictures=[picture["file"] for picture in PICTURES],
        style="study/support/picture_page.css",
        behaviour="study/support/picture_page.js",
        code=CODE["summary"],
    output:
        page="results/summary.md",
        estimators="results/estimators.md",
        study="results/study.html",
        html=report(
            "results/pages/summary.html",
            caption="captions/summary.rst",
            category="Summary",
            labels={"page": "The report, run again"},
        ),
    params:
        told={"noise": STUDY.noise, "setting": STUDY.settings.excitations["report"].reading, "pictures": PICTURES, "structures": STRUCTURE_TITLES},
    script:
        "../scripts/summary.py"


rule pages:
    input:
        tables=[f"results/{name}.csv" for name in PAGES],
        code=CODE["table_page"],
    output:
        pages=[
            report(
                f"results/pages/{name}.html",
                caption=f"captions/{name}.rst",
                category="Tables",
                labels={"table": title, "as": "page"},
            )
            for name, title in PAGES.items()
        ],
    params:
        titles=PAGES,
    script:
        "../scripts/table_page.py"
