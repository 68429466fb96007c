"""What remains to be done when the simulating process has died: its files, and a line for the user."""

import json
import os
import signal
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..command import FAILED, INTERRUPTED, complain
from ..files import update_json, write_json
from ..interrupts import ignore_interrupts
from ..process.run_state import DESCRIPTION, FOLDER, LOGGING, STATE
from ..process.scratch import sweep
from ..results.log import CSV, SIDECAR, cut_to_rows
from ..results.pending_rows import rescue
from ..results.result_files import clear_results


def ending(code: int) -> str:
    """How a process ended, as text.

    Args:
        code: its exit code; negative for a signal, as subprocess has it.
    """
    if code >= 0:
        return f"exit code {code}"
    with suppress(ValueError):
        return f"signal {-code}, {signal.Signals(-code).name}"
    return f"signal {-code}"


def report(code: int, interrupted: bool) -> int:
    """Complete the results of a run whose process died, and tell the user.

    Args:
        code: how it ended; negative for a signal.
        interrupted: whether the user has asked for the end.

    Returns:
        The exit code of the command.
    """
    ignore_interrupts()
    (instance, what), folder = STATE.call(), STATE.read(FOLDER)
    message = f"{instance}: the simulating process died in {what} ({ending(code)})"
    if not instance:
        message = f"the simulating process died ({ending(code)})"
    status, rows = "interrupted" if interrupted else "failed", 0
    if folder:
        try:
            rows, message = _complete(Path(folder), status, message)
        except OSError as error:
            message += f"; cannot write to '{folder}': {error.strerror}"
    sweep()
    kept = f"{rows} rows are kept in '{_shown(folder)}'" if rows else ""
    if interrupted:
        complain(": ".join(filter(None, ["interrupted", kept])), kind="")
        return INTERRUPTED
    complain("; ".join(filter(None, [message, kept])))
    return FAILED


def _complete(folder: Path, status: str, message: str) -> tuple[int, str]:
    """Put log.csv and log.json right; returns the number of rows, and what happened."""
    told: dict[str, Any] = {"rows": 0, "message": message, "status": status}
    if not STATE.numbers[LOGGING]:
        clear_results(folder)
        write_json(folder / SIDECAR, {**json.loads(STATE.read(DESCRIPTION)), **told})
        return 0, message
    content = json.loads((folder / SIDECAR).read_text(encoding="utf-8"))
    if content.get("status") not in ("running", "done"):  # the run itself has told how it ended
        return int(content.get("rows", 0)), content.get("message", message)
    try:
        told["rows"] = rescue(folder / CSV)
    except OSError:
        told["rows"] = cut_to_rows(folder / CSV)
    update_json(folder / SIDECAR, content, told)
    return told["rows"], message


def _shown(folder: str) -> str:
    """A folder as the user may have named it."""
    with suppress(ValueError):
        return min(folder, os.path.relpath(folder), key=len)
    return folder
