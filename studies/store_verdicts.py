"""What chapter 5 says of the store, each with the result of our runs."""

from itertools import pairwise

from .monte_carlo import interval
from .outcome import columns
from .verdict import FOUR, Paths, Table, Verdict

OTHERS = ("abs", "bs")
# Best first.
THESIS_ORDER = ("win_eps", "svd_eps", "win_z2", "svd_z2", *OTHERS)
MUCH = 3.0  # times an error that count as suffering; chosen


def stale(by_path: Paths, what: str, thesis: str) -> Verdict:
    """Where the printed, stale errors wind up: learning then does worse than no learning."""
    rows, wound = [], 0
    for path, table in by_path.items():
        for sense in ("true", "mdf"):
            plain = interval(columns(table[sense]["controller_bs"], "position")).mean
            rows.append(f"{path}, {sense}, backstepping: {plain:.4f} m")
            for name in FOUR:
                error = interval(columns(table[f"{sense}, {what}"][name], "position")).mean
                winds = not error < plain  # NaN where a run broke off
                wound += winds
                label = name.removeprefix("controller_cl_")
                rows.append(f"{label}: {error:.4f} m{' (wound up)' if winds else ''}")
    return Verdict(
        thesis,
        f"winds up in {wound} of {2 * len(FOUR) * len(by_path)}",
        "wound up: no less error than backstepping without adaptation. Position error: "
        + "; ".join(rows),
    )


def order(by_path: Paths) -> Verdict:
    """The thesis' order of all six with the printed algorithms and the weight of footnote 1."""
    rows = {}
    for path, table in by_path.items():
        old = {n: interval(columns(table["true"][f"controller_{n}"], "position")).mean for n in OTHERS}
        runs = table["true, stale, 0.1"]
        new = {
            n.removeprefix("controller_cl_"): interval(columns(o, "position")).mean
            for n, o in runs.items()
        }
        rows[path] = new | old
    same = {path: all(row[a] < row[b] for a, b in pairwise(THESIS_ORDER)) for path, row in rows.items()}
    numbers = "; ".join(
        f"{path}: " + ", ".join(f"{n} {row[n]:.4f} m" for n in THESIS_ORDER)
        for path, row in rows.items()
    )
    return Verdict(
        "The order WIN-ε, SVD-ε, WIN-z2, SVD-z2, ABS, BS (5.3.3, 5.4.3)",
        "; ".join(f"{path}: {'reproduced' if s else 'not reproduced'}" for path, s in same.items()),
        f"as printed with the weight 0.1, true states: {numbers}",
    )


def saturated(by_path: Paths) -> Verdict:
    """The effect of samples that were stored while the thrusters saturated."""
    numbers = []
    for path, table in by_path.items():
        for name in FOUR:
            gated, told, untold = (
                interval(columns(table[c][name], "position")).mean
                for c in ("true", "true, ungated", "true, request")
            )
            label = name.removeprefix("controller_cl_")
            numbers.append(
                f"{path}, {label}: {untold:.5f} m, told the clipped force {told:.5f} m, "
                f"with the gate {gated:.5f} m"
            )
    return Verdict(
        "SVD storage is fragile: it keeps what is wrong (5.3.3, Table 5.2)",
        "reproduced without any spike, until the clipped force is told"
        if _svd_suffers(by_path["eight"])
        else "not reproduced in these runs",
        "true states, samples of saturated thrusters stored as printed: " + "; ".join(numbers),
    )


def _svd_suffers(table: Table) -> bool:
    def error(condition: str, name: str) -> float:
        return interval(columns(table[condition][name], "position")).mean

    untold = [error("true, request", n) for n in FOUR]
    told = [error("true, ungated", n) for n in FOUR[:2]]
    return min(untold[:2]) > MUCH * max(*untold[2:], *told)


def full_rank(by_path: Paths) -> Verdict:
    """Where the store meets Condition 1."""
    shares = {
        f"{path}, {condition}, {name.removeprefix('controller_cl_')}": interval(
            columns(each, "rank")
        ).mean
        for path, table in by_path.items()
        for condition, runs in table.items()
        for name, each in runs.items()
        if name in FOUR
    }
    met = {run: x for run, x in shares.items() if x > 0.0}
    listing = "; ".join(f"{run}: {100.0 * x:.0f} %" for run, x in met.items())
    return Verdict(
        "Condition 1, full rank of the stored regressors, holds (4.1.2)",
        f"σ_min above 0.01 at some time in {len(met)} of {len(shares)}",
        f"share of the time: {listing or 'none'}. On one ellipse abs(r) v = -abs(v) r exactly: no store "
        "can have full rank there, the coefficients do not converge, ω does",
    )


def richer(by_path: Paths) -> Verdict:
    """Which path and which store give the larger smallest singular value."""
    sigma = {
        (path, name): interval(columns(table["mdf"][name], "sigma"))
        for path, table in by_path.items()
        for name in FOUR
    }
    by_store = all(sigma[p, FOUR[0]].mean > sigma[p, FOUR[2]].mean for p in by_path)
    by_shape = all(sigma["eight", n].mean > sigma["ellipse", n].mean for n in FOUR[:2])
    verdict = {True: "reproduced", False: "not reproduced"}
    numbers = "; ".join(f"{p}, {n.removeprefix('controller_cl_')}: {s}" for (p, n), s in sigma.items())
    return Verdict(
        "The SVD store has the larger singular values, the eight is richer than the ellipse (Fig. 5.7)",
        f"store: {verdict[by_store]}; eight: {verdict[by_shape]}",
        f"σ_min at the end, MDF: {numbers}",
    )


def store_claims(by_path: Paths) -> list[Verdict]:
    """Every conclusion on the store with its verdict."""
    return [
        richer(by_path),
        full_rank(by_path),
        stale(by_path, "stale", "Algorithms 1 and 2 as printed, with stored ε_j (4.1.3), weight 1"),
        stale(by_path, "stale, 0.1", "The same with the weight 0.1 of footnote 1"),
        order(by_path),
        saturated(by_path),
    ]
