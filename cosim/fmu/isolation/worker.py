"""The process of one isolated FMU: ``python -m cosim.fmu.isolation.worker``, started by the master only.

A confined one is forked instead, see :mod:`cosim.fmu.isolation.fork_server`.

It carries out the frames on its standard input with the same code that runs an FMU inside the master,
and ends when the master does, also when that is killed.
"""

import ctypes
import io
import json
import math
import os
import signal
import sys
from pathlib import Path
from typing import Any

from ...errors import InputError, SimulationError
from ...process.spawned import end_with_parent
from ..fmu_model import FmuModel, Value
from ..instance import DoubleMemory, Port
from ..local import LocalInstance
from .channel import (
    DIVERGED,
    DONE,
    FAILED,
    GET,
    LOG,
    MOVE,
    MOVE_HEAD,
    PUT,
    REFUSED,
    STEP,
    Channel,
    FeedbackTerm,
)


class Worker:
    """Answers one request after the other."""

    def __init__(self, channel: Channel, model: FmuModel | None = None) -> None:
        self._channel = channel
        self._known = model
        # Nobody reads what a confined FMU logs, but for the reason of an error, which is part of that.
        self._listener = self._log if model is None else None

    def serve(self) -> None:
        """Answer until the master closes its end."""
        while True:
            try:
                kind, body = self._channel.receive()
            except EOFError:
                return
            try:
                answer = self._move(body) if kind == MOVE else self._call(body)
            except InputError as error:
                self._channel.send(REFUSED, str(error).encode())
            except SimulationError as error:
                self._channel.send(FAILED, str(error).encode())
            else:
                self._channel.send(DONE, answer)

    def _call(self, body: bytes) -> bytes:
        name, *arguments = json.loads(body)
        action = getattr(self, f"_{name}", None) or getattr(self._instance, name)
        return json.dumps(action(*arguments)).encode()

    def _start(self, name: str, path: str, folder: str) -> None:
        self._model = self._known or FmuModel(Path(path), Path(folder))
        self._model.alone = True
        self._instance = LocalInstance(name, self._model, self._listener)

    def _log(self, _: str, status: int, text: str) -> None:
        self._channel.send_json(LOG, [status, text])

    def _set_value(self, name: str, value: Value) -> None:
        self._instance.set_value(self._model.variables[name], value)

    def _get_value(self, name: str) -> float:
        return self._instance.get_value(self._model.variables[name])

    def _bind(self, inputs: list[str], outputs: list[str], h: float, redo: bool) -> None:
        """Lay out a memory: the inputs, then the outputs."""
        self._instance.component.can_redo &= redo
        known = self._model.variables
        ports = [Port(known[name], k) for k, name in enumerate([*inputs, *outputs])]
        memory, middle = DoubleMemory(len(ports)), len(inputs)
        self._access = self._instance.bind(ports[:middle], ports[middle:], memory, h)
        self._inputs = memory.octets[: 8 * middle]
        self._outputs = memory.octets[8 * middle : 8 * len(ports)]

    def _move(self, body: bytes) -> bytes:
        actions, t = MOVE_HEAD.unpack_from(body)
        if actions & PUT:
            self._inputs[:] = body[MOVE_HEAD.size :]
            self._access.put()
        if actions & STEP:
            self._access.step(t)
        elif actions & GET:
            self._access.get()
        return bytes(self._outputs)

    def _whole_runs(self, runs: list[Any], h: float) -> list[str]:
        """One after the other, with a reset between two."""
        stated = []
        for k, (start, inputs, steps, terms) in enumerate(runs):
            if k:
                self._reset()
            stated.append(self._whole_run(start, inputs, steps, terms, h))
        return stated

    def _whole_run(
        self, start: dict[str, Value], inputs: str, steps: int, terms: list[FeedbackTerm], h: float
    ) -> str:
        """The outputs at the start of a run and after each step, up to one that has diverged."""
        self._instance.set_up(steps * h)
        for name, value in start.items():
            self._set_value(name, value)
        self._instance.enter_initialization()
        rows, width = bytes.fromhex(inputs), len(self._inputs)
        self._inputs[:] = rows[:width]
        self._access.put()
        self._instance.exit_initialization()
        self._access.get()
        driven, seen = self._inputs.cast("d"), self._outputs.cast("d")
        stated, before, put, step = (
            bytearray(self._outputs),
            [*seen],
            self._access.put,
            self._access.step,
        )
        for k in range(steps):
            self._inputs[:] = rows[k * width : (k + 1) * width]
            for slot, place, power, rate, coefficient, turn, phase in terms:
                y = (seen[place] - before[place]) / h if rate else seen[place] if power else 1.0
                y = math.cos(turn * y + phase) if turn else y
                driven[slot] += coefficient * y * abs(y) ** max(0, power - 1)
            before = seen.tolist()
            put()
            step(k * h)
            stated += self._outputs
            for y in seen.tolist():
                # Some tools integrate for hours once a state is infinite.
                if not -DIVERGED < y < DIVERGED:
                    return stated.hex()
        self._instance.terminate()
        return stated.hex()

    def _reset(self) -> None:
        self._instance.reset(self._listener)


def serve(model: FmuModel | None = None) -> None:
    """Serve the master, over pipes of its own: whatever the FMU prints goes to standard error.

    Args:
        model: the FMU, where it has been read already.
    """
    if sys.platform == "linux":
        libc = ctypes.CDLL(None)
        libc.setlinebuf(ctypes.c_void_p.in_dll(libc, "stdout"))  # as below, for FMUs in C
    channel = Channel(os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb"))
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # a crash must not lose what was printed before
    try:
        Worker(channel, model).serve()
    except OSError:
        os._exit(1)  # the master has ended, or the FMU has closed the pipes
    sys.stdout.flush()
    # Libraries of FMUs sometimes crash in their clean-up at the end of a process.
    os._exit(0)


def main() -> None:
    """Serve the master that has started this process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the master handles Ctrl-C
    end_with_parent(os.getppid())  # an FMU that hangs would outlive a master that was killed
    serve()


if __name__ == "__main__":
    main()
