"""Inverse use of an FMU: its acceleration in a state that is set, by a few short steps from there."""

from collections.abc import Mapping, Sequence

import numpy as np

from cosim import InputError
from cosim.fmu import ConfinedFmu

from ...runs.run_constants import ORDER
from .fmu_playback import Playback, PlaybackRequest


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

    def run(self, start: Mapping[str, float], inputs: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Each output (ORDER + 1,) from a start on; from the first step on where outputs are late.

        Raises:
            InputError: the FMU refuses it, or fails.
        """
        playback = self._playback
        held = np.tile([inputs[name] for name in playback.inputs], (ORDER + self._late, 1))
        found = playback.run(PlaybackRequest(self.h, start, held))
        if found.fault:
            raise InputError(f"'{self._name}' cannot be set to a measured state: {found.fault}")
        return dict(zip(playback.outputs, found.outputs[int(self._late) :].T, strict=True))

    def derivatives(self, x: np.ndarray) -> tuple[float, float]:
        """First and second derivative at the start of an output (ORDER + 1,), of a polynomial."""
        powers = np.vander(self.h * (np.arange(len(x)) + self._late), increasing=True)
        _, first, half, *_ = np.linalg.solve(powers, x).tolist()
        return first, 2.0 * half

    def close(self) -> None:
        """Free the FMU."""
        self._playback.close()
