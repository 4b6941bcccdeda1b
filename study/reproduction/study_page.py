"""The whole study as one page for a browser: verdict, pictures by system, tables that sort, claims that fold.

The file asks for nothing from anywhere: style, script and pictures are in it.
"""

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from study.reproduction import summary
from study.reproduction.claims.claim_pages import conditions
from study.support import document
from study.support.document import Block, Text

TITLE = "The report, run again"


@dataclass(frozen=True)
class Picture:
    """A figure of the study."""

    system: str  # under which it stands
    number: str  # of the report's figure, or what it is called
    shows: str  # in a few words
    png: bytes


def page(tables: summary.Tables, pictures: Sequence[Picture]) -> bytes:
    """The page; ``pictures`` in the order in which they stand."""
    sections = [
        ("verdict", "Verdict", _fragment([*summary.counts(tables), Text(summary.INTRODUCTION)])),
        ("figures", "Figures", _grid(pictures)),
        ("failing", "Not reproduced, or only partly", _fragment(summary.failing(tables))),
        ("numbers", "The report's numbers beside ours", _fragment(summary.numbers(tables))),
        ("claims", "Every claim", _claims(tables)),
        ("parameters", "Parameters by case", _fragment(summary.parameters(tables))),
        ("estimators", "How far each estimator is off", _fragment(summary.estimators(tables)[1:])),
        ("reading", 'What "unit variance" refers to', _fragment(summary.reading(tables))),
        ("times", "Run times", _fragment(summary.run_times(tables))),
    ]
    links = "".join(f'<a href="#{name}">{html.escape(title)}</a>' for name, title, _ in sections)
    body = "".join(
        f'<section id="{name}"><h2>{html.escape(title)}</h2>{content}</section>' for name, title, content in sections
    )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f"<title>{TITLE}</title>\n<style>\n{_text('study_page.css')}\n</style>\n</head>\n<body>\n"
        f"<header><h1>{TITLE}</h1><nav>{links}</nav></header>\n<main>{body}</main>\n"
        '<dialog id="large"><button aria-label="close">×</button><figure><img alt=""><figcaption></figcaption></figure>'
        f"</dialog>\n<script>\n{_text('study_page.js')}\n</script>\n</body>\n</html>\n"
    ).encode()


def _fragment(blocks: Sequence[Block]) -> str:
    return document.fragment([b for b in blocks if not isinstance(b, document.Image)])


def _grid(pictures: Sequence[Picture]) -> str:
    """Thumbnails under the name of their system; each opens large."""
    parts: list[str] = []
    for system in dict.fromkeys(picture.system for picture in pictures):
        shown = "".join(_thumbnail(picture) for picture in pictures if picture.system == system)
        parts.append(f'<h3>{html.escape(system)}</h3><div class="grid">{shown}</div>')
    return "".join(parts)


def _thumbnail(picture: Picture) -> str:
    words = html.escape(f"{picture.number}: {picture.shows}")
    data = base64.b64encode(picture.png).decode()
    return (
        f'<button class="thumb"><img loading="lazy" decoding="async" alt="{words}" src="data:image/png;base64,{data}">'
        f"<span>{words}</span></button>"
    )


def _claims(tables: summary.Tables) -> str:
    """A search field, then every claim, folded."""
    rows = [{str(key): str(value) for key, value in row.items()} for row in tables.claims.to_dict("records")]
    field = '<input id="search" type="search" placeholder="search the claims" aria-label="search the claims">'
    return field + document.fragment([conditions(row) for row in rows])


def _text(name: str) -> str:
    return files("study.reproduction").joinpath(name).read_text(encoding="utf-8").strip()
