"""How often the 95 % intervals of an FMU's parameters hold the truth.

``python -m benchmarks.foreign_parameters.coverage``: the true values of each fit are drawn from the
priors; two runs with noise; nothing is missing. Counted are all parameters of all fits.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.progress import track
from scipy.stats import binomtest

from diagnosis.fmu_parameters.system_calibration import calibrate
from diagnosis.fmu_parameters.system_task import system_task

from .foreign_systems import CASES, ForeignSystem, built
from .hidden_causes import measured


def inside(path: Path, s: ForeignSystem, seed: int, folder: Path) -> list[bool]:
    """Of each parameter whether the interval of one fit holds the drawn value."""
    rng = np.random.default_rng([seed, 1])
    drawn = {n: v * float(np.exp(std * rng.standard_normal())) for n, (v, std) in s.parameters.items()}
    runs = [folder / f"run{k}.csv" for k in range(2)]
    for k, run in enumerate(runs):
        measured(path, s, drawn, False, 10 * seed + k).to_csv(run, index=False)
    task = system_task(path, folder / "map.json", {"train": runs}, folder / "parameters.json")
    try:
        found = calibrate(task.residuals(), (), task.names, task.units, {})
    finally:
        task.close()
    return [v.ci95[0] <= drawn[v.parameter.name] <= v.ci95[1] for v in found.values]


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.foreign_parameters.coverage", description=__doc__
    )
    parser.add_argument("--fits", type=int, default=200, help="number of fits; their number is the seed")
    parser.add_argument("--system", default="oscillator", help="name of a system (oscillator)")
    options = parser.parse_args(arguments)
    (s,) = (s for s in CASES if s.name == options.system)
    began, held = time.perf_counter(), []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = built(s, folder)
        s.write_inputs(folder)
        for seed in track(range(options.fits), "fits"):
            held += inside(path, s, seed, folder)
    low, high = binomtest(sum(held), len(held)).proportion_ci()
    print(
        f"{s.name}: {sum(held)} of {len(held)} intervals of {options.fits} fits hold the truth, "
        f"{np.mean(held):.1%} ({low:.1%} to {high:.1%}); {time.perf_counter() - began:.0f} s"
    )


if __name__ == "__main__":
    main()
