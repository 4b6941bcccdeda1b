# What is identified in the record of each case and the figures of it, and its name as a target. The figures' files are
# named by the report's numbers, which no wildcard can say: one rule a case. One job identifies and draws: it begins for
# longer than it does either.
for _case in STUDY.cases:

    rule:
        name:
            f"identify.{_case}"
        input:
            model=STUDY.cases[_case].model_file,
            record=f"results/{_case}/record.csv",
            style=STYLE,
            code=CODE["identify"],
        output:
            responses=f"results/{_case}/frequency_response.csv",
            coherences=f"results/{_case}/coherence.csv",
            noise=f"results/{_case}/noise.csv",
            parameters=f"results/{_case}/parameters.csv",
            **figures_of(_case),
        params:
            settings=STUDY.identification_settings(_case).plain(),
            title=STUDY.cases[_case].title,
            drawn=STUDY.drawn(_case),
        priority: int(_case == "dead_band")  # takes the longest: last, it would keep the other cores waiting
        benchmark:
            f"results/benchmarks/identify.{_case}.tsv"
        run:
            step("identify", input, output, params, wildcards)

    rule:
        name:
            _case
        input:
            products(_case),
