"""Inverse use of an FMU: its acceleration in a state that is set, by a few short steps from there.

The FMU is begun anew for each state. It is reset in between, if a reset is seen to leave it as its
instantiation does; else each state has an instance of its own.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import TypeVar

import numpy as np

from cosim import InputError, SimulationError
from cosim.fmu import ConfinedFmu

from .instances import FmuRun

STEPS = 3  # Chosen: of a motion at 1 rad/s in steps of 0.02 s differences are then right to 1e-6.

Values = Mapping[str, float]
Found = TypeVar("Found")


def returns_by_reset(
    run: Callable[[], Found], same: Callable[[Found, Found], bool], close: Callable[[], None]
) -> bool:
    """Whether a reset leaves an FMU as its instantiation does, as far as can be seen.

    Args:
        run: runs the FMU, after a reset if it has run before.
        same: whether two results are the same.
        close: frees the FMU, which a failed reset has left in an unknown state.
    """
    new = run()
    with suppress(SimulationError):
        return same(new, run())
    close()
    return False


class ShortSteps:
    """What an FMU does within a few short steps from its start.

    Args:
        fmu: the FMU.
        inputs, outputs: names of what is set in each step, and of what is returned.
        h: length of a step [s].
        late: whether outputs follow the start values only after the first step.
    """

    def __init__(
        self, fmu: ConfinedFmu, inputs: Sequence[str], outputs: Sequence[str], h: float, late: bool
    ) -> None:
        self._fmu, self.h, self._late = fmu, h, late
        self._inputs, self._outputs = tuple(inputs), tuple(dict.fromkeys(outputs))
        self._resets: bool | None = None
        self._begun: FmuRun | None = None

    def run(self, start: Values, inputs: Values) -> dict[str, np.ndarray]:
        """Each output (STEPS + 1,) from a start on; from the first step on where outputs are late.

        Raises:
            InputError: the FMU refuses it, or fails.
        """
        try:
            if self._resets is None:
                self._resets = self._tried(start, inputs)
            return self._run(start, inputs)
        except (InputError, SimulationError) as error:
            self.close()
            told, name = self._fmu.told(error), self._fmu.model.path.name
            raise InputError(f"'{name}' cannot be set to a measured state: {told}") from None

    def derivatives(self, x: np.ndarray) -> tuple[float, float]:
        """First and second derivative at the start of an output (STEPS + 1,), of a polynomial."""
        powers = np.vander(self.h * (np.arange(len(x)) + self._late), increasing=True)
        _, first, half, *_ = np.linalg.solve(powers, x).tolist()
        return first, 2.0 * half

    def close(self) -> None:
        """Free the FMU."""
        begun, self._begun = self._begun, None
        if begun is not None:
            begun.instance.free()

    def _tried(self, start: Values, inputs: Values) -> bool:
        """Whether a reset leaves the FMU as its instantiation does, as far as can be seen."""
        return returns_by_reset(
            lambda: self._run(start, inputs),
            lambda new, again: all(np.array_equal(new[name], again[name]) for name in new),
            self.close,
        )

    def _run(self, start: Values, inputs: Values) -> dict[str, np.ndarray]:
        if self._begun is not None and self._resets is not False:
            self._begun.instance.reset()
        else:
            self.close()
            self._begun = FmuRun(self._fmu, self._inputs, self._outputs, self.h)
        given, steps = [inputs[name] for name in self._inputs], STEPS + self._late
        told = self._begun.whole_run(start, given, steps)
        return dict(zip(self._outputs, told[int(self._late) :].T, strict=True))
