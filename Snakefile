# The study: `snakemake -j2` makes every figure, table and check. See README.md.
import sys
from pathlib import Path

from study.config import load
from study.errors import StudyError

try:
    STUDY = load(Path("config"))
except StudyError as fault:
    sys.exit(f"study: {fault}")


include: "rules/common.smk"
include: "rules/reproduce.smk"
include: "rules/claims.smk"


rule all:
    default_target: True
    input:
        [f"results/{case}/parameters.csv" for case in STUDY.cases],
        CLAIM_RESULTS,
