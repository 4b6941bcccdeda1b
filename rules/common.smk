# The modules that each stage rests on. Snakemake sees a change of a script by itself, of a module only
# when it is an input: touching study/miso.py re-runs identification and what follows, not simulation.
CODE = {
    "record": [
        f"study/{module}.py"
        for module in (
            "case excitation expression graph interpolation kernels model modelfile record simulate terms"
        ).split()
    ],
    "identify": [
        f"study/{module}.py" for module in "inputs miso parameters spectra tables".split()
    ]
    + [f"study/estimators/{module}.py" for module in "base siso miso hand_read".split()],
}


def record_settings(wildcards):
    return STUDY.record_settings(wildcards.case)


def identification_settings(wildcards):
    return STUDY.identification_settings(wildcards.case)


def model_of(wildcards):
    return STUDY.cases[wildcards.case].model
