# Measured records of config/measurements.tsv. Their data are no part of the project, so `rule all` asks for none:
#   snakemake -j2 results/silverbox/comparison.json    how good is the model, and where does it fail
#   snakemake -j2 results/silverbox/diagnosis.json     which effect is missing
#   snakemake -j2 silverbox_climb                      diagnose, add, and again; the history, and climb.html to step through it
#   snakemake -j2 gallery                              all of that, with pictures, for every record
from study.commands import measurements

with one_sentence():
    MEASUREMENTS = measurements.load(Path("config"), STUDY.cases)

CODE["measured"] = rests_on(Path("scripts/measured.py"))
CODE["measured"] += [f"study/explore/page.{ending}" for ending in ("html", "css", "js")]
SEEN = {
    "comparison": ("response", "force_error", "missing_force", "error_in_time"),
    "diagnosis": ("candidates", "constancy"),
}


def climbed(name):
    """What a climb leaves beside its steps."""
    return [f"results/{name}/{file}" for file in ("history.json", "history.png", "history.svg", "reached.yaml", "climb.html")]


for _name, _row in MEASUREMENTS.items():
    for _what, _file in (("compare", "comparison"), ("diagnose", "diagnosis")):

        rule:
            name:
                f"{_what}.{_name}"
            input:
                model=_row.model,
                code=CODE["measured"],
            output:
                f"results/{_name}/{_file}.json",
                [f"results/{_name}/{stem}.{ending}" for stem in SEEN[_file] for ending in ENDINGS],
            params:
                what=_what,
                row=_row.plain(),
            threads: 2
            benchmark:
                f"results/benchmarks/{_what}.{_name}.tsv"
            script:
                "../scripts/measured.py"

    rule:
        name:
            f"climb.{_name}"
        input:
            model=_row.model,
            code=CODE["measured"],
        output:
            history=f"results/{_name}/history.json",
            pictures=[f"results/{_name}/history.{ending}" for ending in ENDINGS],
            reached=f"results/{_name}/reached.yaml",
            page=f"results/{_name}/climb.html",
        params:
            what="climb",
            row=_row.plain(),
        threads: 2
        benchmark:
            f"results/benchmarks/climb.{_name}.tsv"
        script:
            "../scripts/measured.py"

    rule:
        name:
            f"{_name}_climb"
        input:
            climbed(_name),


rule gallery:
    input:
        [path for name in MEASUREMENTS for path in climbed(name)],
        [f"results/{name}/{file}.json" for name in MEASUREMENTS for file in SEEN],
