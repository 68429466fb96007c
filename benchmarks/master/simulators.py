"""The tools that are timed. Each gives seconds of set-up and seconds per step."""

from pathlib import Path
from time import perf_counter
from typing import Any

from .plan import Plan


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
    time = Master.time

    def first(self: Master, k: int) -> float:
        # Either loop begins by asking for a time.
        marks["first step"] = perf_counter()
        Master.time = time
        return time(self, k)

    def progress(t: float) -> None:
        # The last call comes when the last rows have been written.
        marks["end"] = perf_counter()

    Master.time = first
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


def time_fmpy(plan: Plan, out: Path) -> dict[str, float]:
    """FMPy's simulation of an SSP archive; it keeps all rows, written to one CSV file at the end."""
    started = perf_counter()
    from fmpy.ssp import simulation, ssd
    from fmpy.util import write_csv

    step, marks = simulation.do_step, {}

    def first(*arguments: Any) -> None:
        marks["first step"] = perf_counter()
        simulation.do_step = step
        step(*arguments)

    simulation.do_step = first
    start = [ssd.Parameter(name=name, value=value) for name, value in plan["parameters"].items()]
    result = simulation.simulate_ssp(
        str(Path(plan["work"], "system.ssp")),
        # It adds up its time: half a step less keeps rounding from adding a step.
        stop_time=(plan["steps"] - 0.5) * plan["step"],
        step_size=plan["step"],
        parameter_set=ssd.ParameterSet(parameters=start),
    )
    write_csv(out / "log.csv", result, plan["signals"])
    return _times(started, marks["first step"], plan["steps"])


def time_container(plan: Plan, out: Path) -> dict[str, float]:
    """The container FMU of the whole system, stepped by FMPy; its first step belongs to the set-up."""
    started = perf_counter()
    from fmpy import read_model_description, simulate_fmu
    from fmpy.util import write_csv

    fmu, h, steps = Path(plan["work"], "system.fmu"), plan["step"], plan["steps"]
    if plan["no_container"]:
        raise RuntimeError(plan["no_container"])
    known = {v.name for v in read_model_description(str(fmu)).modelVariables}
    signals = [name for name in plan["signals"] if name in known]
    marks: list[float] = []

    def stepped(time: float, recorder: Any) -> bool:
        if not marks:
            marks.append(perf_counter())
        return True

    result = simulate_fmu(
        str(fmu),
        stop_time=steps * h,
        step_size=h,
        output_interval=h,
        output=signals,
        step_finished=stepped,
    )
    write_csv(out / "log.csv", result)
    return _times(started, marks[0], steps - 1)


def _times(started: float, first: float, steps: int) -> dict[str, float]:
    return {"setup": first - started, "per_step": (perf_counter() - first) / steps}
