"""The interface of a running FMU: its calls, their order, and its guarantees."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

from .fmu_model import Model, Value, Variable
from .memory import Memory, Port

if TYPE_CHECKING:
    from .calls import DirectCalls

# Receives (instance, status, text) of each message that an FMU logs; the status is that of FMI.
OnMessage = Callable[[str, int, str], None]


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
    def model(self) -> Model:
        """The FMU that runs."""
        ...

    def bind(self, inputs: Sequence[Port], outputs: Sequence[Port], memory: Memory, h: float) -> Access:
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

    def set_value(self, variable: Variable, value: Value) -> None:
        """Set one variable, outside of the step loop."""
        ...

    def get_value(self, variable: Variable) -> float:
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
