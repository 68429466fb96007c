"""A scenario checked against its FMUs, and laid out for running. Nothing runs before this is done."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from . import metrics
from .errors import InputError, nearest
from .fmu import NUMERIC, Model, Variable
from .models import fmu_builder, read_models
from .order import Link, execution_order
from .scenario import Event, Scenario, Value
from .start_values import Overrides, check_parameters, check_value
from .wiring import Connection, Signal, connect, kind


@dataclass
class System:
    """What the master runs.

    Attributes:
        scenario: as read.
        models: FMU of each instance, by instance name.
        order: instances in the order of stepping.
        every: base steps in one step of each instance.
        steps: number of base steps.
        connections: all of them, groups resolved.
        signals: what the value table holds, by name.
        logged: names of the logged signals, in the order of the log's columns.
        parameters: start values to set, by instance.
        warnings: what is odd but no reason to refuse.
    """

    scenario: Scenario
    models: dict[str, Model]
    every: dict[str, int] = field(default_factory=dict)
    steps: int = 0
    order: list[str] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    signals: dict[str, Signal] = field(default_factory=dict)
    logged: list[str] = field(default_factory=list)
    parameters: dict[str, list[tuple[Variable, Value]]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def close(self) -> None:
        """Remove what was unpacked."""
        for model in set(self.models.values()):
            model.close()

    def find(self, name: str, where: str) -> Signal:
        """The variable behind ``instance.variable``.

        Raises:
            InputError: no such instance or variable.
        """
        instance, _, variable = name.partition(".")
        if instance not in self.models:
            raise InputError(f"{where}: no instance '{instance}'{nearest(instance, self.models)}")
        known = self.models[instance].variables
        if variable not in known:
            hint = nearest(variable, [f"{v}" for v in known])
            raise InputError(f"{where}: '{instance}' has no variable '{variable}'{hint}")
        return Signal(instance, known[variable])


def prepare(scenario: Scenario, overrides: Overrides = (), native: bool = True) -> System:
    """Read the FMUs of a scenario and check everything that can be checked without running.

    Args:
        scenario: what to run.
        overrides: parameter sets that beat the scenario's own.
        native: whether FMUs may run programs that were not built on this computer.

    Raises:
        InputError: the first thing that is wrong.
    """
    warnings: list[str] = []
    system = System(scenario, read_models(scenario, warnings), warnings=warnings)
    if not native:
        fmu_builder("--verify", "--", *{str(model.path) for model in system.models.values()})
    _check_processes(system)
    _check_window(scenario)
    _count_steps(system)
    check_parameters(system, overrides)
    connect(system)
    _check_faults(system)
    _check_events(system)
    _choose_signals(system)
    if scenario.algorithm == "gauss_seidel":
        system.order, late = newest_first(system)
        system.warnings += late
    else:
        system.order = list(system.models)
    return system


def newest_first(system: System) -> tuple[list[str], list[str]]:
    """The order of instances in which values travel farthest at one instant, and where that ends."""
    links = [
        Link(c.source.instance, c.source.variable.name, c.target.instance, c.target.variable.name)
        for c in system.connections
    ]
    feedthrough = {name: model.feedthrough for name, model in system.models.items()}
    return execution_order(list(system.models), links, feedthrough)


def _check_processes(system: System) -> None:
    """Some FMUs want a process for each instance."""
    together: dict[str, str] = {}
    for name, model in system.models.items():
        capabilities = model.description.coSimulation
        if system.scenario.fmus[name].isolate or capabilities is None:
            continue
        other = together.setdefault(model.sha256, name)
        if other != name and capabilities.canBeInstantiatedOnlyOncePerProcess:
            raise InputError(
                f"fmus.{name}: '{model.path}' can be instantiated only once per process, and "
                f'{other} does; give one of them "isolate": true'
            )


def whole(ratio: float) -> int | None:
    """The whole number that a ratio of times is meant to be, if it is one."""
    if not math.isfinite(ratio):
        return None
    count = round(ratio)
    return count if count > 0 and abs(ratio - count) < 1e-6 * max(1.0, ratio) else None


def _check_window(scenario: Scenario) -> None:
    start, stop = scenario.metrics.start or 0.0, scenario.metrics.stop or scenario.stop
    if not start < min(stop, scenario.stop):
        raise InputError(
            f"metrics: there is no time from {start} to {stop} s in a run of {scenario.stop} s"
        )


def _count_steps(system: System) -> None:
    scenario = system.scenario
    steps = whole(scenario.stop / scenario.step)
    if steps is None:
        raise InputError(f"stop = {scenario.stop} s is not a multiple of step = {scenario.step} s")
    system.steps = steps
    for name, entry in scenario.fmus.items():
        every = whole((entry.step or scenario.step) / scenario.step)
        if every is None:
            raise InputError(
                f"fmus.{name}: step = {entry.step} s is not a multiple of step = {scenario.step} s"
            )
        if every > steps:
            raise InputError(f"fmus.{name}: step = {entry.step} s is longer than the whole run")
        system.every[name] = every


def _check_faults(system: System) -> None:
    connected = {c.target.name for c in system.connections}
    for k, fault in enumerate(system.scenario.faults):
        where = f"faults[{k}] ({type(fault).__name__.lower()})"
        found = [system.find(name, where) for name in fault.signals]
        for signal in found:
            if signal.variable.causality not in ("input", "output"):
                raise InputError(f"{where}: {signal.name} is {kind(signal)}, not an input or output")
            if signal.variable.causality == "input" and signal.name not in connected:
                raise InputError(
                    f"{where}: {signal.name} is not connected, so nothing can go wrong there"
                )
            if signal.variable.type != "Real":
                raise InputError(f"{where}: {signal.name} is of type {signal.variable.type}, not Real")
        if len({(s.instance, s.variable.causality) for s in found}) > 1:
            raise InputError(
                f"{where}: signals of one fault must be inputs, or outputs, of one instance"
            )


def _check_events(system: System) -> None:
    for k, event in enumerate(system.scenario.events):
        where = f"events[{k}]"
        signal = system.find(f"{event.model}.{event.variable}", where)
        v = signal.variable
        if v.type == "String":
            raise InputError(f"{where}: {signal.name} is of type String; events need a number")
        if v.causality not in ("input", "output") and v.variability != "tunable":
            raise InputError(f"{where}: {signal.name} is {kind(signal)} that cannot change during a run")
        _check_event_value(system, event, signal, where)
        if event.time >= system.scenario.stop:
            system.warnings.append(f"{where}: no step starts at or after t = {event.time} s: no effect")


def _check_event_value(system: System, event: Event, signal: Signal, where: str) -> None:
    flowing = signal.variable.causality in ("input", "output")
    if event.action not in ("override", "bias"):
        if event.value is not None:
            raise InputError(f"{where}: {event.action} takes no 'value'")
        if event.action == "hold" and not flowing:
            raise InputError(f"{where}: {signal.name} is {kind(signal)}, which holds its value anyway")
        return
    value = event.value
    if value is None:
        raise InputError(f"{where}: {event.action} needs a 'value'")
    if event.action == "bias":
        if flowing:
            return
        value += _start_of(system, signal)
    check_value(signal.variable, value, f"{where}: {signal.name}")


def _start_of(system: System, signal: Signal) -> float:
    """The value that a parameter has before the first event [in its unit]."""
    given = [value for v, value in system.parameters[signal.instance] if v == signal.variable]
    return float(given[-1] if given else signal.variable.start or 0.0)


def _choose_signals(system: System) -> None:
    """The value table holds what is connected, logged, or touched by a fault or an event."""
    available = {
        f"{name}.{v.name}": Signal(name, v)
        for name, model in system.models.items()
        for v in model.variables.values()
        if v.type in NUMERIC
    }
    flowing = [n for n, s in available.items() if s.variable.causality in ("input", "output")]
    wanted = system.scenario.log.signals
    if wanted == "all":
        system.logged = flowing
    else:
        for k, pattern in enumerate(wanted):
            for name in _matching(system, pattern, flowing, f"log.signals[{k}]"):
                if name not in available:
                    raise InputError(f"log.signals[{k}]: {name} is of type String, not a number")
                if name not in system.logged:
                    system.logged.append(name)
    needed = {*system.logged}
    needed |= set(metrics.INPUTS).intersection(available)
    for c in system.connections:
        needed |= {c.source.name, c.target.name}
    for fault in system.scenario.faults:
        needed |= set(fault.signals)
    needed |= {f"{e.model}.{e.variable}" for e in system.scenario.events}.intersection(flowing)
    system.signals = {name: signal for name, signal in available.items() if name in needed}


def _matching(system: System, pattern: str, names: Sequence[str], where: str) -> list[str]:
    """The one variable that a name means, or all inputs and outputs that a pattern with * means."""
    if "*" not in pattern:
        return [system.find(pattern, where).name]
    found = [name for name in names if fnmatchcase(name, pattern.replace("[", "[[]"))]
    if not found:
        raise InputError(f"{where}: nothing matches '{pattern}'")
    return found
