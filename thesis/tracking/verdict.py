"""The conclusions of chapter 5, each with the result of our runs."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import inf, isfinite
from typing import Any

from scipy import stats

from studies.study_report import Verdict

from ..monte_carlo import SampleMean, interval, ratio
from .outcome import TRUE_PHI, TrackingOutcome, columns

FOUR = ("controller_cl_svd_eps", "controller_cl_svd_z2", "controller_cl_win_eps", "controller_cl_win_z2")
# In the order of the thesis' lines, 5.4: ABS blue, BS green.
OLD = ("controller_abs", "controller_bs", "controller_cl_svd_eps", "controller_cl_win_z2")
CONTROLLERS = ("controller_bs", "controller_abs", *FOUR)
# What the thesis puts first on each path, best first; the others, if there are any, come after (5.3.2,
# 5.3.3, 5.4.3).
ORDERS = {
    "ellipse": ("win_eps", "svd_eps", "win_z2", "svd_z2", "abs", "bs"),
    "eight": ("svd_eps", "win_eps"),
}
PRINTED = "true, stale, 0.1"  # the simulations as printed: no noise, stale errors, footnote 1
RELATED = 0.5  # 1, rank correlation from which two numbers are related; chosen
LAP = 0.01  # m, position error of a lap; a hundredth of the ship's length
NEAR = 0.1  # of a coefficient, within which an estimate counts as converged; chosen

Table = Mapping[str, Mapping[str, list[TrackingOutcome]]]
Paths = Mapping[str, Table]


def short(controller: str) -> str:
    """A controller as the reports call it."""
    return controller.removeprefix("controller_").removeprefix("cl_")


def error(runs: Mapping[str, Sequence[TrackingOutcome]], name: str = "position") -> dict[str, float]:
    """A number of each controller, mean over the seeds."""
    return {short(c): interval(columns(o, name)).mean for c, o in runs.items()}


def in_order(errors: Mapping[str, float], path: str) -> bool:
    """Whether the errors of all controllers are in the thesis' order for a path."""
    first = [errors[name] for name in ORDERS[path]]
    others = [x for name, x in errors.items() if name not in ORDERS[path]]
    return all(a < b for a, b in pairwise([*first, min(others, default=inf)]))


def share(table: Table, condition: str, a: str, b: str) -> SampleMean:
    """Position error of controller a over that of b, seed by seed."""
    runs = table[condition]
    x, y = (columns(runs[f"controller_{name}"], "position") for name in (a, b))
    return finite_ratio(x, y)


def finite_ratio(x: Sequence[float], y: Sequence[float]) -> SampleMean:
    """Ratio over the seeds for which both went through; open where there is none."""
    kept = [(p, q) for p, q in zip(x, y, strict=True) if isfinite(p) and isfinite(q)]
    if not kept:
        return SampleMean(float("nan"), 0.0, float("inf"))
    return ratio([p for p, _ in kept], [q for _, q in kept])


def below(ratio: SampleMean) -> bool | None:
    """Whether a ratio is below 1 with its whole interval; None: the interval holds 1, or no run."""
    return True if ratio.high < 1.0 else False if ratio.low > 1.0 else None


def judged(shares: Mapping[str, SampleMean]) -> dict[str, bool | None]:
    """Whether every share is surely below 1, setting by setting."""
    return {setting: below(x) for setting, x in shares.items()}


def worse(shares: Mapping[str, SampleMean]) -> dict[str, bool | None]:
    """Whether every share is surely above 1, setting by setting."""
    return {setting: None if (x := below(s)) is None else not x for setting, s in shares.items()}


def listed(shares: Mapping[str, SampleMean]) -> str:
    """Intervals with the names of their runs."""
    return "; ".join(f"{run}: {value}" for run, value in shares.items())


def printed_share(table: Table, a: str, b: str) -> SampleMean:
    """Position error of controller a over that of b as printed, where nothing is random."""
    runs = error({**table["true"], **table[PRINTED]})
    x = runs[a.removeprefix("cl_")] / runs[b.removeprefix("cl_")]
    return SampleMean(x, x, x)


def better(by_path: Paths, thesis: str, a: str, b: str, *conditions: str) -> Verdict:
    """Whether a tracks better than b, on each path and condition, and as printed."""
    shares = {
        f"{path}, {condition}": share(table, condition, a, b)
        for path, table in by_path.items()
        for condition in conditions
    }
    printed = {path: printed_share(table, a, b) for path, table in by_path.items()}
    numbers = f"error of {a} over {b}: {listed(shares)}; as printed: " + "; ".join(
        f"{path}: {x.mean:.3g}" for path, x in printed.items()
    )
    return Verdict(thesis, judged(shares), numbers, judged(printed))


def correlation(by_path: Paths) -> Verdict:
    """Whether those who know the model error better track better."""
    found: dict[str, float] = {}
    printed: dict[str, float] = {}
    for path, table in by_path.items():
        for condition in ("mdf", "kalman", "true", PRINTED):
            each = {**table["true"], **table[PRINTED]} if condition == PRINTED else table[condition]
            runs = [o for outcomes in each.values() for o in outcomes if o.done]
            rank: Any = stats.spearmanr([o.omega for o in runs], [o.position for o in runs])
            kept = printed if condition == PRINTED else found
            kept[f"{path}, {condition}"] = float(rank.statistic)
    numbers = "; ".join(f"{run}: {value:.2f}" for run, value in (found | printed).items())
    return Verdict(
        "A better estimate of ω improves tracking (5.4.3)",
        {run: value > RELATED for run, value in found.items()},
        f"Spearman's rank correlation of the two errors over controllers and seeds, limit {RELATED:g}: "
        f"{numbers}",
        {run: value > RELATED for run, value in printed.items()},
    )


def extreme(by_path: Paths, condition: str, number: str, choose: Any) -> dict[str, str]:
    """Path -> the variant with the largest or the least of a number, by ``max`` or ``min``."""
    found = {}
    for path, table in by_path.items():
        four = {n: x for n, x in error(table[condition], number).items() if "_" in n and isfinite(x)}
        if four:
            found[path] = choose(four, key=lambda n: four[n])
    return found


def most(by_path: Paths, thesis: str, name: str, number: str, choose: Any, what: str) -> Verdict:
    """Whether a variant has the largest or the least of a number on each path, today and as printed."""
    found = {c: extreme(by_path, c, number, choose) for c in ("mdf", PRINTED)}
    rows = [
        f"{path}, {c}: "
        + ", ".join(f"{n} {x:.3g}" for n, x in error(table[c], number).items() if "_" in n)
        for c in found
        for path, table in by_path.items()
    ]
    here, printed = ({path: n == name for path, n in each.items()} for each in found.values())
    return Verdict(thesis, here, f"{what}: {'; '.join(rows)}", printed)


def converged(by_path: Paths) -> Verdict:
    """How many of the coefficients of (2.30) come near their true values."""
    count, rows = {PRINTED: [], "true": []}, []
    for condition in (PRINTED, "true"):
        for path, table in by_path.items():
            for name in FOUR:
                phi = table[condition][name][0].phi
                near = sum(abs(x - t) < NEAR * abs(t) for x, t in zip(phi, TRUE_PHI, strict=False))
                count[condition].append(near)
                listing = ", ".join(f"{x:.3g}" for x in phi)
                rows.append(f"{path}, {condition}, {short(name)}: {near} ({listing})")
    few = 0.5 * len(TRUE_PHI)
    return Verdict(
        "Only a few parameters converged to the correct value (5.3.3)",
        max(count["true"]) < few,
        f"as printed {min(count[PRINTED])} to {max(count[PRINTED])} of {len(TRUE_PHI)} within "
        f"{100 * NEAR:g} %, today {min(count['true'])} to {max(count['true'])}, few: below {few:g}; "
        f"true {', '.join(f'{x:.3g}' for x in TRUE_PHI)}; {'; '.join(rows)}",
        max(count[PRINTED]) < few,
    )


def goals(by_path: Paths) -> list[Verdict]:
    """What the corrected concurrent learning must reach."""
    ellipse = by_path["ellipse"]
    laps = {short(n): interval(columns(ellipse["true"][n], "second")).mean for n in FOUR}
    shares = {
        f"{path}, {short(name)}": share(table, "kalman", name.removeprefix("controller_"), "abs")
        for path, table in by_path.items()
        for name in FOUR
    }
    return [
        Verdict(
            f"(goal) corrected, with true states: below {LAP:g} m on the second lap of the ellipse",
            {n: e < LAP for n, e in laps.items()},
            "; ".join(f"{n}: {e:.5f} m" for n, e in laps.items()),
        ),
        Verdict(
            "(goal) with the best observer and freezes at least twice as good as ABS",
            {run: s.high < 0.5 for run, s in shares.items()},
            f"share of the error of ABS, below 0.5 with its interval: {listed(shares)}",
        ),
    ]


def claims(by_path: Paths) -> list[Verdict]:
    """Every conclusion on tracking with its verdict."""
    senses = ("mdf", "kalman")
    return [
        better(by_path, "Adaptation helps: ABS tracks better than BS (5.4.3)", "abs", "bs", *senses),
        better(
            by_path,
            "CL tracks better than ABS (5.4.3): CL-SVD-ε",
            "cl_svd_eps",
            "abs",
            *senses,
        ),
        better(by_path, "CL tracks better than ABS: CL-WIN-z2", "cl_win_z2", "abs", *senses),
        better(by_path, "ε beats z2 with the window (5.3.3)", "cl_win_eps", "cl_win_z2", *senses),
        better(by_path, "ε beats z2 with singular values (5.3.3)", "cl_svd_eps", "cl_svd_z2", *senses),
        better(by_path, "CL-SVD-ε beats CL-WIN-z2 (5.4)", "cl_svd_eps", "cl_win_z2", *senses),
        better(
            {"ellipse": by_path["ellipse"]},
            "CL-WIN-ε is better than CL-SVD-ε on the ellipse (5.3.1)",
            "cl_win_eps",
            "cl_svd_eps",
            *senses,
        ),
        better(
            {"eight": by_path["eight"]},
            "CL-SVD-ε is better than CL-WIN-ε on the eight (5.3.2)",
            "cl_svd_eps",
            "cl_win_eps",
            *senses,
        ),
        most(
            by_path,
            "CL-SVD-z2 is the worst of the four (5.3.3)",
            "svd_z2",
            "position",
            max,
            "position error [m]",
        ),
        most(
            by_path,
            "CL-SVD-ε has the smoothest output (Table 5.2)",
            "svd_eps",
            "swing",
            min,
            "RMS of the requested yaw moment above 0.5 Hz [N m]",
        ),
        converged(by_path),
        correlation(by_path),
    ]
