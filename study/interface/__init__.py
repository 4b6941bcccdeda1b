"""The Python interface: what ``import study as st`` offers, and all that is stable of this package.

Every name is re-exported by ``study`` itself and loaded when it is first used. What is done is done by the packages
below, as for the command line and the page; here it is given the habits of a notebook: results with a short ``repr``, a
table in HTML, ``to_frame()`` and ``plot*()`` that take an ``ax``.
"""
