"""The report's checkable statements, each held against what the study measures.

A claim is a small function in the module of its section, named after its row in ``config/reported.tsv``, that gives
the conditions on which the statement holds. The verdict follows from them and is never written down.
"""
