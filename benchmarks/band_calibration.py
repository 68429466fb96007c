"""Do bands about predictions hold what they say? Windows of runs of which nothing was learned, pooled.

``python -m benchmarks.band_calibration`` reads the answers that ``benchmarks.hidden_effects`` has kept:
a held-out run of a simulated ship each. With ``--ship`` each of the four published runs of CyberShip
Enterprise 1 is left out in turn as well, which takes half an hour. A window of 8 s counts by the share
of its samples within the band, positions and headings alike. The interval is that of as many independent
windows, some inside and the others outside: samples of one window miss together.
"""

import argparse
import json
import os
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from diagnosis import diagnose, load
from diagnosis.assessment.bands import LEVELS

from .hidden_effects.answers import within_bands
from .hidden_effects.reliability_diagram import interval

ANSWERS = Path("docs") / "benchmarks" / "hidden_effects" / "answers"
RUNS = ("random_run1", "run1", "dptest1", "dptest3")  # of CyberShip Enterprise 1
Shares = list[list[float]]


def simulated(folder: Path) -> Iterator[tuple[str, Shares]]:
    """Name and shares of each cell that was answered."""
    for path in sorted(folder.glob("*.json")):
        shares = json.loads(path.read_text(encoding="utf-8")).get("bands")
        if shares:
            yield path.stem, shares


def measured(folder: Path) -> Iterator[tuple[str, Shares]]:
    """Each run of the ship, predicted with what the three others teach."""
    for name in RUNS:
        files = [folder / f"{other}.mat" for other in (*(n for n in RUNS if n != name), name)]
        *train, last = load(files)
        yield name, within_bands(diagnose(train, [last]).comparison)


def line(name: str, shares: Shares) -> str:
    """A row of the table: how many windows, and the share within each band with its interval."""
    cells = []
    for each in shares:
        inside, count = float(np.sum(each)), len(each)
        low, high = interval(round(inside), count)
        cells.append(f"{100 * inside / count:.1f} % ({100 * low:.0f}-{100 * high:.0f} %)")
    return f"| {name} | {len(shares[0])} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.band_calibration", description=__doc__)
    parser.add_argument("--answers", type=Path, default=ANSWERS, metavar="DIR", help=f"({ANSWERS})")
    parser.add_argument("--ship", action="store_true", help="the measured ship, too")
    options = parser.parse_args()
    print("| windows of | count |", " | ".join(f"within {100 * level:.0f} %" for level in LEVELS), "|")
    print("|---|--:|--:|--:|")
    parts = {"simulated ships": simulated(options.answers)}
    if options.ship:
        parts["the measured ship"] = measured(Path(os.environ["CYBERSHIP_DATA"]) / "cse1")
    for name, cells in parts.items():
        found = [shares for _, shares in cells]
        if found:
            print(line(name, [[*chain(*each)] for each in zip(*found, strict=True)]))


if __name__ == "__main__":
    main()
