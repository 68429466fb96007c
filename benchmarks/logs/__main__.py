"""How logs are read as others record them: ``python -m benchmarks.logs GOOD [--ship NAME]``.

GOOD is a good log. It is recorded in some 60 ways: slower than its file, held or interpolated, filtered,
rounded, with outliers, jumps of the clock, and a noise that is stated rightly or wrongly. Of each way:
whether it is refused, the noise that is found over the one there is, and, with ``--learn``, the verdict
and the error of the learned model on another good log, beside those of the good log itself.
"""

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from diagnosis.predictors import ship_with
from diagnosis.runs import prepare, read_frame, table_of

from .recorded import SURE, Good, Recorded, recorded
from .ways_to_log import POSE, WAYS

CLEAN = "clean"
WITHIN = 0.3  # of the noise that there is; issue: the estimate counts as right


def good_log(path: Path, ship: str | None, test: Path | None) -> Good:
    """A good log at even times, pose and commands alone, without spikes and stretches without a pose.

    At each time it has the smoothed motion and the residual of the nearest sample, so that times that
    were uneven are no noise.
    """
    craft = ship_with((), ship)
    s = prepare(path, craft).smoothed
    run, eta = s.track.run.rows(s.used), s.eta[s.used]
    time = np.arange(run.time[0], run.time[-1], float(np.median(np.diff(run.time))))
    before = np.searchsorted(run.time, time + 1e-9, side="right") - 1
    after = np.minimum(before + 1, run.time.size - 1)
    nearest = np.where(run.time[after] - time < time - run.time[before], after, before)
    table = pd.DataFrame(table_of(run.rows(before)), columns=["time", *POSE, *run.commanded])
    table["time"] = time - time[0]
    table[POSE] = CubicSpline(run.time, eta)(time) + (s.track.pose[s.used] - eta)[nearest]
    by_pose = prepare(read_frame(table, of=craft), craft).smoothed
    return Good(table, by_pose.noise, ship, test)


def line(o: Recorded, clean: Recorded | None) -> str:
    """A row of the table that is printed."""
    ratio = " ".join("-" if np.isnan(r) else f"{r:.2f}" for r in o.noise)
    told = ", ".join(f"{e} {'-' if c is None else f'{c:.2f}'}" for e, c in o.found.items())
    error = f"{o.error / clean.error:.2f}" if clean is not None and o.error > 0.0 else "-"
    return f"| {o.way} | {o.refused or ratio} | {o.verdict} {told} | {error} | {o.seconds:.0f} |"


def summary(found: Sequence[Recorded]) -> str:
    """What there is to say of all ways together."""
    read_ones = [o for o in found if not o.refused]
    ratios = np.array([r for o in read_ones for r in o.noise if np.isfinite(r) and "times" not in o.way])
    near = np.mean(np.abs(np.log(ratios)) < np.log1p(WITHIN)) if ratios.size else np.nan
    text = [f"{len(read_ones)} of {len(found)} read; noise within {WITHIN:.0%}: {near:.0%} of channels"]
    clean = next((o for o in found if o.way == CLEAN), None)
    if clean is not None and clean.verdict:
        others = [o for o in read_ones if o is not clean]
        kept = [o for o in others if o.verdict == clean.verdict and {*o.found} == {*clean.found}]
        sure = [
            o for o in others if {e for e, c in o.found.items() if (c or 0.0) >= SURE} - {*clean.found}
        ]
        text.append(f"{len(kept)} of {len(others)} keep verdict and cause; sure of another: {len(sure)}")
        if clean.error > 0.0:
            errors = np.array([o.error for o in others]) / clean.error
            text.append(
                f"error on the test run: median {np.median(errors):.2f}, worst {errors.max():.2f}"
            )
    return "; ".join(text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.logs", description=__doc__)
    parser.add_argument("good", type=Path, metavar="GOOD", help="measurement, or folder of a run")
    parser.add_argument("--ship", metavar="NAME|FILE", help="that was measured")
    parser.add_argument("--only", nargs="+", choices=list(WAYS), metavar="WAY", help="of the ways")
    parser.add_argument("--learn", action="store_true", help="look for the cause")
    parser.add_argument("--test", type=Path, metavar="RUN", help="another good log, for the error")
    parser.add_argument("--seed", type=int, default=0, help="of all that is random (0)")
    parser.add_argument("--workers", type=int, default=1, help="processes (1)")
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="for the results")
    options = parser.parse_args(arguments)
    good = good_log(options.good, options.ship, options.test)
    found: list[Recorded] = []
    print("| way | noise found / there | cause | error / clean | s |\n|---|---|---|--:|--:|")
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        ways = options.only or WAYS
        tasks = [pool.submit(recorded, way, good, options.seed, options.learn) for way in ways]
        for task in tasks:
            found.append(task.result())
            print(line(found[-1], found[0] if found[0].way == CLEAN else None), flush=True)
    print(f"\n{summary(found)}")
    if options.out:
        options.out.write_text(json.dumps([asdict(o) for o in found], indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
