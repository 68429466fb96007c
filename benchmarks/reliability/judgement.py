"""What must hold for every ending of a run."""

import json
from pathlib import Path

import numpy as np

import cosim

STATUS = {0: "done", 3: "failed", 130: "interrupted"}
# One line is enough; what an FMU or its library prints by itself is not ours.
OURS = ("error: ", "interrupted")


def faults(code: int, stderr: str, out: Path, expected: set[int], instance: str = "") -> list[str]:
    """What is wrong with the end of ``python -m cosim.run``; empty if nothing.

    Args:
        code: exit code.
        stderr: what it has printed there.
        out: the result folder.
        expected: exit codes that are right.
        instance: the FMU that the line must name, if the run failed.
    """
    wrong = []
    if code not in expected:
        wrong.append(f"exit code {code}, not {sorted(expected)}")
    if "Traceback" in stderr or "should not have happened" in stderr:
        wrong.append("a traceback")
    lines = [line for line in stderr.splitlines() if line.startswith(OURS)]
    if code and len(lines) != 1:
        wrong.append(f"{len(lines)} lines that say why")
    if code == 3 and instance and not any(instance in line for line in lines):
        wrong.append("the line does not name the FMU")
    if any(c < " " and c not in "\n\t" for c in stderr):
        wrong.append("control characters")
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
    told = json.loads((out / "log.json").read_text())
    if told["status"] != status:
        wrong.append(f"log.json says '{told['status']}', not '{status}'")
    rows = 0
    if (out / "log.csv").is_file():
        text = (out / "log.csv").read_text()
        rows = max(0, text.count("\n") - 1)
        if text and not text.endswith("\n") and status != "running":
            wrong.append("a torn row")
        time = cosim.read_log(out)["time"]
        if not np.allclose(np.diff(time), told["scenario"]["step"]):
            wrong.append("rows are missing inside the log")
    if status != "running" and told["rows"] != rows:
        wrong.append(f"log.json counts {told['rows']} rows of {rows}")
    return wrong
