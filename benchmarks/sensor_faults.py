"""Faults of sensors in simulated runs: are they named, and is none reported of a clean run?

``python -m benchmarks.sensor_faults [--seeds N] [--learn N]``. Runs of CyberShip Enterprise 1 in closed
loop, with noise, freezes and spikes of the pose; velocity and yaw rate are measured too. Each fault
is put into runs of the nominal ship, and of one with a hidden effect, for which ``--learn`` looks in
some of the seeds.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import pi
from typing import NamedTuple

import numpy as np

import diagnosis
from diagnosis import Run
from diagnosis.runs import SensorFinding, examine
from fmus.ship import ship

from .hidden_effects.fleet import Order, sail_all
from .hidden_effects.manoeuvres import manoeuvres
from .hidden_effects.simulated_runs import Hidden, Voyage

HIDDEN = {"delta_X_u": -2.0}  # N.s/m, of the ships that have an effect
NOISE = (2e-3, 2e-3, 1e-3)  # m/s, m/s, rad/s; of velocity and yaw rate
CLOCK, PERIODS = 0.2, (37.0, 91.0)  # largest error of the rate of a clock that wanders; s, its periods
EVEN = 1.05  # rate of a clock that is off throughout
LOST, AT = 12.0, 120.0  # s that a clock loses, and when
SPEED, RATE, BIAS = 0.95, 1.04, 0.01  # scales; rad/s
AXIS, PLACE, LATE = 0.05, 0.3, 0.4  # rad, m, s
EVERY = 25  # rows between two telegrams of an angle that is interpolated


class Fault(NamedTuple):
    """What is wrong.

    Attributes:
        channel, kind: that a finding should have.
        value: that it should have; None: it is no single one.
        put: into a run, with the random numbers of the run.
    """

    channel: str
    kind: str
    value: float | None
    put: Callable[[Run], Run]


def _with(run: Run, **channels: np.ndarray) -> Run:
    return replace(run, measured=dict(run.measured) | channels)


def _late(run: Run, name: str) -> np.ndarray:
    return np.interp(run.time - LATE, run.time, run.measured[name])


def _wandering(run: Run) -> Run:
    """The log's time, of which d(true)/d(log) is between 0.8 and 1.2."""
    parts = sum(CLOCK / 2.0 * p / (2.0 * pi) * np.sin(2.0 * pi * run.time / p) for p in PERIODS)
    return replace(run, time=run.time + parts)


def _gap(run: Run) -> Run:
    keep = (run.time <= AT) | (run.time >= AT + LOST)
    cut = run.rows(keep)
    return replace(cut, time=np.where(cut.time <= AT, cut.time, cut.time - LOST + 0.02))


def _wrapped(run: Run) -> Run:
    """The heading within a turn about what it mostly is, a telegram each half second, lines between."""
    good = np.isfinite(run.pose[:, 2])
    psi = np.interp(run.time, run.time[good], np.unwrap(run.pose[good, 2]))
    at, cut = np.arange(0, run.time.size, EVERY), float(np.median(psi))
    line = np.interp(run.time, run.time[at], cut + np.mod(psi[at] - cut, 2.0 * pi))
    return replace(run, pose=np.column_stack([run.pose[:, :2], line]))


def _turned(run: Run) -> Run:
    return replace(run, pose=run.pose + np.array([0.0, 0.0, AXIS]))


def _moved(run: Run) -> Run:
    """The velocity as of a place aft of the position."""
    return _with(run, v=run.measured["v"] - PLACE * run.measured["r"])


CLEAN = "none"
FAULTS = {
    CLEAN: Fault("", "", None, lambda run: run),
    "clock wanders": Fault("time", "clock_rate", None, _wandering),
    "clock slow": Fault("time", "clock_rate", EVEN, lambda r: replace(r, time=r.time / EVEN)),
    "clock jumps": Fault("time", "clock_gap", LOST, _gap),
    "speed scale": Fault(
        "u", "scale", SPEED, lambda r: _with(r, u=SPEED * r.measured["u"], v=SPEED * r.measured["v"])
    ),
    "rate scale": Fault("r", "scale", RATE, lambda r: _with(r, r=RATE * r.measured["r"])),
    "rate offset": Fault("r", "offset", BIAS, lambda r: _with(r, r=r.measured["r"] + BIAS)),
    "rate in degrees": Fault(
        "r", "scale", 180.0 / pi, lambda r: _with(r, r=np.degrees(r.measured["r"]))
    ),
    "heading axis": Fault("psi", "offset", AXIS, _turned),
    "place": Fault("x", "place", PLACE, _moved),
    "rate late": Fault("r", "delay", LATE, lambda r: _with(r, r=_late(r, "r"))),
    "speed late": Fault("u", "delay", LATE, lambda r: _with(r, u=_late(r, "u"), v=_late(r, "v"))),
    "heading wrapped": Fault("psi", "wrap", None, _wrapped),
}


def voyages(seeds: int, vessel: dict[str, float]) -> Iterator[tuple[int, Run]]:
    """Measured runs, three manoeuvres a seed, with velocity and yaw rate."""
    orders = [
        Order(m, Hidden(vessel=vessel), 1.0, seed) for seed in range(seeds) for m in manoeuvres(seed)[:3]
    ]
    for order, voyage in zip(orders, sail_all(orders), strict=True):
        if isinstance(voyage, Voyage):
            rng = np.random.default_rng([order.seed, 7])
            noisy = voyage.nu + NOISE * rng.standard_normal(voyage.nu.shape)
            beside = dict(zip(("u", "v", "r"), noisy.T, strict=True))
            yield order.seed, replace(voyage.measured, measured=beside)


def named(fault: Fault, findings: Sequence[SensorFinding]) -> bool:
    """Whether a fault is reported, with a size within a tenth or its interval."""
    for f in findings:
        if (f.channel, f.kind) != (fault.channel, fault.kind):
            continue
        if fault.value is None or f.ci95[0] <= fault.value <= f.ci95[1]:
            return True
        if abs(f.value - fault.value) < 0.1 * abs(fault.value):
            return True
    return False


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sensor_faults", description=__doc__)
    parser.add_argument("--seeds", type=int, default=2, help="of manoeuvres, noise and faults (2)")
    parser.add_argument(
        "--learn", type=int, default=0, metavar="N", help="learn the hidden effect too, in N seeds (0)"
    )
    options = parser.parse_args(arguments)
    scale = ship().scale
    fleets = [list(voyages(options.seeds, hidden)) for hidden in ({}, HIDDEN)]
    total: Counter[str] = Counter()
    print("| fault | named | with another fault | effect found |")
    print("|---|--:|--:|--:|")
    for name, fault in FAULTS.items():
        count: Counter[str] = Counter()
        for _, run in (each for runs in fleets for each in runs):
            found = examine(fault.put(run), scale).findings
            count["runs"] += 1
            count["named"] += named(fault, found)
            count["another"] += any((f.channel, f.kind) != fault[:2] for f in found)
        learn = [(seed, fault.put(run)) for seed, run in fleets[1] if seed < options.learn]
        count += learned(learn)
        line = _row(name, count)
        print(line.replace(f"0/{count['runs']} |", "– |", 1) if name == CLEAN else line, flush=True)
        total += count if name != CLEAN else Counter()
    print(_row("all faults", total))


def _row(name: str, count: Counter[str]) -> str:
    """A line of the table."""
    named, another = (f"{count[k]}/{count['runs']}" for k in ("named", "another"))
    effect = f"{count['found']}/{count['learned']}" if count["learned"] else "–"
    return f"| {name} | {named} | {another} | {effect} |"


def learned(runs: Sequence[tuple[int, Run]]) -> Counter[str]:
    """In how many seeds the hidden effect is first among what is learned, of how many."""
    by_seed = defaultdict(list)
    for seed, run in runs:
        by_seed[seed].append(run)
    count: Counter[str] = Counter()
    for each in by_seed.values():
        found = diagnosis.diagnose(diagnosis.gather(each)).learned.effects
        count["learned"] += 1
        count["found"] += bool(found) and "X_u" in (found[0].id, *found[0].alike)
    return count


if __name__ == "__main__":
    main()
