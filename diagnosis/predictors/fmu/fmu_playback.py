"""An FMU along given inputs from a given start, many times, in confined processes.

An instance is reset between two predictions, if a reset is seen to leave it as its instantiation does;
else, and where it must know nothing of other predictions, each has an instance, and so a process, of its
own. A request that fails says why; the others go on.
"""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import numpy as np

from cosim import InputError, SimulationError
from cosim.fmu import (
    MEANS,
    MOST_STEPS,
    ConfinedFmu,
    DoubleMemory,
    FeedbackTerm,
    FmuModel,
    IsolatedInstance,
    Port,
    WholeRun,
)

from ...runs.run_constants import ORDER
from ..predictor import Execution


def confined(model: FmuModel, execution: Execution) -> ConfinedFmu:
    """An FMU, and the process that makes those of its instances, whose calls are whole predictions.

    Raises:
        InputError: there is no process for it.
    """
    try:
        means = MEANS if execution.confined else ()
        return ConfinedFmu(model, means, execution.timeout)
    except SimulationError as error:
        raise InputError(str(error)) from None


class PlaybackRequest(NamedTuple):
    """What an FMU gets in one prediction.

    Attributes:
        h: length of a step [s].
        start: variable -> value that it begins with; an input keeps this value.
        inputs: (steps, n), values of the first inputs in each step; all others keep their start value.
        terms: what is added to inputs.
    """

    h: float
    start: Mapping[str, float]
    inputs: np.ndarray
    terms: Sequence[FeedbackTerm] = ()


@dataclass(frozen=True)
class PlayedBack:
    """A prediction.

    Attributes:
        outputs: (steps + 1, m); NaN from where the FMU failed.
        fault: why it failed; empty: it did not.
    """

    outputs: np.ndarray
    fault: str = ""


class Playback:
    """An FMU in one process at a time.

    Args:
        fmu: the FMU.
        inputs, outputs: variables that are put and got in each step.
        fresh: whether each prediction has an instance of its own.
    """

    _begins = Lock()  # processes are begun one after the other

    def __init__(
        self, fmu: ConfinedFmu, inputs: Sequence[str], outputs: Sequence[str], fresh: bool = False
    ) -> None:
        self._fmu, self.inputs, self.outputs = fmu, inputs, outputs
        every = fmu.model.variables
        self._starts = [float(every[name].start or 0.0) for name in inputs]
        ports = [Port(every[n], k) for k, n in enumerate((*inputs, *outputs))]
        self._ports = ports[: len(inputs)], ports[len(inputs) :]
        self._instance: IsolatedInstance | None = None
        self._h = 0.0  # of its steps
        self._resets: bool | None = False if fresh else None
        # To save the state before each step, for one that is discarded, takes a multiple of the time.
        self._redoes = False

    def run(self, prediction: PlaybackRequest) -> PlayedBack:
        """One prediction."""
        try:
            if self._resets is None:
                self._resets = self._returns_by_reset(prediction)
            return self._run(prediction)
        except (SimulationError, InputError) as error:
            self.close()
            if not self._redoes:
                self._redoes = True
                return self.run(prediction)
            return PlayedBack(self._nothing(prediction), self._fmu.stated(error))

    def run_each(self, predictions: Sequence[PlaybackRequest]) -> list[PlayedBack]:
        """Some predictions; many at once where nothing but a reset is between them."""
        alone = 0 if self._resets else 1  # which tells whether it is
        found = [self.run(prediction) for prediction in predictions[:alone]]
        for part in _requests(predictions[alone:]):
            found += self._at_once(part) or map(self.run, part)
        return found

    def _at_once(self, predictions: Sequence[PlaybackRequest]) -> list[PlayedBack]:
        """Nothing where one fails, their steps differ in length, or each has a time that is given."""
        h = predictions[0].h
        if not self._resets or self._fmu.timeout is not None or any(p.h != h for p in predictions):
            return []
        try:
            stated = self._ready(h).whole_runs([self._asked(p) for p in predictions], h)
        except SimulationError:
            self.close()
            return []
        outputs = [np.frombuffer(x).reshape(-1, len(self.outputs)) for x in stated]
        pairs = zip(predictions, outputs, strict=True)
        if all(len(y) == len(p.inputs) + 1 and np.isfinite(y).all() for p, y in pairs):
            return [*map(PlayedBack, outputs)]
        self.close()  # a reset may not cure what has failed
        return []

    def _nothing(self, prediction: PlaybackRequest) -> np.ndarray:
        return np.full((len(prediction.inputs) + 1, len(self.outputs)), np.nan)

    def _returns_by_reset(self, prediction: PlaybackRequest) -> bool:
        """Whether a reset leaves the FMU as its instantiation does, as far as can be seen."""
        new = self._run(prediction)
        with suppress(SimulationError):
            if np.array_equal(new.outputs, self._run(prediction).outputs, equal_nan=True):
                return True
        self.close()  # a reset has left it in an unknown state
        return False

    def _ready(self, h: float) -> IsolatedInstance:
        if self._instance is not None and h == self._h:
            self._instance.reset()
            return self._instance
        self.close()
        with self._begins:
            self._instance, self._h = self._fmu.instance(), h
        count = sum(map(len, self._ports))
        self._instance.bind(*self._ports, DoubleMemory(count), h, self._redoes)
        return self._instance

    def close(self) -> None:
        """End its process."""
        instance, self._instance = self._instance, None
        if instance is not None:
            instance.free()

    def _asked(self, prediction: PlaybackRequest) -> WholeRun:
        """An input that is not driven keeps its start value."""
        start, (steps, driven) = dict(prediction.start), prediction.inputs.shape
        rows = np.tile(self._starts, (steps, 1))
        rows[:, :driven] = prediction.inputs
        for k, name in enumerate(self.inputs):
            rows[:, k] = start.pop(name, rows[:, k])
        return WholeRun(start, rows.tobytes(), steps, prediction.terms)

    def _run(self, prediction: PlaybackRequest) -> PlayedBack:
        h, outputs = prediction.h, self._nothing(prediction)
        (stated,) = self._ready(h).whole_runs([self._asked(prediction)], h)
        known = np.frombuffer(stated).reshape(-1, len(self.outputs))
        outputs[: len(known)] = known
        fine = bool(np.isfinite(outputs).all())
        if self._resets is False or not fine:  # a reset may not cure what has failed
            self.close()
        if fine:
            return PlayedBack(outputs)
        k = len(known) - 1
        place = int(np.argmax(np.nan_to_num(np.abs(outputs[k]), nan=np.inf)))
        how = "diverges" if np.isfinite(outputs[k, place]) else "is not finite"
        return PlayedBack(outputs, f"{self.outputs[place]} {how} at t = {k * h:.6g} s")


def _requests(predictions: Sequence[PlaybackRequest]) -> Iterator[list[PlaybackRequest]]:
    """Predictions in their order, as many together as make MOST_STEPS, or one that has more."""
    part: list[PlaybackRequest] = []
    steps = 0
    for prediction in predictions:
        count = len(prediction.inputs)
        if part and steps + count > MOST_STEPS:
            yield part
            part, steps = [], 0
        part.append(prediction)
        steps += count
    if part:
        yield part


class Processes:
    """An FMU in processes of its own, in which it may fail; arguments as of :class:`Playback`."""

    def __init__(
        self, fmu: ConfinedFmu, inputs: Sequence[str], outputs: Sequence[str], fresh: bool = False
    ) -> None:
        self._fmu, self.name, self.inputs, self.outputs = fmu, fmu.model.path.name, inputs, outputs
        self._playbacks = [Playback(fmu, inputs, outputs, fresh) for _ in range(2)]

    def run(self, predictions: Sequence[PlaybackRequest]) -> list[PlayedBack]:
        """Some predictions, in their order."""
        count = len(self._playbacks)
        found = [PlayedBack(np.zeros((0, 0)))] * len(predictions)
        with ThreadPoolExecutor(count, "playback") as threads:
            try:
                parts = [predictions[k::count] for k in range(count)]
                stated = threads.map(Playback.run_each, self._playbacks, parts)
                for k, part in enumerate(stated):
                    found[k::count] = part
                return found
            except BaseException:  # such as Ctrl-C: predictions that are under way end with the FMU
                threads.shutdown(wait=False, cancel_futures=True)
                self._fmu.close()
                raise

    def close(self) -> None:
        """End the processes."""
        self._fmu.close()
        for playback in self._playbacks:
            playback.close()


class ShortSteps:
    """What an FMU does within a few short steps from its start, as many as the order of the differences.

    Those of a motion at 1 rad/s in steps of 0.02 s are then right to 1e-6.

    Args:
        fmu: the FMU.
        inputs, outputs: names of what is set in each step, and of what is returned.
        h: length of a step [s].
        late: whether outputs follow the start values only after the first step.
    """

    def __init__(
        self, fmu: ConfinedFmu, inputs: Sequence[str], outputs: Sequence[str], h: float, late: bool
    ) -> None:
        self._name, self.h, self._late = fmu.model.path.name, h, late
        self._playback = Playback(fmu, tuple(inputs), tuple(dict.fromkeys(outputs)))

    def run(
        self, start: Mapping[str, np.ndarray], inputs: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Each output (ORDER + 1, n) from starts (n,) on; from the first step on where outputs are late.

        Raises:
            InputError: the FMU refuses one, or fails.
        """
        playback, steps = self._playback, ORDER + self._late
        driven = np.column_stack([inputs[name] for name in playback.inputs])
        starts = np.column_stack([*start.values(), np.zeros((len(driven), 0))]).tolist()
        found = playback.run_each(
            [
                PlaybackRequest(self.h, dict(zip(start, begin, strict=True)), np.tile(row, (steps, 1)))
                for begin, row in zip(starts, driven, strict=True)
            ]
        )
        if fault := next((each.fault for each in found if each.fault), ""):
            raise InputError(f"'{self._name}' cannot be set to a measured state: {fault}")
        outputs = np.array([each.outputs[int(self._late) :] for each in found])
        return dict(zip(playback.outputs, outputs.transpose(2, 1, 0), strict=True))

    def derivatives(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivative (n,) at the start of outputs (ORDER + 1, n), of a polynomial."""
        powers = np.vander(self.h * (np.arange(len(x)) + self._late), increasing=True)
        _, first, half, *_ = np.linalg.solve(powers, x)
        return first, 2.0 * half

    def close(self) -> None:
        """Free the FMU."""
        self._playback.close()
