# Structures of several coordinates: each case of config/structures.tsv in one job, and what is said of all of them.
from study.reproduction.config import load_structures

with one_sentence():
    STRUCTURES = load_structures(Path("config"), list(STUDY.cases))

CODE["structure"] = modules("structure_case")
# What is made of a case: in reverse, equation by equation, or by its modes.
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
STRUCTURE_RESULTS = ["results/structures.csv", "results/structure_claims.csv"]
STRUCTURE_TITLES = {case.case: case.title for case in STRUCTURES.cases.values()}
# Of results/study.html, after those of the report's systems.
STRUCTURE_PICTURES = [
    {"file": f"figures/{case.case}_{kind}.png", "system": "structures", "number": case.title, "shows": shows}
    for case in STRUCTURES.cases.values()
    for kind, shows in STRUCTURE_FIGURES[case.modal].items()
]


def structure_products(case):
    """Everything that is made of a case of structures."""
    way = STRUCTURES.cases[case].modal
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
            **{kind: f"results/{_name}/{name}.csv" for kind, name in STRUCTURE_TABLES[_case.modal].items()},
            **{f"draw_{kind}": pictures(f"{_name}_{kind}") for kind in STRUCTURE_FIGURES[_case.modal]},
        params:
            case=_case.plain(),
            record=STRUCTURES.record_settings(_name).plain(),
            settings=STRUCTURES.identification_settings(_name).plain(),
            limits=STRUCTURES.settings.limits,
        priority: 1
        benchmark:
            f"results/benchmarks/structure.{_name}.tsv"
        run:
            step("structure_case", input, output, params, wildcards)

    rule:
        name:
            _name
        input:
            structure_products(_name),


use rule rates as structures with:
    input:
        tables=[f"results/{case}/parameters.csv" for case in STRUCTURES.cases],
        code=CODE["join"],
    output:
        table=STRUCTURE_RESULTS[0],


use rule rates as structure_claims with:
    input:
        tables=[f"results/{case}/claims.csv" for case in STRUCTURES.cases],
        code=CODE["join"],
    output:
        table=STRUCTURE_RESULTS[1],
