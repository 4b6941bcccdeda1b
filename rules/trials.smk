# Trials with hidden effects, the proof of diagnose: `snakemake -j2 trials`, not part of `all`;
# `make trials` writes docs/trials.csv and the tables of docs/tool.md of them.
TRIALS = STUDY.settings.trials
TRIAL_CODE = {name: modules(name) for name in ("trials", "trial_summary")}


rule trial_runs:
    input:
        code=TRIAL_CODE["trials"],
    output:
        table="results/trials/part_{part}.csv",
    params:
        settings={key: value for key, value in TRIALS.plain().items() if key != "wanted"},
    wildcard_constraints:
        part="[0-9]+",
    benchmark:
        "results/benchmarks/trials.{part}.tsv"
    script:
        "../scripts/trials.py"


rule trials:
    input:
        parts=[f"results/trials/part_{part}.csv" for part in range(TRIALS.jobs)],
        style=STYLE,
        code=TRIAL_CODE["trial_summary"],
    output:
        trials="results/trials/trials.csv",
        confusion="results/trials/confusion.csv",
        summary="results/trials/summary.csv",
        ladder="results/trials/ladder.csv",
        alpha="results/trials/alpha.csv",
        k="results/trials/k.csv",
        confusion_figure=pictures("trials_confusion"),
        ladder_figure=pictures("trials_ladder"),
    params:
        wanted=TRIALS.wanted.plain(),
    script:
        "../scripts/trial_summary.py"


# Trials of structures: `snakemake -j2 trials_mdof`, not part of `all`;
# `make structure_trials` writes docs/trials_of_structures.csv and the table of docs/structures.md of them.
STRUCTURE_TRIALS, STRUCTURE_JOBS = 120, 12
STRUCTURE_CODE = {
    name: modules(name) for name in ("structure_trials", "structure_trial_summary")
}


rule structure_trial_runs:
    input:
        code=STRUCTURE_CODE["structure_trials"],
    output:
        table="results/trials_mdof/part_{part}.csv",
    params:
        trials=STRUCTURE_TRIALS,
        jobs=STRUCTURE_JOBS,
    wildcard_constraints:
        part="[0-9]+",
    script:
        "../scripts/structure_trials.py"


rule trials_mdof:
    input:
        parts=[f"results/trials_mdof/part_{part}.csv" for part in range(STRUCTURE_JOBS)],
        style=STYLE,
        code=STRUCTURE_CODE["structure_trial_summary"],
    output:
        trials="results/trials_mdof/trials.csv",
        rates="results/trials_mdof/rates.csv",
        effects="results/trials_mdof/confusion_of_effects.csv",
        places="results/trials_mdof/confusion_of_places.csv",
        effects_figure=pictures("trials_of_structures_effects"),
        places_figure=pictures("trials_of_structures_places"),
    script:
        "../scripts/structure_trial_summary.py"


# Trials of each kind of test: `snakemake -j2 trials_kinds`, not part of `all`; scripts/kind_docs.py puts them in docs.
KINDS_OF_TESTS, FIRST_OF_KINDS, TRIALS_OF_A_KIND = ("free_decay", "blows", "base", "component", "axis"), 620001, 50
KIND_CODE = modules("kind_trials")


rule trials_of_a_kind:
    input:
        code=KIND_CODE,
    output:
        table="results/trials_by_test/{kind}.csv",
    params:
        first=FIRST_OF_KINDS,
        trials=TRIALS_OF_A_KIND,
    wildcard_constraints:
        kind="|".join(KINDS_OF_TESTS),
    script:
        "../scripts/kind_trials.py"


rule trials_kinds:
    input:
        tables=[f"results/trials_by_test/{kind}.csv" for kind in KINDS_OF_TESTS],
    output:
        table="results/trials_by_test/trials.csv",
    script:
        "../scripts/join.py"
