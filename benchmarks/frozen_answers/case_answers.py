"""Runs the command of a case with the code of a checkout, and keeps its answer."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

from .command_lines import CASES

JSON_FILES = ("diagnosis", "comparison", "posterior", "map")
# Keys that differ between two runs of the same code: versions, what files hold in bytes, where they are.
CHANGING = {"versions", "sha256", "hash", "hashes", "path", "created", "seconds"}
SAID = ("error: ", "warning: ", "note: ")  # lines of a command that belong to its answer
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def answer(name: str, problems: Path, tree: Path) -> dict[str, Any]:
    """The answer of one case: exit code, messages, and the numbers of all files.

    Args:
        name: of the case.
        problems: folder that ``make`` wrote; paths in messages are relative to it.
        tree: checkout whose code runs.
    """
    command, *arguments = CASES[name].split()
    with TemporaryDirectory() as scratch:
        out = Path(scratch, "out")
        done = subprocess.run(
            [sys.executable, "-m", f"diagnosis.{command}", *arguments, "--out", str(out)],
            cwd=problems,
            env=os.environ | dict.fromkeys(THREADS, "1") | {"PYTHONPATH": str(tree)},
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        lines = [line.replace(str(out), "OUT") for line in done.stderr.splitlines()]
        said = [line for line in lines if line.startswith(SAID)]
        if done.returncode and not said:
            said = lines[-1:]  # of a traceback
        found: dict[str, Any] = {"exit": done.returncode, "said": said}
        for kind in JSON_FILES:
            if (file := out / f"{kind}.json").is_file():
                found[kind] = lasting(json.loads(file.read_text(encoding="utf-8")))
        if (file := out / "model.ssv").is_file():
            found["model"] = values(file)
    return found


def lasting(content: Any) -> Any:
    """The content of a JSON file without what changes from run to run."""
    if isinstance(content, dict):
        return {k: lasting(v) for k, v in content.items() if k not in CHANGING}
    if isinstance(content, list):
        return [lasting(v) for v in content]
    if isinstance(content, float) and not math.isfinite(content):
        return str(content)
    return content


def values(path: Path) -> dict[str, str | float]:
    """Name -> value of a parameter set."""
    found: dict[str, str | float] = {}
    for parameter in ElementTree.parse(path).getroot().iter():
        if parameter.tag.endswith("}Parameter"):
            value = parameter[0].attrib["value"]
            try:
                found[parameter.attrib["name"]] = float(value)
            except ValueError:
                found[parameter.attrib["name"]] = value
    return found
