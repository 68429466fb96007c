"""What do native FMUs gain, and what do they cost? ``python -m benchmarks.native``.

Steps every component on the same random inputs in Python and in C, in turns, and builds its native FMU.
Then runs scenarios/ellipse.json with FMUs of both kinds, which must give the same log to the byte. All
times are processor time, medians of several repeats.
"""

import argparse
import json
import os
import platform
import random
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time

import cosim
from fmus.build import build, export, native_targets
from fmus.declare import discover, flatten, packer, variables
from fmus.ship import ship

SCENARIO = Path(__file__).parent.parent / "scenarios" / "ellipse.json"
ROWS, STEP = 500, 0.01

# Steps a component over rows of inputs from a file, many times; prints the processor time of a step [s].
TIMING = """\
#include <stdio.h>
#include <string.h>
#include <time.h>
#include "{name}.c"

static double rows[{rows}][{name}_inputs + 1], params[{name}_params + 1], prepared[{name}_prepared + 1];
static double state[{name}_states + 1], after[{name}_states + 1], outputs[{name}_outputs + 1];

int main(int count, char **arguments) {{
    FILE *file = fopen(arguments[1], "rb");
    double inputs[{name}_inputs + 1];
    int k, round;
    clock_t began;
    for (k = 0; k < {rows}; k++)
        if (fread(rows[k], sizeof(double), {name}_inputs, file) != {name}_inputs) return 1;
    {name}_starts(params, inputs);
    if ({name}_prepare(params, prepared) || {name}_init(params, rows[0], state)) return 1;
    began = clock();
    for (round = 0; round < 20; round++)
        for (k = 0; k < {rows}; k++) {{
            if ({name}_step(params, prepared, rows[k], state, {step}, after, outputs)) return 1;
            memcpy(state, after, sizeof state);
        }}
    printf("%.9g\\n", (double)(clock() - began) / CLOCKS_PER_SEC / (20.0 * {rows}));
    return 0;
}}
"""


def in_python(component, rows):
    """Time of a step [s]."""
    pack, prepared = packer(component.inputs), component.prepared(component.params())
    state = component.init(pack(rows[0]), component.params())
    began = process_time()
    for row in rows:
        state, outputs = component.advance(state, pack(row), prepared, STEP)
        flatten(outputs)
    return (process_time() - began) / len(rows)


def timing_program(component, rows, folder):
    """A program that steps the component, and its arguments."""
    export([component.name], folder)
    (folder / "rows").write_bytes(b"".join(struct.pack(f"{len(row)}d", *row) for row in rows))
    (folder / "timing.c").write_text(TIMING.format(name=component.name, rows=ROWS, step=STEP))
    compiler = shutil.which("gcc") or shutil.which("cc") or "clang"
    options = ["-std=c99", "-O1", "-w", "-ffp-contract=off", "-fno-builtin", "-fno-math-errno"]
    subprocess.run([compiler, *options, "-o", "timing", "timing.c", "-lm"], check=True, cwd=folder)
    return [folder / "timing", folder / "rows"]


def build_time(name, folder):
    """Processor time of a build that finds nothing in the cache [s], its compiler included."""
    os.environ["CYBERSHIP_CACHE"] = str(folder)
    began, children = process_time(), os.times().children_user
    (path,) = build([name], native=native_targets())
    return process_time() - began + os.times().children_user - children, path.stat().st_size


def step_table(names, repeats):
    print(f"{'component':30}{'Python us':>10}{'C us':>8}{'ratio':>8}{'build s':>9}{'FMU kB':>8}")
    for component in [c for _, c in discover(ship()) if not names or c.name in names]:
        rng = random.Random(component.name)
        rows = [[rng.uniform(-0.5, 0.5) for _ in variables(component.inputs)] for _ in range(ROWS)]
        with TemporaryDirectory() as folder:
            program = timing_program(component, rows, Path(folder))
            times = []
            for _ in range(repeats):
                done = subprocess.run(program, capture_output=True, text=True, check=True)
                times.append((in_python(component, rows), float(done.stdout)))
            seconds, size = build_time(component.name, Path(folder) / "cache")
        python, native = (1e6 * median(kind) for kind in zip(*times, strict=True))
        numbers = f"{python:10.1f}{native:8.2f}{python / native:8.0f}{seconds:9.1f}{size / 1e3:8.0f}"
        print(f"{component.name:30}{numbers}", flush=True)


def closed_loop(stop, repeats):
    """The ellipse with FMUs of both kinds, in turns."""
    content = json.loads(SCENARIO.read_text()) | {"stop": stop, "metrics": {}}
    names = [entry["path"].removesuffix(".fmu") for entry in content["fmus"].values()]
    kinds = {"Python": build(names), "native": build(names, native=native_targets())}
    times, logs = {kind: [] for kind in kinds}, set()
    for _ in range(repeats):
        for kind, paths in kinds.items():
            for entry, path in zip(content["fmus"].values(), paths, strict=True):
                entry["path"] = str(path)
            with TemporaryDirectory() as folder:
                began = process_time()
                cosim.simulate(cosim.load_scenario(content), folder)
                times[kind].append(process_time() - began)
                logs.add((Path(folder) / "log.csv").read_bytes())
    python, native = (median(times[kind]) for kind in kinds)
    print(f"ellipse, {stop:g} s: {python:.2f} s with Python FMUs, {native:.2f} s with native ones")
    same = "the same to the byte" if len(logs) == 1 else "DIFFERS"
    print(f"ratio {python / native:.2f}; log.csv {same}")
    return len(logs) == 1


def main():
    parser = argparse.ArgumentParser(prog="python -m benchmarks.native", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="components to step (all)")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--stop", type=float, default=200.0, help="of the closed loop [s]")
    options = parser.parse_args()
    print(f"Python {platform.python_version()}, {platform.machine()}, {os.cpu_count()} cores")
    step_table(options.names, options.repeats)
    same = closed_loop(options.stop, 3)
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
