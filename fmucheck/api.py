"""The C functions of an FMI 2.0 co-simulation FMU, called so that a crash can be distinguished.

ctypes rather than FMPy's classes: every rule that runs the FMU starts a process of its own, which must
be quick; and each call is noted before it is made, so that a crash or an endless loop has a name.
"""

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from ctypes import byref, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from time import sleep
from typing import Any

from .description import DescribedVariable
from .registry import NotApplicableError

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
CO_SIMULATION = 1
DO_STEP_STATUS = 0  # what fmi2GetStatus is asked for

_SETTING = ("Real", "Integer", "Boolean", "String")
# What may be discarded (2.1.3, 4.2.2): a value that the FMU cannot take, a step that it cannot do.
_DISCARDING = ("fmi2DoStep", *(f"fmi2Set{kind}" for kind in _SETTING))
_STATE = ("Get", "Set", "Free", "Serialize", "DeSerialize")
# All that 2.1 and 4.2 define; an FMU that lacks an ability still exports its functions.
FUNCTIONS = (
    *(f"fmi2{name}" for name in ("GetTypesPlatform", "GetVersion", "SetDebugLogging")),
    *(f"fmi2{name}" for name in ("Instantiate", "FreeInstance", "SetupExperiment")),
    *(f"fmi2{name}" for name in ("EnterInitializationMode", "ExitInitializationMode")),
    *(f"fmi2{name}" for name in ("Terminate", "Reset")),
    *(f"fmi2{verb}{kind}" for verb in ("Get", "Set") for kind in _SETTING),
    *(f"fmi2{verb}FMUstate" for verb in _STATE),
    "fmi2SerializedFMUstateSize",
    "fmi2GetDirectionalDerivative",
    *(f"fmi2{name}" for name in ("SetRealInputDerivatives", "GetRealOutputDerivatives")),
    *(f"fmi2{name}" for name in ("DoStep", "CancelStep", "GetStatus")),
    *(f"fmi2Get{kind}Status" for kind in _SETTING),
)

_Logger = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _Logger),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    )


_KEPT: list[_Callbacks] = []  # a thread of an FMU may call back as long as the process lives


class StatusError(Exception):
    """A call returned more than a warning, and not what it may discard."""

    def __init__(self, function: str, status: int, said: str) -> None:
        self.status = status
        why = f": {said}" if said else ""
        super().__init__(f"{function} returned {STATUS[min(status, 5)]}{why}")


class Library:
    """The loaded library of an FMU.

    Args:
        path: the shared library.
        note: receives the name of each function before it is called.
    """

    def __init__(self, path: Path, note: Callable[[str], None]) -> None:
        self.note = note
        note("loading of the library")
        here = os.getcwd()
        os.chdir(path.parent)  # where some libraries look for what they need
        try:
            self.dll = ctypes.CDLL(str(path))
        finally:
            os.chdir(here)
        self.missing = [name for name in FUNCTIONS if not hasattr(self.dll, name)]

    def function(self, name: str, result: Any = c_int) -> Callable[..., Any]:
        """A function by name, noted at each call."""
        call = getattr(self.dll, name, None)
        if call is None:
            raise StatusError(name, ERROR, "the library does not export it")
        call.restype = result

        def noted(*arguments: Any) -> Any:
            self.note(name)
            return call(*arguments)

        return noted


_C_TYPES = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}


class InstanceOnTrial:
    """An instance; a method is an FMI function.

    It raises :class:`StatusError` on more than a warning, but NotApplicableError where the FMU may
    discard what it is asked for: nothing can be said then.

    Args:
        library: what to instantiate.
        name: of the instance.
        guid: of the description.
        resources: URI of the folder of resources.
        asynchronous: whether a step may go on after fmi2DoStep has returned.
    """

    def __init__(
        self, library: Library, name: str, guid: str, resources: str, asynchronous: bool = False
    ) -> None:
        self.library = library
        self.asynchronous = asynchronous
        self.messages: list[tuple[int, str, str]] = []
        libc = ctypes.CDLL("msvcrt") if sys.platform == "win32" else ctypes.CDLL(None)
        callbacks = _Callbacks(
            _Logger(self._listen),
            ctypes.cast(libc.calloc, c_void_p),
            ctypes.cast(libc.free, c_void_p),
            None,
            None,
        )
        _KEPT.append(callbacks)
        instantiate = library.function("fmi2Instantiate", c_void_p)
        component = instantiate(
            name.encode(), CO_SIMULATION, guid.encode(), resources.encode(), byref(callbacks), 0, 1
        )
        if not component:
            raise StatusError("fmi2Instantiate", ERROR, self._said() or "no instance")
        self.component = c_void_p(component)

    def _listen(self, _: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        if len(self.messages) < 1000:
            words = " ".join((text or b"").decode(errors="replace").split())
            self.messages.append((status, (category or b"").decode(errors="replace"), words))

    def _said(self) -> str:
        return next((text for status, _, text in reversed(self.messages) if status > OK), "")

    def call(self, name: str, *arguments: Any) -> int:
        """Call a function of this instance; returns ok or warning."""
        return self._judge(name, self.library.function(name)(self.component, *arguments))

    def _judge(self, name: str, status: int) -> int:
        if status > WARNING:
            refused = StatusError(name, status, self._said())
            if status == DISCARD and name in _DISCARDING:
                raise NotApplicableError(str(refused))
            raise refused
        return status

    def set_up(self, start: float) -> None:
        self.call("fmi2SetupExperiment", 0, c_double(0.0), c_double(start), 0, c_double(0.0))

    def enter(self) -> None:
        self.call("fmi2EnterInitializationMode")

    def exit(self) -> None:
        self.call("fmi2ExitInitializationMode")

    def step(self, time: float, size: float) -> None:
        do_step = self.library.function("fmi2DoStep")
        status = do_step(self.component, c_double(time), c_double(size), 0)
        while status == PENDING and self.asynchronous:
            sleep(0.001)
            stated = c_int()
            self.call("fmi2GetStatus", DO_STEP_STATUS, byref(stated))
            status = stated.value
        self._judge("fmi2DoStep", status)

    def terminate(self) -> None:
        self.call("fmi2Terminate")

    def reset(self) -> None:
        self.call("fmi2Reset")

    def free(self) -> None:
        self.library.function("fmi2FreeInstance", None)(self.component)

    def debug(self, categories: Sequence[str]) -> None:
        """Ask for messages of some categories."""
        texts = (c_char_p * len(categories))(*(c.encode() for c in categories))
        self.call("fmi2SetDebugLogging", 1, c_size_t(len(categories)), texts)

    def get(self, variables: Sequence[DescribedVariable]) -> list[Any]:
        """Values in the order of the variables; strings as bytes."""
        found: dict[int, Any] = {}
        for kind, group in _by_kind(variables):
            values = (_C_TYPES[kind] * len(group))()
            self.call(f"fmi2Get{kind}", _references(group), c_size_t(len(group)), values)
            found.update(zip((v.index for v in group), values, strict=True))
        return [found[v.index] for v in variables]

    def set(self, values: dict[DescribedVariable, Any]) -> None:
        """Set variables, one call for each type."""
        for kind, group in _by_kind(list(values)):
            array = (_C_TYPES[kind] * len(group))(*(values[v] for v in group))
            self.call(f"fmi2Set{kind}", _references(group), c_size_t(len(group)), array)

    def state(self) -> c_void_p:
        """A copy of the whole state."""
        state = c_void_p()
        self.call("fmi2GetFMUstate", byref(state))
        return state

    def restore(self, state: c_void_p) -> None:
        self.call("fmi2SetFMUstate", state)

    def release(self, state: c_void_p) -> None:
        self.call("fmi2FreeFMUstate", byref(state))

    def serialize(self, state: c_void_p) -> bytes:
        """A state as bytes."""
        size = c_size_t()
        self.call("fmi2SerializedFMUstateSize", state, byref(size))
        data = (c_char * size.value)()
        self.call("fmi2SerializeFMUstate", state, data, size)
        return data.raw

    def deserialize(self, data: bytes) -> c_void_p:
        """A state from bytes."""
        state = c_void_p()
        buffer = (c_char * len(data)).from_buffer_copy(data)
        self.call("fmi2DeSerializeFMUstate", buffer, c_size_t(len(data)), byref(state))
        return state


def _by_kind(variables: Sequence[DescribedVariable]) -> list[tuple[str, list[DescribedVariable]]]:
    """Variables by the type that the functions know; an Enumeration is an Integer there."""
    groups: dict[str, list[DescribedVariable]] = {}
    for v in variables:
        groups.setdefault("Integer" if v.type == "Enumeration" else v.type, []).append(v)
    return list(groups.items())


def _references(variables: Sequence[DescribedVariable]) -> Any:
    return (c_uint * len(variables))(*(v.reference for v in variables))
