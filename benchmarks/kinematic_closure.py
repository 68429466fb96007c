"""What integrated speed, heading and yaw rate of a sea trial miss, before and after its repair.

``python -m benchmarks.kinematic_closure DATA``; DATA holds ``trial_1.csv`` and ``trial_2.csv``
of R/V Gunnerus (NTNU-MCS/MCSim_python, GPL-3.0-or-later), which is not part of this project.
"""

import argparse
import hashlib
from collections.abc import Sequence
from math import degrees
from pathlib import Path

from diagnosis.predictors import Model, ship_with
from diagnosis.runs import closure, examine
from studies.research_vessel import COLUMNS
from studies.ship_folds import read

TRACK, TURN = 60.0, 20.0  # s
SHA256 = {
    "trial_1.csv": "f6f08a351ade36a0f66da08427114ba9cdfdb467b2f589101e149bd05f4c6e99",
    "trial_2.csv": "a1ef69c1a1943d108e721fe1adbf5b5082add16479da4e5835af84051c748cbd",
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.kinematic_closure", description=__doc__)
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of the trials")
    data = parser.parse_args(arguments).data
    model = Model(ship=ship_with((), "gunnerus"))
    print(f"trial    position over {TRACK:g} s, median [m]   heading over {TURN:g} s in turns, RMS [°]")
    for name, known in SHA256.items():
        path = data / name
        run = read(path, COLUMNS, model)
        found = examine(run, model.ship.scale)
        before, after = (closure(r, TRACK, TURN) for r in (run, found.run))
        same = hashlib.sha256(path.read_bytes()).hexdigest() == known
        print(
            f"{path.stem}  {before.position:.3g} -> {after.position:.3g}                     "
            f"{degrees(before.heading):.3g} -> {degrees(after.heading):.3g}"
            f"{'' if same else '   (not the file that was looked at)'}"
        )


if __name__ == "__main__":
    main()
