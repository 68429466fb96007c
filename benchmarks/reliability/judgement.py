"""What must hold for every ending of a run."""

import json
import os
from pathlib import Path

import numpy as np
import pandas

import cosim

STATUS = {0: "done", 3: "failed", 130: "interrupted"}
# One line is enough; what an FMU or its library prints by itself is not ours.
OURS = ("error: ", "interrupted")


# Wall time in which an interrupt has to end a command [s], on a machine with a core to spare.
PROMPT = 2.0
TOLD = 2000  # characters of what a command that broke has printed last


def line_faults(code: int, stderr: str, expected: set[int], late: float) -> list[str]:
    """What is wrong with exit code, messages and time of the end of any command.

    Args:
        code: exit code.
        stderr: what it has printed there.
        expected: exit codes that are right.
        late: wall time since it was asked to end [s].
    """
    wrong = []
    if code not in expected:
        wrong.append(f"exit code {code}, not {sorted(expected)}")
    if "Traceback" in stderr or "internal error" in stderr:
        wrong.append(f"a traceback: {stderr.strip()[-TOLD:]}")
    lines = [line for line in stderr.splitlines() if line.startswith(OURS)]
    if code and len(lines) != 1:
        wrong.append(f"{len(lines)} lines that say why")
    if any(c < " " and c not in "\n\t" for c in stderr):
        wrong.append("control characters")
    if late > PROMPT * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)):
        wrong.append(f"it ended {late:.1f} s after it was asked to")
    return wrong


def agreement_faults(out: Path, status: str) -> list[str]:
    """What is wrong with journal, table and summary of a campaign that ended with a status."""
    wrong = []
    stated = json.loads((out / "campaign.json").read_text())
    if stated["status"] != status:
        wrong.append(f"campaign.json says '{stated['status']}', not '{status}'")
    lines = (out / "runs.jsonl").read_text().splitlines(keepends=True)
    journal = {json.loads(line)["hash"] for line in lines if line.endswith("\n")}
    path = out / "runs.parquet"  # of no run there is none
    table = set(pandas.read_parquet(path)["hash"]) if path.is_file() else set()
    if journal != table or len(table) != stated["done"] + stated["failed"]:
        counted = stated["done"] + stated["failed"]
        wrong.append(f"{len(journal)} runs in the journal, {len(table)} in the table, {counted} counted")
    return wrong


def faults(
    code: int, stderr: str, out: Path, expected: set[int], instance: str = "", late: float = 0.0
) -> list[str]:
    """What is wrong with the end of ``python -m cosim.run``; empty if nothing.

    Args:
        code: exit code.
        stderr: what it has printed there.
        out: the result folder.
        expected: exit codes that are right.
        instance: the FMU that the line must name, if the run failed.
        late: wall time since it was asked to end [s].
    """
    wrong = line_faults(code, stderr, expected, late)
    lines = [line for line in stderr.splitlines() if line.startswith(OURS)]
    if code == 3 and instance and not any(instance in line for line in lines):
        wrong.append("the line does not name the FMU")
    if code == 2:
        return wrong + (["bad input left files"] if out.exists() else [])
    if (out / "log.json").is_file():
        wrong += log_faults(out, STATUS.get(code, "running"))
    elif code != 130:
        wrong.append("no log.json")
    return wrong


def log_faults(out: Path, status: str) -> list[str]:
    """What is wrong with the log of a run that ended with a status."""
    wrong = []
    stated = json.loads((out / "log.json").read_text())
    if stated["status"] != status:
        wrong.append(f"log.json says '{stated['status']}', not '{status}'")
    rows = 0
    if (out / "log.csv").is_file():
        text = (out / "log.csv").read_text()
        rows = max(0, text.count("\n") - 1)
        if text and not text.endswith("\n") and status != "running":
            wrong.append("a torn row")
        time = cosim.read_log(out)["time"]
        if not np.allclose(np.diff(time), stated["scenario"]["step"]):
            wrong.append("rows are missing inside the log")
    if status != "running" and stated["rows"] != rows:
        wrong.append(f"log.json counts {stated['rows']} rows of {rows}")
    return wrong
