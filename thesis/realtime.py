"""Hardware in the loop, in software (6.3.2): ``python -m thesis.realtime``.

The thesis ran its controllers against a simulated ship on the ship's own computer, to see whether the
computer keeps up. Here the same scenario is paced to the wall clock, at 1 and more times real time: how
often is a step late, and does anything else change?
"""

import hashlib
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

import cosim
from studies.study_command import progress, run_study, study_parser
from studies.study_report import Report, Verdict, records, stored

from .monte_carlo import Content, shipped, vary

CONTROLLERS = ("controller_bs", "controller_abs", "controller_cl_win_z2", "controller_cl_svd_eps")
FACTORS = (1.0, 10.0, 100.0)
SINGLE = 0.01  # 1, share of late steps up to which they are single ones; chosen


class Paced(NamedTuple):
    """A run against the clock: late steps, all steps, latest and jitter [s], hash of the log."""

    misses: int
    steps: int
    worst: float
    jitter: float
    log: str


def run(content: Content, factor: float | None, folder: Path) -> Paced:
    """Run a scenario at ``factor`` times the wall clock; None: as fast as it goes.

    Raises:
        SimulationError: the run failed.
    """
    result = cosim.simulate(cosim.load_scenario(content), folder, realtime=factor)
    if result.status == "interrupted":
        raise KeyboardInterrupt
    if result.status != "done":
        raise cosim.SimulationError(f"'{folder}' {result.status}: {result.message}")
    digest = hashlib.sha256((folder / "log.csv").read_bytes()).hexdigest()
    pace = result.pace or {"deadline_misses": 0, "lateness_max": 0.0, "jitter_rms": 0.0}
    steps = round(content["stop"] / content["step"])
    return Paced(int(pace["deadline_misses"]), steps, pace["lateness_max"], pace["jitter_rms"], digest)


def picture(runs: dict[str, dict[float, Paced]], step: float) -> Figure:
    """Jitter and largest lateness over the factor, with the deadline."""
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    factors = list(next(iter(runs.values())))
    for axes, title, which in ((left, "jitter", "jitter"), (right, "largest lateness", "worst")):
        for name, by_factor in runs.items():
            lateness = [1000.0 * getattr(by_factor[f], which) for f in factors]
            axes.loglog(factors, lateness, "o-", label=name)
        axes.loglog(factors, [1000.0 * step / f for f in factors], "k--", label="deadline: one step")
        axes.set(title=title, xlabel="times real time", ylabel="[ms]")
        axes.grid(alpha=0.3)
    right.legend(fontsize=7)
    return figure


def fast_enough(runs: Mapping[str, Mapping[float, Paced]]) -> Verdict:
    """Whether every controller keeps its deadlines at the slowest pace, but for single steps."""
    slowest = {name: (min(by_factor), by_factor[min(by_factor)]) for name, by_factor in runs.items()}
    late = {name: p.misses / p.steps for name, (_, p) in slowest.items()}
    return Verdict(
        "The control system is fast enough for real time (6.3.2)",
        {n: x < SINGLE for n, x in late.items()},
        f"share of late steps, below {SINGLE:g}: "
        + ", ".join(f"{n} {x:.2g} at {slowest[n][0]:g} times real time" for n, x in late.items()),
    )


def paced(
    out: Path, content: Content, factors: Sequence[float], controllers: Sequence[str]
) -> dict[str, dict[float, Paced]]:
    """Controller -> factor -> its run; the factor 0 is the run that is not paced."""
    runs: dict[str, dict[float, Paced]] = {}
    with progress(len(controllers) * (len(factors) + 1), "pacing") as advance:
        for name in controllers:
            own = vary(content, {"controller": f"{name}.fmu"})
            runs[name] = {}
            for factor in (0.0, *factors):
                runs[name][factor] = run(own, factor or None, out / "logs" / name / f"{factor:g}")
                advance()
    return runs


def study(
    out: Path,
    seconds: float,
    factors: Sequence[float],
    controllers: Sequence[str],
    again: bool = False,
) -> Path:
    """Pace every controller at every factor, or take earlier runs, and write the report."""
    ellipse = vary(shipped("ellipse"), stop=seconds, metrics={"from": 0.0})
    earlier = stored(out) if again else None
    if earlier is None:
        every = paced(out, ellipse, factors, controllers)
    else:
        every = {
            n: {float(f): p for f, p in each.items()}
            for n, each in records(Paced, earlier["runs"]).items()
        }
    runs = {n: {f: p for f, p in each.items() if f} for n, each in every.items()}
    report = Report(out, "Hardware in the loop in software (6.3.2)", [ellipse["seed"]], earlier)
    report.text(
        f"The ellipse with noise and freezes, {seconds:g} s in steps of {ellipse['step']:g} s, in "
        "real time. A step misses its deadline when it ends more than one step late. Jitter is "
        "the standard deviation of the lateness."
    )
    header = ["controller", "times real time", "deadline misses", "largest lateness [ms]", "jitter [ms]"]
    rows = [
        [name, f"{factor:g}", f"{p.misses} of {p.steps}", 1000.0 * p.worst, 1000.0 * p.jitter]
        for name, by_factor in runs.items()
        for factor, p in by_factor.items()
    ]
    report.why("single late steps come from other work of the operating system.")
    report.verdicts("claims", [fast_enough(runs)])
    report.table(
        [*header, "log as without pacing"],
        [
            [*row, "same" if every[row[0]][float(row[1])].log == every[row[0]][0.0].log else "different"]
            for row in rows
        ],
    )
    report.figure("pace", partial(picture, runs, ellipse["step"]), "Lateness and deadline.")
    report.text(
        "The operating system is not a real-time system: other load of the machine causes single "
        "late steps, and the next run of this study gives other numbers. Real time must not "
        "change the simulation itself; the last column compares the logs byte by byte."
    )
    report.result("runs", every)
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.realtime",
        "Run a scenario in real time, and report deadline misses and jitter (6.3.2).",
        "  python -m thesis.realtime\n  python -m thesis.realtime --factor 1 2 5 --seconds 10",
        seeds=None,
        jobs=False,
        again=True,
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=20.0,
        metavar="S",
        help="simulated time of a run (default: %(default)s)",
    )
    parser.add_argument(
        "--factor", type=float, nargs="+", default=list(FACTORS), metavar="F", help="times real time"
    )
    options = parser.parse_args(arguments)
    if options.quick:
        options.seconds, options.factor = min(options.seconds, 2.0), options.factor[-1:]
    run_study(partial(study, options.out, options.seconds, options.factor, CONTROLLERS, options.again))


if __name__ == "__main__":
    main()
