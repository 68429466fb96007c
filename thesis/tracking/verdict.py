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


def judged(shares: Mapping[str, SampleMean]) -> str:
    """Reproduced where every share is surely below 1, reversed where surely above, else mixed."""
    below = [s.high < 1.0 for s in shares.values()]
    above = [s.low > 1.0 for s in shares.values()]
    if all(below):
        return "reproduced"
    if all(above):
        return "reversed"
    if any(below) or any(above):
        kinds = ("reproduced", "reversed")
        return "; ".join(
            f"{kinds[0] if b else kinds[1] if a else 'undecided'} ({run})"
            for run, b, a in zip(shares, below, above, strict=True)
        )
    return "undecided"


def worse(shares: Mapping[str, SampleMean]) -> str:
    """Reproduced where every share is surely above 1, reversed where surely below, else mixed."""
    return judged(
        {k: SampleMean(1.0 / s.mean, 1.0 / s.high, 1.0 / (s.low or 1e-9)) for k, s in shares.items()}
    )


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
        related(found),
        f"Spearman's rank correlation of the two errors over controllers and seeds: {numbers}",
        related(printed),
    )


def related(ranks: Mapping[str, float]) -> str:
    """Reproduced where every rank correlation is high, not where one is negative."""
    lowest = min(ranks.values())
    return "reproduced" if lowest > 0.5 else "not reproduced" if lowest < 0.0 else "weak"


def worst(by_path: Paths) -> Verdict:
    """Whether SVD with z2 is the worst of the four, and what makes it so."""
    rows = {}
    for condition in ("mdf", "mdf, stale, 0.1", PRINTED, "true, request"):
        for path, table in by_path.items():
            four = {n: e for n, e in error(table[condition]).items() if "_" in n and isfinite(e)}
            if four:
                rows[f"{path}, {condition}"] = max(four, key=lambda n: four[n]) == "svd_z2"
    ours, printed = (
        on_paths([rows[run] for run in rows if run.endswith(f", {condition}") and run.count(",") == n])
        for condition, n in (("mdf", 1), (PRINTED, 3))
    )
    numbers = "; ".join(f"{run}: {'worst' if is_worst else 'not'}" for run, is_worst in rows.items())
    return Verdict("CL-SVD-z2 is the worst of the four (5.3.3)", ours, numbers, printed)


def on_paths(answers: Sequence[bool]) -> str:
    """Reproduced on all paths, on none, or on one."""
    return "reproduced" if all(answers) else "not reproduced" if not any(answers) else "on one path"


def smoothest(by_path: Paths) -> Verdict:
    """Whether SVD with eps asks for the smoothest moment of the four."""
    rows = {}
    for condition in (PRINTED, "mdf"):
        for path, table in by_path.items():
            rows[f"{path}, {condition}"] = {
                n: x for n, x in error(table[condition], "swing").items() if "_" in n
            }
    least = {run: min(row, key=lambda n: row[n]) == "svd_eps" for run, row in rows.items()}
    printed, here = (
        on_paths([x for run, x in least.items() if run.partition(", ")[2] == condition])
        for condition in (PRINTED, "mdf")
    )
    numbers = "; ".join(
        f"{run}: " + ", ".join(f"{n} {x:.3g}" for n, x in row.items()) for run, row in rows.items()
    )
    return Verdict(
        "CL-SVD-ε has the smoothest output (Table 5.2)",
        here,
        f"RMS of the requested yaw moment above 0.5 Hz [N m]: {numbers}",
        printed,
    )


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
    here, printed = (
        "reproduced" if max(count[c]) < 0.5 * len(TRUE_PHI) else "not reproduced"
        for c in ("true", PRINTED)
    )
    return Verdict(
        "Only a few parameters converged to the correct value (5.3.3)",
        here,
        f"as printed {min(count[PRINTED])} to {max(count[PRINTED])} of {len(TRUE_PHI)} within "
        f"{100 * NEAR:g} %, today {min(count['true'])} to {max(count['true'])}; true "
        f"{', '.join(f'{x:.3g}' for x in TRUE_PHI)}; {'; '.join(rows)}",
        printed,
    )


def goals(by_path: Paths) -> list[Verdict]:
    """What the corrected concurrent learning must reach."""
    ellipse = by_path["ellipse"]
    laps = {n: interval(columns(ellipse["true"][n], "second")).mean for n in FOUR}
    shares = {
        f"{path}, {name.removeprefix('controller_')}": share(
            table, "kalman", name.removeprefix("controller_"), "abs"
        )
        for path, table in by_path.items()
        for name in FOUR
    }
    return [
        Verdict(
            "(goal) corrected, with true states: below 0.01 m on the second lap of the ellipse",
            "reached" if max(laps.values()) < 0.01 else "not reached",
            "; ".join(f"{n.removeprefix('controller_')}: {e:.5f} m" for n, e in laps.items()),
        ),
        Verdict(
            "(goal) with the best observer and freezes at least twice as good as ABS",
            "reached" if all(s.high < 0.5 for s in shares.values()) else "not by all",
            f"share of the error of ABS: {listed(shares)}",
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
        worst(by_path),
        smoothest(by_path),
        converged(by_path),
        correlation(by_path),
    ]
