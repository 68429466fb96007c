"""How soon a failing thruster is noticed, and how often one is reported that does not fail.

    python -m benchmarks.watch_delay                       # 200 runs
    python -m benchmarks.watch_delay --runs 24 --out results/watch

Half of the runs have no failure. The detector is ``watch_thrusters``; beside it the threshold on the
losses of thrust that concurrent learning estimates (``controller_cl_improved``), as 7.2.5 proposes. Both
see the same estimates of the modified derivative filter. All runs of a batch go on at once, an array for
each scalar.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.controller import cl_improved
from fmus.controller.backstepping import Applied, Inputs
from fmus.declare import Component, packer, variables
from fmus.observer import mdf
from fmus.ship import ship
from fmus.signals import Force, Measurement
from fmus.watch import thruster_watch
from studies.study_report import Report

from .hidden_effects.fleet import TOGETHER
from .hidden_effects.simulated_runs import STEP
from .watched_runs import SHARES, Case, Watched, cases, sail_watched

EVERY = 5  # steps of the observer in one of the detectors
PROBABILITIES = (0.01, 0.1, 0.5, 0.9, 0.99, 0.9999, 0.999999)
THRESHOLDS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)


class Told(NamedTuple):
    """What a detector says of a run: times (n,) [s], and scores of VSP and bow thruster (n, 2)."""

    case: Case
    time: np.ndarray
    score: np.ndarray


class Outcome(NamedTuple):
    """All runs at one threshold.

    Attributes:
        per_hour: false alarms in an hour without a failure.
        found: share of the failures that are reported.
        right: share of these in which it is the right thruster.
        delay: median delay of these [s].
    """

    per_hour: float
    found: float
    right: float
    delay: float


def parameters(component: Component, **given: float) -> Any:
    """Start values, but for some."""
    return packer(component.params)([given.get(v.name, v.start) for v in variables(component.params)])


def watched(runs: Sequence[Watched], component: Component, score: Callable[[Any], Any]) -> list[Told]:
    """A component on all runs at once, fed by the observer.

    Args:
        runs: measurements.
        component: takes the inputs of a controller.
        score: of its outputs: one for the VSP and one for the bow thruster.
    """
    steps = max(len(r.time) for r in runs)

    def filled(name: str) -> np.ndarray:
        """(steps, 3, runs); a run that ended earlier keeps its last values."""
        rows = [np.minimum(np.arange(steps), len(r.time) - 1) for r in runs]
        return np.stack([getattr(r, name)[k] for r, k in zip(runs, rows, strict=True)], axis=2)

    pose, tau = filled("pose"), filled("tau")
    seen = parameters(mdf.COMPONENT, measurement_period=STEP)
    first = mdf.COMPONENT.inputs(Measurement(*pose[0]), Force(*tau[0]))
    eye, estimate = mdf.step(mdf.init(first, seen), first, seen, 0.0)
    p = parameters(component)
    state = component.init(Inputs(estimate, applied=Applied(*tau[0])), p)
    found = []
    for k in range(1, steps):
        eye, estimate = mdf.step(
            eye, mdf.COMPONENT.inputs(Measurement(*pose[k]), Force(*tau[k - 1])), seen, STEP
        )
        if k % EVERY == 0:
            acted = Applied(*tau[k - EVERY : k].mean(axis=0))
            state, out = component.step(state, Inputs(estimate, applied=acted), p, EVERY * STEP)
            found.append(np.broadcast_arrays(*score(out), np.zeros(len(runs)))[:2])
    time = EVERY * STEP * np.arange(1, len(found) + 1)
    scores = np.array(found)
    ends = [time <= r.time[-1] for r in runs]
    return [
        Told(r.case, time[m], scores[m, :, j]) for j, (r, m) in enumerate(zip(runs, ends, strict=True))
    ]


def losses(out: Any) -> tuple[Any, Any]:
    """delta_X tells the VSP, delta_Y and delta_N the bow thruster, Fig. 7.3."""
    X, Y, N = out.phi_hat[11:]
    return X, np.maximum(Y, N)


def outcome(stated: Sequence[Told], threshold: float, share: float | None = None) -> Outcome:
    """False alarms of all runs, and failures of one share or all."""
    hours, alarms, failures = 0.0, 0, 0
    delays, right = [], []
    for t in stated:
        above = t.score.max(axis=1) > threshold
        starts = np.flatnonzero(above & ~np.concatenate([[False], above[:-1]]))
        before = t.time < t.case.time
        hours += float(before.sum()) * EVERY * STEP / 3600.0
        alarms += int(before[starts].sum())
        if t.case.thruster is None or share not in (None, t.case.share):
            continue
        failures += 1
        late = np.flatnonzero(above & ~before)
        if late.size:
            delays.append(t.time[late[0]] - t.case.time)
            right.append(("vsp", "bow")[int(t.score[late[0]].argmax())] == t.case.thruster)
    none = float("nan")
    return Outcome(
        alarms / hours,
        len(delays) / failures if failures else none,
        float(np.mean(right)) if right else none,
        float(np.median(delays)) if delays else none,
    )


def report(out: Path, seed: int, detector: Sequence[Told], printed: Sequence[Told]) -> Path:
    """Write the tables; returns the path of the report."""
    made = Report(out, "Failing thrusters: delay and false alarms", [seed])
    hours = sum(float((t.time < t.case.time).sum()) * EVERY * STEP for t in detector) / 3600.0
    failing = sum(t.case.thruster is not None for t in detector)
    made.text(
        f"{len(detector)} runs of 240 s, {failing} with a thruster that loses 100, 50 or 30 % of its "
        f"force after 80 to 160 s; {hours:.2f} h without failure; nominal ship, SYSID4, other damping, "
        "current, lag; noise n1, n4, n10 with freezes and spikes. Found: until the run ends."
    )
    header = ["above", "false alarms per hour"]
    header += [f"{share:.0%}: found, right, median delay [s]" for share in SHARES]
    for name, stated, levels in (
        ("watch_thrusters, probability", detector, PROBABILITIES),
        ("loss of thrust by concurrent learning, 7.2.5", printed, THRESHOLDS),
    ):
        made.heading(name)
        rows = []
        for level in levels:
            by_share = [outcome(stated, level, share) for share in SHARES]
            cells = [f"{o.found:.0%}, {o.right:.0%}, {o.delay:.1f}" for o in by_share]
            rows.append([f"{level:g}", by_share[0].per_hour, *cells])
            made.result(f"{name} {level:g}", dict(zip(map(str, SHARES), by_share, strict=True)))
        made.table(header, rows)
    return made.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.watch_delay",
        description="Delay until a failing thruster is noticed, against false alarms.",
    )
    parser.add_argument("--runs", type=int, default=200, help="half of them with a failure (200)")
    parser.add_argument("--seed", type=int, default=1, help="of ships, manoeuvres and noise (1)")
    parser.add_argument("--out", type=Path, default=Path("results/watch_delay"), help="report folder")
    options = parser.parse_args(arguments)
    todo = cases(options.runs // 2, options.runs - options.runs // 2, options.seed)
    detector: list[Told] = []
    printed: list[Told] = []
    with np.errstate(all="ignore"):
        detecting = thruster_watch.make(ship().effects, ship().description)
        assert detecting is not None
        for first in range(0, len(todo), TOGETHER):
            runs = sail_watched(todo[first : first + TOGETHER])
            detector += watched(runs, detecting, lambda o: tuple(o[:2]))
            printed += watched(runs, cl_improved.COMPONENT, losses)
    print(report(options.out, options.seed, detector, printed))


if __name__ == "__main__":
    main()
