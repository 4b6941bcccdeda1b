"""The whole study as one page for a browser: verdict, pictures by system, tables that sort, claims that fold."""

from collections.abc import Sequence

from study.reproduction import structure_pages, summary
from study.reproduction.claims.claim_pages import conditions
from study.support import document
from study.support.document import PageSection, Picture, Text, fragment_without_images

TITLE = "The report, run again"


def study_page(tables: summary.Tables, pictures: Sequence[Picture]) -> bytes:
    """The page; ``pictures`` in the order in which they stand."""
    sections = [
        ("verdict", "Verdict", fragment_without_images([*summary.counts(tables), Text(summary.INTRODUCTION)])),
        ("figures", "Figures", document.picture_groups(pictures)),
        ("failing", "Not reproduced, or only partly", fragment_without_images(summary.failing_claims(tables))),
        ("numbers", "The report's numbers beside ours", fragment_without_images(summary.numbers(tables))),
        ("claims", "Every claim", _claims(tables)),
        ("parameters", "Parameters by case", fragment_without_images(summary.parameter_blocks(tables))),
        (
            "structures",
            "Structures of several coordinates",
            fragment_without_images(structure_pages.structure_blocks(tables.structures)),
        ),
        ("estimators", "How far each estimator is off", fragment_without_images(summary.estimator_blocks(tables)[1:])),
        ("reading", 'What "unit variance" refers to', fragment_without_images(summary.reading(tables))),
        ("times", "Run times", fragment_without_images(summary.run_times(tables))),
    ]
    return document.picture_page(TITLE, [PageSection(*section) for section in sections])


def _claims(tables: summary.Tables) -> str:
    """A search field, then every claim, folded."""
    rows = [{str(key): str(value) for key, value in row.items()} for row in tables.claims.to_dict("records")]
    field = '<input id="search" type="search" placeholder="search the claims" aria-label="search the claims">'
    return field + document.fragment([conditions(row) for row in rows])
