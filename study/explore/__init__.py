"""A page to see the loop on: compare, diagnose, add, watch the error fall.

No mathematics of its own: ``session`` keeps the models tried and calls what the commands call, ``view`` turns a
model's findings into columns and ``words`` into sentences, ``plots`` and ``html_page`` lay them out; where coordinates
have names, ``placed_view``, ``placed_words`` and ``placed_panels`` do so by place and sensor. ``saved`` makes one file
that needs no network, ``saved_files`` what is written on saving, ``desk`` and ``server`` the live page.
"""
