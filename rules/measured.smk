# Measured records of config/measurements.tsv. Their data are no part of the project, so `rule all` asks for none:
#   snakemake -j2 results/silverbox/comparison.json    how good is the model, and where does it fail
#   snakemake -j2 results/silverbox/diagnosis.json     which effect is missing
#   snakemake -j2 silverbox_climb                      diagnose, add, and again; the history, and climb.html to step through it
#   snakemake -j2 damper                               all of that, with pictures, for every row of an entry
#   snakemake -j2 gallery                              every entry, and results/gallery.html, a page of all of them
from study.commands import measurements

with one_sentence():
    MEASUREMENTS = measurements.load_measurements(
        Path("config"), STUDY.cases, {"all", "gallery", "gallery_page", "campaign", *(rule.name for rule in workflow.rules)}
    )

CODE["measured"] = rests_on(Path("scripts/measured.py"))
CODE["measured"] += [f"study/explore/page.{ending}" for ending in ("html", "css", "js")]
CODE["gallery"] = rests_on(Path("scripts/gallery.py"))
OF_STRUCTURES = {name for name, row in MEASUREMENTS.items() if measurements.is_structure(row)}
ENTRIES = dict.fromkeys(row.entry for row in MEASUREMENTS.values())
SEEN = {
    "comparison": ("response", "force_error", "missing_force", "error_in_time"),
    "diagnosis": ("candidates", "constancy"),
}


def climbed(name):
    """What a climb leaves beside its steps."""
    files = ("history.json", "history.png", "history.svg", "reached.yaml", "climb.html")
    return [f"results/{name}/{file}" for file in files]


def drawn(name, file):
    """Pictures that every comparison or diagnosis makes of one record; of several, each has its own names."""
    alone = name not in OF_STRUCTURES and (file == "diagnosis" or len(MEASUREMENTS[name].paths) == 1)
    return [f"results/{name}/{stem}.{ending}" for stem in SEEN[file] for ending in ENDINGS] if alone else []


def made_of(names):
    """Everything that is made of rows."""
    return [path for name in names for path in [*climbed(name), *(f"results/{name}/{file}.json" for file in SEEN)]]


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
                drawn(_name, _file),
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
            page=climbed(_name)[4:],
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


for _entry in ENTRIES:

    rule:
        name:
            _entry
        input:
            made_of([name for name, row in MEASUREMENTS.items() if row.entry == _entry]),


rule gallery:
    input:
        made_of(MEASUREMENTS),
        "results/gallery.html",


rule gallery_page:
    input:
        [path for name in MEASUREMENTS for path in climbed(name)],
        known=[f"config/{name}.tsv" for name in ("literature", "published")],
        style=[f"study/support/picture_page.{ending}" for ending in ("css", "js")],
        code=CODE["gallery"],
    output:
        page="results/gallery.html",
    params:
        records={entry: [name for name, row in MEASUREMENTS.items() if row.entry == entry] for entry in ENTRIES},
    script:
        "../scripts/gallery.py"
