# What all cases give together: one table of parameters, and the pages, of which a reader opens results/summary.md first.
BENCHMARKS = [f"results/benchmarks/{stage}.{case}.tsv" for stage in ("record", "identify") for case in STUDY.cases]
BENCHMARKS += [f"results/benchmarks/{rule}.tsv" for rule in ("excitation_reading", "integrator_steps", "claims", "estimator_errors")]
# Tables that are pages of the workflow's report as they stand.
TABLE_PAGES = {
    "claims": "Claims of the report",
    "parameters": "Parameters of all cases",
    "estimators": "Errors of the estimators",
    "excitation_reading": "Reading of unit variance",
    "integrator_steps": "Steps of the integrator",
}
# Of results/study.html, in the order of the cases: where a figure is, whose it is, and what it shows. Those of structures
# and of the other chapters of Part II stand in their sections.
PICTURES = [
    {"file": f"figures/{stem}.png", "system": case.title, "number": stem.replace("_", " ").capitalize() if stem.startswith("figure_") else "Not in the report", "shows": DESCRIBED[kind]}
    for case in STUDY.cases.values()
    for kind, stem in case.figures.items()
]
DOCUMENTS = ("summary", "estimators", "claims", "structures", "integrator_steps")
SUMMARY_RESULTS = [f"results/{name}" for name in ("parameters.csv", *(f"{name}.md" for name in DOCUMENTS))]
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
    run:
        step("join", input, output, params, wildcards)


rule summary:
    input:
        **{name: f"results/{name}.csv" for name in TABLE_PAGES},
        case_parameters=[f"results/{case}/parameters.csv" for case in STUDY.cases],
        structures=STRUCTURE_RESULTS[0],
        structure_claims=STRUCTURE_RESULTS[1],
        benchmarks=BENCHMARKS,
        code=CODE["pages"],
    output:
        **{name: f"results/{name}.md" for name in DOCUMENTS},
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
        titles=STRUCTURE_TITLES,
        tables=TABLE_PAGES,
    run:
        step("pages", input, output, params, wildcards)


# Both parts on one page with one table of contents.
rule study_page:
    input:
        **{name: f"results/{name}.csv" for name in TABLE_PAGES},
        case_parameters=[f"results/{case}/parameters.csv" for case in STUDY.cases],
        structures=STRUCTURE_RESULTS[0],
        structure_claims=STRUCTURE_RESULTS[1],
        part_two_claims=PART_TWO_CLAIMS,
        **{name: f"results/part_two/{name}.csv" for contents in CHAPTERS.values() for name in contents.tables},
        benchmarks=BENCHMARKS + PART_TWO_BENCHMARKS,
        pictures=[picture["file"] for picture in PICTURES + STRUCTURE_PICTURES + PART_TWO_PICTURES],
        style=[f"study/support/picture_page.{ending}" for ending in ("css", "js")],
        code=CODE["pages"] + CODE["chapters"],
    output:
        study="results/study.html",
        part_two="results/part_two.md",
    params:
        noise=STUDY.noise,
        setting=STUDY.settings.excitations["report"].reading,
        pictures=PICTURES + STRUCTURE_PICTURES + PART_TWO_PICTURES,
        titles=STRUCTURE_TITLES,
    run:
        step("pages", input, output, params, wildcards)
