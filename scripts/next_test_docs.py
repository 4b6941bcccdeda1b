"""Write the example of docs/next_test.md and its picture, by the commands that it shows; ``make next_test`` does it."""

import io
import json
import os
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

from study import cli
from study.support import document
from study.support.document import Image, Text
from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

COMMANDS = (
    "study trial --seed 560078 --hidden displacement_damping --noise 0.05 --response displacement",
    "study plan trial_560078.csv --model trial_560078.yaml --max-force 270 --max-displacement 0.0009 --max-length 125",
)
SHOWS = "What drives the test, what each rival would answer, and how the evidence grows"


def main(docs: Path) -> None:
    page, home = docs.resolve() / "next_test.md", Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            with redirect_stdout(io.StringIO()):
                for command in COMMANDS:
                    if cli.main(command.split()[1:]):
                        raise StudyError(f"'{command}' failed; expected the example of {page}")
            results = Path("results") / "trial_560078"
            says, picture = (
                json.loads((results / "plan.json").read_text())["says"],
                (results / "next_test.png").read_bytes(),
            )
        finally:
            os.chdir(home)
    replace_file(page.with_suffix(".png"), picture)
    shown = "\n".join(("```", *COMMANDS, "```"))
    document.put(page, "example", [Text(shown), Text(f"> {says}"), Image(SHOWS, "next_test.png")])


if __name__ == "__main__":
    with one_sentence():
        main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs"))
