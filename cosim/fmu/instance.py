"""The interface of a running FMU: its calls, their order, its guarantees, and the memory of values."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from .fmu_model import FmuModel, FmuVariable, Value

# Receives (instance, status, text) of each message that an FMU logs; the status is that of FMI.
OnMessage = Callable[[str, int, str], None]


class DoubleMemory:
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

    variable: FmuVariable
    slot: int


class DirectTransfer(NamedTuple):
    """One vector get or set between an FMU and a memory, for a loop in C.

    Attributes:
        function: address of the FMI function.
        references: value references, an array of C.
        address: of the values that the function takes or gives.
        slots: places in the memory of the values of a buffer of integers; None for Reals, which need
            none.
    """

    function: int
    references: Any
    address: int
    slots: Sequence[int] | None


class DirectCalls(NamedTuple):
    """What a loop in C needs in order to make the calls of an FMU itself.

    Attributes:
        pointer: the ``fmi2Component``.
        is_python: whether the FMU takes the interpreter's lock at every call.
        do_step: address of fmi2DoStep.
        save: address of fmi2GetFMUstate if the state is to be saved before each step, else None.
        state: address of the ``fmi2FMUstate``.
        sets, gets: of its inputs and outputs, in their order.
        settle: see :class:`cosim.fmu.stepping.Steps`.
        check: ``check(what, status)`` ends the run if a call returned more than a warning.
        kept: what must live as long as these calls.
    """

    pointer: int
    is_python: bool
    do_step: int
    save: int | None
    state: int
    sets: Sequence[DirectTransfer]
    gets: Sequence[DirectTransfer]
    settle: Callable[[float, int, bool], None]
    check: Callable[[str, int], None]
    kept: Sequence[Any]


class Access(NamedTuple):
    """The calls of an FMU in the step loop; a refused call raises SimulationError.

    Attributes:
        put: ``put()`` copies the inputs from the memory to the FMU.
        get: ``get()`` copies the outputs from the FMU to the memory.
        step: ``step(t)`` steps from t [s] and gets the outputs.
        begin: ``begin(t)`` starts a step from t [s] that runs beside those of other FMUs, and
            ``step(t)`` waits for its end; None if the FMU cannot.
        direct: the same calls for a loop in C; None for an FMU in a process of its own.
    """

    put: Callable[[], None]
    get: Callable[[], None]
    step: Callable[[float], None]
    begin: Callable[[float], None] | None = None
    direct: DirectCalls | None = None


class Instance(Protocol):
    """A running FMU, in this process or in one of its own.

    Call order (the state machine of FMI 2.0.4, 4.2.4, for co-simulation):

    1. The constructor instantiates the FMU.
    2. :meth:`bind`, once, before the first exchange of values.
    3. :meth:`set_up`, once; then :meth:`set_value` of start values.
    4. :meth:`enter_initialization`. From here on :meth:`get_value`, and ``put`` and ``get`` of the
       :class:`Access`, as often as wanted.
    5. :meth:`exit_initialization`.
    6. Each step: ``put``, then ``step``; or ``put`` and ``begin`` of several instances, then ``step`` of
       each. Between steps, :meth:`set_value` of tunable parameters and :meth:`get_value`.
    7. :meth:`terminate`, unless initialisation failed.
    8. :meth:`free`, once, whatever happened before.

    Guarantees:

    - A call returns when the FMU has done it; only ``begin`` returns before.
    - A call that the FMU refuses, or that its process does not survive, raises SimulationError, whose
      message names the instance and the call. Then only :meth:`terminate` and :meth:`free` may follow.
    - An FMU that cannot be instantiated raises InputError, in the constructor or the next call.
    - Where the FMU runs changes no value, to the bit.
    - Log messages of the FMU reach ``on_message`` of the constructor, those of a call before it returns.
    """

    @property
    def name(self) -> str:
        """Name of the instance."""
        ...

    @property
    def model(self) -> FmuModel:
        """The FMU that runs."""
        ...

    def bind(
        self, inputs: Sequence[Port], outputs: Sequence[Port], memory: DoubleMemory, h: float
    ) -> Access:
        """The calls of the step loop, bound to a memory.

        Args:
            inputs, outputs: variables to put and to get; the Reals of each are adjacent in the memory,
                and for an isolated instance all ports of each.
            memory: where the values are.
            h: length of a step [s].
        """
        ...

    def set_up(self, stop: float) -> None:
        """Announce an experiment from 0 to ``stop`` [s], with the tolerance that the FMU suggests."""
        ...

    def set_value(self, variable: FmuVariable, value: Value) -> None:
        """Set one variable, outside of the step loop."""
        ...

    def get_value(self, variable: FmuVariable) -> float:
        """Value of one numeric variable, outside of the step loop."""
        ...

    def enter_initialization(self) -> None:
        """Enter initialisation mode, in which outputs follow inputs without a step."""
        ...

    def exit_initialization(self) -> None:
        """Leave initialisation mode; steps may follow."""
        ...

    def terminate(self) -> None:
        """End the simulation, unless an error already has."""
        ...

    def free(self) -> None:
        """Release the instance and what belongs to it; nothing may be called afterwards."""
        ...
