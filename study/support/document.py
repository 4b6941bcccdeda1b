"""Pages made of headings, text and tables, as Markdown for a reader of files and as HTML for a browser.

An HTML page is one file that asks for nothing from anywhere: style, script and pictures are in it.
"""

import base64
import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import groupby
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
code { background: #f2f2f2; padding: 0 0.2em }
img { max-width: 100% }"""
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
    """A picture in a file of its own; a self-contained page gives its words, and shows it if it has its bytes."""

    words: str
    path: str
    png: bytes = b""


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


def put(path: Path, mark: str, blocks: Sequence[Block]) -> None:
    """Write blocks into a Markdown file, in place of what stands between ``<!-- mark -->`` and ``<!-- /mark -->``."""
    place = re.compile(rf"(<!-- {mark} -->\n).*?(<!-- /{mark} -->)", re.DOTALL)
    block = markdown(blocks)
    text, count = place.subn(lambda match: match[1] + block + match[2], path.read_text(encoding="utf-8"))
    if count != 1:
        raise StudyError(
            f"{path} has no place for {mark}: expected a line '<!-- {mark} -->' and one '<!-- /{mark} -->'"
        )
    replace_file(path, text.encode())


def document_page(title: str, blocks: Sequence[Block]) -> str:
    """The page as HTML."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>\n{fragment(blocks)}\n</body>\n</html>\n"
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
        case Image(words, _, png) if png:
            data = base64.b64encode(png).decode()
            return f'<p><img alt="{html.escape(words)}" src="data:image/png;base64,{data}"></p>'
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


@dataclass(frozen=True)
class Picture:
    """A picture that a page shows."""

    group: str  # under which it stands
    name: str  # what it is called
    shows: str  # in a few words
    png: bytes


@dataclass(frozen=True)
class PageSection:
    """A part of the page that the line at its top leads to."""

    anchor: str
    title: str
    content: str  # HTML
    part: str = ""  # of the page, under which that line has it


def picture_page(title: str, sections: Sequence[PageSection]) -> bytes:
    """Sections, thumbnails that open large, tables that sort, in UTF-8."""
    style, behaviour = (
        files("study.support").joinpath(f"picture_page.{kind}").read_text(encoding="utf-8").strip()
        for kind in ("css", "js")
    )
    links = "".join(
        (f"<b>{html.escape(part)}</b>" if part else "")
        + "".join(f'<a href="#{s.anchor}">{html.escape(s.title)}</a>' for s in own)
        for part, own in groupby(sections, key=lambda s: s.part)
    )
    body = "".join(f'<section id="{s.anchor}"><h2>{html.escape(s.title)}</h2>{s.content}</section>' for s in sections)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{style}\n</style>\n</head>\n<body>\n"
        f"<header><h1>{html.escape(title)}</h1><nav>{links}</nav></header>\n<main>{body}</main>\n"
        '<dialog id="large"><button aria-label="close">×</button><figure><img alt=""><figcaption></figcaption></figure>'
        f"</dialog>\n<script>\n{behaviour}\n</script>\n</body>\n</html>\n"
    ).encode()


def fragment_without_images(blocks: Sequence[Block]) -> str:
    """Blocks without their images, which such a page has as thumbnails."""
    return fragment([b for b in blocks if not isinstance(b, Image)])


def picture_groups(pictures: Sequence[Picture]) -> str:
    """Thumbnails under the names of their groups."""
    names = dict.fromkeys(picture.group for picture in pictures)
    return "".join(
        f"<h3>{html.escape(name)}</h3>{thumbnails([p for p in pictures if p.group == name])}" for name in names
    )


def thumbnails(pictures: Sequence[Picture]) -> str:
    """Thumbnails side by side; each opens large."""
    shown: list[str] = []
    for picture in pictures:
        words, data = html.escape(f"{picture.name}: {picture.shows}"), base64.b64encode(picture.png).decode()
        image = f'<img loading="lazy" decoding="async" alt="{words}" src="data:image/png;base64,{data}">'
        shown.append(f'<button class="thumb">{image}<span>{words}</span></button>')
    return f'<div class="grid">{"".join(shown)}</div>'
