"""What do FMUs and a master cost beside one C program? ``python -m benchmarks.one_program``.

Runs scenarios/ellipse.json without faults: with native FMUs in this master, and as one program made of
the components' plain C (``fmus.build --native --source``), which passes values in memory. The master
logs nothing but one signal at the start and the end; then all signals at the start and the end, for
which it takes all outputs from the FMUs at each step. With these both must end with the same outputs to
the bit.
Processor time of the steps alone, in turns.
"""

import argparse
import json
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time

import cosim
from cosim.master import Master
from cosim.system import prepare
from fmus.build import export

SCENARIO = Path(__file__).parent.parent / "scenarios" / "ellipse.json"
OPTIONS = ("-std=c99", "-O1", "-w", "-ffp-contract=off", "-fno-builtin", "-fno-math-errno")

COMPONENT = """\
static double {n}_p[{n}_params + 1], {n}_i[{n}_inputs + 1], {n}_r[{n}_prepared + 1];
static double {n}_s[2][{n}_states + 1], {n}_o[{n}_outputs + 1];
"""
PROGRAM = """\
#include <stdio.h>
#include <time.h>
{includes}
{components}
int main(void) {{
    long k;
    clock_t began;
{starts}
    began = clock();
    for (k = 0; k < {steps}; k++) {{
        const int now = k % 2;
{loop}
    }}
    fprintf(stderr, "%.9g\\n", (double)(clock() - began) / CLOCKS_PER_SEC / {steps});
{results}
    return 0;
}}
"""


def program(content, folder):
    """The scenario as one program; its path, and the outputs that it writes, in their order."""
    system = prepare(cosim.load_scenario(content))
    names = {instance: model.name for instance, model in system.models.items()}
    export([*names.values()], folder)

    def place(signal, of="output"):
        instance, _, variable = signal.partition(".")
        return f"{names[instance]}_{of[0]}[{names[instance]}_{of}_{variable}]"

    def passed(instance):
        pairs = [(c.target.name, c.source.name) for c in system.connections]
        own = [pair for pair in pairs if pair[0].startswith(f"{instance}.")]
        return [f"{place(target, 'input')} = {place(source)};" for target, source in own]

    order = system.order
    starts, loop = [], []
    for instance in order:
        n = names[instance]
        starts.append(f"    {n}_starts({n}_p, {n}_i);")
        for variable, value in system.parameters[instance]:
            starts.append(f"    {place(f'{instance}.{variable.name}', 'param')} = {value!r};")
        starts.append(f"    {n}_prepare({n}_p, {n}_r);")
    # As many sweeps as there are FMUs in a chain, as in the master.
    for instance in order * len(order):
        n = names[instance]
        starts += passed(instance)
        starts.append(f"    {n}_init({n}_p, {n}_i, {n}_s[0]);")
        starts.append(f"    {n}_step({n}_p, {n}_r, {n}_i, {n}_s[0], 0.0, {n}_s[1], {n}_o);")
    for instance in order:
        n = names[instance]
        step = f"{n}_step({n}_p, {n}_r, {n}_i, {n}_s[now], {content['step']}, {n}_s[1 - now], {n}_o)"
        loop += [*passed(instance), f"        if ({step}) return 1;"]
    outputs = [s.name for s in system.signals.values() if s.variable.causality == "output"]
    text = PROGRAM.format(
        includes="\n".join(f'#include "{n}.h"' for n in names.values()),
        components="".join(COMPONENT.format(n=n) for n in names.values()),
        starts="\n".join(starts),
        steps=system.steps,
        loop="\n".join(loop),
        results="\n".join(f"    fwrite(&{place(name)}, 8, 1, stdout);" for name in outputs),
    )
    system.close()
    (folder / "loop.c").write_text(text)
    compiler = shutil.which("gcc") or shutil.which("cc") or "clang"
    sources = ["loop.c", *(f"{n}.c" for n in names.values())]
    subprocess.run([compiler, *OPTIONS, "-o", "loop", *sources, "-lm"], check=True, cwd=folder)
    return folder / "loop", outputs


def in_master(content, folder):
    """Processor time of a step in this master [s]."""
    marks = []
    time = Master.time

    def first(self, k):
        marks.append(process_time())
        Master.time = time
        return time(self, k)

    Master.time = first
    cosim.simulate(
        cosim.load_scenario(content),
        folder,
        progress=lambda t: marks.append(process_time()),
        native=True,
    )
    return marks[-1] - marks[0]


def main():
    parser = argparse.ArgumentParser(prog="python -m benchmarks.one_program", description=__doc__)
    parser.add_argument("--stop", type=float, default=1000.0, help="end [s]")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    content = json.loads(SCENARIO.read_text()) | {"stop": options.stop, "faults": [], "metrics": {}}
    steps = round(options.stop / content["step"])
    logs = {
        "nothing logged": {"every": steps, "signals": ["vessel.x"]},
        "all signals taken": {"every": steps},
    }
    ours, theirs, same = {name: [] for name in logs}, [], True
    with TemporaryDirectory() as work:
        path, outputs = program(content, Path(work))
        for _ in range(options.repeats):
            done = subprocess.run([path], capture_output=True, check=True)
            theirs.append(float(done.stderr))
            for name, log in logs.items():
                ours[name].append(in_master(content | {"log": log}, Path(work) / "out") / steps)
            log = cosim.read_log(Path(work) / "out")
            end = struct.pack(f"{len(outputs)}d", *(log[name][-1] for name in outputs))
            same = same and end == done.stdout
    load = f"load {os.getloadavg()[0]:.1f}"
    print(f"{os.cpu_count()} cores, {load}, {steps} steps, {options.repeats} repeats in turns")
    for name, pick in (("median", median), ("least", min)):
        one = 1e6 * pick(theirs)
        print(f"{name}: one C program {one:.2f} us a step; native FMUs in this master")
        for what, each in ours.items():
            master = 1e6 * pick(each)
            print(f"    {what}: {master:.2f} us a step, ratio {master / one:.2f}")
    print(f"last outputs {'the same to the bit' if same else 'DIFFER'}")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
