"""Write measured numbers into README.md and docs/ from the tables of results/: ``make readme``.

The Silverbox is a target of its own; where its history is not there, its place is left as it is. ``trial_docs.py``
writes what is said of the trials.
"""

import json
from pathlib import Path

import pandas as pd

from study.compare import history
from study.reproduction import study_pages, whole_page
from study.support import document
from study.support.errors import StudyError
from study.support.workflow_step import one_sentence

SHOWN = (
    "siso_stiffness", "duffing_share", "duffing_cubic", "van_der_pol_damping", "mathieu_stiffness",
    "dead_band_stiffness", "dead_band_error", "error_free", "noise_random_only",
)  # fmt: skip


def main(results: Path, readme: Path, docs: Path) -> None:
    claims = results / "claims.csv"
    if not claims.is_file():
        raise StudyError(f"{claims}: there is no such file; run 'make study' first")
    table = pd.read_csv(claims, keep_default_na=False).set_index("id")
    said = study_pages.statements(table.loc[list(SHOWN)].reset_index())
    document.put(docs / "reproduction.md", "numbers", [said])
    if (judged := results / "part_two" / "claims.csv").is_file():
        said = whole_page.part_two_sentence(pd.read_csv(judged, keep_default_na=False))
        for page in (docs / "reproduction.md", readme):
            document.put(page, "part two", [document.Text(said)])
    if (climbed := results / "silverbox" / "history.json").is_file():
        document.put(
            docs / "tool.md", "history", [errors_by_step(json.loads(climbed.read_text(encoding="utf-8"))["steps"])]
        )


def errors_by_step(steps: list[dict]) -> document.Block:
    rows = [
        ("linear oscillator" if number == 0 else history.label(step).replace("_", " "),
         f"{100.0 * step['error']['response']:.3g} %", f"{1000.0 * step['rms']:.3f} mV")
        for number, step in enumerate(steps)
    ]  # fmt: skip
    return document.table(("model", "error of the response", "rms"), rows)


if __name__ == "__main__":
    with one_sentence():
        main(Path("results"), Path("README.md"), Path("docs"))
