"""The report's checkable statements, each held against what the study measures.

A claim is a small function ``(Evidence, Reported) -> list[Condition]`` in the module of its section, under the id of
its row in ``config/reported.tsv``. The verdict follows from the conditions and is never written down.
"""
