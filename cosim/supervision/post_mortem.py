"""What remains to be done when the working process has died: its files, and a line for the user."""

import json
import os
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

from cybership.scratch_folder import is_scratch, sweep

from ..command import FAILED, INTERRUPTED, complain
from ..errors import not_written
from ..files import update_json, write_json
from ..interrupts import ignore_interrupts
from ..process.run_state import CAMPAIGN, DESCRIPTION, FOLDER, LATE, LOGGING, STATE, UNFINISHED
from ..process.spawned import ending
from ..results.log import CSV, SIDECAR, cut_to_rows
from ..results.pending_rows import rescue
from ..results.result_files import clear_results


def report(code: int, interrupted: bool) -> int:
    """Complete the results of a command whose process died, and tell the user.

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
        message = f"the process of this command died ({ending(code)})"
    if late := STATE.read(LATE):
        message = f"{late}; --timeout sets that"
    status, kept = "interrupted" if interrupted else "failed", ""
    try:
        if folder and not is_scratch(Path(folder)):
            rows, message = _complete(Path(folder), status, message)
            kept = f"{rows} rows are kept in '{_shown(folder)}'" if rows else ""
        if summary := STATE.read(CAMPAIGN):
            folder, runs = str(Path(summary).parent), _end_campaign(Path(summary), status, message)
            kept = f"{runs} runs are kept in '{_shown(folder)}'; the same command goes on"
    except OSError as error:
        message += f"; {not_written(Path(folder), error)}"
    _remove_unfinished()
    sweep()
    if interrupted:
        complain(": ".join(filter(None, ["interrupted", kept])), kind="")
        return INTERRUPTED
    complain("; ".join(filter(None, [message, kept])))
    return FAILED


def _end_campaign(summary: Path, status: str, message: str) -> str:
    """Say in campaign.json how it ended; returns how many runs have ended, of how many."""
    content = json.loads(summary.read_text(encoding="utf-8"))
    update_json(summary, content, {"status": status, "message": message})
    return f"{content['done'] + content['failed']} of {content['runs']}"


def _remove_unfinished() -> None:
    """Remove the folders that the process has made, and would have removed itself."""
    for k, path in enumerate(filter(None, STATE.read(UNFINISHED).split("\n"))):
        if k == 0:
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):  # not empty: it has other files
                os.rmdir(path)


def _complete(folder: Path, status: str, message: str) -> tuple[int, str]:
    """Put log.csv and log.json right; returns the number of rows, and what happened."""
    stated: dict[str, Any] = {"rows": 0, "message": message, "status": status}
    if not STATE.numbers[LOGGING]:
        if (
            status == "interrupted"
        ):  # before its first row: an earlier run stays, as where it ends in order
            return 0, message
        clear_results(folder)
        write_json(folder / SIDECAR, {**json.loads(STATE.read(DESCRIPTION)), **stated})
        return 0, message
    content = json.loads((folder / SIDECAR).read_text(encoding="utf-8"))
    if content.get("status") not in ("running", "done"):  # the run itself has reported how it ended
        return int(content.get("rows", 0)), content.get("message", message)
    try:
        stated["rows"] = rescue(folder / CSV)
    except OSError:
        stated["rows"] = cut_to_rows(folder / CSV)
    update_json(folder / SIDECAR, content, stated)
    return stated["rows"], message


def _shown(folder: str) -> str:
    """A folder as the user may have named it."""
    with suppress(ValueError):
        return min(folder, os.path.relpath(folder), key=len)
    return folder
