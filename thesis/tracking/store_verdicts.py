"""What chapter 5 says of the store, each with the result of our runs."""

from studies.study_report import Verdict

from ..monte_carlo import interval
from .outcome import columns
from .verdict import FOUR, ORDERS, PRINTED, Paths, Table, error, in_order, short

MUCH = 3.0  # times an error that count as suffering; chosen
FULL = 0.01  # sigma_min from which Condition 1 holds, ``rank_tolerance``
ONE_SIGN = 0.99  # mean sign of v r from which |r|v and |v|r are one column; chosen
RESTS = 1e-3  # m/s; v below which the columns with v are as good as empty (chosen: the noise's size)


def stale(by_path: Paths, what: str, thesis: str) -> Verdict:
    """Where the printed, stale errors wind up: learning then does worse than no learning."""
    rows, wound = [], 0
    for path, table in by_path.items():
        for sense in ("true", "mdf"):
            plain = error(table[sense])["bs"]
            rows.append(f"{path}, {sense}, backstepping: {plain:.4f} m")
            for name, x in error(table[f"{sense}, {what}"]).items():
                winds = not x < plain  # NaN where a run broke off
                wound += winds
                rows.append(f"{name}: {x:.4f} m{' (wound up)' if winds else ''}")
    return Verdict(
        thesis,
        f"winds up in {wound} of {2 * len(FOUR) * len(by_path)}",
        "wound up: no less error than backstepping without adaptation. Position error: "
        + "; ".join(rows),
    )


def order(by_path: Paths) -> Verdict:
    """The thesis' order for each path, with the printed algorithms and the weight of footnote 1."""
    rows = {path: error(table["true"]) | error(table[PRINTED]) for path, table in by_path.items()}
    numbers = "; ".join(
        f"{path}: " + ", ".join(f"{n} {x:.4f} m" for n, x in row.items()) for path, row in rows.items()
    )
    return Verdict(
        "; ".join(f"{path}: {', '.join(ORDERS[path])} first" for path in rows)
        + " (5.3.2, 5.3.3, 5.4.3)",
        "; ".join(
            f"{path}: {'reproduced' if in_order(row, path) else 'not reproduced'}"
            for path, row in rows.items()
        ),
        f"as printed with the weight 0.1, true states: {numbers}",
    )


def saturated(by_path: Paths) -> Verdict:
    """The effect of samples that were stored while the thrusters saturated."""
    numbers = []
    for path, table in by_path.items():
        gated, told, untold = (error(table[c]) for c in ("true", "true, ungated", "true, request"))
        numbers += [
            f"{path}, {n}: {x:.5f} m, with the clipped force {told[n]:.5f} m, with the gate "
            f"{gated[n]:.5f} m"
            for n, x in untold.items()
        ]
    return Verdict(
        "SVD storage is fragile: it keeps wrong samples (5.3.3, Table 5.2)",
        "reproduced without any spike, if the controller does not get the clipped force"
        if _svd_suffers(by_path["eight"])
        else "not reproduced in these runs",
        "true states, samples of saturated thrusters stored as printed: " + "; ".join(numbers),
    )


def _svd_suffers(table: Table) -> bool:
    untold, told = error(table["true, request"]), error(table["true, ungated"])
    svd, win = ([f"{store}_{by}" for by in ("eps", "z2")] for store in ("svd", "win"))
    return min(untold[n] for n in svd) > MUCH * max([untold[n] for n in win] + [told[n] for n in svd])


def lack_of_rank(sway: float, signs: float) -> str:
    """Why no store of a motion can have full rank, as far as its v [m/s] and the sign of v r tell."""
    reasons = []
    if sway < RESTS:
        reasons.append("the columns with v are nearly zero")
    if abs(signs) > ONE_SIGN:
        reasons.append(
            f"|r|v = {'−' if signs < 0.0 else ''}|v|r, because v and r have a fixed relation of signs"
        )
    return " and ".join(reasons) or "no reason in v and r"


def full_rank(by_path: Paths) -> Verdict:
    """Where the store meets Condition 1, and what v and r say where it does not."""
    shares = {
        f"{path}, {condition}, {short(name)}": interval(columns(each, "rank")).mean
        for path, table in by_path.items()
        for condition, runs in table.items()
        for name, each in runs.items()
        if name in FOUR
    }
    met = {run: x for run, x in shares.items() if x > 0.0}
    listing = "; ".join(f"{run}: {100.0 * x:.0f} %" for run, x in met.items())
    why = []
    for path, table in by_path.items():
        sways, signs = (error(table["true"], key) for key in ("sway", "signs"))
        why += [
            f"{path}, {n}: v {1e3 * sways[n]:.2g} mm/s RMS, mean sign of v r {signs[n]:.2f} "
            f"({lack_of_rank(sways[n], signs[n])})"
            for n in ("abs", "svd_eps", "win_eps")
        ]
    return Verdict(
        "Condition 1, full rank of the stored regressors, holds (4.1.2)",
        f"σ_min above {FULL:g} at some time in {len(met)} of {len(shares)}",
        f"share of the time: {listing or 'none'}. True states: {'; '.join(why)}",
    )


def richer(by_path: Paths, condition: str) -> Verdict:
    """Which path and which store give the larger smallest singular value."""
    sigma = {path: error(table[condition], "sigma") for path, table in by_path.items()}
    by_store = all(s["svd_eps"] > s["win_eps"] for s in sigma.values())
    sense, _, _ = condition.partition(",")
    plain = {path: error(table[sense])["bs"] for path, table in by_path.items()}
    position = {path: error(table[condition]) for path, table in by_path.items()}
    stores = [short(c) for c in FOUR]
    larger = [n for n in stores if sigma["eight"][n] > sigma["ellipse"][n]]
    wound = [f"{p}, {n}" for p, e in position.items() for n in stores if not e[n] < plain[p]]
    by_shape = (
        "reproduced" if larger == stores else f"with {', '.join(larger)}" if larger else "reversed"
    )
    numbers = "; ".join(
        f"{p}, {n}: {x:.3g}" for p, each in sigma.items() for n, x in each.items() if "_" in n
    )
    return Verdict(
        "The SVD store has the larger singular values, the eight is richer than the ellipse (Fig. 5.7), "
        f"{condition}",
        f"store: {'reproduced' if by_store else 'not reproduced'}; eight: {by_shape}"
        f"{'; of runs that wound up in part' if wound else ''}",
        f"σ_min at the end: {numbers}. Wound up: {'; '.join(wound) or 'none'}",
    )


def store_claims(by_path: Paths) -> list[Verdict]:
    """Every conclusion on the store with its verdict."""
    return [
        richer(by_path, "mdf"),
        richer(by_path, PRINTED),
        full_rank(by_path),
        stale(by_path, "stale", "Algorithms 1 and 2 as printed, with stored ε_j (4.1.3), weight 1"),
        stale(by_path, "stale, 0.1", "The same with the weight 0.1 of footnote 1"),
        order(by_path),
        saturated(by_path),
    ]
