"""What does the memory of concurrent learning cost? ``python -m benchmarks.storage``.

Runs scenarios/ellipse.json with each controller that stores samples, then gives the controller's
inputs to its plain function again and times the storage alone: the gate, the choice of a row, the sums.
All times are processor time, of FMUs in Python.
"""

import argparse
import json
import platform
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from unittest.mock import patch

import cosim
from fmus.controller import concurrent, store
from fmus.declare import discover, packer, variables
from fmus.ship import ship

SCENARIO = Path(__file__).parent.parent / "scenarios" / "ellipse.json"


def run(controller, stop, folder):
    """Result of the scenario with this controller up to a time [s], and how long it took [s]."""
    content = json.loads(SCENARIO.read_text())
    content["stop"], content["metrics"], content["native"] = stop, {}, False
    content["fmus"]["controller"] = {"path": f"{controller}.fmu"}
    started = process_time()
    result = cosim.simulate(cosim.load_scenario(content), folder)
    return result, process_time() - started


def inputs_of(component, folder):
    """The controller's inputs, one row for each step."""
    columns = [f"controller.{v.name}" for v in variables(component.inputs)]
    log = cosim.read_log(folder, columns)
    return [list(map(float, row)) for row in zip(*(log[c] for c in columns), strict=True)]


def storage_times(component, rows, step):
    """Time [s] that storage takes in each step, and how often the store changed."""
    times, changes = [], 0

    def timed(*args):
        nonlocal changes
        started = process_time()
        after = store.offer(*args)
        times.append(process_time() - started)
        changes += after is not args[2]
        return after

    pack, params = packer(component.inputs), component.params()
    state = component.init(pack(rows[0]), params)
    with patch.object(concurrent, "offer", timed):
        for row in rows[1:]:
            state, _ = component.step(state, pack(row), params, step)
    return times, changes


def main():
    argparse.ArgumentParser(prog="python -m benchmarks.storage", description=__doc__).parse_args()
    components = [c for _, c in discover(ship()) if c.name.startswith("controller_cl")]
    print(f"us, ellipse, 19,800 steps, Python {platform.python_version()}")
    print(f"{'controller':28}{'loop':>8}{'storage':>9}{'of loop':>9}{'worst':>9}{'changes':>9}")
    for component in components:
        with TemporaryDirectory() as folder:
            _, half = run(component.name, 99.0, f"{folder}/warm")
            _, half = run(component.name, 99.0, f"{folder}/half")
            result, full = run(component.name, 198.0, f"{folder}/full")
            rows = inputs_of(component, result.folder)
        times, changes = storage_times(component, rows, 0.01)
        # The difference leaves out what happens once: building, loading, metrics.
        loop = 1e6 * (full - half) / 9900
        mean = 1e6 * sum(times) / len(times)
        print(
            f"{component.name:28}{loop:8.1f}{mean:9.2f}{100 * mean / loop:7.1f} %"
            f"{1e6 * max(times):9.0f}{changes:9d}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
