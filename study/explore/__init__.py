"""A page to see the loop on: compare, diagnose, add, watch the error fall.

No mathematics of its own: ``session`` keeps the models tried, and calls what commands call. ``view`` turns a model's
findings on a record into columns: of the record, of each sensor, of each place; of a single mass one of each. ``words``
tell them, ``cards`` says what stands on the page, ``plots`` draws, ``html_page`` puts it together. ``saved`` makes one
file that needs no network, and what else is written on saving; ``desk`` and ``server`` are the live page.
"""

PAGE = "explore.html"  # the file that holds it
