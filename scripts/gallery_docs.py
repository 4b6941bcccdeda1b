"""Write docs/gallery.md and its small pictures from what the climbs left in results/: ``make gallery``."""

import io
from pathlib import Path

import pandas as pd
from PIL import Image

from study.commands import measurements
from study.gallery import gallery_page
from study.gallery.gallery_page import entries
from study.support import document
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

WIDTH, COLOURS = 720, 64  # of a kept picture, in pixels, and of its palette


def main(config: Path, results: Path, docs: Path) -> None:
    records: dict[str, list[str]] = {}
    for name, row in measurements.load_measurements(config).items():
        if (results / name / "history.json").is_file():
            records.setdefault(row.entry, []).append(name)
        else:
            print(f"{name} is left out: there is no {results / name / 'history.json'}")
    made = entries(config, results, records)
    folder = docs / "gallery"
    folder.mkdir(exist_ok=True)
    for old in folder.glob("*.png"):
        old.unlink()
    for entry in made:
        first = entry.found[0]
        for name in gallery_page.kept(first):
            replace_file(folder / gallery_page.picture_name(first, name), small(first.folder / name))
    document.put(docs / "gallery.md", "gallery", gallery_page.documented(made, folder.name))
    kept = [
        {"record": f.record, "step": i, "term": s.get("added") or "", "dropped": s.get("dropped") or "",
         "error": s["error"]["response"], "noise_floor": s["noise_floor"]["response"],
         "verdict": f.last["verdict"] if i == len(f.steps) - 1 else ""}
        for entry in made for f in entry.found for i, s in enumerate(f.steps)
    ]  # fmt: skip
    replace_file(docs / "gallery.csv", pd.DataFrame(kept).to_csv(index=False, float_format="%.5g").encode())


def small(path: Path) -> bytes:
    """A picture with few colours, no wider than a page."""
    with Image.open(path) as image:
        width = min(WIDTH, image.width)
        shown = image.convert("RGB").resize(
            (width, round(image.height * width / image.width)), Image.Resampling.LANCZOS
        )
    target = io.BytesIO()
    shown.quantize(COLOURS).save(target, format="png", optimize=True)
    return target.getvalue()


if __name__ == "__main__":
    with one_sentence():
        main(Path("config"), Path("results"), Path("docs"))
