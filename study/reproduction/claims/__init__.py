"""The report's checkable statements, each held against what the study measures.

A claim is a small function ``(Evidence, Reported) -> Claim`` in the module of its section. What the
report states comes from ``config/reported.tsv``; the verdict follows from the measured numbers alone.
"""
