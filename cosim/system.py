"""A scenario checked against its FMUs, and laid out for running. Nothing runs before this is done."""

import math
import subprocess
import sys
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path, PurePath

from . import metrics
from .access import INT_LIMIT
from .errors import InputError, nearest
from .fmu import NUMERIC, Model, Variable
from .order import Link, execution_order
from .scenario import Event, Scenario, Value
from .ssv import ParameterSet
from .table import read_table, table_parameters
from .units import SAME, Conversion, conversion

# What an input of one type accepts from an output of another.
ACCEPTS = {
    "Real": ("Real", "Integer", "Enumeration"),
    "Integer": ("Integer", "Enumeration"),
    "Enumeration": ("Enumeration", "Integer"),
    "Boolean": ("Boolean",),
}

# Parameter sets, each with its file.
Overrides = Sequence[tuple[Path, ParameterSet]]


@dataclass(frozen=True)
class Signal:
    """A variable of an instance."""

    instance: str
    variable: Variable

    @property
    def name(self) -> str:
        return f"{self.instance}.{self.variable.name}"


@dataclass(frozen=True)
class Connection:
    """A checked connection, with the conversion of units that it needs."""

    source: Signal
    target: Signal
    conversion: Conversion


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
    system = System(scenario, _read_models(scenario, warnings), warnings=warnings)
    if not native:
        _fmu_builder("--verify", "--", *{str(model.path) for model in system.models.values()})
    _check_processes(system)
    _check_window(scenario)
    _count_steps(system)
    _check_parameters(system, overrides)
    _connect(system)
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


def _read_models(scenario: Scenario, warnings: list[str]) -> dict[str, Model]:
    bare = {e.path for e in scenario.fmus.values() if PurePath(e.path).name == e.path}
    # A bare name means the project's own FMU; only one that the project lacks may be a file beside.
    beside = sorted(name for name in bare if (scenario.folder / name).is_file())
    paths = _own_fmus(sorted(bare.difference(beside)))
    for name in beside:
        try:
            paths |= _own_fmus([name])
            warnings.append(f"'{name}' beside the scenario is not used; './{name}' would mean that file")
        except InputError:
            paths[name] = scenario.folder / name
    models: dict[Path, Model] = {}
    found: dict[str, Model] = {}
    for instance, entry in scenario.fmus.items():
        path = paths.get(entry.path) or scenario.folder / entry.path
        if path not in models:
            models[path] = Model(path)
        found[instance] = models[path]
    return found


def _own_fmus(names: Sequence[str]) -> dict[str, Path]:
    """Paths of the project's own FMUs, built if need be."""
    if not names:
        return {}
    return dict(zip(names, map(Path, _fmu_builder("--", *names)), strict=True))


def _fmu_builder(*arguments: str) -> list[str]:
    """Lines that the project's FMU builder prints, in a process of its own.

    Raises:
        InputError: what it complains of.
    """
    done = subprocess.run(
        [sys.executable, "-m", "fmus.build", *arguments], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        reason = done.stderr.strip().splitlines()[-1:] or ["python -m fmus.build failed"]
        raise InputError(reason[0].removeprefix("error: "))
    return done.stdout.splitlines()


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


def _check_parameters(system: System, overrides: Overrides) -> None:
    for name, values in _merge_parameters(system, overrides).items():
        known = system.models[name].variables
        settable = {k: v for k, v in known.items() if v.causality in ("parameter", "input")}
        system.parameters[name] = []
        for parameter, (value, where) in values.items():
            if parameter not in settable:
                what = "cannot be set" if parameter in known else "does not exist"
                hint = nearest(parameter, list(settable))
                raise InputError(f"{where}: {name}.{parameter} {what}{hint}")
            _check_value(settable[parameter], value, f"{where}: {name}.{parameter}")
            system.parameters[name].append((settable[parameter], value))


def _merge_parameters(system: System, overrides: Overrides) -> dict[str, dict[str, tuple[Value, str]]]:
    """Instance -> parameter -> value and where it comes from; parameter sets beat the scenario."""
    chosen: dict[str, dict[str, tuple[Value, str]]] = {}
    for name, entry in system.scenario.fmus.items():
        chosen[name] = {k: (v, f"fmus.{name}.parameters") for k, v in entry.parameters.items()}
        chosen[name] |= _from_table(system, name)
    for path, given in overrides:
        for name, beside in given.beside.items():
            system.warnings.append(
                f"'{path}': {name} = {beside.value} {beside.unit or ''} is no parameter of an FMU "
                f"and has no effect here: {beside.description}"
            )
        for model_name in given.values:
            targets = [n for n, model in system.models.items() if model.name == model_name]
            if not targets:
                system.warnings.append(
                    f"'{path}' has values for a model '{model_name}', which does not run here"
                    f"{_models_hint(system, model_name)}"
                )
            for name in targets:
                for parameter, value in _in_units_of(system.models[name], path, given).items():
                    old = chosen[name].get(parameter)
                    if old is not None and old[0] != value:
                        system.warnings.append(
                            f"{name}.{parameter} = {value} from '{path}' beats {old[0]} from {old[1]}"
                        )
                    chosen[name][parameter] = (value, f"'{path}'")
    return chosen


def _from_table(system: System, name: str) -> dict[str, tuple[Value, str]]:
    """The parameters of one instance that stand in a table, and where they come from."""
    entry = system.scenario.fmus[name]
    if entry.table is None:
        return {}
    path = system.scenario.folder / entry.table
    known = {k: v for k, v in system.models[name].variables.items() if v.causality == "parameter"}
    found = table_parameters(read_table(path), known, f"fmus.{name}.table '{path}'")
    for parameter in entry.parameters:
        if parameter in found:
            raise InputError(f"fmus.{name}: {parameter} is given twice, in parameters and by '{path}'")
    return {parameter: (value, f"'{path}'") for parameter, value in found.items()}


def _models_hint(system: System, wrong: str) -> str:
    if wrong in system.models:
        return f"; the model of that instance is called '{system.models[wrong].name}'"
    return nearest(wrong, {model.name for model in system.models.values()})


def _in_units_of(model: Model, path: Path, given: ParameterSet) -> dict[str, Value]:
    """The values of a parameter set for one model, in the units of the FMU.

    Raises:
        InputError: no such variable, or a unit that does not fit.
    """
    found: dict[str, Value] = {}
    for name, parameter in given.values[model.name].items():
        where = f"'{path}': {model.name}.{name}"
        variable = model.variables.get(name)
        if variable is None:
            raise InputError(f"{where} does not exist{_effects_hint(model, name)}")
        value = given.number(parameter, variable.unit, where)
        found[name] = int(value) if variable.type != "Real" and value.is_integer() else value
    return found


def _effects_hint(model: Model, wrong: str) -> str:
    """What may be meant by a parameter that an FMU lacks, and how one of ours would get it."""
    hint = nearest(wrong, [v.name for v in model.variables.values() if v.causality == "parameter"])
    if model.path.name != f"{model.name}.fmu":
        return hint
    return (
        f"{hint}; if it is of an effect of your own, build the FMU that has it, with "
        f"'python -m fmus.build {model.name} --effects FILE.py --out fmu', and name it by its path"
    )


def _check_value(variable: Variable, value: Value | None, where: str) -> None:
    if variable.type == "String":
        fits = isinstance(value, str)
    elif variable.type == "Boolean":
        fits = isinstance(value, bool) or value in (0, 1)
    elif variable.type == "Real":
        fits = isinstance(value, (int, float)) and not isinstance(value, bool)
    else:
        fits = isinstance(value, int) and not isinstance(value, bool) and abs(value) < INT_LIMIT
    if not fits:
        raise InputError(f"{where} = {value!r}: needs a value of type {variable.type}")
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if variable.min is not None and value < variable.min:
            raise InputError(f"{where} = {value} is below its minimum {variable.min}")
        if variable.max is not None and value > variable.max:
            raise InputError(f"{where} = {value} is above its maximum {variable.max}")


def _connect(system: System) -> None:
    taken: dict[str, Signal] = {}
    for k, (output, input_) in enumerate(system.scenario.connections):
        where = f"connections[{k}] {output} -> {input_}"
        for source, target in _resolve(system, output, input_, where):
            ends = f"connections[{k}] {source.name} -> {target.name}"
            if source.variable.causality != "output":
                raise InputError(f"{ends}: {source.name} is {_kind(source)}, not an output")
            if target.variable.causality != "input":
                raise InputError(f"{ends}: {target.name} is {_kind(target)}, not an input")
            if target.name in taken:
                raise InputError(
                    f"{ends}: {target.name} is already connected to {taken[target.name].name}"
                )
            if source.variable.type not in ACCEPTS.get(target.variable.type, ()):
                raise InputError(f"{ends}: {source.variable.type} cannot feed {target.variable.type}")
            taken[target.name] = source
            system.connections.append(Connection(source, target, _link(source, target, ends, system)))
    for name in system.scenario.transformations:
        if name not in taken:
            raise InputError(f"transformations: {name} is not connected{nearest(name, taken)}")
    _find_free_inputs(system, taken)


def _find_free_inputs(system: System, taken: Collection[str]) -> None:
    """Warn of inputs that nothing feeds and the scenario does not mention."""
    for name, model in system.models.items():
        free = [
            v.name
            for v in model.variables.values()
            if v.causality == "input"
            and f"{name}.{v.name}" not in taken
            and v.name not in system.scenario.fmus[name].parameters
        ]
        if free:
            system.warnings.append(
                f"{name}: input {', '.join(free)} not connected; keeps its start value"
            )


def _link(source: Signal, target: Signal, ends: str, system: System) -> Conversion:
    """What becomes of a value between two ends: a warning where units cannot be compared."""
    given = system.scenario.transformations.get(target.name)
    if given is not None:
        if target.variable.type != "Real":
            raise InputError(f"{ends}: a transformation needs a Real, not {target.variable.type}")
        return Conversion(given.factor, given.offset)
    a, b = source.variable.unit, target.variable.unit
    how = conversion(a, b, ends)
    if how is None and a is not None and b is not None:
        system.warnings.append(
            f"{ends}: units '{a.name}' and '{b.name}' cannot be compared, "
            "because an FMU does not define them; the value passes unchanged"
        )
    return how or SAME


def _kind(signal: Signal) -> str:
    causality = signal.variable.causality
    return f"an {causality}" if causality[0] in "aeiou" else f"a {causality}"


def _resolve(system: System, output: str, input_: str, where: str) -> list[tuple[Signal, Signal]]:
    """The pairs that a connection means: one, or with * on both sides all whose names agree there."""
    if "*" not in output + input_:
        return [(system.find(output, where), system.find(input_, where))]
    if output.count("*") != 1 or input_.count("*") != 1:
        raise InputError(f"{where}: a group needs exactly one * on each side")
    head, tail = _around(output)
    source = output.partition(".")[0]
    target = input_.partition(".")[0]
    for name in (source, target):
        if name not in system.models:
            raise InputError(f"{where}: no instance '{name}'{nearest(name, system.models)}")
    pairs: list[tuple[Signal, Signal]] = []
    for variable in system.models[source].variables.values():
        name = f"{source}.{variable.name}"
        if variable.causality != "output" or len(name) < len(head) + len(tail):
            continue
        if name.startswith(head) and name.endswith(tail):
            middle = name[len(head) : len(name) - len(tail)]
            partner = input_.replace("*", middle).partition(".")[2]
            other = system.models[target].variables.get(partner)
            if other is not None and other.causality == "input":
                pairs.append((Signal(source, variable), Signal(target, other)))
    if not pairs:
        raise InputError(f"{where}: no output and input agree in the place of *")
    return pairs


def _around(pattern: str) -> tuple[str, str]:
    head, _, tail = pattern.partition("*")
    return head, tail


def _check_faults(system: System) -> None:
    connected = {c.target.name for c in system.connections}
    for k, fault in enumerate(system.scenario.faults):
        where = f"faults[{k}] ({type(fault).__name__.lower()})"
        found = [system.find(name, where) for name in fault.signals]
        for signal in found:
            if signal.variable.causality not in ("input", "output"):
                raise InputError(f"{where}: {signal.name} is {_kind(signal)}, not an input or output")
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
            raise InputError(
                f"{where}: {signal.name} is {_kind(signal)} that cannot change during a run"
            )
        _check_event_value(system, event, signal, where)
        if event.time >= system.scenario.stop:
            system.warnings.append(f"{where}: no step starts at or after t = {event.time} s: no effect")


def _check_event_value(system: System, event: Event, signal: Signal, where: str) -> None:
    flowing = signal.variable.causality in ("input", "output")
    if event.action not in ("override", "bias"):
        if event.value is not None:
            raise InputError(f"{where}: {event.action} takes no 'value'")
        if event.action == "hold" and not flowing:
            raise InputError(f"{where}: {signal.name} is {_kind(signal)}, which holds its value anyway")
        return
    value = event.value
    if value is None:
        raise InputError(f"{where}: {event.action} needs a 'value'")
    if event.action == "bias":
        if flowing:
            return
        value += _start_of(system, signal)
    _check_value(signal.variable, value, f"{where}: {signal.name}")


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
