"""An FMU in a process of its own: the master's end.

Whatever the FMU does to its process, each call ends with an answer or a SimulationError. In a step, one
request carries the inputs and one answer the outputs.
"""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple, NoReturn

from ...errors import InputError, SimulationError
from ...process.call_watch import TIMEOUT, TIMES_USUAL
from ...process.spawned import ending
from ..component import WARNING
from ..fmu_model import FmuModel, FmuVariable, Value
from ..instance import Access, DoubleMemory, OnMessage, Port
from .channel import (
    CALL,
    DONE,
    GET,
    LOG,
    MOVE,
    MOVE_HEAD,
    PUT,
    REFUSED,
    STEP,
    Channel,
    FeedbackTerm,
    GarbledError,
)
from .worker_process import Printed, StartedProcess, WorkerProcess

# Longest wall time of instantiation where none is given, for which a process is started [s]; chosen:
# loading a large tool may take tens of seconds.
START_TIMEOUT = 60.0
# Wall time that an idle process may take to exit [s]; chosen: far beyond the clean-up of any library.
EXIT_TIMEOUT = 5.0
# Wall time between two looks at a call that is under way [s], at most; chosen: short beside TIMEOUT.
WATCH_INTERVAL = 0.5
# Wall time of a whole run where none is given [s]: RUN_TIMEOUT, or SLOW_STEP for each step where that is
# more; chosen: no FMU that is of use takes longer.
RUN_TIMEOUT, SLOW_STEP = 120.0, 0.1
MOST_STEPS = round(RUN_TIMEOUT / SLOW_STEP)  # 1, of whole runs whose request has no more time than one
START, RUN = "its instantiation", "a run"


class WholeRun(NamedTuple):
    """A run from its set-up to its termination.

    Attributes:
        start: start value -> number.
        inputs: in each step those that are bound, doubles.
        steps: how many.
        terms: what is added to the inputs.
    """

    start: Mapping[str, Value]
    inputs: bytes
    steps: int
    terms: Sequence[FeedbackTerm] = ()


class IsolatedInstance:
    """A running FMU in a process of its own; see :class:`cosim.fmu.instance.Instance` for its calls.

    Args:
        name: instance name.
        model: what to run.
        on_message: receives the messages that the FMU logs.
        timeout: longest wall time that one call may take [s]; None: by what a step usually takes, and by
            the number of steps of a whole run.
        start: makes its process.
        printed: receives each line that the FMU prints.

    Raises:
        InputError: the archive cannot be unpacked. An FMU that cannot be instantiated raises it in the
            first call: processes start side by side.
    """

    def __init__(
        self,
        name: str,
        model: FmuModel,
        on_message: OnMessage,
        timeout: float | None = None,
        start: Callable[[], WorkerProcess] = StartedProcess,
        printed: Callable[[str], None] | None = None,
    ) -> None:
        self.name = name
        self.model = model
        self._on_message = on_message
        self._timeout = timeout
        folder = model.unpack()
        try:
            self._process = start()
        except OSError as error:
            raise SimulationError(f"{name}: its process cannot be started: {error}") from None
        self._printed = Printed(self._process.printed, printed or _to_standard_error)
        self._channel = Channel(self._process.reader, self._process.writer)
        self._lost = ""  # why the process has ended
        self._asked = ""  # the call whose answer is due
        self._in_frame = False  # an exception inside a frame makes the channel unusable
        self._waiting_since: float | None = None
        self._is_late = False
        self._steps = 0  # of the whole runs that are under way
        self._spent, self._answers = 0.0, 0  # on answers but that of the instantiation [s]
        self._closed = threading.Event()
        threading.Thread(target=self._watch, name=f"watch {name}", daemon=True).start()
        path = str(model.path.resolve())
        self._send(START, CALL, json.dumps(["start", name, path, str(folder)]).encode())

    def _watch(self) -> None:
        """End the process when an answer takes too long; the thread that waits for it notices."""
        while not self._closed.wait(min(WATCH_INTERVAL, (self._timeout or TIMEOUT) / 4)):
            since, allowed = self._waiting_since, self._allowed()
            if since is not None and time.monotonic() - since > allowed:
                self._is_late = True
                self._process.kill()

    def _allowed(self) -> float:
        if self._asked == START:
            return max(self._timeout or 0.0, START_TIMEOUT)
        if self._asked == RUN:
            return self._timeout or max(RUN_TIMEOUT, SLOW_STEP * self._steps)
        usual = self._spent / max(1, self._answers)
        return self._timeout or max(TIMEOUT, TIMES_USUAL * usual)

    def _send(self, what: str, kind: int, body: bytes) -> None:
        """Send a request, after the answer to the one before."""
        if self._asked:
            self._answer()
        if self._lost:
            raise SimulationError(self._lost)
        self._asked, self._in_frame = what, True
        try:
            self._channel.send(kind, body)
        except OSError:
            self._give_up()
        self._in_frame = False

    def _answer(self, length: int | None = None) -> bytes:
        """Wait for the answer that is due, and pass on what the FMU logs meanwhile.

        Args:
            length: of the answer [bytes]; None accepts any.
        """
        if self._lost:
            raise SimulationError(self._lost)
        self._in_frame = True
        self._waiting_since = time.monotonic()
        try:
            kind, body = self._channel.receive()
            while kind == LOG:
                status, text = json.loads(body)
                self._on_message(self.name, status, text)
                kind, body = self._channel.receive()
            complaint = "" if kind == DONE else body.decode()
            if kind == DONE and length not in (None, len(body)):
                raise GarbledError
        except EOFError:
            self._give_up()
        except (GarbledError, ValueError, TypeError):
            self._give_up(is_garbled=True)
        self._spent += 0.0 if self._asked == START else time.monotonic() - self._waiting_since
        self._answers += self._asked != START
        self._waiting_since = None
        what, self._in_frame, self._asked = self._asked, False, ""
        if kind == DONE:
            return body
        if what == START:
            self._lost = complaint  # there is nothing to terminate or free
        raise (InputError if kind == REFUSED else SimulationError)(complaint)

    def _give_up(self, is_garbled: bool = False) -> NoReturn:
        """The process has ended, or its answers are no frames: raise the reason.

        Raises:
            SimulationError: always.
        """
        self._waiting_since = None
        self._closed.set()
        if is_garbled:
            self._process.kill()
        try:
            code = self._process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:  # it closed its pipes and runs on
            self._process.kill()
            code = self._process.wait(EXIT_TIMEOUT)
        self._process.kill()
        self._printed.finish()
        if self._is_late:
            how = f"{self._asked} took longer than {self._allowed():g} s; its process was ended"
        elif is_garbled:
            how = f"it wrote into the pipe to the master in {self._asked}; its process was ended"
        else:
            how = f"its process died in {self._asked} ({ending(code)})"
        self._lost = f"{self.name}: {how}"
        raise SimulationError(self._lost)

    def _call(self, what: str, name: str, *arguments: Any) -> Any:
        self._send(what, CALL, json.dumps([name, *arguments]).encode())
        answer = self._answer()
        try:
            return json.loads(answer)
        except ValueError:
            self._asked = what
            self._give_up(is_garbled=True)

    def set_value(self, variable: FmuVariable, value: Value) -> None:
        self._call(f"setting {variable.name} = {value}", "set_value", variable.name, value)

    def get_value(self, variable: FmuVariable) -> float:
        return float(self._call(f"getting {variable.name}", "get_value", variable.name))

    def directional_derivative(self, unknown: Sequence[FmuVariable], known: FmuVariable) -> list[float]:
        """Partial derivatives of variables by one, after initialisation.

        Raises:
            SimulationError: the FMU refuses.
        """
        what, references = "fmi2GetDirectionalDerivative", [v.reference for v in unknown]
        return list(self._call(what, "directional_derivative", references, known.reference))

    def set_up(self, stop: float) -> None:
        self._call("fmi2SetupExperiment", "set_up", stop)

    def enter_initialization(self) -> None:
        self._call("fmi2EnterInitializationMode", "enter_initialization")

    def exit_initialization(self) -> None:
        self._call("fmi2ExitInitializationMode", "exit_initialization")

    def bind(
        self,
        inputs: Sequence[Port],
        outputs: Sequence[Port],
        memory: DoubleMemory,
        h: float,
        redo: bool = True,
    ) -> Access:
        """See :class:`cosim.fmu.instance.Instance`; ``redo``: whether discarded steps are repeated."""
        names = [[port.variable.name for port in ports] for ports in (inputs, outputs)]
        self._call("the choice of its variables", "bind", *names, h, redo)
        own_inputs, own_outputs = _part(inputs, memory), _part(outputs, memory)
        self._width = len(own_outputs)
        pending = 0

        def move(what: str, actions: int, t: float) -> None:
            nonlocal pending
            actions |= pending
            pending = 0
            body = MOVE_HEAD.pack(actions, t)
            self._send(what, MOVE, body + own_inputs if actions & PUT else body)

        def put() -> None:
            # The inputs are sent with the next request.
            nonlocal pending
            pending = PUT

        def get() -> None:
            move("getting its outputs", GET, 0.0)
            own_outputs[:] = self._answer(len(own_outputs))

        def begin(t: float) -> None:
            move(f"the step from t = {t} s", STEP, t)

        def step(t: float) -> None:
            if not self._asked:
                begin(t)
            own_outputs[:] = self._answer(len(own_outputs))

        return Access(put, get, step, begin)

    def whole_runs(self, runs: Sequence[WholeRun], h: float) -> list[bytes]:
        """Runs in steps of h [s], as one request, for which the timeout counts; between two is a reset.

        Returns:
            Of each the outputs that are bound, at least one, doubles: at the start and after each step,
            up to one that is not finite.

        Raises:
            SimulationError: the FMU refuses or fails.
        """
        self._steps = sum(run.steps for run in runs)
        asked = [(dict(r.start), r.inputs.hex(), r.steps, [*r.terms]) for r in runs]
        stated = self._call(RUN, "whole_runs", asked, h)
        try:
            found = [*map(bytes.fromhex, stated)]
            sizes = [divmod(len(x), self._width) for x in found]
            whole = [not rest and 0 < n <= r.steps + 1 for r, (n, rest) in zip(runs, sizes, strict=True)]
        except (TypeError, ValueError):
            found, whole = [], [False]
        if not all(whole):
            self._asked = RUN
            self._give_up(is_garbled=True)
        return found

    def reset(self) -> None:
        """Return to the state after instantiation, for another run (fmi2Reset).

        Raises:
            SimulationError: the FMU refuses.
        """
        self._call("fmi2Reset", "reset")

    def terminate(self) -> None:
        if not self._lost and not self._in_frame:
            self._call("fmi2Terminate", "terminate")

    def free(self) -> None:
        if self._in_frame:  # interrupted during a call
            self._process.kill()
        elif not self._lost:
            try:
                self._call("fmi2FreeInstance", "free")
            except (SimulationError, InputError) as error:
                self._on_message(self.name, WARNING, str(error))
        self._closed.set()
        for pipe in (self._process.writer, self._process.reader):
            with suppress(OSError):
                pipe.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(EXIT_TIMEOUT)
        self._process.kill()  # also for the processes that the FMU started
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(EXIT_TIMEOUT)
        self._printed.finish()


def _to_standard_error(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _part(ports: Sequence[Port], memory: DoubleMemory) -> memoryview:
    """The part of a memory that holds some variables."""
    first = ports[0].slot if ports else 0
    return memory.octets[8 * first : 8 * (first + len(ports))]
