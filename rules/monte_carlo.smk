# How often each tolerance is met: `snakemake -j2 monte_carlo`, a few minutes, not part of `all`.
rule ensemble:
    input:
        models=lambda wildcards: [model_of(wildcards)],
        code=CODE["monte_carlo"],
    output:
        table="results/monte_carlo/{case}.csv",
    params:
        records=lambda wildcards: [ensemble_settings(wildcards)],
        identifications=monte_carlo_settings,
        judged="rates",
        seeds=STUDY.settings.monte_carlo.seeds,
        first_seed=STUDY.settings.monte_carlo.first_seed,
    benchmark:
        "results/benchmarks/ensemble.{case}.tsv"
    run:
        step("monte_carlo", input, output, params, wildcards)


rule rates:
    input:
        tables=[f"results/monte_carlo/{case}.csv" for case in STUDY.cases],
        code=CODE["join"],
    output:
        table="results/monte_carlo.csv",
    run:
        step("join", input, output, params, wildcards)


rule monte_carlo:
    input:
        monte_carlo="results/monte_carlo.csv",
        code=CODE["pages"],
    output:
        monte_carlo="results/monte_carlo.md",
    params:
        noise=STUDY.noise,
    run:
        step("pages", input, output, params, wildcards)
