"""One page for a browser: sections, thumbnails that open large, tables that sort.

The file asks for nothing from anywhere: style, script and pictures are in it.
"""

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from study.support import document
from study.support.document import Block


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


def picture_page(title: str, sections: Sequence[PageSection]) -> bytes:
    """The page, in UTF-8."""
    links = "".join(f'<a href="#{s.anchor}">{html.escape(s.title)}</a>' for s in sections)
    body = "".join(f'<section id="{s.anchor}"><h2>{html.escape(s.title)}</h2>{s.content}</section>' for s in sections)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{_text('picture_page.css')}\n</style>\n</head>\n<body>\n"
        f"<header><h1>{html.escape(title)}</h1><nav>{links}</nav></header>\n<main>{body}</main>\n"
        '<dialog id="large"><button aria-label="close">×</button><figure><img alt=""><figcaption></figcaption></figure>'
        f"</dialog>\n<script>\n{_text('picture_page.js')}\n</script>\n</body>\n</html>\n"
    ).encode()


def fragment_without_images(blocks: Sequence[Block]) -> str:
    """Blocks without their images, which such a page has as thumbnails."""
    return document.fragment([b for b in blocks if not isinstance(b, document.Image)])


def groups(pictures: Sequence[Picture]) -> str:
    """Thumbnails under the names of their groups."""
    names = dict.fromkeys(picture.group for picture in pictures)
    return "".join(
        f"<h3>{html.escape(name)}</h3>{thumbnails([p for p in pictures if p.group == name])}" for name in names
    )


def thumbnails(pictures: Sequence[Picture]) -> str:
    """Thumbnails side by side; each opens large."""
    return f'<div class="grid">{"".join(map(_thumbnail, pictures))}</div>'


def _thumbnail(picture: Picture) -> str:
    words = html.escape(f"{picture.name}: {picture.shows}")
    data = base64.b64encode(picture.png).decode()
    return (
        f'<button class="thumb"><img loading="lazy" decoding="async" alt="{words}" src="data:image/png;base64,{data}">'
        f"<span>{words}</span></button>"
    )


def _text(name: str) -> str:
    return files("study.support").joinpath(name).read_text(encoding="utf-8").strip()
