"""The loaded library of an FMU with one instance in it, which FMI calls a component.

FMPy loads the library and makes the calls of the life cycle. The calls of the step loop go to the
library directly, with buffers that are laid out once (:mod:`cosim.fmu.calls`,
:mod:`cosim.fmu.stepping`).
"""

import ctypes
import itertools
import os
import sys
import typing
from abc import ABC
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import ModuleType

import fmpy
from fmpy import fmi2
from fmpy.logging import addLoggerProxy

from ..errors import InputError, SimulationError
from ..process.run_state import STATE
from .fmu_model import PYTHON_SYMBOL, FmuModel
from .instance import OnMessage

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING, DISCARD, ERROR, FATAL, PENDING = 1, 2, 3, 4, 5  # of fmi2Status
OWN_TOOL = "cybership"  # generationTool of the FMUs of python -m fmus.build --native
SLAVE_MODULE = "resources/slavemodule.txt"  # of a Python FMU: the name of its module

# FMPy's logger proxy knows one logger for the whole process: this one finds the instance by its number.
_environments = itertools.count(1)
_listeners: dict[int, Callable[[int, str], None]] = {}


def _log(environment: int | None, _: bytes, status: int, category: bytes, message: bytes) -> None:
    listener = _listeners.get(environment or 0)
    if listener is not None:
        listener(status, message.decode(errors="replace") if message else "")


_LOGGER = fmi2.fmi2CallbackLoggerTYPE(_log)


def _callbacks(environment: int) -> fmi2.fmi2CallbackFunctions:
    """Callbacks for an instance; its messages carry its number."""
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = _LOGGER
    callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
    callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
    callbacks.componentEnvironment = environment
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


class _Nothing(ABC):  # noqa: B024 - the layout in memory must be that of pythonfmu's base class
    """Base class of the classes of Python FMUs that have been freed."""


def _hold(namespace: dict[str, object]) -> None:
    """Never free the namespace of a Python FMU's module.

    The library (pythonfmu 0.7.0) releases it once more often than it took it: some garbage collection
    would free it while it is in use, and end the process.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(namespace))


def _classes(module: ModuleType, folder: Path) -> list[type]:
    """The classes that the module of a Python FMU has defined, and their bases from its folder.

    Those that it has replaced are among them: its code runs twice.
    """
    named = [value for value in vars(module).values() if isinstance(value, type)]
    bases = {base for found in named for base in found.__bases__}
    defined = {
        found
        for base in bases - {object}
        for found in type.__subclasses__(base)
        if any(getattr(value, "__globals__", None) is vars(module) for value in vars(found).values())
    }
    files = {name: getattr(other, "__file__", None) or "" for name, other in sys.modules.items()}
    own = {
        base
        for found in defined
        for base in found.__mro__
        if files.get(base.__module__, "").startswith(str(folder))
    }
    return list(defined | own)


class FmuComponent:
    """An instantiated FMU as its library sees it.

    Args:
        name: instance name.
        model: what to run.
        on_message: receives the messages that the FMU logs; None: it logs errors only.

    Attributes:
        slave: FMPy's face of the library.
        pointer: the ``fmi2Component``.
        is_python: whether the library is pythonfmu's.
        can_redo: whether the FMU can be set back to redo a step with another length.
        saved_state: the ``fmi2FMUstate`` of the last save, if there was one.
        complaint: the last message of a warning or worse that the FMU logged.
        worst_status: the worst status that any call returned.
        on_message: as given; another one may take its place between runs.

    Raises:
        InputError: no binary for this platform, or instantiation refused.
    """

    def __init__(self, name: str, model: FmuModel, on_message: OnMessage | None) -> None:
        self.name = name
        self.model = model
        folder = model.unpack()
        cs = model.description.coSimulation
        assert cs is not None
        here = os.getcwd()
        STATE.calls(name, "its instantiation")
        try:
            self.slave = fmi2.FMU2Slave(
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

        # A Python FMU takes the interpreter's lock at every call; keeping it held saves that. Others may
        # work in threads of their own and must not find it held.
        self.is_python = hasattr(self.slave.dll, PYTHON_SYMBOL)
        if self.is_python and not (folder / SLAVE_MODULE).is_file():
            raise InputError(f"'{model.path}' is a Python FMU without its {SLAVE_MODULE}")
        # A Python FMU saves its state in many small pieces, and does not report how far it got; those of
        # this project's tool discard no step, so that there is no state to save before each.
        self.can_redo = bool(
            not self.is_python
            and model.description.generationTool != OWN_TOOL
            and cs.canGetAndSetFMUstate
            and cs.canHandleVariableCommunicationStepSize
        )
        self.saved_state = ctypes.c_void_p()
        self.complaint = ""
        self.worst_status = 0
        self.on_message = on_message

        def listen(status: int, text: str) -> None:
            text = " ".join(text.split())
            if status > 0:
                self.complaint = text
            if self.on_message is not None:
                self.on_message(name, status, text)

        self._modules: list[ModuleType] = []
        self._classes: list[type] = []
        self._environment = next(_environments)
        _listeners[self._environment] = listen
        self._callbacks = _callbacks(self._environment)
        self.pointer = self._instantiate(folder)
        STATE.calls_nothing()

    def _instantiate(self, folder: Path) -> int:
        resources = folder / "resources"
        # pythonfmu decodes no escapes but that of the space.
        uri = f"file://{str(resources).replace(' ', '%20')}" if self.is_python else resources.as_uri()
        # Modules of the same names that are loaded already would be taken for the FMU's own, or for
        # those of Python FMUs that it contains.
        own = {script.read_text().strip() for script in folder.rglob(Path(SLAVE_MODULE).name)}
        others = {name: sys.modules.pop(name) for name in own & sys.modules.keys()}
        pointer = self.slave.fmi2Instantiate(
            self.name.encode(),
            fmi2.fmi2CoSimulation,
            str(self.model.description.guid).encode(),
            uri.encode(),
            ctypes.byref(self._callbacks),
            fmi2.fmi2False,
            # Debug logging of some tools takes more time than their model. A Python FMU without it does
            # not report its exceptions either.
            fmi2.fmi2False if self.on_message is None and not self.is_python else fmi2.fmi2True,
        )
        self.slave.component = pointer
        if own:
            self._modules = [sys.modules[name] for name in own & sys.modules.keys()]
            for module in self._modules:
                _hold(vars(module))
            self._classes = [found for module in self._modules for found in _classes(module, folder)]
            if not self.model.alone:
                self.model.forget_modules()
        sys.modules.update(others)
        if not pointer:
            why = f": {self.complaint}" if self.complaint else ""
            why += _tool_hint(self.model, folder)
            raise InputError(f"'{self.model.path}' cannot be instantiated as '{self.name}'{why}")
        return int(pointer)

    def check(self, what: str, status: int, note: str = "") -> None:
        """End the run if a call returned more than a warning.

        Args:
            what: the call.
            status: what it returned.
            note: text to add to the message.

        Raises:
            SimulationError: names the instance, the call and the status, and the FMU's own message.
        """
        if status >= DISCARD:
            self.worst_status = max(self.worst_status, status)
            why = f": {self.complaint}" if self.complaint else ""
            raise SimulationError(f"{self.name}: {what} returned {STATUS[min(status, 5)]}{note}{why}")

    def address(self, name: str) -> int:
        """Address of an FMI function of the library."""
        try:
            address = ctypes.cast(getattr(self.slave.dll, name), ctypes.c_void_p).value
        except AttributeError:
            raise InputError(f"'{self.model.path}' does not export {name}") from None
        assert address is not None
        return address

    def function(self, name: str) -> Callable[..., int]:
        """An FMI function of the library; its arguments must be ctypes values."""
        kind = ctypes.PYFUNCTYPE if self.is_python else ctypes.CFUNCTYPE
        return kind(ctypes.c_int)(self.address(name))

    def free(self) -> None:
        """Free the instance and its library; after a fatal error no function of it may be called."""
        STATE.calls(self.name, "fmi2FreeInstance")
        if self.worst_status < FATAL:
            if self.saved_state:
                self.function("fmi2FreeFMUstate")(
                    ctypes.c_void_p(self.pointer), ctypes.byref(self.saved_state)
                )
            self.slave.fmi2FreeInstance(self.slave.component)
            self._empty_classes()
        _listeners.pop(self._environment, None)
        # The first pythonfmu library in a process cannot be unloaded. Without this call it would
        # finalise when the process exits, after its own memory is gone, and now and then abort the
        # process.
        finalize = getattr(self.slave.dll, PYTHON_SYMBOL, None)
        if self.is_python and finalize is not None:
            finalize()
        self.slave.freeLibrary()
        STATE.calls_nothing()

    def _empty_classes(self) -> None:
        """Release what the class of a freed Python FMU refers to: the modules that came with it."""
        if not self.is_python:
            return
        for found in self._classes:
            with suppress(TypeError):  # another layout in memory than that of pythonfmu's own
                found.__bases__ = (_Nothing,)
            for name in [name for name in vars(found) if name not in vars(_Nothing)]:
                with suppress(AttributeError, TypeError):
                    delattr(found, name)
        for module in self._modules:
            vars(module).clear()
        self._classes, self._modules = [], []
        # Python caches types such as Annotated[float, ...] with what the FMU's modules put into them.
        for clear in getattr(typing, "_cleanups", ()):
            clear()


def _tool_hint(model: FmuModel, folder: Path) -> str:
    """A possible reason why an FMU does not start; a Python FMU's tool is Python, which is there."""
    if not model.needs_tool or (folder / SLAVE_MODULE).is_file():
        return ""
    return "; it needs an installation of the tool that exported it"
