"""The gallery as one page for a browser, and as blocks of the documentation with a picture or two of each entry."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from study.gallery import blocks
from study.gallery.findings_of_record import Beside, RecordFindings, found_beside, read_findings
from study.gallery.known import Literature, literature, published
from study.support import document
from study.support.document import Block, Fold, Heading, Image, PageSection, Picture
from study.support.numbers import percent

TITLE = "Measured records"
PICTURES: Mapping[str, str] = {  # of a climb's folder, and what they show
    "history.png": "every model of the climb and its held-out error",
    "climb/step_0/structure.png": "where a force is missing from the structure as given",
    "climb/step_0/candidates.png": "what could be missing from the model as given",
    "climb/step_0/constancy.png": "the test of a constant coefficient: a true effect has one",
    "climb/decay.png": "frequency and damping ratio against amplitude, of the model reached",
    "climb/loops.png": "loops of the force, of the model reached",
    "climb/response.png": "the model reached beside the measurement",
    "climb/missing_force.png": "the force that the model reached still lacks",
    "climb/force_error.png": "unexplained force by frequency, of the model reached",
}
KEPT = (
    "climb/decay.png",
    "climb/loops.png",
    "climb/step_0/structure.png",
    "climb/response.png",
    "climb/step_0/constancy.png",
)  # the first ...
MOST = 2  # ... of these that there are stand in the documentation


@dataclass(frozen=True)
class Entry:
    """One entry of the gallery."""

    known: Literature
    found: tuple[RecordFindings, ...]  # a record each
    values: tuple[Beside, ...]


def entries(config: Path, results: Path, records: Mapping[str, Sequence[str]]) -> list[Entry]:
    """The entries of the gallery in the order of the literature, with the names of their records.

    Raises
    ------
    StudyError
        If a table has a fault, or a climb left no results.
    """
    values = published(config)
    made: list[Entry] = []
    for name, known in literature(config).items():
        found = tuple(read_findings(results / record, record) for record in records.get(name, []))
        own = tuple(found_beside(row, one) for one in found for row in values if row.record == one.record)
        if found:
            made.append(Entry(known, found, own))
    return made


def gallery_page(shown: Sequence[Entry]) -> bytes:
    """Everything on one page, with thumbnails that open."""
    first = PageSection("all", "All of them", document.fragment([climb_overview(shown)]))
    return document.picture_page(TITLE, [first, *(_section(entry) for entry in shown)])


def climb_overview(shown: Sequence[Entry]) -> Block:
    """One line a record: where the climb begins, what it adds, and where it ends."""
    rows = [
        (f"`{f.record}`", e.known.test, percent(f.steps[0]["error"]["response"]), _added(f),
         percent(f.steps[-1]["error"]["response"]), percent(f.steps[-1]["noise_floor"]["response"]),
         f.last["verdict"].replace("_", " "))
        for e in shown for f in e.found
    ]  # fmt: skip
    head = ("record", "test", "error as given", "added", "error at the end", "noise floor", "last verdict")
    return document.table(head, rows)


def _added(found: RecordFindings) -> str:
    names = [s["added"] for s in found.steps if s.get("added")]
    gone = {s["dropped"] for s in found.steps if s.get("dropped")}
    return ", ".join(n.replace("_", " ") + (" (taken out again)" if n in gone else "") for n in names) or "nothing"


def _section(entry: Entry) -> PageSection:
    told = blocks.told(entry.known, entry.found, entry.values)
    folds = [Fold(f"{f.record}: the first candidates", (blocks.candidates(f),)) for f in entry.found]
    shown = "".join(
        (f"<h3>{f.record}</h3>" if len(entry.found) > 1 else "") + document.thumbnails(climb_pictures(f))
        for f in entry.found
    )
    return PageSection(entry.known.entry, entry.known.title, document.fragment([*told, *folds]) + shown)


def climb_pictures(found: RecordFindings) -> list[Picture]:
    """Those that the climb made."""
    return [
        Picture(found.record, found.record, shows, (found.folder / name).read_bytes())
        for name, shows in PICTURES.items()
        if (found.folder / name).is_file()
    ]


def kept(found: RecordFindings) -> list[str]:
    """Names of the pictures that the documentation keeps of a record."""
    return [name for name in KEPT if (found.folder / name).is_file()][:MOST]


def picture_name(found: RecordFindings, name: str) -> str:
    """What such a picture is called in the documentation."""
    return f"{found.record}_{name.rpartition('/')[2]}"


def documented(shown: Sequence[Entry], folder: str) -> list[Block]:
    """The gallery for the documentation; ``folder`` holds its pictures."""
    parts: list[Block] = [climb_overview(shown)]
    for entry in shown:
        parts.append(Heading(entry.known.title))
        parts += blocks.told(entry.known, entry.found, entry.values)
        first = entry.found[0]
        parts += [Image(PICTURES[name], f"{folder}/{picture_name(first, name)}") for name in kept(first)]
    return parts
