"""Studies: the tests of the thesis run again over many seeds, each with a report of its own.

``python -m studies.<name> --out DIR`` writes ``report.md`` with its figures and ``results.json``.
"""

import sys
from importlib.util import find_spec

if missing := [name for name in ("scipy", "pandas") if find_spec(name) is None]:
    print(f"error: studies need {' and '.join(missing)}: pip install '.[studies]'", file=sys.stderr)
    raise SystemExit(2)
