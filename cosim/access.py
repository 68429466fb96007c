"""The calls that one FMU gets in a step, bound once and for all to a memory of doubles.

Reals pass directly between the FMU and the memory, in one call; other types through small buffers.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from .errors import SimulationError

if TYPE_CHECKING:
    from .fmu import Variable
    from .instance import Instance

WARNING, DISCARD, ERROR, FATAL, PENDING = 1, 2, 3, 4, 5
INT_LIMIT = 2**31

_SETTERS = {
    "Integer": ("fmi2SetInteger", "fmi2GetInteger", ctypes.c_int),
    "Enumeration": ("fmi2SetInteger", "fmi2GetInteger", ctypes.c_int),
    "Boolean": ("fmi2SetBoolean", "fmi2GetBoolean", ctypes.c_int),
}

# A function and its arguments, converted for C once and for all; returns an FMI status.
Call = tuple[Callable[..., int], tuple[Any, ...]]


class Memory:
    """Doubles that FMUs read and write.

    Args:
        count: how many.
    """

    def __init__(self, count: int) -> None:
        self._memory = (ctypes.c_double * max(1, count))()
        self.address = ctypes.addressof(self._memory)
        self.octets = memoryview(self._memory).cast("B")
        self.values = self.octets.cast("d")


@dataclass(frozen=True)
class Port:
    """A variable and its place in a memory."""

    variable: Variable
    slot: int


class Access(NamedTuple):
    """What an FMU does in the loop; a refused call raises SimulationError.

    Attributes:
        put: ``put()`` brings the inputs from the memory to the FMU.
        get: ``get()`` brings the outputs from the FMU to the memory.
        step: ``step(t)`` steps from t and gets the outputs.
        begin: ``begin(t)`` lets a step from t begin while others do theirs, ``step(t)`` awaits its end;
            None if the FMU cannot do so.
    """

    put: Callable[[], None]
    get: Callable[[], None]
    step: Callable[[float], None]
    begin: Callable[[float], None] | None = None


def bind(
    instance: Instance, inputs: Sequence[Port], outputs: Sequence[Port], memory: Memory, h: float
) -> Access:
    """Access to an FMU in this process.

    Args:
        instance: whose variables.
        inputs, outputs: what to put and get; the Reals of each stand side by side in the memory.
        memory: where the values are.
        h: length of its steps [s].
    """
    # These run every step and keep what they need in their own scope, where Python finds it fastest.
    sets = _calls(instance, inputs, memory, setting=True)
    gets = _calls(instance, outputs, memory, setting=False)
    do_step = instance.stepping(h)

    def put() -> None:
        for function, arguments in sets:
            if (status := function(*arguments)) >= DISCARD:
                instance.check("setting its inputs", status)

    def get() -> None:
        for function, arguments in gets:
            if (status := function(*arguments)) >= DISCARD:
                instance.check("getting its outputs", status)

    def step(t: float) -> None:
        do_step(t)
        for function, arguments in gets:
            if (status := function(*arguments)) >= DISCARD:
                instance.check("getting its outputs", status)

    return Access(put, get, step)


def _calls(instance: Instance, ports: Sequence[Port], memory: Memory, setting: bool) -> list[Call]:
    """Calls that set or get some variables of one FMU."""
    calls: list[Call] = []
    reals = [p for p in ports if p.variable.type == "Real"]
    if reals:
        address = memory.address + 8 * reals[0].slot
        calls.append(_vector_call(instance, "fmi2SetReal" if setting else "fmi2GetReal", reals, address))
    for kind in _SETTERS:
        others = [p for p in ports if p.variable.type == kind]
        if others:
            calls.append((_buffered_call(instance, kind, others, memory, setting), ()))
    return calls


def _vector_call(instance: Instance, what: str, ports: Sequence[Port], address: int) -> Call:
    """One vector get or set between an FMU and a memory."""
    references = (ctypes.c_uint * len(ports))(*[p.variable.reference for p in ports])
    return instance.function(what), (
        ctypes.c_void_p.from_param(instance.component),
        ctypes.byref(references),
        ctypes.c_size_t.from_param(len(ports)),
        ctypes.c_void_p.from_param(address),
    )


def _buffered_call(
    instance: Instance, kind: str, ports: Sequence[Port], memory: Memory, setting: bool
) -> Callable[[], int]:
    """The same for variables that are not Real: whole numbers, converted on the way."""
    setter, getter, c_type = _SETTERS[kind]
    buffer = (c_type * len(ports))()
    slots = [p.slot for p in ports]
    values = memory.values
    what = setter if setting else getter
    function, arguments = _vector_call(instance, what, ports, ctypes.addressof(buffer))

    def set_() -> int:
        for k, slot in enumerate(slots):
            if not abs(values[slot]) < INT_LIMIT:
                name = f"{instance.name}.{ports[k].variable.name}"
                raise SimulationError(f"{name} = {values[slot]} is not a 32-bit number")
            buffer[k] = round(values[slot])
        return function(*arguments)

    def get() -> int:
        status = function(*arguments)
        for k, slot in enumerate(slots):
            values[slot] = float(buffer[k])
        return status

    return set_ if setting else get
