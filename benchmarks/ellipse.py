"""Does adaptation pay? ``python -m benchmarks.ellipse [--seeds N]``.

Runs scenarios/ellipse.json without adaptation, with it, and with concurrent learning, and prints the RMS
of the true position error after the first 20 s, over several seeds.
"""

import argparse
import json
import platform
import statistics
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import cosim

SCENARIO = Path(__file__).parent.parent / "scenarios" / "ellipse.json"
CONTROLLERS = ("controller_bs.fmu", "controller_abs.fmu", "controller_cl_win_eps.fmu")


def position_error(controller: str, seed: int) -> float:
    """RMS of the true position error [m] over the window that the scenario's metrics cover.

    Args:
        controller: FMU that takes the place of the scenario's controller.
        seed: of noise and freezes.

    Returns:
        The error [m].
    """
    content = json.loads(SCENARIO.read_text())
    content["seed"] = seed
    content["fmus"]["controller"] = {"path": controller}
    with TemporaryDirectory() as folder:
        result = cosim.simulate(cosim.load_scenario(content), folder)
    return result.metrics["e_pos_rms"]


def over_seeds(seeds: Sequence[int]) -> dict[str, list[float]]:
    """Controller -> error for each seed, on two processes."""
    # Forking a process that has loaded FMUs would copy their threads' locks.
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        return {
            controller: list(pool.map(position_error, [controller] * len(seeds), seeds))
            for controller in CONTROLLERS
        }


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ellipse", description=__doc__)
    parser.add_argument("--seeds", type=int, default=10, metavar="N", help="seeds 0 to N-1 (10)")
    seeds = range(parser.parse_args().seeds)
    errors = over_seeds(seeds)
    print(f"RMS position error [m], seeds 0-{len(seeds) - 1}, Python {platform.python_version()}")
    print(f"{'controller':28}{'median':>9}{'min':>9}{'max':>9}{'less than bs':>14}")
    plain = statistics.median(errors[CONTROLLERS[0]])
    for controller, values in errors.items():
        median = statistics.median(values)
        less = f"{100.0 * (1.0 - median / plain):.0f} %"
        print(f"{controller:28}{median:9.4f}{min(values):9.4f}{max(values):9.4f}{less:>14}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
