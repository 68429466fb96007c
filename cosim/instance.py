"""An FMU that runs.

FMPy loads the library and makes the calls of the life cycle. The calls made once a step go to the
library directly, with buffers that are laid out once.
"""

import ctypes
import itertools
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import fmpy
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.logging import addLoggerProxy

from . import access, stepping
from .access import DISCARD, ERROR, FATAL, Access, Memory, Port
from .errors import InputError, SimulationError
from .fmu import Model, Variable

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
SLAVE_MODULE = "resources/slavemodule.txt"  # of a Python FMU: which module it is

# FMPy's logger proxy knows one logger for the whole process: ours finds the instance by its number.
_environments = itertools.count(1)
_listeners: dict[int, Callable[[int, str], None]] = {}


def _log(environment: int | None, _: bytes, status: int, category: bytes, message: bytes) -> None:
    listener = _listeners.get(environment or 0)
    if listener is not None:
        listener(status, message.decode(errors="replace") if message else "")


_LOGGER = fmi2.fmi2CallbackLoggerTYPE(_log)


def _callbacks(environment: int) -> fmi2.fmi2CallbackFunctions:
    """Callbacks for an instance; messages come back with its number."""
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = _LOGGER
    callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
    callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
    callbacks.componentEnvironment = environment
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


# The modules with the classes of Python FMUs. Their library (pythonfmu 0.7.0) never lets go of a class,
# but of its module's dictionary, once more often than it took it: were the module freed, the class
# would point to nothing, and some garbage collection would end the process.
_kept: list[ModuleType] = []


class Instance:
    """A running FMU.

    Args:
        name: instance name.
        model: what to run.
        on_message: receives (instance, status, text) of each message that the FMU logs.

    Raises:
        InputError: no binary for this platform, or instantiation refused.
    """

    def __init__(self, name: str, model: Model, on_message: Callable[[str, int, str], None]) -> None:
        self.name = name
        self.model = model
        folder = model.unpack()
        cs = model.description.coSimulation
        assert cs is not None
        here = os.getcwd()
        try:
            self._fmu = fmi2.FMU2Slave(
                instanceName=name,
                guid=model.description.guid,
                modelIdentifier=cs.modelIdentifier,
                unzipDirectory=str(folder),
            )
        except Exception as error:
            os.chdir(here)
            there = sorted(path.name for path in (folder / "binaries").glob("*"))
            why = f"{error}" if fmpy.platform in there else f"it has {', '.join(there) or 'no binaries'}"
            why += _tool_hint(model, folder)
            raise InputError(f"'{model.path}' cannot be loaded on {fmpy.platform}: {why}") from error

        # A Python FMU takes the interpreter's lock at every call; keeping it held saves that. Others
        # may work in threads of their own and must not find it held.
        self.is_python = hasattr(self._fmu.dll, "finalizePythonInterpreter")
        if self.is_python and not (folder / SLAVE_MODULE).is_file():
            raise InputError(f"'{model.path}' is a Python FMU without its {SLAVE_MODULE}")
        # A Python FMU saves its state in many small pieces, and does not tell how far it got.
        self.can_redo = bool(
            not self.is_python and cs.canGetAndSetFMUstate and cs.canHandleVariableCommunicationStepSize
        )
        self.saved_state = ctypes.c_void_p()
        self.complaint = ""
        self.worst_status = 0

        def listen(status: int, text: str) -> None:
            text = " ".join(text.split())
            if status > 0:
                self.complaint = text
            on_message(name, status, text)

        self._environment = next(_environments)
        _listeners[self._environment] = listen
        self._callbacks = _callbacks(self._environment)
        self.component = self._instantiate(folder)

    def _instantiate(self, folder: Path) -> int:
        resources = folder / "resources"
        # pythonfmu undoes no escapes but that of the space.
        uri = f"file://{str(resources).replace(' ', '%20')}" if self.is_python else resources.as_uri()
        # Modules of the same names that are there already would be taken for the FMU's own, or for those
        # of Python FMUs that it contains.
        own = {script.read_text().strip() for script in folder.rglob(Path(SLAVE_MODULE).name)}
        others = {name: sys.modules.pop(name) for name in own & sys.modules.keys()}
        component = self._fmu.fmi2Instantiate(
            self.name.encode(),
            fmi2.fmi2CoSimulation,
            str(self.model.description.guid).encode(),
            uri.encode(),
            ctypes.byref(self._callbacks),
            fmi2.fmi2False,
            fmi2.fmi2True,
        )
        self._fmu.component = component
        if own:
            _kept.extend(sys.modules[name] for name in own & sys.modules.keys())
            self.model.forget_modules()
        sys.modules.update(others)
        if not component:
            why = f": {self.complaint}" if self.complaint else ""
            why += _tool_hint(self.model, folder)
            raise InputError(f"'{self.model.path}' cannot be instantiated as '{self.name}'{why}")
        return int(component)

    def check(self, what: str, status: int, note: str = "") -> None:
        """End the run if a call returned more than a warning.

        Args:
            what: the call.
            status: what it returned.
            note: text to add to the message.

        Raises:
            SimulationError: names the instance, the call and the status, and what the FMU said of it.
        """
        if status >= DISCARD:
            self.worst_status = max(self.worst_status, status)
            why = f": {self.complaint}" if self.complaint else ""
            raise SimulationError(f"{self.name}: {what} returned {STATUS[min(status, 5)]}{note}{why}")

    def function(self, name: str) -> Callable[..., int]:
        """An FMI function of the library; its arguments must be ctypes values."""
        kind = ctypes.PYFUNCTYPE if self.is_python else ctypes.CFUNCTYPE
        try:
            address = ctypes.cast(getattr(self._fmu.dll, name), ctypes.c_void_p).value
        except AttributeError:
            raise InputError(f"'{self.model.path}' does not export {name}") from None
        assert address is not None
        return kind(ctypes.c_int)(address)

    def stepping(self, h: float) -> Callable[[float], None]:
        """A function of t [s] that steps from t to t + h."""
        return (stepping.redoing if self.can_redo else stepping.plain)(self, h)

    def bind(self, inputs: Sequence[Port], outputs: Sequence[Port], memory: Memory, h: float) -> Access:
        """What the loop calls, see :func:`cosim.access.bind`."""
        return access.bind(self, inputs, outputs, memory, h)

    def call(self, what: str, action: Callable[[], Any]) -> None:
        """Run a step of the life cycle; an FMU that refuses it ends the run."""
        try:
            action()
        except Exception as error:
            status = error.status if isinstance(error, FMICallException) else ERROR
            self.worst_status = max(self.worst_status, status)
            raise SimulationError(
                f"{self.name} ({self.model.path.name}): {what} failed: {error}"
            ) from error

    def set_value(self, variable: Variable, value: float | int | bool | str) -> None:
        """Set one variable, outside the step loop."""

        def action() -> None:
            references = [variable.reference]
            if variable.type == "Real":
                self._fmu.setReal(references, [float(value)])
            elif variable.type == "Boolean":
                self._fmu.setBoolean(references, [bool(value)])
            elif variable.type == "String":
                self._fmu.setString(references, [str(value)])
            else:
                self._fmu.setInteger(references, [int(value)])

        self.call(f"setting {variable.name} = {value}", action)

    def get_value(self, variable: Variable) -> float:
        """One numeric variable, outside the step loop."""
        references = [variable.reference]
        values: list[float] = []

        def action() -> None:
            if variable.type == "Real":
                values.extend(self._fmu.getReal(references))
            elif variable.type == "Boolean":
                values.extend(self._fmu.getBoolean(references))
            else:
                values.extend(self._fmu.getInteger(references))

        self.call(f"getting {variable.name}", action)
        return float(values[0])

    def set_up(self, stop: float) -> None:
        """Announce the experiment, from 0 to stop [s], with the tolerance that the FMU suggests."""
        suggested = self.model.description.defaultExperiment
        tolerance = None if suggested is None else suggested.tolerance
        self.call(
            "fmi2SetupExperiment",
            lambda: self._fmu.setupExperiment(
                tolerance=None if tolerance is None else float(tolerance), startTime=0.0, stopTime=stop
            ),
        )

    def enter_initialization(self) -> None:
        self.call("fmi2EnterInitializationMode", self._fmu.enterInitializationMode)

    def exit_initialization(self) -> None:
        self.call("fmi2ExitInitializationMode", self._fmu.exitInitializationMode)

    def terminate(self) -> None:
        """End the simulation, unless an error already has."""
        if self.worst_status < ERROR:
            self.call("fmi2Terminate", self._fmu.terminate)

    def free(self) -> None:
        """Free the instance and its library; after a fatal error nothing of it may be called."""
        if self.worst_status < FATAL:
            if self.saved_state:
                self.function("fmi2FreeFMUstate")(
                    ctypes.c_void_p(self.component), ctypes.byref(self.saved_state)
                )
            self._fmu.fmi2FreeInstance(self._fmu.component)
        _listeners.pop(self._environment, None)
        # The first pythonfmu library in a process cannot be unloaded. Left alone it would do this when
        # the process ends, after its own memory is gone, and now and then abort the process.
        finalize = getattr(self._fmu.dll, "finalizePythonInterpreter", None)
        if self.is_python and finalize is not None:
            finalize()
        self._fmu.freeLibrary()


def _tool_hint(model: Model, folder: Path) -> str:
    """What may be the reason why an FMU does not start; a Python FMU's tool is there, it is Python."""
    cs = model.description.coSimulation
    if cs is None or not cs.needsExecutionTool or (folder / SLAVE_MODULE).is_file():
        return ""
    return "; it needs the tool that it was made with to be installed"
