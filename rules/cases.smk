# Figures of each case, and its name as a target. Their files are named by the report's numbers, which no
# wildcard can say: one rule a case.
from study.reproduction.config import IDENTIFIED

for _case in STUDY.cases:

    rule:
        name:
            f"draw.{_case}"
        input:
            record=f"results/{_case}/record.csv",
            responses=f"results/{_case}/frequency_response.csv",
            coherences=f"results/{_case}/coherence.csv",
            parameters=f"results/{_case}/parameters.csv",
            style=STYLE,
            code=CODE["draw"],
        output:
            **figures_of(_case, IDENTIFIED, DESCRIBED),
        params:
            title=STUDY.cases[_case].title,
            drawn=STUDY.drawn(_case),
        benchmark:
            f"results/benchmarks/draw.{_case}.tsv"
        script:
            "../scripts/draw_case.py"

    if draws_preliminary(STUDY.cases[_case]):

        rule:
            name:
                f"draw_preliminary.{_case}"
            input:
                record=f"results/{_case}/record.csv",
                model=STUDY.cases[_case].model_file,
                style=STYLE,
                code=CODE["preliminary"],
            output:
                **figures_of(_case, PRELIMINARY, DESCRIBED),
            params:
                title=STUDY.cases[_case].title,
                segments=STUDY.settings.segments.plain(),
            benchmark:
                f"results/benchmarks/draw_preliminary.{_case}.tsv"
            script:
                "../scripts/draw_preliminary.py"

    rule:
        name:
            _case
        input:
            products(_case),
