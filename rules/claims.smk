# The report's claims, and the two studies that they rest on: the reading of "unit variance" and the
# integrator's steps. All work on ensembles of their own seeds, not on results/<case>: they wait for no case, and what
# takes longest begins first. What they do beside the simulations keeps one core busy, not two.
from study.reproduction.claims import claims_table
from study.reproduction.claims.reported import check_complete, check_systems, load_reported

STATEMENTS = "config/reported.tsv"

with one_sentence():
    _reported = load_reported(Path(STATEMENTS))
    check_complete(_reported, Path(STATEMENTS), claims_table.CLAIMS, claims_table.NUMBERS)
    check_systems(_reported, Path("models"))

# The systems of Table 1: another model in the folder is none of the claims' business.
MODELS = sorted({f"models/{name.split('.')[1]}.yaml" for name in _reported.statements if name.count(".") == 2})

with one_sentence():
    CLAIM_SETTINGS = STUDY.settings.claims.plain()
WITHOUT_NOISE = {key: value for key, value in CLAIM_SETTINGS.items() if key != "noise_seed"}
CLAIM_RESULTS = [f"results/{name}.csv" for name in ("excitation_reading", "integrator_steps", "claims")]


rule excitation_reading:
    input:
        statements=STATEMENTS,
        models=MODELS,
        code=modules("excitation_reading"),
    output:
        table=report(
            "results/excitation_reading.csv",
            category="Tables",
            caption="captions/excitation_reading.rst",
            labels={"table": "Reading of unit variance", "as": "raw CSV"},
        ),
    params:
        models="models",
        settings=WITHOUT_NOISE,
    priority: 1
    benchmark:
        "results/benchmarks/excitation_reading.tsv"
    run:
        step("excitation_reading", input, output, params, wildcards)


rule integrator_steps:
    input:
        models=MODELS,
        code=modules("integrator_steps"),
    output:
        csv=report(
            "results/integrator_steps.csv",
            category="Tables",
            caption="captions/integrator_steps.rst",
            labels={"table": "Steps of the integrator", "as": "raw CSV"},
        ),
    params:
        models="models",
        settings=WITHOUT_NOISE,
    priority: 1
    benchmark:
        "results/benchmarks/integrator_steps.tsv"
    run:
        step("integrator_steps", input, output, params, wildcards)


rule claims:
    input:
        statements=STATEMENTS,
        steps="results/integrator_steps.csv",
        models=MODELS,
        code=modules("claims"),
    output:
        csv=report(
            "results/claims.csv",
            category="Tables",
            caption="captions/claims.rst",
            labels={"table": "Claims of the report", "as": "raw CSV"},
        ),
    params:
        models="models",
        settings=CLAIM_SETTINGS,
    priority: 1
    benchmark:
        "results/benchmarks/claims.tsv"
    run:
        step("claims", input, output, params, wildcards)
