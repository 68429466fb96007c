"""Lag and noise of the observers over K_1 and K_2 (6.3.3): ``python -m thesis.observer_gains``.

The thesis does not give these gains. The filter's lag is a number, theirs a choice: (4.48) has the
characteristic s² + K_1 s + K_2, so that the velocity of the nonlinear observer lags by K_1/K_2 behind a
steady acceleration, and its noise grows with K_2.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from math import sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cosim.dispatch import FinishedRun
from studies.study_command import progress, run_study, study_parser
from studies.study_report import Report, Verdict, records, stored

from .estimators import QUICK_STOP, STOP, variants
from .monte_carlo import interval, run_all
from .observers.estimates_replayed import Log, freezes, lag, observer, peak_after, replay, roughness

# 1/s², up to the largest that the observers take; 9 is what they start with.
K_2 = (2.0, 9.0, 25.0, 50.0)
# Damping ratio of the error: 1 is critical, with 0.7 the passband is widest. K_1 = 2 ζ √K_2.
DAMPING = (1.0, 0.7)
CORRECTING = ("nonlinear", "luenberger")
CLEAN, FROZEN = "rich, no freezes", "rich"


class Behaviour(NamedTuple):
    """Of the estimate of u in one run: lag [s], noise [m/s], largest error after a freeze [m/s]."""

    lag: float
    noise: float
    after_freeze: float


Found = dict[str, Behaviour]


def gains(k_2: float, damping: float) -> dict[str, float]:
    """Parameters of an observer, alike on all axes."""
    k_1 = 2.0 * damping * sqrt(k_2)
    return {f"k1_{a}": k_1 for a in ("x", "y", "psi")} | {f"k2_{a}": k_2 for a in ("u", "v", "r")}


def name_of(observer_name: str, k_2: float, damping: float) -> str:
    return f"{observer_name}, {2.0 * damping * sqrt(k_2):.1f}, {k_2:g}"


def behaviour(log: Log, estimate: Log) -> Behaviour:
    """The numbers of an estimate; NaN after a freeze where there is none."""
    ends = [b for _, b in freezes(log)]
    return Behaviour(
        lag(log, estimate, "u"), roughness(log, estimate, "u"), peak_after(log, estimate, ends, "u")
    )


def analyse(run: FinishedRun) -> Found:
    """Both filters, and both observers with each pair of gains, on one run."""
    run.demand()
    found = {name: behaviour(run.log, replay(observer(name), run.log)) for name in ("df", "mdf")}
    for name in CORRECTING:
        for k_2 in K_2:
            for damping in DAMPING:
                estimate = replay(observer(name), run.log, **gains(k_2, damping))
                found[name_of(name, k_2, damping)] = behaviour(run.log, estimate)
    return found


def _values(runs: Sequence[Found], name: str, number: str) -> list[float]:
    return [x for run in runs if np.isfinite(x := getattr(run[name], number))] or [float("nan")]


def _mean(runs: Sequence[Found], name: str, number: str) -> float:
    return float(np.mean(_values(runs, name, number)))


def claims(found: Mapping[str, Sequence[Found]]) -> list[Verdict]:
    """With which gains both observers lag less and are noisier than the filter, and jump more."""
    clean, frozen = found[CLEAN], found[FROZEN]
    swift, jumpy = {}, {}
    for k_2 in K_2:
        for damping in DAMPING:
            both = [name_of(name, k_2, damping) for name in CORRECTING]
            gain = f"({2.0 * damping * sqrt(k_2):.1f} {k_2:g})"
            lags = all(_mean(clean, b, "lag") < _mean(clean, "mdf", "lag") for b in both)
            noisy = all(_mean(clean, b, "noise") > _mean(clean, "mdf", "noise") for b in both)
            jumps = [_mean(frozen, b, "after_freeze") for b in both]
            swift[gain] = lags and noisy
            jumpy[gain] = min(jumps) > _mean(frozen, "df", "after_freeze")
    tried = "(K_1 [1/s] K_2 [1/s²]), both observers against the filter by their means, table below"
    return [
        Verdict(
            "The derivative filter lags behind the other observers, but is less noisy", swift, tried
        ),
        Verdict("The DF recovers from the jump after a freeze better than the two others", jumpy, tried),
    ]


def table(report: Report, found: Mapping[str, Sequence[Found]]) -> None:
    """Both observers over their gains, beside the filters."""
    rows = []
    for name in found[CLEAN][0]:
        which, k_1, k_2 = (*name.split(", "), "–", "–")[:3]
        cells = [interval(_values(found[CLEAN], name, n)) for n in ("lag", "noise")]
        rows.append([which, k_1, k_2, *cells, interval(_values(found[FROZEN], name, "after_freeze"))])
    header = ["observer", "K_1 [1/s]", "K_2 [1/s²]", "lag [s]", "noise [m/s]", "after a freeze [m/s]"]
    report.table(header, rows)


def run(seeds: Sequence[int], stop: float, jobs: int | None) -> Mapping[str, Sequence[Found]]:
    """Run -> the behaviour of all observers by seed."""
    runs = {name: content for name, content in variants(stop).items() if name in (CLEAN, FROZEN)}
    with progress(len(runs) * len(seeds), "gains") as advance:
        return run_all(runs, seeds, analyse, processes=jobs, advance=advance)


def study(out: Path, seeds: Sequence[int], stop: float, jobs: int | None, again: bool = False) -> Path:
    """Run, or take the behaviours of an earlier run, and write the report; returns its path."""
    earlier = stored(out) if again else None
    found = run(seeds, stop, jobs) if earlier is None else records(Behaviour, earlier["gains"])
    report = Report(out, "Lag and noise of the observers over their gains, 6.3.3", seeds, earlier)
    report.text(
        "The thesis does not give K_1 and K_2. All axes have the same values, K_1 = 2 ζ √K_2 with "
        f"damping ζ = {' and '.join(f'{d:g}' for d in DAMPING)}. The nonlinear observer lags by "
        "K_1/K_2 behind a constant acceleration; the Luenberger observer has the correct model "
        f"here and does not lag. Estimate of u, lag and noise on `{CLEAN}`, largest error within 1 "
        f"s of a freeze on `{FROZEN}`, {stop:g} s each, open loop."
    )
    rows = claims(found)
    report.why("K_1/K_2 is the lag, K_2 the noise; the thesis gives neither.")
    report.verdicts("claims", rows)
    table(report, found)
    report.result("gains", found)
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.observer_gains",
        "Lag, noise and jumps of the nonlinear and the Luenberger observer over K_1 and K_2.",
        "  python -m thesis.observer_gains",
        seeds=3,
        again=True,
    )
    options = parser.parse_args(arguments)
    seeds, stop = range(1 if options.quick else options.seeds), QUICK_STOP if options.quick else STOP
    run_study(partial(study, options.out, seeds, stop, options.jobs, options.again))


if __name__ == "__main__":
    main()
