"""``results/study.html``, both parts of the study with one table of contents, and Part II as a document."""

from collections.abc import Callable, Mapping, Sequence

import pandas as pd

from study.reproduction import study_pages
from study.reproduction.chapters.chapter import HELD, get_chapter
from study.reproduction.chapters.contents import CHAPTERS, OF_STRUCTURES
from study.reproduction.study_pages import SECTIONS, Results, claim_folds, each_row, shortened, verdict_blocks
from study.support import document
from study.support.document import Block, Bullets, Heading, PageSection, Picture, Text, table

ONE, TWO = "Part I: the report, run again", "Part II: its recommendations, followed"
BOTH = {"verdict": "", "times": "Both parts"}  # sections of both parts, and what stands above them in the contents
SEARCH = '<input id="search" type="search" placeholder="search the claims" aria-label="search the claims">'
ANCHOR = "part-two-"  # begins those of chapters


def part_two_sentence(claims: pd.DataFrame) -> str:
    """How many claims of Part II hold."""
    whole, part, none = (int((claims["verdict"] == word).sum()) for word in HELD)
    tested = whole + part + none
    said = f"{whole} of {tested} claims hold**, {part} partly, {none} not"
    if tested < len(claims):
        said += f"; {len(claims) - tested} more are not tested, as their data are not there"
    return f"**Part II, the report's recommendations followed: {said}."


def part_two_verdict(results: Results) -> list[Block]:
    """How many claims hold, and what had to be left out."""
    said = "Each was written down with its tolerance before the run; what fails is a finding, with its reason."
    lines = [f"{part_two_sentence(results['part_two_claims'])} {said}"]
    for name, contents in CHAPTERS.items():
        lines += [f"{contents.title}: {left}" for left in get_chapter(name).left_out(_tables(results, name))]
    return [Bullets(tuple(lines))]


def chapter_blocks(name: str, results: Results) -> list[Block]:
    """A chapter: the recommendation, the claims, what was found, and the conditions of every claim."""
    contents = CHAPTERS[name]
    claims = results["part_two_claims"][results["part_two_claims"]["chapter"] == name]
    rows = [[row["verdict"], row["claim"], shortened({**row, "reported": ""}), row["why"]] for row in each_row(claims)]
    own: list[Block] = [
        Text(f"The report's recommendation: \u201c{contents.recommendation}\u201d"),
        table(("verdict", "claim", "measured", "why"), rows),
        *get_chapter(name).told(_tables(results, name)),
    ]
    if name == OF_STRUCTURES:
        own += study_pages.structure_blocks(results)
    return [*own, Heading("What each verdict rests on", 3), *claim_folds(claims.assign(where="", reported=""))]


def _tables(results: Results, chapter: str) -> Mapping[str, pd.DataFrame]:
    return {name: results[name] for name in CHAPTERS[chapter].tables}


def part_two_blocks(results: Results) -> list[Block]:
    """All chapters."""
    page: list[Block] = [Heading(TWO, 1), *part_two_verdict(results)]
    for name, contents in CHAPTERS.items():
        page += [Heading(contents.title), *chapter_blocks(name, results)]
    return page


def study_page(results: Results, pictures: Sequence[Picture]) -> bytes:
    """The whole study for a browser; pictures whose group is a chapter stand in its section, the others by system."""
    sections: list[PageSection] = []
    for anchor, title, make, pages in SECTIONS:
        if "study" not in pages:
            continue
        blocks = make(results) if anchor != "verdict" else [*verdict_blocks(results), *part_two_verdict(results)]
        search = SEARCH if anchor == "claims" else ""
        found = search + document.fragment_without_images(blocks)
        sections.append(PageSection(anchor, title, found, BOTH.get(anchor, ONE)))
    by_system = [picture for picture in pictures if picture.group not in CHAPTERS]
    sections.insert(1, PageSection("figures", "Figures", document.picture_groups(by_system), ONE))
    chapters: list[PageSection] = []
    for name, contents in CHAPTERS.items():
        drawn = document.thumbnails([picture for picture in pictures if picture.group == name])
        found = drawn + document.fragment_without_images(chapter_blocks(name, results))
        chapters.append(PageSection(f"{ANCHOR}{name}", contents.title, found, TWO))
    last = len(sections) - 1 if sections[-1].anchor in BOTH else len(sections)
    sections[last:last] = chapters
    return document.picture_page(study_pages.TITLE, sections)


WHOLE_DOCUMENTS: Mapping[str, Callable[[Results], list[Block]]] = {"part_two": part_two_blocks}
