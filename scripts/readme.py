"""Write the table of the report's numbers into README.md from results/claims.csv: ``make readme``."""

import re
from pathlib import Path

import pandas as pd

from study import document, summary
from study.errors import StudyError
from study.files import replace_file
from study.step import one_sentence

SHOWN = (
    "siso_stiffness", "siso_frequency", "duffing_share", "duffing_cubic", "van_der_pol_damping", "van_der_pol_share",
    "mathieu_side_resonances", "mathieu_stiffness", "dead_band_stiffness", "dead_band_error", "dead_band_share",
    "levels_invariant", "levels_siso", "error_free", "noise_random_only",
)  # fmt: skip
PLACE = re.compile(r"(<!-- numbers -->\n).*?(<!-- /numbers -->)", re.DOTALL)


def main(readme: Path, claims: Path) -> None:
    if not claims.is_file():
        raise StudyError(f"{claims}: there is no such file; run 'make study' first")
    table = pd.read_csv(claims, keep_default_na=False).set_index("id").loc[list(SHOWN)].reset_index()
    block = document.markdown([summary.statements(table)])
    text, count = PLACE.subn(lambda found: found[1] + block + found[2], readme.read_text(encoding="utf-8"))
    if count != 1:
        raise StudyError(f"{readme} has no place for the table: a line '<!-- numbers -->' and one '<!-- /numbers -->'")
    replace_file(readme, text.encode())


if __name__ == "__main__":
    with one_sentence():
        main(Path("README.md"), Path("results/claims.csv"))
