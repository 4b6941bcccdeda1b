# The study: `snakemake -j2` makes every figure, table and check. See README.md.
import sys
from pathlib import Path

from snakemake import benchmark

from study.support.cores import one_thread_of_algebra

one_thread_of_algebra()  # two jobs at a time, each with fits side by side

from study.reproduction.config import load_config
from study.support.workflow_step import one_sentence, only_run, remove_half_written

with one_sentence():
    STUDY = load_config(Path("config"))
    if workflow.is_main_process and not workflow.dryrun:
        LOCK = only_run(Path(".snakemake/running"))  # held until this process ends
        remove_half_written(Path("results"), Path("figures"))


report: "rules/captions/workflow.rst"


onstart:
    # To hold to a number of jobs a second, Snakemake looks again a second later, after each job that has ended, for good:
    # after fifty jobs fifty times a second, each time at every file that waiting jobs need, which takes a core. Here a job
    # waits for nothing but a core, and the one that ends says so.
    if workflow.local_exec:
        workflow.scheduler.job_rate_limiter = None
        # What a job's memory is, a thread asks twice a second of this process and all below it; only its time is told.
        benchmark.BENCHMARK_INTERVAL_SHORT = benchmark.BENCHMARK_INTERVAL


include: "rules/common.smk"
include: "rules/reproduce.smk"
include: "rules/claims.smk"
include: "rules/monte_carlo.smk"
include: "rules/estimators.smk"
include: "rules/structures.smk"
include: "rules/part_two.smk"
include: "rules/summary.smk"
include: "rules/trials.smk"
include: "rules/cases.smk"
include: "rules/measured.smk"
include: "rules/campaign.smk"


PART_ONE = [
    [products(case) for case in STUDY.cases],
    CLAIM_RESULTS,
    ERROR_RESULTS,
    SUMMARY_RESULTS,
]
PART_TWO_RESULTS = [
    [structure_products(case) for case in STRUCTURES.cases],
    STRUCTURE_RESULTS,
    PART_TWO_TABLES,
    PART_TWO_CLAIMS,
    [list(figures.values()) for figures in PART_TWO_FIGURES.values()],
]


rule all:
    default_target: True
    input:
        PART_ONE,
        PART_TWO_RESULTS,
        "results/study.html",


# The report, run again; the report's recommendations, followed. The page of both is made with `all`.
rule part1:
    input:
        PART_ONE,


rule part2:
    input:
        PART_TWO_RESULTS,
