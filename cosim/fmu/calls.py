"""The calls of one FMU in a step, with their arguments converted once and bound to a memory of doubles.

Reals pass directly between the FMU and the memory, in one call; other types through small buffers.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence

from ..errors import SimulationError
from .component import DISCARD, FmuComponent
from .fmu_model import INT_LIMIT
from .instance import Access, DirectCalls, DirectTransfer, DoubleMemory, Port
from .stepping import redoing_steps, single_steps

_SETTERS = {
    "Real": ("fmi2SetReal", "fmi2GetReal", ctypes.c_double),
    "Integer": ("fmi2SetInteger", "fmi2GetInteger", ctypes.c_int),
    "Enumeration": ("fmi2SetInteger", "fmi2GetInteger", ctypes.c_int),
    "Boolean": ("fmi2SetBoolean", "fmi2GetBoolean", ctypes.c_int),
}

# A function and its arguments, converted for C once; returns an FMI status.
Call = tuple[Callable[..., int], tuple[object, ...]]


class Transfer:
    """One vector get or set between an FMU and a memory.

    Args:
        component: the FMU.
        kind: type of the variables.
        ports: the variables, all of this type, and their places; Reals are adjacent.
        memory: where the values are.
        setting: whether to set.

    Attributes:
        direct: the same for a loop in C.
        call: makes it; returns an FMI status.
    """

    def __init__(
        self,
        component: FmuComponent,
        kind: str,
        ports: Sequence[Port],
        memory: DoubleMemory,
        setting: bool,
    ) -> None:
        what, c_type = _SETTERS[kind][not setting], _SETTERS[kind][2]
        self._component, self._ports, self._values = component, ports, memory.values
        references = (ctypes.c_uint * len(ports))(*[p.variable.reference for p in ports])
        is_real = kind == "Real"
        self._buffer = None if is_real else (c_type * len(ports))()
        address = (
            memory.address + 8 * ports[0].slot
            if self._buffer is None
            else ctypes.addressof(self._buffer)
        )
        slots = None if is_real else [p.slot for p in ports]
        self.direct = DirectTransfer(component.address(what), references, address, slots)
        self._function = component.function(what)
        self._arguments = (
            ctypes.c_void_p.from_param(component.pointer),
            ctypes.byref(references),
            ctypes.c_size_t.from_param(len(ports)),
            ctypes.c_void_p.from_param(address),
        )
        buffered = self._set_buffered if setting else self._get_buffered
        self.call: Call = (self._function, self._arguments) if is_real else (buffered, ())

    # Integers are converted on the way.

    def _set_buffered(self) -> int:
        assert self._buffer is not None
        for k, port in enumerate(self._ports):
            value = self._values[port.slot]
            if not -INT_LIMIT - 0.5 <= value < INT_LIMIT - 0.5:  # rounding is to even
                name = f"{self._component.name}.{port.variable.name}"
                raise SimulationError(f"{name} = {value} is not a 32-bit number")
            self._buffer[k] = round(value)
        return self._function(*self._arguments)

    def _get_buffered(self) -> int:
        assert self._buffer is not None
        status = self._function(*self._arguments)
        for k, port in enumerate(self._ports):
            self._values[port.slot] = float(self._buffer[k])
        return status


def bind(
    component: FmuComponent,
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    memory: DoubleMemory,
    h: float,
) -> Access:
    """Access to an FMU in this process.

    Args:
        component: the FMU.
        inputs, outputs: what to put and get; the Reals of each are adjacent in the memory.
        memory: where the values are.
        h: length of its steps [s].
    """
    set_transfers = _transfers(component, inputs, memory, setting=True)
    get_transfers = _transfers(component, outputs, memory, setting=False)
    steps = (redoing_steps if component.can_redo else single_steps)(component, h)
    # These run every step and keep what they need in their own scope, where Python finds it fastest.
    sets = [transfer.call for transfer in set_transfers]
    gets = [transfer.call for transfer in get_transfers]
    do_step, check = steps.step, component.check

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

    direct = DirectCalls(
        component.pointer,
        component.is_python,
        component.address("fmi2DoStep"),
        component.address("fmi2GetFMUstate") if steps.saves else None,
        ctypes.addressof(component.saved_state),
        [transfer.direct for transfer in set_transfers],
        [transfer.direct for transfer in get_transfers],
        steps.settle,
        check,
        [component, *set_transfers, *get_transfers],
    )
    return Access(put, get, step, direct=direct)


def _transfers(
    component: FmuComponent, ports: Sequence[Port], memory: DoubleMemory, setting: bool
) -> list[Transfer]:
    """What sets or gets some variables of one FMU: a call for each type."""
    of_kind = {kind: [p for p in ports if p.variable.type == kind] for kind in _SETTERS}
    return [Transfer(component, kind, some, memory, setting) for kind, some in of_kind.items() if some]
