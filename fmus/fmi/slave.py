"""The FMI face of a component: one class over pythonfmu that repairs what pythonfmu leaves out.

It keeps the values in one flat list in the order of the value references, so that getting and setting
costs no look-up, and holds nothing else but the component's state: resetting, rolling back and
serialising follow from that.
"""

import hashlib
import json
from itertools import pairwise
from math import inf, isfinite
from typing import Any, ClassVar
from xml.etree.ElementTree import Element

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from ..declare import Component, flatten, packer, rebuild, width

STATE_VERSION = 1  # of a serialised state


class InitialisationError(Exception):
    """No state follows from the start values."""


class StateError(Exception):
    """Bytes are no state of this FMU."""


class Slave(Fmi2Slave):
    """A component as an FMI 2.0 co-simulation slave.

    A subclass names the component and the hash of the code it was built from. Setting a value that is
    out of place (unknown reference, an output, a parameter fixed at initialisation, NaN for a
    parameter) is logged and changes nothing. A step that fails is logged with its cause, returns a
    status and leaves the state as it was.
    """

    component: ClassVar[Component]
    code_hash: ClassVar[str]
    code_version: ClassVar[str]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        c = self.component
        self.modelName = c.name
        self._names = [v.name for v in c.variables]
        self._values = [v.start for v in c.variables]
        self._fixed = {k for k, v in enumerate(c.variables) if v.fixed}
        bounds = (0, width(c.params), width(c.params) + width(c.inputs), len(self._values))
        self._slices = [slice(a, b) for a, b in pairwise(bounds)]
        self._all_inputs = list(range(bounds[1], bounds[2]))
        self._pack_params, self._pack_inputs = packer(c.params), packer(c.inputs)
        self._params: Any = None
        self._prepared: Any = None
        self._state: Any = None
        self._initialising = True
        self._stale = True
        self._failure = ""

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """The model description; only needed while the FMU is built."""
        from .model_description import guid_of, model_description

        return model_description(self.component, guid_of(self.code_hash), self.code_version)

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        if vrs == self._all_inputs and isfinite(sum(values)):
            self._values[self._slices[1]] = values  # what a master does in every step
        else:
            for vr, value in zip(vrs, values, strict=True):
                self._set(vr, value)
        if self._initialising:
            self._stale = True

    def _set(self, vr: int, value: float) -> None:
        inputs = self._slices[1]
        if inputs.start <= vr < inputs.stop:
            if self.component.hold_nonfinite and not isfinite(value):
                self._warn(f"input {self._names[vr]} is {value}; it keeps its last value")
            else:
                self._values[vr] = value
        elif 0 <= vr < inputs.start:
            self._set_parameter(vr, value)
        else:
            self._warn(f"value reference {vr} cannot be set")

    def _set_parameter(self, vr: int, value: float) -> None:
        if not isfinite(value):
            self._warn(f"parameter {self._names[vr]} cannot be {value}")
        elif vr in self._fixed and not self._initialising:
            self._warn(f"parameter {self._names[vr]} is fixed after initialisation")
        else:
            self._values[vr] = value
            self._params = None

    def get_real(self, vrs: list[int]) -> list[float]:
        if self._stale:
            self._initialise()
        values = self._values
        return [values[vr] for vr in vrs]

    def _warn(self, message: str) -> None:
        self.log(message, Fmi2Status.warning)

    def _arguments(self) -> tuple[Any, Any]:
        """Inputs and parameters as the component wants them."""
        if self._params is None:
            params = self._pack_params(self._values[self._slices[0]])
            self._prepared = self.component.prepared(params)
            self._params = params  # where that fails, it is tried again before the next step
        return self._pack_inputs(self._values[self._slices[1]]), self._params

    def _initialise(self) -> None:
        """State and outputs that follow from the present inputs and parameters."""
        self._stale = False
        try:
            inputs, params = self._arguments()
            self._state = self.component.init(inputs, params)
            _, outputs = self.component.advance(self._state, inputs, self._prepared, 0.0)
            flat = flatten(outputs)
            sum(flat)  # refuses what is no number
            self._values[self._slices[2]] = flat
            self._failure = ""
        except Exception as error:
            self._failure = f"initialisation failed: {error!r}"
            self._state = None
            self.log(self._failure, Fmi2Status.error)

    def exit_initialization_mode(self) -> None:
        if self._stale:
            self._initialise()
        if self._failure:
            raise InitialisationError(self._failure)
        self._initialising = False

    def do_step(self, current_time: float, step_size: float) -> bool:
        if self._initialising:
            self.log("a step needs a finished initialisation", Fmi2Status.error)
            return False
        if not 0.0 <= step_size < inf:
            self.log(
                f"step at t = {current_time} s: {step_size} s is not a valid step size", Fmi2Status.error
            )
            return False
        try:
            inputs, _ = self._arguments()
            state, outputs = self.component.advance(self._state, inputs, self._prepared, step_size)
            flat = flatten(outputs)
            total = sum(flat)
        except Exception as error:
            self.log(f"step at t = {current_time} s failed: {error!r}", Fmi2Status.error)
            return False
        # A finite sum has no other terms; a sum may also be too large though no term is.
        if not isfinite(total) and not all(map(isfinite, flat)):
            bad = [n for n, x in zip(self._names[self._slices[2]], flat, strict=True) if not isfinite(x)]
            self.log(
                f"step at t = {current_time} s failed: {', '.join(bad)} not finite", Fmi2Status.error
            )
            return False
        self._state = state
        self._values[self._slices[2]] = flat
        return True

    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "values": list(self._values),
            "state": [] if self._initialising else flatten(self._state),
            "initialising": self._initialising,
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self._values = list(state["values"])
        self._params = None
        # Before initialisation has ended, all follows from the start values.
        self._initialising = self._stale = state["initialising"]
        self._failure = ""
        if not self._initialising:
            inputs, params = self._arguments()
            self._state = rebuild(self.component.init(inputs, params), state["state"])

    @classmethod
    def _fmu_state_to_bytes(cls, state: dict[str, Any]) -> bytes:  # pyright: ignore[reportIncompatibleMethodOverride]
        body = json.dumps(state)
        return json.dumps([STATE_VERSION, cls.code_hash, _checksum(body), body]).encode()

    @classmethod
    def _fmu_state_from_bytes(cls, state: bytes) -> dict[str, Any]:  # pyright: ignore[reportIncompatibleMethodOverride]
        version, code_hash, checksum, body = json.loads(bytes(state))
        if code_hash != cls.code_hash:
            raise StateError("these bytes are not a state of this FMU")
        if version != STATE_VERSION:
            raise StateError("this state belongs to another version")
        if checksum != _checksum(body):
            raise StateError("this state was changed: its checksum differs")
        return json.loads(body)


def _checksum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
