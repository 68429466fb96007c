"""What the thesis says of its observers, 6.3.3 and 6.3.7, and what the simulated runs say to it."""

from collections.abc import Mapping, Sequence

import numpy as np

from studies.study_report import Report, Verdict

from ..monte_carlo import SampleMean, interval, paired
from .estimates_replayed import OBSERVERS, SIGNALS

KEPT, GONE = 0.05, 0.5  # 1, of a velocity that is kept or not through a freeze; chosen
BAD = 1.0  # rad/s, error of a yaw rate that is useless, twice the ship's largest; chosen

Runs = Mapping[str, Sequence[Mapping[str, Mapping[str, float]]]]


def _each(found: Runs, variant: str, observer: str, measure: str) -> list[float]:
    """A measure over the runs in which it could be taken."""
    return [x for run in found[variant] if np.isfinite(x := run[observer][measure])]


def _mean(found: Runs, variant: str, observer: str, measure: str) -> SampleMean:
    return interval(_each(found, variant, observer, measure) or [float("nan")])


def _less(found: Runs, variant: str, measure: str, a: str, b: str) -> bool:
    """Whether a measure of observer a is surely below that of b, seed by seed."""
    x, y = _each(found, variant, a, measure), _each(found, variant, b, measure)
    return len(x) == len(y) > 0 and (paired(x, y).high < 0.0 if len(x) > 1 else x < y)


def lag_and_noise(found: Runs) -> Verdict:
    clean = "rich, no freezes"
    others = ("nonlinear", "luenberger")
    numbers = "; ".join(
        f"{o}: lag {_mean(found, clean, o, 'lag_u')} s, noise {_mean(found, clean, o, 'noise_u')} m/s"
        for o in ("mdf", *others)
    )
    gains = "K_1 = 6 1/s, K_2 = 9 1/s²; others: `python -m thesis.observer_gains`"
    return Verdict(
        "The derivative filter lags behind the other observers, but is less noisy",
        {f"lag, {o}": _less(found, clean, "lag_u", o, "mdf") for o in others}
        | {f"noise, {o}": _less(found, clean, "noise_u", "mdf", o) for o in others},
        f"surely less seed by seed; u, rich without freezes, {gains}: {numbers}",
    )


def held(found: Runs) -> Verdict:
    mdf, df = (_mean(found, "rich", o, "held") for o in ("mdf", "df"))
    holds = abs(mdf.mean - 1.0) < KEPT and abs(df.mean) < GONE
    numbers = (
        f"share of u left after a freeze of at least 0.5 s, within {KEPT:g} of 1 and below {GONE:g}: "
        f"MDF {mdf}, DF {df}"
    )
    said = "During a freeze the MDF keeps the velocity constant, the DF takes it to zero"
    return Verdict(said, holds, numbers)


def spikes(found: Runs) -> Verdict:
    holds = _less(found, "rich", "after_freeze_u", "mdf", "df")
    numbers = ", ".join(f"{o} {_mean(found, 'rich', o, 'after_freeze_u')} m/s" for o in OBSERVERS)
    said = "The spikes after a freeze are smaller with the MDF than with the DF"
    return Verdict(said, holds, f"largest error of u within 1 s of a freeze, rich: {numbers}")


def robust(found: Runs) -> Verdict:
    holds = all(_less(found, "rich", "after_freeze_u", "df", o) for o in ("nonlinear", "luenberger"))
    numbers = ", ".join(
        f"{o} {_mean(found, 'rich', o, 'after_freeze_u')} m/s" for o in ("df", "nonlinear", "luenberger")
    )
    said = (
        "The DF recovers from the jump after a freeze better than the nonlinear and the "
        "Luenberger observer"
    )
    return Verdict(said, holds, f"largest error of u within 1 s of a freeze, rich: {numbers}")


def wrap(found: Runs) -> Verdict:
    df, mdf = (_mean(found, "ellipse", o, "after_wrap_r") for o in ("df", "mdf"))
    holds = df.mean > BAD > 10.0 * mdf.mean
    said = "The DF does not handle a wrap of the heading, the MDF does"
    numbers = (
        f"largest error of r within 1 s of a wrap, ellipse, above {BAD:g} and below {0.1 * BAD:g}: DF "
        f"{df} rad/s, MDF {mdf} rad/s"
    )
    return Verdict(said, holds, numbers)


def stuck(found: Runs) -> Verdict:
    upsets = "ellipse, upsets"
    counts = {o: sum(_each(found, upsets, o, "stuck")) for o in OBSERVERS}
    numbers = ", ".join(f"{o} {count:.0f}" for o, count in counts.items())
    return Verdict(
        "The nonlinear and the Luenberger observer remain at NaN after large spikes",
        {o: counts[o] > 0.0 for o in ("nonlinear", "luenberger")},
        f"of {len(found[upsets])} runs with NaN, zeros and spikes of 10 m and 1 km, those that end "
        f"without an estimate; here their velocity is limited: {numbers}",
    )


def write(report: Report, found: Runs) -> None:
    """The table of claims, and what is new here: how far the Kalman filter is ahead."""
    rows = [claim(found) for claim in (lag_and_noise, held, spikes, robust, wrap, stuck)]
    report.heading("Statements of the thesis, and results here")
    report.why(
        "K_1 and K_2, which the thesis does not give, decide the lag of the observers, and this "
        "project's observers reject NaN and spikes."
    )
    report.verdicts("claims", rows)
    report.heading("The Kalman filter compared with the best of the others")
    report.text(
        "RMS error of the Kalman filter divided by that of the best other observer for this "
        "signal and run; geometric mean over the seeds with its 95 % interval. Below 1, the "
        "Kalman filter is the best."
    )
    table = {variant: ahead(runs) for variant, runs in found.items()}
    report.table(["run", *SIGNALS], [[v, *(row[s] for s in SIGNALS)] for v, row in table.items()])
    report.result("kalman_to_best", table)


def ahead(runs: Sequence[Mapping[str, Mapping[str, float]]]) -> dict[str, SampleMean]:
    """Signal -> error of the Kalman filter over the least of the others', by seed."""
    found = {}
    for signal in SIGNALS:
        key = f"rms_{signal}"
        others = [o for o in OBSERVERS if o != "kalman"]
        best = min(others, key=lambda o: np.mean([np.log(run[o][key]) for run in runs]))
        logs = interval([float(np.log(run["kalman"][key] / run[best][key])) for run in runs])
        found[signal] = SampleMean(*(float(np.exp(x)) for x in logs))
    return found
