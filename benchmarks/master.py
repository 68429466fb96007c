"""Time the master beside other co-simulation tools: ``python -m benchmarks.master``.

All run the five FMUs of the ellipse scenario, from the same files, with the same connections, the same
step and the same signals logged to CSV at each step, each in a process of its own. The repeats are
interleaved, so that a slow minute of the machine meets all of them.
"""

import argparse
import json
import os
import platform
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import Any

ROOT = Path(__file__).parent.parent
SCENARIO = ROOT / "scenarios" / "ellipse.json"
# Logged are all outputs but these, and the disturbed measurements that reach the observer.
NOT_LOGGED = re.compile(
    r"vessel\.(\w+_m|omega_star_\w+)|controller\.(tau_lin_\w+|tau_nonlin_\w+|omega_hat_\w+)"
)
ALSO_LOGGED = ["observer.x_m", "observer.y_m", "observer.psi_m"]
PACKAGES = ("cybership", "fmpy", "numpy", "pythonfmu", "libcosimpy", "ecospy")
DIFFERENCES = """
This master steps one FMU after the other, with noise and freezes on the measurements. The others
cannot freeze a measurement: they run without faults and so do less. They exchange values once a
step (Jacobi), as the last line does; 'end away' is how far the outputs in their last row are from
that line's, relative to max(1, |value|). This master writes numbers that read back to the bit,
libcosim 6 significant digits in a file for each FMU, Ecos 6 decimals. Set-up counts from the import
of the tool to the first step."""

Plan = dict[str, Any]


def time_master(
    plan: Plan, out: Path, faults: bool = True, log: bool = True, algorithm: str = ""
) -> dict[str, float]:
    """This project's master, through its public functions."""
    started = perf_counter()
    import cosim
    from cosim.master import Master

    content = plan["scenario"] | {"algorithm": algorithm or plan["scenario"]["algorithm"]}
    if not faults:
        content["faults"] = []
    content["log"] = {"signals": plan["signals"], "every": 1 if log else 10**9}
    marks: dict[str, float] = {}
    run = Master.run

    def marked(self: Master):
        marks["first step"] = perf_counter()
        return run(self)

    def progress(t: float) -> None:
        # The last call comes when the last rows have been written.
        marks["end"] = perf_counter()

    Master.run = marked
    result = cosim.simulate(cosim.load_scenario(content), out, progress=progress)
    if result.status != "done":
        raise RuntimeError(result.message)
    return {
        "setup": marks["first step"] - started,
        "per_step": (marks["end"] - marks["first step"]) / plan["steps"],
    }


def time_libcosim(plan: Plan, out: Path, structure: str) -> dict[str, float]:
    """libcosim through libcosimpy; its file observer writes one CSV file for each FMU."""
    started = perf_counter()
    from ctypes import POINTER, c_char_p

    from libcosimpy import CosimLogging
    from libcosimpy._internal import get_last_error_message, libcosimc, wrap_function
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    CosimLogging.log_output_level(CosimLogging.CosimLogLevel.WARNING)
    execution = CosimExecution.from_ssp_file(str(Path(plan["work"], structure)))
    for name, value in plan["parameters"].items():
        instance, _, variable = name.partition(".")
        index = execution.slave_index_from_instance_name(instance)
        references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
        execution.real_initial_value(index, references[variable], value)
    # libcosimpy wraps only the observer that logs everything; the library also has one that chooses.
    create = wrap_function(
        libcosimc(), "cosim_file_observer_create_from_cfg", POINTER(CosimObserver), [c_char_p, c_char_p]
    )
    config = Path(plan["work"], "LogConfig.xml")
    pointer = create(str(out).encode(), str(config).encode())
    observer = CosimObserver(CosimObserver._CosimObserver__create_key, pointer)
    # It initialises at the first step, which therefore belongs to the set-up.
    if not execution.add_observer(observer) or not execution.step(1):
        raise RuntimeError(get_last_error_message())
    first = perf_counter()
    if not execution.step(plan["steps"] - 1):
        raise RuntimeError(get_last_error_message())
    return {"setup": first - started, "per_step": (perf_counter() - first) / (plan["steps"] - 1)}


def time_ecos(plan: Plan, out: Path) -> dict[str, float]:
    """Ecos through ecospy, with its CSV writer."""
    started = perf_counter()
    from ecospy.EcosSimulation import EcosSimulation
    from ecospy.EcosSimulationStructure import EcosSimulationStructure

    def named(name: str) -> str:
        return name.replace(".", "::")

    structure = EcosSimulationStructure()
    for name, path in plan["fmus"].items():
        structure.add_model(name, path)
    for source, target in plan["connections"]:
        structure.make_real_connection(named(source), named(target))
    structure.add_parameter_set("start", {named(n): v for n, v in plan["parameters"].items()})
    simulation = EcosSimulation(structure=structure, step_size=plan["step"])
    simulation.add_csv_writer(str(out / "log.csv"), identifiers=[named(n) for n in plan["signals"]])
    if not simulation.init(parameter_set="start"):
        raise RuntimeError("its initialisation failed")
    first = perf_counter()
    simulation.step(plan["steps"])
    end = perf_counter()
    simulation.terminate()
    return {"setup": first - started, "per_step": (end - first) / plan["steps"]}


def time_components(plan: Plan, out: Path) -> dict[str, float]:
    """The step functions inside the FMUs, called from Python in the same closed loop."""
    from fmus.declare import discover, flatten, packer, width

    known = {component.name: component for _, component in discover()}
    values: dict[str, float] = {}
    loop = []
    for name in plan["order"]:
        component = known[plan["models"][name]]
        names = [f"{name}.{v.name}" for v in component.variables]
        values.update(zip(names, (v.start for v in component.variables), strict=True))
        values.update({n: v for n, v in plan["parameters"].items() if n in names})
        first = width(component.params)
        last = first + width(component.inputs)
        params = packer(component.params)([values[n] for n in names[:first]])
        sources = {target: source for source, target in plan["connections"]}
        inputs = [sources.get(n, n) for n in names[first:last]]
        loop.append(
            (component.advance, packer(component.inputs), inputs, params, names[last:], component)
        )
    states = [
        component.init(pack([values[n] for n in inputs]), params)
        for _, pack, inputs, params, _, component in loop
    ]
    ready = [component.prepared(params) for _, _, _, params, _, component in loop]
    spent = 0.0
    for _ in range(plan["steps"]):
        for k, (advance, pack, inputs, _, outputs, _) in enumerate(loop):
            packed = pack([values[n] for n in inputs])
            before = perf_counter()
            states[k], result = advance(states[k], packed, ready[k], plan["step"])
            spent += perf_counter() - before
            values.update(zip(outputs, flatten(result), strict=True))
    before = perf_counter()
    for _ in range(plan["steps"]):
        perf_counter()
    clock = len(loop) * (perf_counter() - before)
    return {"per_step": (spent - clock) / plan["steps"]}


def time_fmi(plan: Plan, out: Path) -> dict[str, float]:
    """The FMI calls of a step and next to nothing else: one copy moves all values at once."""
    import ctypes

    import numpy as np

    from cosim.fmu import Instance, Model

    pointer, size = ctypes.c_void_p.from_param, ctypes.c_size_t.from_param
    used = {*plan["signals"], *(source for source, _ in plan["connections"])}
    sources = {target: source for source, target in plan["connections"]}
    models = {name: Model(Path(path)) for name, path in plan["fmus"].items()}
    got = [f"{n}.{v}" for n, m in models.items() for v in m.variables if f"{n}.{v}" in used - {*sources}]
    set_ = [f"{n}.{v}" for n, m in models.items() for v in m.variables if f"{n}.{v}" in sources]
    outputs, inputs = np.zeros(len(got)), np.zeros(len(set_))
    calls: list[tuple[Callable[..., int], list[Any]]] = []
    time = ctypes.c_double()
    kept: list[Any] = []

    def bind(instance: Instance, function: str, names: list[str], table: np.ndarray) -> None:
        own = [n for n in names if n.startswith(f"{instance.name}.")]
        if own:
            numbers = [instance.model.variables[n.partition(".")[2]].reference for n in own]
            references = (ctypes.c_uint * len(own))(*numbers)
            kept.append(references)
            address = table.ctypes.data + 8 * names.index(own[0])
            arguments = (instance.component, ctypes.addressof(references), len(own), address)
            convert = (pointer, pointer, size, pointer)
            converted = [to_c(value) for to_c, value in zip(convert, arguments, strict=True)]
            calls.append((instance.function(function), converted))

    for name, model in models.items():
        instance = Instance(name, model, lambda *message: None)
        kept.append(instance)
        instance.set_up(plan["steps"] * plan["step"])
        for parameter, value in plan["parameters"].items():
            if parameter.startswith(f"{name}."):
                instance.set_value(model.variables[parameter.partition(".")[2]], value)
        instance.enter_initialization()
        instance.exit_initialization()
        bind(instance, "fmi2SetReal", set_, inputs)
        length, flag = ctypes.c_double.from_param(plan["step"]), ctypes.c_int.from_param(1)
        calls.append(
            (instance.function("fmi2DoStep"), [pointer(instance.component), time, length, flag])
        )
        bind(instance, "fmi2GetReal", got, outputs)
    order = np.array([got.index(sources[n]) for n in set_])
    before = perf_counter()
    for k in range(plan["steps"]):
        time.value = k * plan["step"]
        for function, arguments in calls:
            if function(*arguments) > 1:
                raise RuntimeError(f"an FMI call failed at step {k}")
        outputs.take(order, out=inputs)
    spent = perf_counter() - before
    for model in models.values():
        model.close()
    return {"per_step": spent / plan["steps"]}


@dataclass(frozen=True)
class Case:
    """Something to time: how the report calls it, and the function that a process of its own runs."""

    label: str
    run: Callable[[Plan, Path], dict[str, float]]


TOOLS = {
    "master": Case("this master", time_master),
    "libcosim_default": Case(
        "libcosim, default workers", partial(time_libcosim, structure="default_workers.ssd")
    ),
    "libcosim_0": Case("libcosim, 0 workers", partial(time_libcosim, structure="0_workers.ssd")),
    "ecos": Case("Ecos", time_ecos),
}
PARTS = {
    "master_like_others": Case(
        "this master, Jacobi, no faults", partial(time_master, faults=False, algorithm="jacobi")
    ),
    "no_faults": Case("this master, no faults", partial(time_master, faults=False)),
    "no_log": Case("this master, no log", partial(time_master, log=False)),
    "neither": Case("this master, no faults, no log", partial(time_master, faults=False, log=False)),
    "fmi": Case("FMI calls alone", time_fmi),
    "components": Case("step functions alone", time_components),
}
CASES = TOOLS | PARTS


def make_plan(work: Path, steps: int) -> Plan:
    """Everything that the processes need to know, so that no tool has to find it out in its own time."""
    from cosim.scenario import load_scenario
    from cosim.system import prepare

    system = prepare(load_scenario(SCENARIO))
    fmus = {name: work / "resources" / f"{name}.fmu" for name in system.models}
    (work / "resources").mkdir()
    for name, path in fmus.items():
        shutil.copyfile(system.models[name].path, path)
    outputs = [n for n, s in system.signals.items() if s.variable.causality == "output"]
    content = system.scenario.model_dump(mode="json", by_alias=True)
    content |= {"stop": steps * system.scenario.step, "metrics": {}}
    for name, path in fmus.items():
        content["fmus"][name]["path"] = str(path)
    plan = {
        "work": str(work),
        "steps": steps,
        "step": system.scenario.step,
        "scenario": content,
        "fmus": {name: str(path) for name, path in fmus.items()},
        "models": {name: model.name for name, model in system.models.items()},
        "order": system.order,
        "connections": [[c.source.name, c.target.name] for c in system.connections],
        "parameters": {
            f"{name}.{v.name}": value
            for name, values in system.parameters.items()
            for v, value in values
        },
        "signals": [*(n for n in outputs if not NOT_LOGGED.fullmatch(n)), *ALSO_LOGGED],
    }
    system.close()
    (work / "default_workers.ssd").write_text(_ssd(plan, ""))
    (work / "0_workers.ssd").write_text(_ssd(plan, 'numWorkerThreads="0"'))
    (work / "LogConfig.xml").write_text(_log_config(plan))
    (work / "plan.json").write_text(json.dumps(plan))
    return plan


def _ssd(plan: Plan, workers: str) -> str:
    """The system as an SSP system structure with libcosim's annotation for its algorithm."""
    components = []
    for name in plan["fmus"]:
        ends = {(target, "input") for _, target in plan["connections"]}
        ends |= {(source, "output") for source, _ in plan["connections"]}
        connectors = "".join(
            f'<ssd:Connector name="{end.partition(".")[2]}" kind="{kind}"><ssc:Real/></ssd:Connector>'
            for end, kind in sorted(ends)
            if end.startswith(f"{name}.")
        )
        components.append(
            f'<ssd:Component name="{name}" source="resources/{name}.fmu">'
            f"<ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>"
        )
    connections = []
    for source, target in plan["connections"]:
        (start, output), (end, input_) = source.split("."), target.split(".")
        connections.append(
            f'<ssd:Connection startElement="{start}" startConnector="{output}"'
            f' endElement="{end}" endConnector="{input_}"/>'
        )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription name="loop" version="1.0"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">
  <ssd:System name="loop">
    <ssd:Elements>{"".join(components)}</ssd:Elements>
    <ssd:Connections>{"".join(connections)}</ssd:Connections>
  </ssd:System>
  <ssd:DefaultExperiment startTime="0.0">
    <ssd:Annotations>
      <ssc:Annotation type="com.opensimulationplatform">
        <osp:Algorithm>
          <osp:FixedStepAlgorithm baseStepSize="{plan["step"]}" {workers}/>
        </osp:Algorithm>
      </ssc:Annotation>
    </ssd:Annotations>
  </ssd:DefaultExperiment>
</ssd:SystemStructureDescription>
"""


def _log_config(plan: Plan) -> str:
    """Which signals libcosim's file observer writes."""
    simulators = []
    for name in plan["fmus"]:
        own = [n.partition(".")[2] for n in plan["signals"] if n.startswith(f"{name}.")]
        variables = "".join(f'<variable name="{variable}"/>' for variable in own)
        simulators.append(f'<simulator name="{name}" decimationFactor="1">{variables}</simulator>')
    return f"<simulators>{''.join(simulators)}</simulators>"


def run_apart(case: str, work: Path, timeout: float) -> dict[str, Any]:
    """Run a case in a process of its own; a crash or a hang becomes an ``error``."""
    out = work / case
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    command = [sys.executable, "-m", "benchmarks.master", "--case", case, str(work)]
    try:
        done = subprocess.run(
            command,
            cwd=ROOT,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return {"error": f"no end within {timeout:.0f} s"}
    answer = out / "result.json"
    if answer.is_file():
        return json.loads(answer.read_text())
    if done.returncode < 0:
        return {"error": f"ended by {signal.Signals(-done.returncode).name}"}
    return {"error": (done.stderr.strip().splitlines() or ["no result"])[-1]}


def run_here(case: str, work: Path) -> None:
    """What the process of a case does."""
    try:
        result = CASES[case].run(json.loads((work / "plan.json").read_text()), work / case)
    except ModuleNotFoundError as error:
        result = {"error": f"not installed: {error}"}
    except Exception as error:
        result = {"error": f"{type(error).__name__}: {error}".splitlines()[0]}
    (work / case / "result.json").write_text(json.dumps(result))


def read_end(folder: Path) -> tuple[dict[str, float], float]:
    """The last values that a tool logged, by our names, and the size of its log [MB]."""
    values: dict[str, float] = {}
    size = 0
    for path in folder.rglob("*.csv"):
        # libcosim writes a file for each instance, with the date behind its name.
        instance = re.sub(r"(_\d+){3}$", "", path.stem)
        lines = path.read_text().splitlines()
        size += path.stat().st_size
        for title, value in zip(lines[0].split(","), lines[-1].split(","), strict=True):
            name = title.strip().removesuffix("[REAL]").replace("::", ".")
            values[name if "." in name else f"{instance}.{name}"] = float(value)
    return values, size / 1e6


def compare(plan: Plan, work: Path, case: str) -> dict[str, float]:
    """What a tool left: size of its log, and how far its end is from ours without faults."""
    values, size = read_end(work / case)
    ours, _ = read_end(work / "master_like_others")
    missing = [n for n in plan["signals"] if n not in values]
    if missing:
        return {"log_mb": size, "missing": len(missing)}
    # A row shows the inputs of the step before it, or, in Ecos, those of the step after it.
    outputs = {*plan["signals"]}.difference(target for _, target in plan["connections"])
    away = max(abs(values[n] - ours[n]) / max(1.0, abs(ours[n])) for n in outputs)
    return {"log_mb": size, "away": away}


def time_commands(work: Path, repeat: int) -> dict[str, list[float]]:
    """Whole runs from the command line, from the start of the process to its end [s]."""
    content = json.loads(SCENARIO.read_text())
    times: dict[str, list[float]] = {}
    for _ in range(repeat):
        for stop in (content["stop"], 100.0):
            path = work / "cold.json"
            path.write_text(json.dumps(content | {"stop": stop}))
            for label, options in (("no pictures", ["--no-plots"]), ("with pictures", [])):
                command = [sys.executable, "-m", "cosim.run", str(path), "--quiet", *options]
                before = perf_counter()
                subprocess.run([*command, "--out", str(work / "cold")], cwd=ROOT, check=True)
                times.setdefault(f"{stop:g} s, {label}", []).append(perf_counter() - before)
    return times


def machine() -> dict[str, str]:
    """What the numbers depend on."""
    facts = {
        "platform": platform.platform(),
        "CPUs": str(os.cpu_count()),
        "Python": f"{platform.python_implementation()} {platform.python_version()}",
    }
    for package in PACKAGES:
        try:
            facts[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            facts[package] = "not installed"
    return facts


def measure(steps: int, repeat: int) -> dict[str, Any]:
    """Run everything; the result is what ``--json`` writes."""
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        work = Path(folder)
        plan = make_plan(work, steps)
        cases: dict[str, dict[str, Any]] = {case: {"runs": []} for case in CASES}
        for k in range(repeat):
            names = list(cases)
            # Each round starts with another case: what ran before makes a difference.
            for case in names[k % len(names) :] + names[: k % len(names)]:
                found = cases[case]
                print(f"\r{k + 1}/{repeat}  {CASES[case].label:40}", end="", file=sys.stderr, flush=True)
                if "error" not in found:
                    result = run_apart(case, work, 60.0 + 0.01 * steps)
                    if "error" in result:
                        found["error"] = result["error"]
                    else:
                        found["runs"].append(result)
        for case in TOOLS:
            if "error" not in cases[case]:
                cases[case] |= compare(plan, work, case)
        print(f"\r{'whole runs':46}", end="", file=sys.stderr, flush=True)
        commands = time_commands(work, repeat)
        print(f"\r{'':46}\r", end="", file=sys.stderr)
    return {
        "machine": machine(),
        "steps": steps,
        "repeat": repeat,
        "fmus": len(plan["fmus"]),
        "connections": len(plan["connections"]),
        "signals": len(plan["signals"]),
        "cases": cases,
        "commands": commands,
    }


def _per_step(found: dict[str, Any], pick: Callable[[Sequence[float]], float]) -> float:
    """Microseconds per step, over the repeats."""
    return 1e6 * pick([run["per_step"] for run in found["runs"]])


def report(results: dict[str, Any]) -> None:
    """Print the tables."""
    print(", ".join(f"{name} {value}" for name, value in results["machine"].items()))
    print(
        f"{results['fmus']} FMUs, {results['connections']} connections, {results['signals']} signals "
        f"logged at each of {results['steps']} steps, {results['repeat']} interleaved repeats\n"
    )
    _report_tools(results["cases"])
    _report_parts(results["cases"])
    print("\nWhole command, from the start of the process to its end [s]   median     min")
    for label, times in results["commands"].items():
        print(f"  {label:58} {statistics.median(times):7.2f} {min(times):7.2f}")


def _report_tools(cases: dict[str, Any]) -> None:
    print("                                 us per step      ratio   set-up     log    end")
    print("                               median     min               [s]    [MB]   away")
    ours = None if "error" in cases["master"] else _per_step(cases["master"], statistics.median)
    for case in [*TOOLS, "master_like_others"]:
        found = cases[case]
        if "error" in found:
            print(f"{CASES[case].label:30} {found['error']}")
            continue
        median = _per_step(found, statistics.median)
        setup = statistics.median(run["setup"] for run in found["runs"])
        ratio = f"{median / ours:8.2f}" if ours is not None else 8 * " "
        end = f" {found['log_mb']:7.1f}" if "log_mb" in found else ""
        if "missing" in found:
            end += f"  {found['missing']} signals are not in its log"
        elif case != "master" and "away" in found:
            end += f"  {found['away']:.0e}"
        least = _per_step(found, min)
        print(f"{CASES[case].label:30} {median:6.1f} {least:7.1f}   {ratio} {setup:8.2f}{end}")
    print(DIFFERENCES)


def _report_parts(cases: dict[str, Any]) -> None:
    parts = ("master", "no_faults", "no_log", "neither", "fmi", "components")
    if any("error" in cases[case] for case in parts):
        for case in parts:
            if "error" in cases[case]:
                print(f"\n{CASES[case].label}: {cases[case]['error']}")
        return
    full, no_faults, no_log, neither, fmi, components = (_per_step(cases[case], min) for case in parts)
    print("\nWhere the time of this master goes (differences of minima)     us per step    share")
    for label, value in (
        ("step functions of the components, in Python", components),
        ("FMI calls: fmus/slave.py, PythonFMU, ctypes", fmi - components),
        ("master: transfers, checks, the loop", neither - fmi),
        ("faults, and what they make the observer do", (full - no_faults + no_log - neither) / 2),
        ("log", (full - no_log + no_faults - neither) / 2),
        ("all", full),
    ):
        print(f"  {label:58} {value:13.1f} {value / full:8.0%}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.master", description=__doc__)
    parser.add_argument("--steps", type=int, default=10_000, help="steps of 0.01 s (10000)")
    parser.add_argument("--repeat", type=int, default=3, help="how often each is run (3)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers here as well")
    parser.add_argument("--case", nargs=2, metavar=("CASE", "FOLDER"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.case:
        run_here(options.case[0], Path(options.case[1]))
        return 0
    if options.steps < 2 or options.repeat < 1:
        parser.error("needs at least 2 steps and 1 repeat")
    results = measure(options.steps, options.repeat)
    report(results)
    if options.json:
        options.json.write_text(json.dumps(results, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
