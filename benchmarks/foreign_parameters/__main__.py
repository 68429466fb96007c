"""Hide a cause in an FMU and let ``learn`` find it: ``python -m benchmarks.foreign_parameters``.

A parameter is off by a quarter, a force is missing, both, or nothing; two runs to learn from and one
kept aside, of random steps, with noise of a hundredth of the output's spread. The runs are made with
FMPy, not with this project's master. ``--fmus`` names a folder with FMUs of other tools.
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
import pandas as pd
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from rich.console import Console
from rich.table import Table

from .foreign_systems import CASES, OTHERS, ForeignSystem, built

SAMPLES, NOISE, FACTOR = 600, 0.01, 1.25
KINDS = ("nothing", "parameter", "physics", "both")
EXPECTED = {"nothing": "none", "parameter": "parameters", "physics": "found", "both": "found"}


def measured(path: Path, s: ForeignSystem, kind: str, seed: int) -> pd.DataFrame:
    """A run of an FMU with a hidden cause, by FMPy."""
    rng = np.random.default_rng(seed)
    held = rng.integers(15, 60, SAMPLES)
    steps = {n: np.repeat(rng.uniform(-1.0, 1.0, SAMPLES), held)[:SAMPLES] for n in s.inputs}
    inputs = {n: s.inputs_at_rest + s.inputs[n] * x for n, x in steps.items()}
    description = read_model_description(str(path), validate=False)
    with tempfile.TemporaryDirectory() as folder:
        extract(str(path), folder)
        fmu = FMU2Slave(
            guid=description.guid, unzipDirectory=folder, instanceName="truth",
            modelIdentifier=description.coSimulation.modelIdentifier,
        )  # fmt: skip
        place = {v.name: v.valueReference for v in description.modelVariables}
        fmu.instantiate()
        fmu.setupExperiment(startTime=0.0)
        if kind in ("parameter", "both"):
            fmu.setReal([place[s.off]], [FACTOR * s.parameters[s.off][0]])
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        y, (state, power) = [], s.lacks
        for k in range(SAMPLES):
            y.append(fmu.getReal([place[s.output]])[0])
            now = {n: float(x[k]) for n, x in inputs.items()}
            if kind in ("physics", "both"):
                (at,) = fmu.getReal([place[state]]) if state else (1.0,)
                extra = s.size * (at * abs(at) ** (power - 1) if power else 1.0)
                now[s.force] = now.get(s.force, 0.0) + extra
            fmu.setReal([place[n] for n in now], [*now.values()])
            fmu.doStep(k * s.step, s.step)
        fmu.terminate()
        fmu.freeInstance()
    clean = np.array(y)
    noisy = clean + NOISE * clean.std() * rng.standard_normal(SAMPLES)
    return pd.DataFrame({"time": s.step * np.arange(SAMPLES), **inputs, s.output: noisy})


def one(path: Path, s: ForeignSystem, kind: str, seed: int, folder: Path) -> dict[str, Any]:
    """What ``learn`` says of one hidden cause."""
    runs = []
    for k in range(3):
        runs.append(folder / f"run{k}.csv")
        measured(path, s, kind, 10 * seed + k).to_csv(runs[-1], index=False)
    content = {
        "inputs": {n: n for n in s.inputs},
        "outputs": {s.output: s.output},
        "disturbance_inputs": [s.force] if s.force else [],
    }
    given = [
        {"name": n, "value": v, "log": True, "prior": {"rel_std": share}}
        for n, (v, share) in s.parameters.items()
    ]
    (folder / "map.json").write_text(json.dumps(content))
    (folder / "parameters.json").write_text(json.dumps({"parameters": given}))
    options = {"model": path, "map": folder / "map.json", "parameters": folder / "parameters.json"}
    named = [str(x) for name, value in options.items() for x in (f"--{name}", value)]
    began = time.perf_counter()
    named += ["--out", str(folder / "out"), "--overwrite"]
    command = [sys.executable, "-m", "diagnosis.learn", *map(str, runs[:2]), "--test", str(runs[2])]
    code = subprocess.run([*command, *named], stdout=subprocess.DEVNULL).returncode
    seconds = time.perf_counter() - began
    if code != 0:
        return {"verdict": f"exit code {code}", "right": False, "seconds": seconds}
    found = json.loads((folder / "out" / "diagnosis.json").read_text())
    off = {s.off} if kind in ("parameter", "both") else set()
    truth = {n: v * (FACTOR if n in off else 1.0) for n, (v, _) in s.parameters.items()}
    moved = {p["name"] for p in found["parameters"] if p["moved"]}
    inside = [p["ci95"][0] <= truth[p["name"]] <= p["ci95"][1] for p in found["parameters"]]
    (test,) = (e["outputs"][s.output] for e in found["errors"] if e["held_out"])
    shape = {0: "1", 2: f"|{s.lacks[0]}|{s.lacks[0]}"}[s.lacks[1]]
    true_id = f"{s.force}:{shape}"
    ids = [e["id"] for e in found["effects"]]
    right = found["verdict"] == EXPECTED[kind] and moved == off
    if kind in ("physics", "both"):
        right = right and ids[:1] == [true_id]
    return {
        "verdict": found["verdict"],
        "moved": sorted(moved),
        "forces": ids,
        "right": right,
        "false cause": any(
            e["confidence"] >= 0.9 and (kind in ("nothing", "parameter") or e["id"] != true_id)
            for e in found["effects"]
        ),
        "inside": sum(inside),
        "intervals": len(inside),
        "worse": test["after"] > 1.02 * test["before"],
        "seconds": seconds,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.foreign_parameters", description=__doc__)
    parser.add_argument("--fmus", type=Path, help="folder with FMUs of other tools (none)")
    parser.add_argument("--seeds", type=int, default=1, help="runs of each case (1)")
    parser.add_argument("--systems", nargs="+", help="names of systems (all)")
    parser.add_argument("--json", type=Path, help="file for the results")
    options = parser.parse_args(arguments)
    shown = Table("system", "cause", "verdict", "off", "forces", "right", "s", box=None)
    results = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases = [(s, built(s, folder)) for s in CASES]
        if options.fmus is not None:
            cases += [(s, options.fmus / f"{s.name}.fmu") for s in OTHERS]
        for s, path in cases:
            if options.systems and s.name not in options.systems:
                continue
            for kind in KINDS if s.force else KINDS[:2]:
                for seed in range(options.seeds):
                    r = {
                        "system": s.name,
                        "kind": kind,
                        "seed": seed,
                        **one(path, s, kind, seed, folder),
                    }
                    results.append(r)
                    cells = (r["verdict"], ", ".join(r.get("moved", [])), ", ".join(r.get("forces", [])))
                    shown.add_row(
                        s.name, kind, *cells, "yes" if r["right"] else "NO", f"{r['seconds']:.0f}"
                    )
                    if options.json is not None:
                        options.json.write_text(json.dumps(results, indent=1))
    Console().print(shown)
    print(summary(results))


def summary(results: Sequence[dict[str, Any]]) -> str:
    """All cases in a sentence."""

    def total(key: str) -> int:
        return sum(int(r.get(key, 0)) for r in results)

    seconds = [float(r["seconds"]) for r in results]
    return (
        f"{total('right')} of {len(results)} right; {total('inside')} of {total('intervals')} intervals "
        f"hold the truth; {total('false cause')} false causes at 0.9 or more; {total('worse')} test "
        f"runs predicted worse; {np.median(seconds):.0f} s a case, {max(seconds):.0f} s at most"
    )


if __name__ == "__main__":
    main()
