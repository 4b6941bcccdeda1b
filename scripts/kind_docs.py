"""Write the rates of docs/kinds_of_tests.md from docs/trials_by_test.csv.

``kind_docs.py results/trials_by_test/trials.csv`` puts a new run there first.
"""

import sys
from pathlib import Path

import pandas as pd

from study.support import document
from study.support.files import replace_file
from study.support.workflow_step import one_sentence
from study.trials import kind_rates
from study.trials.likelihoods import likelihood_blocks

if __name__ == "__main__":
    with one_sentence():
        kept = Path("docs/trials_by_test.csv")
        for name in sys.argv[1:]:
            replace_file(kept, Path(name).read_bytes())
        page, table = Path("docs/kinds_of_tests.md"), pd.read_csv(kept)
        kind_rates.write_rates(page, table)
        document.put(page, "laws", likelihood_blocks(table))
