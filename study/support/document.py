"""Pages made of headings, text and tables, as Markdown for a reader of files and as HTML for the report page."""

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from tabulate import tabulate

from study.support.errors import StudyError
from study.support.files import replace_file

STYLE = """\
body { font: 15px/1.45 system-ui, sans-serif; color: #1a1a1a; max-width: 1200px; margin: 1.5em auto; padding: 0 1em }
table { border-collapse: collapse; margin: 0.6em 0 1.4em; font-size: 13px }
th, td { text-align: left; vertical-align: top; padding: 0.3em 0.7em; border-bottom: 1px solid #ddd }
th { border-bottom: 2px solid #888; position: sticky; top: 0; background: white }
tr:hover td { background: #f4f7fb }
code { background: #f2f2f2; padding: 0 0.2em }"""
BOLD, CODE, LINK = r"\*\*(.+?)\*\*", r"`(.+?)`", r"\[(.+?)\]\(([^)]+)\)"


@dataclass(frozen=True)
class Heading:
    """A heading of level 1 or 2."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Text:
    """A paragraph. Text may hold ``**bold**``, a word of code in back quotes, and ``[a](link)``."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of sentences."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class TableBlock:
    """Rows of words under a heading."""

    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Image:
    """A picture in a file of its own; a self-contained page gives its words alone."""

    words: str
    path: str


@dataclass(frozen=True)
class Fold:
    """Blocks that are shown when their title is clicked; ``anchor`` is what a link on the page leads to."""

    title: str
    blocks: "tuple[Block, ...]"
    anchor: str = ""


Block = Heading | Text | Bullets | TableBlock | Image | Fold


def table(heading: Sequence[str], rows: Sequence[Sequence[object]]) -> Block:
    """A table, or the word "None." where there are no rows."""
    if not rows:
        return Text("None.")
    return TableBlock(tuple(heading), tuple(tuple(str(cell) for cell in row) for row in rows))


def markdown(blocks: Sequence[Block]) -> str:
    """The page as Markdown."""
    return "\n\n".join(_markdown(block) for block in blocks) + "\n"


def _markdown(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"{'#' * level} {text}"
        case Text(text):
            return text
        case Bullets(items):
            return "\n".join(f"- {item}" for item in items)
        case Image(words, path):
            return f"![{words}]({path})"
        case Fold(title, blocks, anchor):
            place = f'<a id="{html.escape(anchor)}"></a>' if anchor else ""
            return f"<details>{place}<summary>{_inline(title)}</summary>\n\n{markdown(blocks)}\n</details>"
        case TableBlock(heading, rows):
            cells = [[cell.replace("|", "\\|") for cell in row] for row in rows]
            return tabulate(cells, headers=list(heading), tablefmt="pipe", disable_numparse=True)


def unpadded(heading: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table in Markdown whose columns are not aligned, for cells of several hundred characters."""
    cells = [[str(cell).replace("|", "\\|") for cell in row] for row in (heading, ["---"] * len(heading), *rows)]
    return "\n".join(f"| {' | '.join(row)} |" for row in cells)


def put(path: Path, mark: str, blocks: Sequence[Block]) -> None:
    """Write blocks into a Markdown file, in place of what stands between ``<!-- mark -->`` and ``<!-- /mark -->``.

    Raises
    ------
    StudyError
        If the file does not have exactly one such place.
    """
    place = re.compile(rf"(<!-- {mark} -->\n).*?(<!-- /{mark} -->)", re.DOTALL)
    block = markdown(blocks)
    text, count = place.subn(lambda match: match[1] + block + match[2], path.read_text(encoding="utf-8"))
    if count != 1:
        raise StudyError(
            f"{path} has no place for {mark}: expected a line '<!-- {mark} -->' and one '<!-- /{mark} -->'"
        )
    replace_file(path, text.encode())


def document_page(title: str, blocks: Sequence[Block]) -> str:
    """The page as one HTML file that asks for nothing from anywhere."""
    body = fragment(blocks)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def fragment(blocks: Sequence[Block]) -> str:
    """The blocks as a part of an HTML page."""
    return "\n".join(_html(block) for block in blocks)


def _html(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"<h{level}>{_inline(text)}</h{level}>"
        case Text(text):
            return f"<p>{_inline(text)}</p>"
        case Bullets(items):
            return "<ul>" + "".join(f"<li>{_inline(item)}</li>" for item in items) + "</ul>"
        case Image(words, path):
            return f"<p>{_inline(words)}: <code>{html.escape(PurePosixPath(path).name)}</code></p>"
        case Fold(title, blocks, anchor):
            place = f' id="{html.escape(anchor)}"' if anchor else ""
            return f"<details{place}><summary>{_inline(title)}</summary>\n{fragment(blocks)}\n</details>"
        case TableBlock(heading, rows):
            head = "".join(f"<th>{_inline(cell)}</th>" for cell in heading)
            lines = ["<tr>" + "".join(f"<td>{_inline(cell)}</td>" for cell in row) + "</tr>" for row in rows]
            return f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n" + "\n".join(lines) + "\n</tbody>\n</table>"


def _inline(text: str) -> str:
    """Marks within a line; links lead out of a self-contained page and become plain words."""
    text = html.escape(text, quote=False)
    for pattern, replacement in ((BOLD, r"<strong>\1</strong>"), (CODE, r"<code>\1</code>"), (LINK, r"\1")):
        text = re.sub(pattern, replacement, text)
    return text
