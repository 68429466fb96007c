"""Studies: the tests of the thesis run again over many seeds, each with a report of its own.

``python -m studies.<name> --out DIR`` writes ``report.md`` with its figures and ``results.json``.
"""
