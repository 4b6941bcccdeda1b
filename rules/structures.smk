# Structures of several coordinates: each case of config/structures.tsv in one job, and what is said of all of them.
from study.structure import structure_study

with one_sentence():
    STRUCTURES = structure_study.load_structures(Path("config"), list(STUDY.cases))

CODE["structure"] = rests_on(Path("scripts/structure_case.py"))
CODE["structure_summary"] = rests_on(Path("scripts/structure_summary.py"))
# What is made of a case: in reverse, equation by equation, or by its modes where the linear part is as measured.
STRUCTURE_TABLES = {
    "": {
        "record": "record", "responses": "frequency_response", "coherences": "coherence", "parameters": "parameters",
        "reactions": "reactions", "claims": "claims",
    },
    "yes": {"record": "record", "responses": "frequency_response", "parameters": "parameters", "claims": "claims"},
}  # fmt: skip
STRUCTURE_FIGURES = {
    "": {"connections": "A_j(f) of every connection", "coherence": "cumulative coherence of each equation"},
    "yes": {"measured": "coefficients and transfer functions line by line, the linear part as measured"},
}
STRUCTURE_RESULTS = [f"results/{name}" for name in ("structures.csv", "structure_claims.csv", "structures.md")]
STRUCTURE_TITLES = {case.case: case.title for case in STRUCTURES.cases.values()}
# Of results/study.html, after those of the report's systems.
STRUCTURE_PICTURES = [
    {"file": f"figures/{case.case}_{kind}.png", "system": case.title, "number": "Not in the report", "shows": shows}
    for case in STRUCTURES.cases.values()
    for kind, shows in STRUCTURE_FIGURES[case.measured].items()
]


def structure_products(case):
    """Everything that is made of a case of structures."""
    way = STRUCTURES.cases[case].measured
    tables = [f"results/{case}/{name}.csv" for name in STRUCTURE_TABLES[way].values()]
    return tables + [path for kind in STRUCTURE_FIGURES[way] for path in pictures(f"{case}_{kind}")]


for _name, _case in STRUCTURES.cases.items():

    rule:
        name:
            f"structure.{_name}"
        input:
            model=_case.model_file,
            style=STYLE,
            code=CODE["structure"],
        output:
            **{kind: f"results/{_name}/{name}.csv" for kind, name in STRUCTURE_TABLES[_case.measured].items()},
            **{
                f"{kind}_{ending}": f"figures/{_name}_{kind}.{ending}"
                for kind in STRUCTURE_FIGURES[_case.measured]
                for ending in ENDINGS
            },
        params:
            case=_case.plain(),
            settings=STRUCTURES.settings.plain(),
        benchmark:
            f"results/benchmarks/structure.{_name}.tsv"
        script:
            "../scripts/structure_case.py"

    rule:
        name:
            _name
        input:
            structure_products(_name),


rule structures:
    input:
        parameters=[f"results/{case}/parameters.csv" for case in STRUCTURES.cases],
        claims=[f"results/{case}/claims.csv" for case in STRUCTURES.cases],
        code=CODE["structure_summary"],
    output:
        table=STRUCTURE_RESULTS[0],
        claims=STRUCTURE_RESULTS[1],
        page=STRUCTURE_RESULTS[2],
    params:
        titles=STRUCTURE_TITLES,
    script:
        "../scripts/structure_summary.py"
