# How far each estimator is from the truth on the same records. `snakemake -j2 estimators` takes many seeds, a job a
# case, ten minutes; `make estimators` writes docs/estimators.* of them. Within `all` one job, which begins early as it
# waits for nothing, takes a few seeds of all cases.
COMPARED = STUDY.settings.estimator_errors
MANY = f"estimators_{COMPARED.many}"
ERRORS = {"judged": "errors", "first_seed": COMPARED.first_seed}
ERROR_RESULTS = ["results/estimators.csv", *pictures("estimators")]


rule estimator_errors:
    priority: 1
    input:
        models=[case.model_file for case in STUDY.cases.values()],
        code=CODE["monte_carlo"],
    output:
        table=report(
            "results/estimators.csv",
            caption="captions/estimators.rst",
            category="Tables",
            labels={"table": "Errors of the estimators", "as": "raw CSV"},
        ),
    params:
        **ERRORS,
        records=[STUDY.record_settings(case).without_seeds().plain() for case in STUDY.cases],
        identifications=[compared_settings(case) for case in STUDY.cases],
        seeds=COMPARED.seeds,
    benchmark:
        "results/benchmarks/estimator_errors.tsv"
    run:
        step("monte_carlo", input, output, params, wildcards)


use rule ensemble as many_errors with:
    output:
        table=f"results/{MANY}/{{case}}.csv",
    params:
        **ERRORS,
        records=lambda wildcards: [ensemble_settings(wildcards)],
        identifications=lambda wildcards: [compared_settings(wildcards.case)],
        seeds=COMPARED.many,
    benchmark:
        "results/benchmarks/many_errors.{case}.tsv"


use rule rates as join_errors with:
    input:
        tables=[f"results/{MANY}/{case}.csv" for case in STUDY.cases],
        code=CODE["join"],
    output:
        table=f"results/{MANY}.csv",


rule draw_estimators:
    input:
        errors="results/estimators.csv",
        style=STYLE,
        code=CODE["draw"],
    output:
        errors=[
            report(
                "figures/estimators.png",
                caption="captions/estimators.rst",
                category="Figures",
                subcategory="All cases",
                labels={"figure": "not in the report", "shows": "errors of the estimators"},
            ),
            "figures/estimators.svg",
        ],
    params:
        cases=list(STUDY.cases),
    benchmark:
        "results/benchmarks/draw_estimators.tsv"
    run:
        step("draw", input, output, params, wildcards)


use rule draw_estimators as draw_many_errors with:
    input:
        errors=f"results/{MANY}.csv",
        style=STYLE,
        code=CODE["draw"],
    output:
        errors=pictures(MANY),
    benchmark:
        "results/benchmarks/draw_many_errors.tsv"


rule estimators:
    input:
        f"results/{MANY}.csv",
        pictures(MANY),
