"""Write measured numbers into README.md and docs/ from the tables of results/: ``make readme``.

``trial_docs.py`` writes what is said of the trials.
"""

from pathlib import Path

import pandas as pd

from study.reproduction import study_pages, whole_page
from study.support import document
from study.support.errors import StudyError
from study.support.workflow_step import one_sentence

SHOWN = (
    "siso_stiffness", "duffing_share", "duffing_cubic", "van_der_pol_damping", "dead_band_stiffness", "error_free",
    "noise_random_only",
)  # fmt: skip


def main(results: Path, readme: Path, docs: Path) -> None:
    claims = results / "claims.csv"
    if not claims.is_file():
        raise StudyError(f"{claims}: there is no such file; run 'make study' first")
    table = pd.read_csv(claims, keep_default_na=False).set_index("id")
    said = study_pages.statements(table.loc[list(SHOWN)].reset_index())
    document.put(docs / "reproduction.md", "numbers", [said])
    if (judged := results / "part_two" / "claims.csv").is_file():
        sentence = whole_page.part_two_sentence(pd.read_csv(judged, keep_default_na=False))
        for page in (docs / "reproduction.md", readme):
            document.put(page, "part two", [document.Text(sentence)])


if __name__ == "__main__":
    with one_sentence():
        main(Path("results"), Path("README.md"), Path("docs"))
