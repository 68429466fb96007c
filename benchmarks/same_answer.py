"""Run one system in several tools and compare: ``python -m benchmarks.same_answer``.

The system is exported once (SSP archive, OSP directory, container FMU), each tool runs that in a process
of its own, and every output of every FMU is compared with this master's at each step, at full precision.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
SCENARIO = ROOT / "scenarios" / "ellipse.json"
TOLERANCE = 1e-9
# Where a disturbance enters, and the outputs that tell how it goes around the loop.
PUSHED = "vessel.x_m"
AROUND = ("observer.x_hat", "controller.tau_X", "thrusters.tau_act_X", "vessel.u")

Plan = dict[str, Any]


def run_master(plan: Plan, algorithm: str, events: Sequence[dict[str, Any]] = ()) -> np.ndarray:
    """This master; row k is time k h."""
    import cosim

    content = plan["scenario"] | {"algorithm": algorithm, "events": list(events)}
    with tempfile.TemporaryDirectory() as folder:
        result = cosim.simulate(cosim.load_scenario(content), folder)
        if result.status != "done":
            raise RuntimeError(result.message)
        log = cosim.read_log(folder, plan["outputs"])
    return np.column_stack([log[name] for name in plan["outputs"]])


def zeros_first(plan: Plan) -> list[dict[str, Any]]:
    """Events that make this master start as FMPy does: nothing has arrived before the first step."""
    events = []
    for target in plan["inputs"]:
        model, _, variable = target.partition(".")
        event = {"time": 0.0, "model": model, "variable": variable}
        events.append(event | {"action": "override", "value": 0.0})
        events.append(event | {"time": plan["step"], "action": "reset"})
    return events


def push(plan: Plan) -> list[dict[str, Any]]:
    """An event that moves one measurement by a millimetre half-way."""
    model, _, variable = plan["pushed"].partition(".")
    time = plan["steps"] // 2 * plan["step"]
    return [{"time": time, "model": model, "variable": variable, "action": "bias", "value": 0.001}]


def run_fmpy(plan: Plan) -> np.ndarray:
    """FMPy's SSP simulation; its row with the stamp t holds the outputs at t + h."""
    from fmpy.ssp.simulation import simulate_ssp

    h = plan["step"]
    # It adds up its time: half a step less keeps rounding from adding a step.
    found = simulate_ssp(plan["ssp"], stop_time=(plan["steps"] - 0.5) * h, step_size=h)
    return np.column_stack([found[name] for name in plan["outputs"]])


def run_libcosim(plan: Plan, path: str) -> np.ndarray:
    """libcosim, read through an observer: its CSV writer gives six digits."""
    from libcosimpy import CosimLogging
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    CosimLogging.log_output_level(CosimLogging.CosimLogLevel.WARNING)
    load = CosimExecution.from_ssp_file if path == "ssp" else CosimExecution.from_osp_config_file
    execution = load(plan[path])
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    wanted: dict[int, list[int]] = {}
    for name in plan["outputs"]:
        instance, _, variable = name.partition(".")
        index = execution.slave_index_from_instance_name(instance)
        references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
        wanted.setdefault(index, []).append(references[variable])
    rows = []
    for _ in range(plan["steps"]):
        if not execution.step():
            raise RuntimeError("a step failed")
        rows.append([x for index, own in wanted.items() for x in observer.last_real_values(index, own)])
    return np.array(rows)


def run_ecos(plan: Plan) -> np.ndarray:
    """Ecos, which applies a set of parameters if it is called by its name."""
    from ecospy.EcosSimulation import EcosSimulation

    names = [name.replace(".", "::") for name in plan["outputs"]]
    rows = []
    with EcosSimulation(ssp_path=plan["ssp"], step_size=plan["step"]) as simulation:
        simulation.init(parameter_set=plan.get("set"))
        for _ in range(plan["steps"]):
            simulation.step()
            rows.append([simulation.get_real(name) for name in names])
        simulation.terminate()
    return np.array(rows)


def run_container(plan: Plan, path: str) -> np.ndarray:
    """The container FMU, in FMPy."""
    from fmpy import simulate_fmu

    h, steps = plan["step"], plan["steps"]
    found = simulate_fmu(
        plan[path], stop_time=steps * h, step_size=h, output_interval=h, output=plan["outputs"]
    )
    return np.column_stack([found[name] for name in plan["outputs"]])[1:]


@dataclass(frozen=True)
class Case:
    """A run, and what it is to be compared with.

    Attributes:
        label: for the table.
        run: gives the outputs at h, 2 h, ... (or from 0 on).
        like: the case that it should agree with.
        meaning: how the tool's time goes.
    """

    label: str
    run: Callable[[Plan], np.ndarray]
    like: str
    meaning: str


CASES = {
    "jacobi": Case("this master, jacobi", lambda p: run_master(p, "jacobi"), "", ""),
    "jacobi_zero": Case(
        "this master, jacobi, zeros first", lambda p: run_master(p, "jacobi", zeros_first(p)), "", ""
    ),
    "jacobi_pushed": Case("pushed, jacobi", lambda p: run_master(p, "jacobi", push(p)), "", ""),
    "gauss_seidel": Case("this master, gauss_seidel", lambda p: run_master(p, "gauss_seidel"), "", ""),
    "gauss_seidel_pushed": Case(
        "pushed, gauss_seidel", lambda p: run_master(p, "gauss_seidel", push(p)), "", ""
    ),
    "libcosim_ssp": Case("libcosim, SSP", lambda p: run_libcosim(p, "ssp"), "jacobi", "row k is k h"),
    "libcosim_osp": Case(
        "libcosim, OSP directory", lambda p: run_libcosim(p, "osp"), "jacobi", "row k is k h"
    ),
    "ecos": Case("Ecos, SSP", run_ecos, "jacobi", "row k is k h"),
    "fmpy": Case(
        "FMPy, SSP",
        run_fmpy,
        "jacobi_zero",
        "the row with the stamp t is t + h; inputs are zero in the first step",
    ),
    "container_jacobi": Case(
        "container FMU, jacobi", lambda p: run_container(p, "container_jacobi"), "jacobi", "row k is k h"
    ),
    "container_gauss_seidel": Case(
        "container FMU, gauss_seidel",
        lambda p: run_container(p, "container_gauss_seidel"),
        "gauss_seidel",
        "row k is k h",
    ),
}


def make_plan(work: Path, steps: int, scenario: Path = SCENARIO, native: bool = False) -> Plan:
    """Export the scenario, without what cannot travel, and write down what all runs share."""
    import cosim
    from cosim.export import export_fmu, export_osp, export_ssp
    from cosim.system import prepare

    content = json.loads(scenario.read_text())
    step = content["step"]
    content |= {"stop": steps * step, "metrics": {}, "faults": [], "events": [], "native": native}
    for entry in content["fmus"].values():
        if "/" in entry["path"]:
            entry["path"] = str((scenario.parent / entry["path"]).resolve())
    plan: Plan = {"scenario": content, "step": step, "steps": steps}
    for algorithm in ("jacobi", "gauss_seidel"):
        system = prepare(cosim.load_scenario(content | {"algorithm": algorithm}))
        plan[f"container_{algorithm}"] = str(work / f"{algorithm}.fmu")
        export_fmu(system, work / f"{algorithm}.fmu")
        if algorithm == "jacobi":
            plan |= {"ssp": str(work / "system.ssp"), "osp": str(work / "osp")}
            export_ssp(system, work / "system.ssp")
            export_osp(system, work / "osp")
            plan["inputs"] = [c.target.name for c in system.connections]
            sources = [c.source.name for c in system.connections]
            plan["pushed"] = PUSHED if PUSHED in sources else sources[0]
            plan["outputs"] = [
                f"{name}.{v.name}"
                for name, model in system.models.items()
                for v in model.variables.values()
                if v.causality == "output" and v.type == "Real"
            ]
        system.close()
    (work / "plan.json").write_text(json.dumps(plan))
    return plan


def run_apart(case: str, work: Path) -> np.ndarray | str:
    """The result of a case, run in a process of its own; or why there is none."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.same_answer", "--case", case, str(work)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    result = work / f"{case}.npy"
    if result.is_file():
        return np.load(result)
    lines = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
    return lines[-1]


def difference(found: np.ndarray, expected: np.ndarray) -> tuple[float, float]:
    """Largest difference, absolute, and relative to the larger of one and the value."""
    away = np.abs(found - expected)
    return float(away.max()), float((away / np.maximum(1.0, np.abs(expected))).max())


def measure(steps: int, scenario: Path = SCENARIO, native: bool = False) -> dict[str, Any]:
    """Run all cases; the result is what ``--json`` writes."""
    with tempfile.TemporaryDirectory(prefix="same_answer_") as folder:
        work = Path(folder)
        plan = make_plan(work, steps, scenario, native)
        found: dict[str, np.ndarray | str] = {}
        for case in CASES:
            result = run_apart(case, work)
            found[case] = result if isinstance(result, str) else result[-steps:]
    answer: dict[str, Any] = {"steps": steps, "step": plan["step"], "outputs": len(plan["outputs"])}
    answer["versions"] = {p: _version(p) for p in PACKAGES}
    answer["cases"] = {}
    for case, result in found.items():
        like = found.get(CASES[case].like)
        if isinstance(result, str):
            answer["cases"][case] = {"error": result}
        elif isinstance(like, np.ndarray):
            absolute, relative = difference(result, like)
            answer["cases"][case] = {"like": CASES[case].like, "away": absolute, "relative": relative}
    answer["order"] = _order(found, plan)
    return answer


def _order(found: dict[str, Any], plan: Plan) -> dict[str, Any]:
    """What the order of execution costs: steps until a push shows, and how far runs are apart."""
    places = {name: plan["outputs"].index(name) for name in AROUND if name in plan["outputs"]}
    steps = {}
    for algorithm in ("jacobi", "gauss_seidel"):
        away = found[algorithm] != found[f"{algorithm}_pushed"]
        shown = {name: np.flatnonzero(away[:, k]) for name, k in places.items()}
        # Row k is the end of step k + 1; the push is there from the beginning of step steps // 2.
        steps[algorithm] = {
            name: int(rows[0]) + 1 - plan["steps"] // 2 if len(rows) else None
            for name, rows in shown.items()
        }
    apart = np.abs(found["jacobi"] - found["gauss_seidel"]).max(axis=0)
    pose = {name: float(apart[k]) for k, name in enumerate(plan["outputs"]) if name in POSE}
    return {"steps": steps, "apart": pose}


POSE = ("vessel.x", "vessel.y", "vessel.psi")
PACKAGES = ("cybership", "fmpy", "libcosimpy", "ecospy", "fmu-manipulation-toolbox", "pythonfmu")


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def report(answer: dict[str, Any]) -> bool:
    """Print the tables; returns whether everything that ran agrees."""
    print(", ".join(f"{name} {version}" for name, version in answer["versions"].items()))
    print(f"{answer['outputs']} outputs at each of {answer['steps']} steps of {answer['step']:g} s\n")
    print(f"{'':32} {'compared with':34} {'largest':>9} {'relative':>9}  what a row means")
    good = True
    for case, result in answer["cases"].items():
        label = CASES[case].label
        if "error" in result:
            print(f"{label:32} did not run: {result['error']}")
            continue
        good &= result["relative"] <= TOLERANCE
        print(
            f"{label:32} {CASES[result['like']].label:34} {result['away']:9.1e} "
            f"{result['relative']:9.1e}  {CASES[case].meaning}"
        )
    _report_order(answer)
    return good


def _report_order(answer: dict[str, Any]) -> None:
    steps = answer["order"]["steps"]
    print("\nSteps until a push of the measurement shows in       jacobi  gauss_seidel  difference")
    for name, late in steps["jacobi"].items():
        early = steps["gauss_seidel"][name]
        if late is None or early is None:
            continue
        milliseconds = 1e3 * (late - early) * answer["step"]
        print(f"  {name:46} {late:10} {early:13} {milliseconds:8.0f} ms")
    apart = ", ".join(f"{name} {value:.1e}" for name, value in answer["order"]["apart"].items())
    print(f"The two are at most apart by: {apart}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; 0 if all tools that run agree, 1 otherwise."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.same_answer", description=__doc__)
    parser.add_argument("scenario", nargs="?", type=Path, default=SCENARIO, help="(ellipse)")
    parser.add_argument("--steps", type=int, default=2000, help="how many (2000)")
    parser.add_argument("--native", action="store_true", help="compiled FMUs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers here as well")
    parser.add_argument("--case", nargs=2, metavar=("CASE", "FOLDER"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.case:
        case, work = options.case[0], Path(options.case[1])
        np.save(work / f"{case}.npy", CASES[case].run(json.loads((work / "plan.json").read_text())))
        return 0
    answer = measure(options.steps, options.scenario, options.native)
    if options.json:
        options.json.write_text(json.dumps(answer, indent=2) + "\n")
    return 0 if report(answer) else 1


if __name__ == "__main__":
    sys.exit(main())
