"""Draw one picture of every fault of the measurement for docs/tool.md; ``make fault_pictures`` does it."""

import io
import sys
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from study.equations.model_file import read_model
from study.faults.fault import FORCE_NOISE, NAMES
from study.faults.fault_examples import example
from study.faults.fault_pictures import picture
from study.figures import page
from study.figures.sheet import in_style
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

USUAL, LINEAR = "duffing", "linear"  # of a linear system noise on the force is estimated best
GREYS = 16  # of a picture: it has no colours


def small(data: bytes) -> bytes:
    """A picture in few shades of grey."""
    target = io.BytesIO()
    Image.open(io.BytesIO(data)).convert("L").quantize(GREYS).save(target, "PNG", optimize=True)
    return target.getvalue()


def main(models: Path, folder: Path, faults: Sequence[str] = NAMES) -> None:
    systems = {name: read_model(models / f"{name}.yaml") for name in (USUAL, LINEAR)}
    folder.mkdir(parents=True, exist_ok=True)
    with in_style():
        for name in faults:
            one = example(systems[LINEAR if name == FORCE_NOISE else USUAL], name)
            replace_file(folder / f"{name}.png", small(page.rendered(picture(one), "png")))
            print(f"{name}: {one.found.says}")


if __name__ == "__main__":
    with one_sentence():
        main(Path(sys.argv[1]), Path(sys.argv[2]))
