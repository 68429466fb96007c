"""Preparation of a system: a scenario checked against its FMUs. Nothing runs before this is done."""

import math
from collections.abc import Collection, Mapping, Sequence
from fnmatch import fnmatchcase

from ..errors import InputError
from ..fmu.fmu_model import NUMERIC, FmuModel, FmuVariable
from ..scenario.schema import Scenario
from .checks import (
    check_events,
    check_faults,
    check_overwritten,
    check_processes,
    check_recordings,
    check_roles,
    check_window,
)
from .order import Link, execution_order
from .own_fmus import read_models, run_builder
from .start_values import Overrides, check_parameters
from .system import Signal, System
from .wiring import connect, find_free_inputs

# Relative deviation of a ratio of times from an integer that counts as rounding.
RATIO_TOLERANCE = 1e-6


def prepare(
    scenario: Scenario,
    overrides: Overrides = (),
    only_own: bool = False,
    models: Mapping[str, FmuModel] | None = None,
    controller_models: Overrides = (),
    unlogged: Collection[str] = (),
) -> System:
    """Read the FMUs of a scenario and check all that can be checked without running.

    Args:
        scenario: what to run.
        overrides: parameter sets whose values override the scenario's.
        only_own: whether to refuse FMUs with programs that were not built on this computer.
        models: the FMU of each instance, where they have been read before.
        controller_models: parameter sets for the models of the plant that other FMUs have.
        unlogged: instances of which nothing is logged, whatever the scenario says.

    Raises:
        InputError: the first error.
    """
    warnings: list[str] = []
    found = read_models(scenario, warnings) if models is None else dict(models)
    system = System(scenario, found, warnings=warnings)
    if only_own:
        run_builder("--verify", "--", *{str(model.path) for model in system.models.values()})
    check_processes(system)
    check_window(scenario)
    _count_steps(system)
    check_parameters(system, overrides, controller_models)
    connect(system)
    system.recordings = check_recordings(system)
    find_free_inputs(system)
    check_overwritten(system)
    check_faults(system)
    check_events(system)
    check_roles(system)
    _choose_signals(system, unlogged)
    if scenario.algorithm == "gauss_seidel":
        system.order, late = newest_first(system)
        system.warnings += late
    else:
        system.order = list(system.models)
    return system


def newest_first(system: System) -> tuple[list[str], list[str]]:
    """Order of instances in which values travel farthest at one instant, and a warning for each cut."""
    links = [
        Link(c.source.instance, c.source.variable.name, c.target.instance, c.target.variable.name)
        for c in system.connections
    ]
    feedthrough = {name: model.feedthrough for name, model in system.models.items()}
    return execution_order(list(system.models), links, feedthrough)


def integer_ratio(ratio: float) -> int | None:
    """The positive integer that a ratio of times equals but for rounding; None if there is none."""
    if not math.isfinite(ratio):
        return None
    count = round(ratio)
    return count if count > 0 and abs(ratio - count) < RATIO_TOLERANCE * max(1.0, ratio) else None


def _count_steps(system: System) -> None:
    scenario = system.scenario
    steps = integer_ratio(scenario.stop / scenario.step)
    if steps is None:
        raise InputError(f"stop = {scenario.stop} s is not a multiple of step = {scenario.step} s")
    system.steps = steps
    for name, entry in scenario.fmus.items():
        every = integer_ratio((entry.step or scenario.step) / scenario.step)
        if every is None:
            raise InputError(
                f"fmus.{name}: step = {entry.step} s is not a multiple of step = {scenario.step} s"
            )
        if every > steps:
            raise InputError(f"fmus.{name}: step = {entry.step} s is longer than the whole run")
        system.every[name] = every


def _choose_signals(system: System, unlogged: Collection[str]) -> None:
    """Choose the signals of the value table: connected, logged, or used by metrics, faults or events."""
    available = _numbers(system)
    flowing = [name for name, v in available.items() if v.causality in ("input", "output")]
    wanted = system.scenario.log.signals
    if wanted == "all":
        system.logged = flowing
    elif wanted == "compact":
        system.logged = _compact(system, available)
    else:
        for k, pattern in enumerate(wanted):
            for name in _matching(system, pattern, flowing, f"log.signals[{k}]"):
                if name not in available:
                    raise InputError(f"log.signals[{k}]: {name} is of type String, not a number")
                if name not in system.logged:
                    system.logged.append(name)
    system.logged = [name for name in system.logged if name.partition(".")[0] not in unlogged]
    needed = {*system.logged}
    needed |= set(system.scenario.roles.metric_inputs).intersection(available)
    needed |= set() if system.trial is None else {system.trial.order}
    for c in system.connections:
        needed |= {c.source.name, c.target.name}
    needed |= system.fed
    for fault in system.scenario.faults:
        needed |= set(fault.signals)
    needed |= {f"{e.model}.{e.variable}" for e in system.scenario.events}.intersection(flowing)
    system.signals = {
        name: Signal(name.partition(".")[0], v) for name, v in available.items() if name in needed
    }


def _compact(system: System, available: Mapping[str, FmuVariable]) -> list[str]:
    """What metrics, pictures and the diagnosis read: roles, recordings, commands, measured pose."""
    sources = set(system.scenario.roles.pose)
    measured = [c.target.name for c in system.connections if c.source.name in sources]
    poses = [f"{name}.{axis}_m" for name in system.models for axis in ("x", "y", "psi")]
    wanted = {*system.scenario.roles.columns, *measured, *poses}
    wanted |= system.recorded | (set() if system.trial is None else {system.trial.order})
    # Commands of actuators have limits, or enter the model of the force from elsewhere, as an angle.
    acting = {name.partition(".")[0] for name in system.scenario.roles.force}
    parts = [(m, v) for m in acting & system.models.keys() for v in system.models[m].variables.values()]
    entering = {f"{m}.{v.name}" for m, v in parts if v.causality == "input"}
    copied = {c.target.name for c in system.connections if c.source.name in wanted}
    wanted |= system.limited.keys() | (entering - copied)
    return [name for name in available if name in wanted]


def _numbers(system: System) -> dict[str, FmuVariable]:
    """All variables that are numbers, by ``instance.variable``."""
    return {
        f"{name}.{v.name}": v
        for name, model in system.models.items()
        for v in model.variables.values()
        if v.type in NUMERIC
    }


def _matching(system: System, pattern: str, names: Sequence[str], where: str) -> list[str]:
    """The variable of a name, or all inputs and outputs that match a pattern with *."""
    if "*" not in pattern:
        return [system.find(pattern, where).name]
    found = [name for name in names if fnmatchcase(name, pattern.replace("[", "[[]"))]
    if not found:
        raise InputError(f"{where}: nothing matches '{pattern}'")
    return found
