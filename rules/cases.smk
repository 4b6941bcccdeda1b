# Figures of each case, and its name as a target. Their files are named by the report's numbers, which no
# wildcard can say: one rule a case. One job draws them all: it begins twice as long as it draws.
for _case in STUDY.cases:

    rule:
        name:
            f"draw.{_case}"
        input:
            model=STUDY.cases[_case].model_file,
            record=f"results/{_case}/record.csv",
            responses=f"results/{_case}/frequency_response.csv",
            coherences=f"results/{_case}/coherence.csv",
            parameters=f"results/{_case}/parameters.csv",
            style=STYLE,
            code=CODE["draw"],
        output:
            **figures_of(_case),
        params:
            title=STUDY.cases[_case].title,
            drawn=STUDY.drawn(_case),
            segments=STUDY.settings.segments.plain(),
        benchmark:
            f"results/benchmarks/draw.{_case}.tsv"
        script:
            "../scripts/draw.py"

    rule:
        name:
            _case
        input:
            products(_case),
