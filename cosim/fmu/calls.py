"""The calls of one FMU in a step, with their arguments converted once and bound to a memory of doubles.

Reals pass directly between the FMU and the memory, in one call; other types through small buffers.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence

from ..errors import SimulationError
from .component import DISCARD, Component
from .fmu_model import INT_LIMIT
from .instance import Access
from .memory import Memory, Port
from .stepping import redoing_steps, single_steps

_SETTERS = {
    "Integer": ("fmi2SetInteger", "fmi2GetInteger", ctypes.c_int),
    "Enumeration": ("fmi2SetInteger", "fmi2GetInteger", ctypes.c_int),
    "Boolean": ("fmi2SetBoolean", "fmi2GetBoolean", ctypes.c_int),
}

# A function and its arguments, converted for C once; returns an FMI status.
Call = tuple[Callable[..., int], tuple[object, ...]]


def bind(
    component: Component, inputs: Sequence[Port], outputs: Sequence[Port], memory: Memory, h: float
) -> Access:
    """Access to an FMU in this process.

    Args:
        component: the FMU.
        inputs, outputs: what to put and get; the Reals of each are adjacent in the memory.
        memory: where the values are.
        h: length of its steps [s].
    """
    # These run every step and keep what they need in their own scope, where Python finds it fastest.
    sets = _calls(component, inputs, memory, setting=True)
    gets = _calls(component, outputs, memory, setting=False)
    do_step = (redoing_steps if component.can_redo else single_steps)(component, h)
    check = component.check

    def put() -> None:
        for function, arguments in sets:
            if (status := function(*arguments)) >= DISCARD:
                check("setting its inputs", status)

    def get() -> None:
        for function, arguments in gets:
            if (status := function(*arguments)) >= DISCARD:
                check("getting its outputs", status)

    def step(t: float) -> None:
        do_step(t)
        for function, arguments in gets:
            if (status := function(*arguments)) >= DISCARD:
                check("getting its outputs", status)

    return Access(put, get, step)


def _calls(component: Component, ports: Sequence[Port], memory: Memory, setting: bool) -> list[Call]:
    """Calls that set or get some variables of one FMU."""
    calls: list[Call] = []
    reals = [p for p in ports if p.variable.type == "Real"]
    if reals:
        address = memory.address + 8 * reals[0].slot
        what = "fmi2SetReal" if setting else "fmi2GetReal"
        calls.append(_vector_call(component, what, reals, address))
    for kind in _SETTERS:
        others = [p for p in ports if p.variable.type == kind]
        if others:
            calls.append((_buffered_call(component, kind, others, memory, setting), ()))
    return calls


def _vector_call(component: Component, what: str, ports: Sequence[Port], address: int) -> Call:
    """One vector get or set between an FMU and a memory."""
    references = (ctypes.c_uint * len(ports))(*[p.variable.reference for p in ports])
    return component.function(what), (
        ctypes.c_void_p.from_param(component.pointer),
        ctypes.byref(references),
        ctypes.c_size_t.from_param(len(ports)),
        ctypes.c_void_p.from_param(address),
    )


def _buffered_call(
    component: Component, kind: str, ports: Sequence[Port], memory: Memory, setting: bool
) -> Callable[[], int]:
    """The same for variables that are not Real: integers, converted on the way."""
    setter, getter, c_type = _SETTERS[kind]
    buffer = (c_type * len(ports))()
    slots = [p.slot for p in ports]
    values = memory.values
    what = setter if setting else getter
    function, arguments = _vector_call(component, what, ports, ctypes.addressof(buffer))

    def set_() -> int:
        for k, slot in enumerate(slots):
            if not abs(values[slot]) < INT_LIMIT:
                name = f"{component.name}.{ports[k].variable.name}"
                raise SimulationError(f"{name} = {values[slot]} is not a 32-bit number")
            buffer[k] = round(values[slot])
        return function(*arguments)

    def get() -> int:
        status = function(*arguments)
        for k, slot in enumerate(slots):
            values[slot] = float(buffer[k])
        return status

    return set_ if setting else get
