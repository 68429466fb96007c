"""Tuning the thrust allocation by sway pushes, 6.3.4: ``python -m thesis.allocation``.

A force straight to the side should move the ship sideways and not turn it. Where it turns, the assumed
point of attack p_o is moved until it does not, as was done by hand in the basin, with the result (6.2).
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

import cosim
from cosim.process import scratch_folder
from studies.study_command import progress, run_study, study_parser
from studies.study_report import Report, Verdict, records, stored

from .monte_carlo import Content, SampleMean, interval

# Where the thrust of the hidden ships really acts, forward of where it is assumed [m].
HIDDEN = (-0.05, 0.0, 0.05, 0.18)
REACH = 0.4
NEAR = 0.005  # m, error of a point of attack that counts as found; chosen


class Push(NamedTuple):
    """A push to the side: force [N], how long [s], and the noise of the measured heading [rad]."""

    force: float = 0.3
    seconds: float = 3.0
    noise: float = 0.0003


def scenario(p_x: float, hidden: float, push: Push, seed: int) -> Content:
    """A ship at rest with a commanded sway force and nothing else.

    Args:
        p_x: point of attack that the allocation assumes [m].
        hidden: where the thrust really acts, forward of the origin [m].
        push: the push.
        seed: of the noise.
    """
    return {
        "name": "sway push",
        "step": 0.01,
        "stop": push.seconds,
        "seed": seed,
        "fmus": {
            "vessel": {"path": "vessel.fmu"},
            "thrusters": {
                "path": "thrusters.fmu",
                "parameters": {"p_x": p_x, "attack_point_dx": hidden},
            },
            "observer": {"path": "observer_mdf.fmu"},
        },
        "connections": [
            ["vessel.*", "observer.*"],
            ["vessel.*", "thrusters.*"],
            ["thrusters.tau_act_*", "vessel.tau_*"],
        ],
        "events": [
            {
                "time": 0.0,
                "model": "thrusters",
                "variable": "tau_Y",
                "action": "override",
                "value": push.force,
            }
        ],
        "faults": [{"kind": "noise", "signals": ["observer.psi_m"], "std": push.noise}],
        "log": {"signals": ["observer.psi_m", "vessel.psi"]},
    }


def headings(content: Content) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and measured heading [rad] of a push."""
    with scratch_folder() as folder:
        result = cosim.simulate(cosim.load_scenario(content), folder)
        if result.status != "done":
            raise cosim.SimulationError(f"a push {result.status}: {result.message}")
        log = cosim.read_log(folder)
        return log["time"], np.unwrap(log["observer.psi_m"])


def turn(p_x: float, hidden: float, push: Push, seed: int) -> float:
    """Heading [rad] gained by a push to starboard less that by one to port, halved."""
    gained = []
    for k, side in enumerate((1.0, -1.0)):  # with a noise of its own, which does not cancel
        t, psi = headings(scenario(p_x, hidden, push._replace(force=side * push.force), 2 * seed + k))
        # By the whole run, not by its last noisy sample: the turn grows with the square of time.
        gained.append(float(np.polyfit(t**2, psi - psi[0], 1)[0]) * t[-1] ** 2)
    return 0.5 * (gained[0] - gained[1])


def tune(hidden: float, push: Push, seed: int) -> tuple[float, list[tuple[float, float]]]:
    """The point of attack [m] at which a push does not turn the ship, and all that was tried.

    Raises:
        SimulationError: the ship turns the same way wherever the force is assumed to act.
    """
    tried: list[tuple[float, float]] = []

    def missed(p_x: float) -> float:
        tried.append((p_x, turn(p_x, hidden, push, seed)))
        return tried[-1][1]

    if missed(-REACH) * missed(REACH) > 0.0:
        raise cosim.SimulationError(f"no point of attack within {REACH} m keeps the heading")
    found = brentq(lambda p: dict(tried).get(p) or missed(p), -REACH, REACH, xtol=1e-4)
    return float(found), tried  # pyright: ignore[reportArgumentType]


def tuned(found: Mapping[float, Sequence[float]], offset: float) -> Verdict:
    """Whether tuning finds where the thrust really acts: true point -> estimates [m], common offset."""
    worst = max(abs(x - dx - offset) for dx, each in found.items() for x in each)
    return Verdict(
        "Sway pushes tune the point of attack (6.3.4, Fig. 6.7)",
        worst < NEAR,
        f"largest error of the shift {1e3 * worst:.2g} mm, near below {1e3 * NEAR:g} mm",
    )


def picture(runs: dict[str, tuple[np.ndarray, np.ndarray]]) -> Figure:
    """Headings of pushes before and after tuning."""
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    axes = figure.subplots()
    for name, (t, psi) in runs.items():
        axes.plot(t, np.degrees(psi), label=name)
    axes.set(xlabel="time [s]", ylabel="heading [°]")
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


class Tuned(NamedTuple):
    """Estimated points of attack by seed [m], and how many pairs of pushes each took."""

    points: tuple[float, ...]
    pairs: tuple[int, ...]


def run(seeds: Sequence[int], push: Push, hidden: Sequence[float]) -> dict[float, Tuned]:
    """True point of attack -> what the tuning found."""
    found: dict[float, Tuned] = {}
    with progress(len(hidden) * len(seeds), "tuning") as advance:
        for dx in hidden:
            each = []
            for seed in seeds:
                each.append(tune(dx, push, seed))
                advance()
            found[dx] = Tuned(tuple(p for p, _ in each), tuple(len(tried) for _, tried in each))
    return found


def before_and_after(hidden: float, tuned_: float, push: Push, seed: int) -> Figure:
    """Headings of a push before and after tuning."""
    pushes = {"p_o = 0": 0.0, f"p_o = {tuned_:.3f} m": tuned_}
    return picture({n: headings(scenario(p, hidden, push, seed)) for n, p in pushes.items()})


def study(
    out: Path, seeds: Sequence[int], push: Push, hidden: Sequence[float], again: bool = False
) -> Path:
    """Tune every hidden ship with every seed, or take earlier results, and write the report."""
    earlier = stored(out) if again else None
    if earlier is None:
        every = run(seeds, push, hidden)
    else:
        every = {float(dx): t for dx, t in records(Tuned, earlier["found"]).items()}
        push = records(Push, earlier["push"])
    found = {dx: t.points for dx, t in every.items()}
    steps = [n for t in every.values() for n in t.pairs]
    report = Report(out, "Tuning the thrust allocation (6.3.4)", seeds, earlier)
    report.text(
        f"A ship at rest is commanded {push.force:g} N to starboard and to port for "
        f"{push.seconds:g} s. The assumed point of attack p_o is moved until neither force turns "
        f"the ship. It took {np.mean(steps):.1f} pairs of forces on average. The heading is "
        f"measured with {push.noise:g} rad of noise."
    )
    zero = min(found, key=abs)
    offset = interval(found[zero])
    report.why("the turn of a pushed ship is linear in the assumed point of attack.")
    report.verdicts("claims", [tuned(found, offset.mean - zero)])
    rows = []
    for dx, points in found.items():
        each = interval(points)
        error = SampleMean(*(1000.0 * (x - dx - offset.mean + zero) for x in each))
        rows.append([f"{dx:+.3f}", str(each), str(error)])
    header = ["true point of attack [m]", "estimated p_o [m]", "error of the shift [mm]"]
    report.table(header, rows)
    report.text(
        f"With the thrust at its assumed point, p_o = {offset.mean:.4f} m. The hull's own centre "
        "of resistance and inertia in sway is not at the body origin (x_g = 0.0375 m and the "
        "added mass), so a force at the origin turns the ship slightly. The tuned value is the "
        "sum of both, as in the basin, where (6.2) gave 0.18 m."
    )
    worst = max(found, key=abs)
    report.figure(
        "heading",
        partial(before_and_after, worst, found[worst][0], push, report.seeds[0]),
        f"A sway force with the thrust acting {worst:+g} m away (Fig. 6.7).",
    )
    report.result("found", {f"{dx:+.3f}": t for dx, t in every.items()})
    report.result("push", push)
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.allocation",
        "Find the point of attack of the thrust allocation from sway forces (6.3.4).",
        "  python -m thesis.allocation\n  python -m thesis.allocation --hidden 0.18 --seeds 1",
        seeds=3,
        jobs=False,
        again=True,
    )
    parser.add_argument(
        "--hidden", type=float, nargs="+", default=list(HIDDEN), metavar="M", help="hidden offsets [m]"
    )
    parser.add_argument(
        "--force", type=float, default=Push().force, help="sway force [N] (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    seeds = range(1 if options.quick else options.seeds)
    push = Push(force=options.force)
    run_study(partial(study, options.out, seeds, push, options.hidden, options.again))


if __name__ == "__main__":
    main()
