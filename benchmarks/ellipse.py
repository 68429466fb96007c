"""Does adaptation pay? ``python -m benchmarks.ellipse [--seeds N]``.

Runs scenarios/ellipse.json without adaptation, with it, and with concurrent learning, and prints the RMS
of the true position error after the first 20 s, over several seeds.
"""

import argparse
import platform
import statistics
import sys
from collections.abc import Sequence

from thesis.monte_carlo import run_all, shipped, vary

CONTROLLERS = ("controller_bs.fmu", "controller_abs.fmu", "controller_cl_win_eps.fmu")


def over_seeds(seeds: Sequence[int]) -> dict[str, list[float]]:
    """Controller -> RMS of the true position error [m] for each seed, after the first 20 s."""
    variants = {name: vary(shipped("ellipse"), {"controller": name}) for name in CONTROLLERS}
    found = run_all(variants, seeds, processes=2)
    return {name: [metrics["e_pos_rms"] for metrics in each] for name, each in found.items()}


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
