"""Checks of a scenario against its FMUs: processes, metrics, recordings, faults, events."""

from ..errors import InputError
from ..fmu.fmu_model import NUMERIC
from ..scenario.faults import NO_EFFECT
from ..scenario.schema import Event, Scenario
from .recordings import Recorded, read_recording
from .start_values import check_value
from .system import Signal, System, causality_of


def check_processes(system: System) -> None:
    """Refuse two instances in one process of an FMU that allows only one."""
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


def check_window(scenario: Scenario) -> None:
    start, stop = scenario.metrics.start or 0.0, scenario.metrics.stop or scenario.stop
    if not start < min(stop, scenario.stop):
        raise InputError(
            f"metrics: there is no time from {start} to {stop} s in a run of {scenario.stop} s"
        )


def check_roles(system: System) -> None:
    for role, name in system.scenario.roles.given():
        signal = system.find(name, f"roles.{role}")
        if signal.variable.type not in NUMERIC:
            raise InputError(f"roles.{role}: {name} is of type {signal.variable.type}, not a number")


def check_recordings(system: System) -> dict[str, list[Recorded]]:
    """Read the recordings of a scenario.

    Returns:
        Instance -> what its inputs are given.

    Raises:
        InputError: no such input, or one that is given twice; no such file or column; a cell that is not
            a number, or times that do not grow.
    """
    found: dict[str, list[Recorded]] = {}
    taken: set[str] = set()
    for k, recording in enumerate(system.scenario.recordings):
        where = f"recordings[{k}]"
        for name in recording.inputs:
            signal = system.find(name, where)
            if signal.variable.causality != "input":
                raise InputError(f"{where}: {name} is {causality_of(signal)}, not an input")
            if signal.variable.type != "Real":
                raise InputError(f"{where}: {name} is of type {signal.variable.type}, not Real")
            if name in taken:
                raise InputError(f"{where}: {name} is given by two recordings")
            taken.add(name)
        time, columns = read_recording(
            system.scenario.folder / recording.path, dict.fromkeys(recording.inputs.values())
        )
        instances = dict.fromkeys(name.partition(".")[0] for name in recording.inputs)
        for instance in instances:
            own = {n: c for n, c in recording.inputs.items() if n.partition(".")[0] == instance}
            rows = list(zip(*(columns[c] for c in own.values()), strict=True))
            found.setdefault(instance, []).append(Recorded(list(own), time, rows))
        if time[-1] < system.scenario.stop:
            system.warnings.append(f"{where}: it ends at {time[-1]:g} s; its last values are held")
    return found


def check_overwritten(system: System) -> None:
    """Warn of start values of inputs that connections or files give others."""
    for name, given in system.parameters.items():
        for variable, value in given:
            if f"{name}.{variable.name}" in system.fed:
                text = "has no effect, as the input is connected or has a recording"
                system.warnings.append(f"fmus.{name}: {variable.name} = {value} {text}")


def check_faults(system: System) -> None:
    fed = system.fed
    for k, fault in enumerate(system.scenario.faults):
        where = f"faults[{k}] ({type(fault).__name__.lower()})"
        found = [system.find(name, where) for name in fault.signals]
        for signal in found:
            if signal.variable.causality not in ("input", "output"):
                raise InputError(
                    f"{where}: {signal.name} is {causality_of(signal)}, not an input or output"
                )
            if signal.variable.causality == "input" and signal.name not in fed:
                raise InputError(f"{where}: {signal.name} is not connected, so a fault has no effect")
            if signal.variable.type != "Real":
                raise InputError(f"{where}: {signal.name} is of type {signal.variable.type}, not Real")
        if len({(s.instance, s.variable.causality) for s in found}) > 1:
            raise InputError(
                f"{where}: signals of one fault must be inputs, or outputs, of one instance"
            )
        for signal in found if fault.units else ():
            unit = signal.variable.unit and signal.variable.unit.name
            if unit not in fault.units:
                raise InputError(f"{where}: {signal.name} is in {unit}, and only angles in rad wrap")
        if remark := fault.remark(system.scenario.step, system.scenario.stop):
            system.warnings.append(f"{where}: {remark}")


def check_events(system: System) -> None:
    places: dict[tuple[float, str, str, str], int] = {}
    for k, event in enumerate(system.scenario.events):
        where = f"events[{k}]"
        same = places.setdefault((event.time, event.model, event.variable, event.action), k)
        if same != k:
            raise InputError(
                f"{where}: events[{same}] has the same action on {event.model}.{event.variable} at "
                f"t = {event.time:g} s"
            )
        signal = system.find(f"{event.model}.{event.variable}", where)
        v = signal.variable
        if v.type == "String":
            raise InputError(f"{where}: {signal.name} is of type String; events need a number")
        if v.causality not in ("input", "output") and v.variability != "tunable":
            raise InputError(
                f"{where}: {signal.name} is {causality_of(signal)} that cannot change during a run"
            )
        _check_event_value(system, event, signal, where)
        if event.time >= system.scenario.stop:
            system.warnings.append(f"{where}: {NO_EFFECT.format(event.time)}")


def _check_event_value(system: System, event: Event, signal: Signal, where: str) -> None:
    flowing = signal.variable.causality in ("input", "output")
    if event.action not in ("override", "bias"):
        if event.value is not None:
            raise InputError(f"{where}: {event.action} takes no 'value'")
        if event.action == "hold" and not flowing:
            raise InputError(
                f"{where}: {signal.name} is {causality_of(signal)}, which is held in any case"
            )
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
