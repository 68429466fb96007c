"""Studies of measured ships, each with a report of its own.

``python -m studies.<name> --out DIR`` writes ``report.md`` with its figures and ``results.json``.
"""

import sys
from importlib.util import find_spec

from diagnosis.moved import keep_old_names

if missing := [name for name in ("scipy", "pandas") if find_spec(name) is None]:
    print(
        f"error: studies need {' and '.join(missing)}: pip install '.[analysis,campaign]'",
        file=sys.stderr,
    )
    raise SystemExit(2)
keep_old_names()
