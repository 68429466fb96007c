"""A log as a table of pandas, with units."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .log import SIDECAR, read_log

if TYPE_CHECKING:
    import pandas


def log_frame(folder: str | Path) -> pandas.DataFrame:
    """The log of a run as a table: one row a logged step, one column a signal.

    Args:
        folder: results of a run.

    Returns:
        The columns of ``log.csv``; ``attrs["units"]`` and ``attrs["descriptions"]`` describe each.

    Raises:
        InputError: there is no log, or pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise InputError("a log as a table needs pandas: pip install 'cybership[tables]'") from None
    frame = pandas.DataFrame(read_log(folder))
    try:
        columns = json.loads((Path(folder) / SIDECAR).read_text(encoding="utf-8"))["columns"]
    except (OSError, ValueError, KeyError):
        columns = {}
    for kind in ("unit", "description"):
        frame.attrs[f"{kind}s"] = {name: told.get(kind, "") for name, told in columns.items()}
    return frame
