# Part II, the report's recommendations followed: each chapter's tables in one job, then the claims of all, and the figures.
# `snakemake -j2 part2` makes it, `snakemake -j2 results/part_two/noise.csv` one chapter's tables.
from study.reproduction.chapters.contents import CHAPTERS
from study.reproduction.chapters.chapter import PartTwoSettings, check_expected
from study.commands.ladder import load_ladders
from study.commands.measurements import load_measurements
from study.gallery.gallery_page import Literature
from study.support.config_files import read_rows, read_yaml

EXPECTED = "config/expected.tsv"

with one_sentence():
    PART_TWO = read_yaml(Path("config/part_two.yaml"), PartTwoSettings)
    if workflow.is_main_process:
        check_expected(load_reported(Path(EXPECTED)), Path(EXPECTED))

with one_sentence():
    _measurements = load_measurements(Path("config"))
    LADDERS = load_ladders(Path("config"), _measurements)
    TITLES = {row.entry: row.title for _, row in read_rows(Path("config/literature.tsv"), Literature)}
LADDER_ROWS = {name: _measurements[name] for name in LADDERS}

PART_TWO_TABLES = [f"results/part_two/{name}.csv" for contents in CHAPTERS.values() for name in contents.tables]
PART_TWO_CLAIMS = "results/part_two/claims.csv"
PART_TWO_FIGURES = {chapter: {name: pictures(name) for name in contents.figures} for chapter, contents in CHAPTERS.items()}
CODE["chapters"] = modules("part_two", also=[f"study.reproduction.chapters.{c.module}" for c in CHAPTERS.values()])
# Of results/study.html: a chapter's stand in its section.
PART_TWO_PICTURES = [
    {"file": f"figures/{name}.png", "system": chapter, "number": contents.title, "shows": shows}
    for chapter, contents in CHAPTERS.items()
    for name, shows in contents.figures.items()
]

for _chapter, _contents in CHAPTERS.items():
    if _chapter == "measured":
        continue

    rule:
        name:
            f"chapter.{_chapter}"
        input:
            models=[*MODELS, *sorted(str(path) for folder in ("forces", "structures", "varying") for path in Path("models", folder).glob("*.yaml"))],
            code=modules("chapter", also=[f"study.reproduction.chapters.{_contents.module}", *ESTIMATORS.values()]),
        output:
            **{name: f"results/part_two/{name}.csv" for name in _contents.tables},
        params:
            chapter=_chapter,
            study=CLAIM_SETTINGS,
            own=PART_TWO.plain()[_chapter],
        priority: 1 + (_chapter in ("excitations", "noise"))  # as of the ladders
        benchmark:
            f"results/benchmarks/chapter.{_chapter}.tsv"
        run:
            step("chapter", input, output, params, wildcards)


# Ladders of the records that are there; of another folder of data, or when a file comes or goes, they are made anew.
rule ladders:
    input:
        models=sorted({row.model for row in LADDER_ROWS.values()}),
        code=modules("ladders"),
    output:
        ladders="results/part_two/ladders.csv",
    params:
        rows={name: row.plain() for name, row in LADDER_ROWS.items()},
        ladders={name: row.plain() for name, row in LADDERS.items()},
        titles={name: TITLES[LADDER_ROWS[name].entry] for name in LADDERS},
        there=[path for row in LADDER_ROWS.values() for path in row.paths if Path(path).is_file()],
    priority: 2  # takes long: last, it would keep the other cores waiting
    benchmark:
        "results/benchmarks/chapter.measured.tsv"
    run:
        step("ladders", input, output, params, wildcards)


rule part_two_claims:
    input:
        tables=PART_TWO_TABLES,
        statements=EXPECTED,
        code=CODE["chapters"],
    output:
        claims=PART_TWO_CLAIMS,
    benchmark:
        "results/benchmarks/part_two_claims.tsv"
    run:
        step("part_two", input, output, params, wildcards)


for _chapter, _contents in CHAPTERS.items():

    rule:
        name:
            f"draw_chapter.{_chapter}"
        input:
            tables=[f"results/part_two/{name}.csv" for name in _contents.tables],
            style=STYLE,
            code=CODE["chapters"],
        output:
            **PART_TWO_FIGURES[_chapter],
        params:
            chapter=_chapter,
        benchmark:
            f"results/benchmarks/draw_chapter.{_chapter}.tsv"
        run:
            step("part_two", input, output, params, wildcards)


PART_TWO_BENCHMARKS = [f"results/benchmarks/chapter.{chapter}.tsv" for chapter in CHAPTERS]
PART_TWO_BENCHMARKS += [f"results/benchmarks/draw_chapter.{chapter}.tsv" for chapter in CHAPTERS]
PART_TWO_BENCHMARKS += ["results/benchmarks/part_two_claims.tsv"]
