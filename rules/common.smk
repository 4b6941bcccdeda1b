# What several rules share: the modules that each stage rests on, settings and files by case.
from study.identify.estimators import ESTIMATORS
from study.support import step_server
from study.support.workflow_step import rests_on

# Scripts of steps that take less time than a start of Python with its packages, or little more.
STEP_SCRIPTS = ("make_record", "identify", "monte_carlo", "draw", "claims", "excitation_reading", "integrator_steps", "structure_case", "join", "pages", "chapter", "part_two")
if workflow.is_main_process and not workflow.dryrun:
    step_server.preload((f"scripts/{script}.py" for script in STEP_SCRIPTS), "study.figures.first_page")

# Touching study/identify/frequency_domain/conditioned.py re-runs identification and what follows, not simulation, though the two share
# study/reproduction/cases.py: what only identification uses is not followed from there.
IDENTIFICATION_ONLY = ["study.identify.estimators", "study.identify.estimators.base", "study.records.spectra", "study.identify.frequency_domain.local_polynomial"]


# Where results go to a store (profiles/kubernetes), jobs get the project's files with the job, as they were when the run
# began; its modules are no inputs there, which each job would fetch one by one.
STORED = workflow.storage_settings.default_storage_provider is not None


def modules(script, **options):
    """A script and the modules that it rests on."""
    path = Path(f"scripts/{script}.py")
    return [] if STORED else [str(path), *rests_on(path, **options)]


def step(script, input, output, params, wildcards):
    """Run a script as a rule's step: in a process of its own that has its packages already, or that is the job's."""
    told = {"input": input, "output": output, "params": params, "wildcards": wildcards}
    if workflow.is_main_process:
        step_server.run_forked(f"scripts/{script}.py", told, workflow.resource_settings.cores or 1)
    else:
        step_server.run_here(f"scripts/{script}.py", told)


CODE = {
    "record": modules("make_record", without=IDENTIFICATION_ONLY),
    "identify": modules("identify", also=ESTIMATORS.values()),
    "draw": modules("draw"),
    "monte_carlo": modules("monte_carlo", also=ESTIMATORS.values()),
    "join": modules("join"),
    "pages": modules("pages"),
}
STYLE = "study/figures/study.mplstyle"
ENDINGS = ("png", "svg")
DESCRIBED = {
    "linear": "A_1: magnitude and phase",
    "nonlinear": "A_2 (A_3): real and imaginary part",
    "coherence": "cumulative coherence",
    "histogram": "histogram of the response",
    "pattern": "restoring force against displacement",
    "autospectrum": "autospectrum of the response",
    "force_history": "force history and autospectrum",
    "force_histogram": "histogram of the force",
}
IDENTIFIED_FILES = ("frequency_response.csv", "coherence.csv", "noise.csv", "parameters.csv")


def record_settings(wildcards):
    return STUDY.record_settings(wildcards.case).plain()


def ensemble_settings(wildcards):
    return STUDY.record_settings(wildcards.case).without_seeds().plain()


def monte_carlo_settings(wildcards):
    return [STUDY.identification_settings(wildcards.case, STUDY.settings.monte_carlo.estimators).plain()]


def compared_settings(case):
    return STUDY.identification_settings(case, STUDY.settings.estimator_errors.estimators).plain()


def model_of(wildcards):
    return STUDY.cases[wildcards.case].model_file


def pictures(stem):
    """The files of a figure."""
    return [f"figures/{stem}.{ending}" for ending in ENDINGS]


def products(case):
    """Everything that is made of a case."""
    tables = [f"results/{case}/{name}" for name in ("record.csv", *IDENTIFIED_FILES)]
    return tables + [path for stem in STUDY.cases[case].figures.values() for path in pictures(stem)]


def figures_of(case):
    """Outputs of the rule that draws a case: by kind the files, the PNG of each with its words in the report page."""
    found = {}
    for kind, stem in STUDY.cases[case].figures.items():
        png, svg = pictures(stem)
        number = stem.removeprefix("figure_").rjust(2) if stem.startswith("figure_") else "not in the report"
        page = {
            "caption": f"captions/{kind}.rst",
            "category": "Figures",
            "subcategory": STUDY.cases[case].title,
            "labels": {"figure": number, "shows": DESCRIBED[kind]},
        }
        found[kind] = [report(png, **page), svg]
    return found
