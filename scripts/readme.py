"""Write measured numbers into README.md and docs/tool.md from the tables of results/: ``make readme``.

The trials and the Silverbox are targets of their own; a table that is not there leaves its place as it is.
"""

import json
import re
import shutil
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
CONFUSION = "trials_confusion.png"


def main(results: Path, figures: Path, readme: Path, tool: Path) -> None:
    claims = results / "claims.csv"
    if not claims.is_file():
        raise StudyError(f"{claims}: there is no such file; run 'make study' first")
    table = pd.read_csv(claims, keep_default_na=False).set_index("id").loc[list(SHOWN)].reset_index()
    put(readme, "numbers", document.markdown([summary.statements(table)]))
    if (reached := results / "trials" / "summary.csv").is_file():
        put(tool, "reach", f"{reach(pd.read_csv(reached))}\n![What was hidden, and what was said]({CONFUSION})\n")
        shutil.copyfile(figures / CONFUSION, tool.parent / CONFUSION)
    if (history := results / "silverbox" / "history.json").is_file():
        put(tool, "ladder", ladder(json.loads(history.read_text(encoding="utf-8"))["steps"]))


def put(page: Path, name: str, block: str) -> None:
    """Replace what stands between the two marks of this name."""
    place = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
    text, count = place.subn(lambda found: found[1] + block + found[2], page.read_text(encoding="utf-8"))
    if count != 1:
        raise StudyError(f"{page} has no place for the table: a line '<!-- {name} -->' and one '<!-- /{name} -->'")
    replace_file(page, text.encode())


def reach(table: pd.DataFrame) -> str:
    percent = 100.0 * table[["rate", "standard_error"]]
    rates = [f"{rate:.1f} +- {error:.1f} %" for rate, error in percent.itertuples(index=False)]
    wanted = ["" if pd.isna(w) else f"{100.0 * w:.0f} %" for w in table["wanted"]]
    shown = pd.DataFrame({"reach": table["reach"], "trials": table["trials"], "measured": rates, "wanted": wanted})
    return shown.to_markdown(index=False) + "\n"


def ladder(steps: list[dict]) -> str:
    rows = [
        {"model": "linear oscillator" if step["added"] is None else f"+ {step['added'].replace('_', ' ')}",
         "error of the response": f"{100.0 * step['error']['response']:.3g} %", "rms": f"{1000.0 * step['rms']:.3f} mV"}
        for step in steps
    ]  # fmt: skip
    return pd.DataFrame(rows).to_markdown(index=False) + "\n"


if __name__ == "__main__":
    with one_sentence():
        main(Path("results"), Path("figures"), Path("README.md"), Path("docs/tool.md"))
