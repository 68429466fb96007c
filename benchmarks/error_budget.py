"""Which parts a prediction error has: ``python -m benchmarks.error_budget DATA [--dataset NAME]``.

The model is calibrated to all runs of a data set. Its predictions in the longest windows are linearised.
*Stated*: share of the mean square error that a part has by its own uncertainty. *Explained*: share that
goes if the part is fitted, within its prior, to what it explains; an upper bound, and parts overlap.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import diagnosis
from cosim import InputError
from cosim.command import run_command
from diagnosis import Model, WeakWindows
from diagnosis.predictors.shooting import Shooting
from diagnosis.search.candidates import SMALL
from diagnosis.search.prediction_fit.disturbance import ForceDisturbance, covariance

from .ships.datasets import DATASETS

NONE = ForceDisturbance(np.zeros(3), np.ones(3))
CONSTANTS = ("body_bias_X", "body_bias_Y", "body_bias_N")


class Part(NamedTuple):
    """Shares of the squared position and heading errors; None: it has no uncertainty of its own."""

    name: str
    stated: np.ndarray | None
    explained: np.ndarray


class Budget:
    """The residuals (w, T, 3) of windows, and the run (w,) of each."""

    def __init__(self, run: np.ndarray, residuals: np.ndarray) -> None:
        self.run, self.r = run, residuals
        mean = np.stack([np.mean(residuals[run == k] ** 2, axis=(0, 1)) for k in range(run.max() + 1)])
        mean[:, :2] = mean[:, :2].mean(axis=1, keepdims=True)
        self.noise = np.broadcast_to(mean[run][:, None], residuals.shape)

    def share(self, squares: np.ndarray) -> np.ndarray:
        """Means over the runs of sums of squares (w, T, 3) over those of the residuals."""
        sums = [
            np.stack([np.bincount(self.run, x) for x in s.sum(axis=1).T]) for s in (squares, self.r**2)
        ]
        place, heading = ([x[:2].sum(axis=0) for x in sums], [x[2] for x in sums])
        return np.array(
            [np.nanmean(s / np.maximum(r, np.finfo(float).tiny)) for s, r in (place, heading)]
        )

    def explained(self, V: Sequence[np.ndarray], together: np.ndarray) -> np.ndarray:
        """Shares that a part explains.

        Args:
            V: its prior covariance of all residuals of the windows of one number, by number.
            together: (w,), that number.
        """
        left = self.r.copy()
        for k, own in enumerate(V):
            of = together == k
            r, noise = self.r[of].ravel(), self.noise[of].ravel()
            left[of] = (r - own @ np.linalg.solve(own + np.diag(noise), r)).reshape(
                -1, *self.r.shape[1:]
            )
        return 1.0 - self.share(left**2)

    def by_run(self, slopes: np.ndarray) -> np.ndarray:
        """Shares that unit normal variables of each run, with slopes (w, T, 3, k), explain."""
        flat = [slopes[self.run == k].reshape(-1, slopes.shape[-1]) for k in range(self.run.max() + 1)]
        return self.explained([A @ A.T for A in flat], self.run)


def group(coefficient: str) -> str:
    """Part of the ship of a coefficient: an actuator, the wind, or the hull with its inertia."""
    first, _, rest = coefficient.partition("_")
    return rest.partition("_")[0] if first == "plant" else first if first == "wind" else "hull"


def budget(runs: Sequence[WeakWindows], model: Model) -> Iterator[Part]:
    """The parts of the error over the windows of the runs.

    Raises:
        InputError: the runs do not determine the coefficients.
    """
    session = diagnosis.begin(runs, model=model)
    fit = session.calibration
    if fit is None:
        raise InputError("these runs do not determine the coefficients")
    model, std = fit.findings.model, fit.posterior.std
    kept = [k for k, x in enumerate(std.values()) if x > 0.0]
    names, C = [[*std][k] for k in kept], fit.posterior.covariance[np.ix_(kept, kept)]
    size = dict(zip(CONSTANTS, fit.unrecorded.disturbance.size.tolist(), strict=True))
    windows = Shooting([w.smoothed for w in runs], runs[0].horizon)
    around = windows.around(model, {n: SMALL * (std | size)[n] for n in (*names, *CONSTANTS)})
    numbers = np.unique(windows.run, return_inverse=True)[1]
    b = Budget(numbers, around.residuals)
    start = covariance(around.motion, windows.at_start, NONE).reshape(len(b.r), b.r[0].size, -1)
    own = np.einsum("wii->wi", start).reshape(b.r.shape)
    yield Part("start state of each window", b.share(own), b.explained([*start], np.arange(len(b.r))))
    parts = {g: [k for k, n in enumerate(names) if group(n) == g] for g in sorted({*map(group, names)})}
    for g, of in {"all coefficients": [*range(len(names))], **parts}.items():
        slopes = around.slopes[..., of]
        own = np.einsum("wtik,wtik->wti", slopes @ C[np.ix_(of, of)], slopes)
        prior = np.array([session.known.std.get(names[k], std[names[k]]) for k in of])
        yield Part(g, b.share(own), b.by_run(slopes * prior))
    force = around.slopes[..., len(names) :] * np.array([*size.values()])
    yield Part("constant force and moment of each run", None, b.by_run(force))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.error_budget", description=__doc__)
    parser.add_argument("data", type=Path, metavar="DATA", help="folder with a folder for each data set")
    parser.add_argument("--dataset", choices=[*DATASETS], default="esso_osaka", help="(esso_osaka)")
    options = parser.parse_args(arguments)
    runs, model = DATASETS[options.dataset].load(options.data)
    print("| part | stated: position [%] | heading [%] | explained: position [%] | heading [%] |")
    print("|---|--:|--:|--:|--:|")
    for part in budget(runs, model):
        shares = [*([None] * 2 if part.stated is None else part.stated), *part.explained]
        cells = ["–" if x is None else f"{100.0 * x:.0f}" for x in shares]
        print(f"| {part.name} | {' | '.join(cells)} |", flush=True)
    return 0


if __name__ == "__main__":
    run_command(main)
