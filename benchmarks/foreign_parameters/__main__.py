"""Hide a cause in an FMU and let ``learn`` find it: ``python -m benchmarks.foreign_parameters``.

A parameter is off by a quarter, a force is missing, both, or nothing; two runs to learn from and one
kept aside, of random steps, with noise of a hundredth of the output's spread. ``--packages`` names a
folder with the packages of :mod:`.other_tools`, whose FMUs this project did not write.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from .foreign_systems import CASES, ForeignSystem, built
from .hidden_causes import PARAMETER, PHYSICS, measured, truth
from .other_tools import unpacked

WORSE = 2.0  # paired standard errors; contract
CAUSES = ("nothing", "parameter", "physics", "both")
LIMIT = 300.0  # s that a diagnosis may take; what the project promises


def expected(s: ForeignSystem, cause: str) -> str:
    """The right verdict; a force on what is no input of the FMU cannot be found."""
    if cause in PHYSICS:
        return "found" if s.stated else "unexplained"
    return "parameters" if cause in PARAMETER else "none"


def one(
    path: Path, s: ForeignSystem, cause: str, seed: int, folder: Path, limit: float
) -> dict[str, Any]:
    """What ``learn`` says of one hidden cause within a limit of time [s]."""
    runs = []
    for k in range(3):
        runs.append(folder / f"run{k}.csv")
        run = measured(path, s, truth(s, cause), cause in PHYSICS, 10 * seed + k)
        run.to_csv(runs[-1], index=False)
    s.write_inputs(folder)
    options = {"model": path, "map": folder / "map.json", "parameters": folder / "parameters.json"}
    named = [str(x) for name, value in options.items() for x in (f"--{name}", value)]
    began = time.perf_counter()
    named += ["--out", str(folder / "out"), "--overwrite"]
    command = [sys.executable, "-m", "diagnosis.learn", *map(str, runs[:2]), "--test", str(runs[2])]
    try:
        code = subprocess.run([*command, *named], stdout=subprocess.DEVNULL, timeout=limit).returncode
        ended = f"exit code {code}" if code else ""
    except subprocess.TimeoutExpired:
        ended = "stopped"
    seconds = time.perf_counter() - began
    if ended:
        return {"verdict": ended, "right": False, "seconds": seconds}
    found = json.loads((folder / "out" / "diagnosis.json").read_text())
    off, true = {s.off} if cause in PARAMETER else set(), truth(s, cause)
    moved = {p["name"] for p in found["parameters"] if p["moved"]}
    inside = [p["ci95"][0] <= true[p["name"]] <= p["ci95"][1] for p in found["parameters"]]
    (test,) = (e for e in found["errors"] if e["held_out"])
    errors, change = test["outputs"][s.output], test["change"]
    true_id = f"{s.force}:{_shape(*s.lacks)}"
    ids = [e["id"] for e in found["effects"]]
    right = found["verdict"] == expected(s, cause)
    if found["verdict"] != "unexplained":  # which is no claim about parameters
        right = right and moved == off and (cause not in PHYSICS or ids[:1] == [true_id])
    return {
        "verdict": found["verdict"],
        "moved": sorted(moved),
        "forces": ids,
        "right": right,
        "false cause": any(
            e["confidence"] >= 0.9 and (cause not in PHYSICS or e["id"] != true_id)
            for e in found["effects"]
        ),
        "inside": sum(inside) if found["verdict"] != "unexplained" else 0,
        "intervals": len(inside) if found["verdict"] != "unexplained" else 0,
        "before": errors["before"],
        "after": errors["after"],
        # Paired standard errors by which the sum of squares of the run kept aside grows.
        "change": change["squares"] / max(change["standard_error"], 1e-300),
        "worse": change["squares"] > max(WORSE * change["standard_error"], 0.0),
        "seconds": seconds,
    }


def _shape(output: str, power: int) -> str:
    return ("1", output, f"|{output}|{output}")[power]


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.foreign_parameters", description=__doc__)
    parser.add_argument("--packages", type=Path, help="folder of packages with FMUs of others (none)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], help="seed of each repetition (0)")
    parser.add_argument("--systems", nargs="+", help="names of systems (all)")
    parser.add_argument("--causes", nargs="+", choices=CAUSES, default=CAUSES, help="causes (all)")
    parser.add_argument("--limit", type=float, default=LIMIT, help="longest time of a case [s] (300)")
    parser.add_argument("--json", type=Path, help="file for the results")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        groups = {"written here": [(s, built(s, folder)) for s in CASES]}
        if options.packages is not None:
            groups["written by others"] = [*unpacked(options.packages, folder)]
        results = []
        for group, systems in groups.items():
            chosen = [x for x in systems if not options.systems or x[0].name in options.systems]
            shown = Table(
                "system", "cause", "seed", "verdict", "off", "forces", "right", "change", "s", box=None
            )
            for s, path in chosen:
                for cause in options.causes:
                    for seed in options.seeds:
                        r = one(path, s, cause, seed, folder, options.limit)
                        results.append(
                            {"group": group, "system": s.name, "cause": cause, "seed": seed} | r
                        )
                        cells = [", ".join(r.get(key, [])) for key in ("moved", "forces")]
                        right = "yes" if r["right"] else "NO"
                        change = f"{r['change']:+.1f}" if "change" in r else ""
                        shown.add_row(s.name, cause, str(seed), r["verdict"], *cells, right, change,
                                      f"{r['seconds']:.0f}")  # fmt: skip
                        if options.json is not None:
                            options.json.write_text(json.dumps(results, indent=1))
            if chosen:
                Console().print(shown)
                print(f"{group}: {summary([r for r in results if r['group'] == group])}")


def summary(results: Sequence[dict[str, Any]]) -> str:
    """All cases in a sentence."""

    def total(key: str) -> int:
        return sum(int(r.get(key, 0)) for r in results)

    seconds = [float(r["seconds"]) for r in results]
    return (
        f"{total('right')} of {len(results)} right; {total('inside')} of {total('intervals')} intervals "
        f"hold the truth; {total('false cause')} false causes at 0.9 or more; {total('worse')} test "
        "runs predicted worse by more than two paired standard errors; "
        f"{np.median(seconds):.0f} s a case, {max(seconds):.0f} s at most"
    )


if __name__ == "__main__":
    main()
