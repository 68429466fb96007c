"""Compute the force of a ship's thrusters at rest and full command.

``cybership bollard-pull [SHIP]``.
"""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence

import numpy as np

from cosim import InputError
from cosim.command import BAD_INPUT, complain, program, run_command
from diagnosis.predictors import ship_with


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog=program("jet_boat.bollard_pull"), description=__doc__)
    parser.add_argument("ship", nargs="?", default="jet_boat", metavar="SHIP", help="ship (jet_boat)")
    try:
        ship = ship_with([], parser.parse_args(arguments).ship)
    except InputError as error:
        complain(error)
        return BAD_INPUT
    X, Y, N = ship.commanded_force(np.ones((1, len(ship.layout.commands))))[0]
    print(f"{X:.2f} N, {Y:.2f} N, {N:.2f} N m")
    return 0


if __name__ == "__main__":
    run_command(main)
