# Trials with hidden effects, the proof of diagnose: `snakemake -j2 trials` (or trials_by_test, trials_of_structures,
# trials_like_rigs, trials_of_next_tests, trials_of_changes), not part of `all`; `make trials TABLE=trials` writes docs/trials.csv, and what docs/tool.md says of them.
TRIALS = STUDY.settings.trials
TRIAL_CODE = {name: modules(name) for name in ("trials", "trial_summary")}
TRIAL_JOBS = {"trials": TRIALS.jobs, "trials_by_test": 10, "trials_of_structures": 12, "trials_like_rigs": 26, "trials_of_next_tests": 12, "trials_of_changes": 12}
TRIAL_FIGURES = {
    "trials": ["trials_confusion", "trials_ladder"],
    "trials_by_test": [],
    "trials_like_rigs": [],
    "trials_of_next_tests": [],
    "trials_of_changes": [],
    "trials_of_structures": ["trials_of_structures_effects", "trials_of_structures_places"],
}
TRIAL_RESULTS = {table: ["trials", "summary", *figures] for table, figures in TRIAL_FIGURES.items()}
TRIAL_RESULTS["trials"] += ["alpha", "k"]


rule trial_runs:
    input:
        code=TRIAL_CODE["trials"],
    output:
        table="results/{table}/part_{part}.csv",
    params:
        settings={key: value for key, value in TRIALS.plain().items() if key != "wanted"},
        jobs=lambda wildcards: TRIAL_JOBS[wildcards.table],
    wildcard_constraints:
        table="|".join(TRIAL_JOBS),
        part="[0-9]+",
    benchmark:
        "results/benchmarks/{table}.{part}.tsv"
    script:
        "../scripts/trials.py"


for trial_table, jobs in TRIAL_JOBS.items():

    rule:
        name:
            trial_table
        input:
            parts=[f"results/{trial_table}/part_{part}.csv" for part in range(jobs)],
            style=STYLE,
            code=TRIAL_CODE["trial_summary"],
        output:
            tables=[f"results/{trial_table}/{name}.csv" for name in TRIAL_RESULTS[trial_table]],
            figures=[path for name in TRIAL_FIGURES[trial_table] for path in pictures(name)],
        params:
            table=trial_table,
            wanted=TRIALS.wanted.plain() if trial_table == "trials" else None,
        script:
            "../scripts/trial_summary.py"
