"""An FMU that runs in this process."""

from collections.abc import Callable, Mapping, Sequence

from fmpy.fmi1 import FMICallException

from ..errors import SimulationError
from ..process.run_state import STATE
from . import calls
from .component import ERROR, FmuComponent
from .fmu_model import FmuModel, FmuVariable, Value
from .instance import Access, DoubleMemory, OnMessage, Port

# Type of a variable, as FMPy calls it -> what makes a value of it; an Enumeration is an Integer.
KINDS: Mapping[str, type] = {"Real": float, "Integer": int, "Boolean": bool, "String": str}


class LocalInstance:
    """A running FMU in this process; see :class:`cosim.fmu.instance.Instance` for its calls.

    Args:
        name: instance name.
        model: what to run.
        on_message: receives the messages that the FMU logs; None: it logs errors only.

    Raises:
        InputError: no binary for this platform, or instantiation refused.
    """

    def __init__(self, name: str, model: FmuModel, on_message: OnMessage | None) -> None:
        self.name = name
        self.model = model
        self.component = FmuComponent(name, model, on_message)
        self._slave = self.component.slave

    def bind(
        self, inputs: Sequence[Port], outputs: Sequence[Port], memory: DoubleMemory, h: float
    ) -> Access:
        return calls.bind(self.component, inputs, outputs, memory, h)

    def _call(self, what: str, action: Callable[[], object]) -> None:
        """Make a call of the life cycle; an FMU that refuses it ends the run."""
        component = self.component
        component.complaint = ""
        STATE.calls(self.name, what)
        try:
            action()
            STATE.calls_nothing()
        except Exception as error:
            status = error.status if isinstance(error, FMICallException) else ERROR
            component.worst_status = max(component.worst_status, status)
            why = f": {component.complaint}" if component.complaint else ""
            raise SimulationError(
                f"{self.name} ({self.model.path.name}): {what} failed: {error}{why}"
            ) from error

    def set_up(self, stop: float) -> None:
        suggested = self.model.description.defaultExperiment
        tolerance = None if suggested is None else suggested.tolerance
        self._call(
            "fmi2SetupExperiment",
            lambda: self._slave.setupExperiment(
                tolerance=None if tolerance is None else float(tolerance), startTime=0.0, stopTime=stop
            ),
        )

    def set_value(self, variable: FmuVariable, value: Value) -> None:
        kind = variable.type if variable.type in KINDS else "Integer"
        put = getattr(self._slave, f"set{kind}")
        self._call(
            f"setting {variable.name} = {value}", lambda: put([variable.reference], [KINDS[kind](value)])
        )

    def get_value(self, variable: FmuVariable) -> float:
        values: list[float] = []
        get = getattr(self._slave, f"get{variable.type if variable.type in KINDS else 'Integer'}")
        self._call(f"getting {variable.name}", lambda: values.extend(get([variable.reference])))
        return float(values[0])

    def directional_derivative(self, unknown: Sequence[int], known: int) -> list[float]:
        """Partial derivatives of variables by one, all by reference (fmi2GetDirectionalDerivative)."""
        found: list[float] = []
        self._call(
            "fmi2GetDirectionalDerivative",
            lambda: found.extend(self._slave.getDirectionalDerivative(unknown, [known], [1.0])),
        )
        return found

    def enter_initialization(self) -> None:
        self._call("fmi2EnterInitializationMode", self._slave.enterInitializationMode)

    def exit_initialization(self) -> None:
        self._call("fmi2ExitInitializationMode", self._slave.exitInitializationMode)

    def terminate(self) -> None:
        if self.component.worst_status < ERROR:
            self._call("fmi2Terminate", self._slave.terminate)

    def reset(self, on_message: OnMessage | None) -> None:
        """Return to the state after instantiation, for another run (fmi2Reset).

        Args:
            on_message: receives the messages of the next run.

        Raises:
            SimulationError: the FMU refuses.
        """
        self.component.on_message = on_message
        self._call("fmi2Reset", self._slave.reset)

    @property
    def sound(self) -> bool:
        """Whether no call has been refused so far."""
        return self.component.worst_status < ERROR

    def free(self) -> None:
        self.component.free()
