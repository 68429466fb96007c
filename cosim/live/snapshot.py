"""A system at t = 0 as data for a page: values, connections, planned operations, events."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..fmu.fmu_model import FmuVariable
from ..fmu.instance import Instance
from ..master.algorithm import Master
from ..master.changes import Changes
from ..master.loops.compiled_loop import ask_stepper_ahead, function_among, operations_of
from ..master.loops.rounding import round_to_places
from ..master.stepper import Stepper
from ..scenario.operations import Operation
from ..scenario.plans import TIME_TOLERANCE
from ..scenario.schema import Event
from ..system.system import Signal, System

# A part of the page's data, which becomes JSON.
Part = dict[str, Any]


def packed(numbers: Iterable[float]) -> str:
    """Numbers to the bit: float64, little endian, in base64."""
    return b64encode(np.asarray([*numbers], "<f8").tobytes()).decode()


def snapshot(master: Master) -> Part:
    """What the page needs of a system that is initialised and has not stepped.

    Args:
        master: its operations are planned to the end of the run, so it can step no more.

    Raises:
        InputError: a fault is a function in Python.
    """
    system, table = master.system, master.table
    scenario, slots = system.scenario, table.slots
    times = round_to_places(np.arange(system.steps + 1) * scenario.step)
    for stepper in master.steppers:
        if why := function_among(stepper):
            raise InputError(f"{why}; a page cannot run it")
        ask_stepper_ahead(stepper, times, 0, range(system.steps), master.is_jacobi)
    roles = scenario.roles
    force = roles.force if set(roles.force) <= slots.keys() else roles.requested_force
    columns = {"pose": roles.pose, "velocity": roles.velocity, "target": roles.target, "force": force}
    outline = system.outline
    return {
        "name": scenario.name,
        "description": scenario.description,
        "seed": scenario.seed,
        "step": scenario.step,
        "steps": system.steps,
        "jacobi": master.is_jacobi,
        "signals": [s.name for s in table.signals],
        "logged": [slots[name] for name in system.logged],
        "every": scenario.log.every,
        "row": packed(table.values),
        "fmus": [_fmu(master, stepper) for stepper in master.steppers],
        "events": [_event(system, slots, event) for event in sorted(scenario.events, key=_time)
                   if event.time > TIME_TOLERANCE],
        "roles": {role: [slots.get(name, -1) for name in names] for role, names in columns.items()},
        "power": [slots[name] for name in roles.power if name in slots],
        "from": scenario.metrics.start,
        "to": scenario.metrics.stop,
        "outline": None if outline is None else outline._asdict(),
        "measured": [slots[name] for name in _measured(system) if name in slots],
        "actuators": [_shown(slots, s) for s in _actuators(master, force)],
    }  # fmt: skip


def _time(event: Event) -> float:
    return event.time


def _fmu(master: Master, stepper: Stepper) -> Part:
    system, instance, slots = master.system, stepper.instance, master.table.slots
    effects = (stepper.input_effects, stepper.output_effects)
    changed = stepper.input_changes, stepper.output_changes
    planned = [[_operation(o) for e in part if not isinstance(e, Changes) for o in operations_of([e])]
               for part in effects]  # fmt: skip
    model = system.models[instance.name]
    tunable = [v for v in model.variables.values() if v.variability == "tunable"]
    return {
        "name": instance.name,
        "module": model.name,
        "every": stepper.every,
        "h": stepper.step_size,
        "values": packed(_start_values(instance)),
        "copies": stepper.copies,
        **ports(slots, stepper.put, stepper.got),
        "on_inputs": planned[0],
        "on_outputs": planned[1],
        "changes": [[[o.slots, [*o.numbers]] for o in operations_of([c])] for c in changed],
        "parameters": [_described(v) for v in tunable if v.causality == "parameter"],
    }


def ports(slots: dict[str, int], put: Sequence[Signal], got: Sequence[Signal]) -> Part:
    """Pairs of value reference and slot, of the signals that an FMU gets and gives."""
    pairs = [[[s.variable.reference, slots[s.name]] for s in signals] for signals in (put, got)]
    return {"put": pairs[0], "got": pairs[1]}


def _start_values(instance: Instance) -> list[float]:
    """Parameters and inputs as they are now, in the order of their value references."""
    own = instance.model.variables.values()
    given = sorted((v for v in own if v.causality in ("parameter", "input")), key=lambda v: v.reference)
    return [instance.get_value(v) for v in given]


def _described(v: FmuVariable) -> Part:
    unit = "" if v.unit is None else v.unit.name
    return {"reference": v.reference, "name": v.name, "unit": unit, "description": v.description,
            "min": v.min, "max": v.max}  # fmt: skip


def _shown(slots: dict[str, int], signal: Signal) -> Part:
    return {**_described(signal.variable), "slot": slots[signal.name]}


def _operation(o: Operation) -> Part:
    is_planned = o.plan is not None
    return {
        "code": o.code,
        "slots": o.slots,
        "acts": b64encode(o.acts.tobytes()).decode() if is_planned else None,
        "numbers": packed(o.numbers),
        "stride": o.width * is_planned,
        "memory": packed(o.memory),
        "calls": o.calls[0],
        "samples": o.samples,
        "sources": o.sources,
    }


def _event(system: System, slots: dict[str, int], event: Event) -> Part:
    signal = system.find(f"{event.model}.{event.variable}", "events")
    v = signal.variable
    started = {given.name: value for given, value in system.parameters[event.model]}
    is_signal = v.causality in ("input", "output")
    return {
        "time": event.time,
        "fmu": system.order.index(event.model),
        "kind": v.causality,
        "place": slots[signal.name] if is_signal else v.reference,
        "action": event.action,
        "value": float(event.value or 0.0),
        "original": float(started.get(v.name, v.start or 0.0)),
    }


def _measured(system: System) -> list[str]:
    """Inputs with a measured pose, of which a freeze acts on all."""
    found = [f"{name}.{axis}_m" for name in system.models for axis in ("x", "y", "psi")]
    inputs = [
        n for n in found if n in system.signals and system.signals[n].variable.causality == "input"
    ]
    poses = set(system.scenario.roles.pose)
    return inputs or [c.target.name for c in system.connections if c.source.name in poses]


def _actuators(master: Master, force: Sequence[str]) -> list[Signal]:
    """Commands of the actuators, and what they report: all but forces of the FMU that has the force."""
    system, owner = master.system, force[0].partition(".")[0]
    plant = system.scenario.roles.pose[0].partition(".")[0]
    commands = {c.target.name for c in system.connections if c.source.instance != plant}
    own = [s for s in master.table.signals if s.instance == owner]
    shown = [s for s in own if s.variable.causality == "output" or s.name in commands]
    return [s for s in shown if not s.variable.name.startswith("tau_")]
