"""Predictions of an FMU by cosim, one instance for each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

import cosim
from cosim.process import scratch_folder

TOGETHER = 16  # instances in one simulation; chosen: each may have a process of its own


class Begun(NamedTuple):
    """A prediction to be made: start value -> number, and input -> value (steps,) in each step."""

    start: Mapping[str, float]
    inputs: Mapping[str, np.ndarray]


def simulate(
    path: Path, isolated: bool, begun: Sequence[Begun], outputs: Sequence[str], h: float, steps: int
) -> dict[str, np.ndarray]:
    """Each output (steps + 1, w) of w predictions in steps of h [s].

    Args:
        path: of the FMU.
        isolated: whether each instance needs a process of its own.
        begun: what is predicted.
        outputs: names of variables.
        h, steps: length of a step [s], and how many.

    Raises:
        InputError: the FMU fails.
    """
    groups = [begun[k : k + TOGETHER] for k in range(0, len(begun), TOGETHER)]
    parts = [_together(path, isolated, group, outputs, h, steps) for group in groups]
    return {name: np.concatenate([part[name] for part in parts], axis=1) for name in outputs}


def _together(
    path: Path, isolated: bool, begun: Sequence[Begun], outputs: Sequence[str], h: float, steps: int
) -> dict[str, np.ndarray]:
    windows = {f"window{k}": one for k, one in enumerate(begun)}
    with scratch_folder() as folder:
        recording = folder / "commands.csv"
        # A row acts in the step that ends at its time, the first one before that, too.
        columns = {"time": np.round((np.arange(steps) + 1) * h, 12)}
        columns |= {f"{k}.{name}": x for k, one in windows.items() for name, x in one.inputs.items()}
        pd.DataFrame(columns).to_csv(recording, index=False)
        scenario = {
            "name": "prediction",
            "step": h,
            "stop": round(steps * h, 9),
            "fmus": {
                k: {"path": str(path), "parameters": one.start, "isolate": isolated}
                for k, one in windows.items()
            },
            "recordings": [{"path": str(recording), "inputs": {n: n for n in columns if n != "time"}}],
            "log": {"signals": [f"{k}.{name}" for k in windows for name in outputs]},
        }
        result = cosim.simulate(cosim.load_scenario(scenario), folder / "out", pictures=False)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        if result.status != "done":
            raise cosim.InputError(result.message)
        log = cosim.read_log(result.folder)
    return {name: np.column_stack([log[f"{k}.{name}"] for k in windows]) for name in outputs}
