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
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from diagnosis.predictors import ship_with
from diagnosis.runs import prepare, read_frame, table_of

from .aims import CLEAN, aims, line
from .recorded import Good, Recorded, recorded
from .ways_to_log import POSE, WAYS


def good_log(path: Path, part: Sequence[float] | None, ship: str | None, rate: float, seed: int) -> Good:
    """A good log at even times, pose and commands alone, without spikes and stretches without a pose.

    Its pose is the smoothed motion and the residual of the nearest sample, so that times that were
    uneven are no noise; where the log is quicker than the measurement was, a residual drawn at random.

    Args:
        path: of the measurement.
        part: from when to when it is taken, as its time counts [s]; None: all of it.
        ship: name or file; None: the default one.
        rate: of the log [Hz].
        seed: of what is drawn.
    """
    craft = ship_with((), ship)
    prepared = prepare(path, craft)
    if part is not None:
        first, last = part
        prepared = prepared.part((prepared.track.run.time >= first) & (prepared.track.run.time <= last))
    s = prepared.smoothed
    run, eta = s.track.run.rows(s.used), s.eta[s.used]
    time = np.arange(run.time[0], run.time[-1], 1.0 / rate)
    before = np.searchsorted(run.time, time + 1e-9, side="right") - 1
    after = np.minimum(before + 1, run.time.size - 1)
    sample = np.where(run.time[after] - time < time - run.time[before], after, before)
    if rate * s.track.period > 1.5:
        sample = np.random.default_rng(seed).integers(run.time.size, size=time.size)
    acting = np.searchsorted(s.time, time + 1e-9, side="right") - 1
    table = pd.DataFrame(table_of(s.track.run.rows(acting)), columns=["time", *POSE, *run.commanded])
    table["time"] = time - time[0]
    motion = CubicSpline(run.time, eta)(time)
    table[POSE] = motion + (s.track.pose[s.used] - eta)[sample]
    by_pose = prepare(read_frame(table, of=craft), craft).smoothed
    return Good(table, motion, by_pose.noise, ship)


def _answers(file: Path | None, of: object, parser: argparse.ArgumentParser) -> dict[str, Recorded]:
    """Way -> what an earlier call with the same arguments made of it, which goes on where that ended."""
    if file is None or not file.is_file():
        return {}
    content = json.loads(file.read_text(encoding="utf-8"))
    if content["of"] != of:
        parser.error(f"'{file}' holds results of other arguments: {content['of']}; name another file")
    return {way["way"]: Recorded.of(way) for way in content["ways"]}


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.logs", description=__doc__)
    parser.add_argument("good", type=Path, metavar="GOOD", help="measurement, or folder of a run")
    parser.add_argument("--part", nargs=2, type=float, metavar="S", help="from when to when of it [s]")
    parser.add_argument("--ship", metavar="NAME|FILE", help="that was measured")
    parser.add_argument("--rate", type=float, default=10.0, metavar="HZ", help="of the good log (10)")
    parser.add_argument("--only", nargs="+", choices=list(WAYS), metavar="WAY", help="of the ways")
    parser.add_argument("--learn", action="store_true", help="look for the cause")
    parser.add_argument("--test", type=Path, metavar="RUN", help="another good log, for the error")
    parser.add_argument("--test-part", nargs=2, type=float, metavar="S", help="of that")
    parser.add_argument("--there", nargs="*", metavar="EFFECT", help="effects that there are, if known")
    parser.add_argument("--seed", type=int, default=0, help="of all that is random (0)")
    parser.add_argument("--workers", type=int, default=1, help="processes (1)")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.json", help="for the results; it goes on with those there"
    )
    o = parser.parse_args(arguments)
    good = good_log(o.good, o.part, o.ship, o.rate, o.seed)
    test = o.test and good_log(o.test, o.test_part, o.ship, o.rate, o.seed)
    asked_for = {n: v for n, v in vars(o).items() if n not in ("only", "workers", "out", "there")}
    of = {n: v.name if isinstance(v, Path) else v for n, v in asked_for.items()}
    before = _answers(o.out, of, parser)
    ways, found = o.only or [*WAYS], list[Recorded]()
    print("| way | noise found / there | cause | error / clean | s |\n|---|---|---|--:|--:|")
    with ProcessPoolExecutor(o.workers, get_context("spawn")) as pool:
        asked = [way for way in ways if way not in before]
        tasks = {way: pool.submit(recorded, way, good, o.seed, o.learn, test) for way in asked}
        for way in ways:
            found.append(before[way] if way in before else tasks[way].result())
            print(line(found[-1], found[0] if found[0].way == CLEAN else None), flush=True)
            if o.out:
                kept = before | {x.way: x for x in found}
                content = {"of": of, "ways": [x.content() for x in kept.values()]}
                o.out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print("\n| aim | number |\n|---|---|")
    for aim, number in aims(found, o.there):
        print(f"| {aim} | {number} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
