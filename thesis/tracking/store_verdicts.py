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
    """Where the printed, stale errors wind up: learning then does no better than no learning."""
    rows, winds = [], {}
    for path, table in by_path.items():
        for sense in ("true", "mdf"):
            plain = error(table[sense])["bs"]
            rows.append(f"{path}, {sense}, backstepping: {plain:.4f} m")
            for name, x in error(table[f"{sense}, {what}"]).items():
                winds[f"{path}, {sense}, {name}"] = not x < plain  # NaN where a run broke off
                rows.append(f"{name}: {x:.4f} m")
    return Verdict(
        thesis,
        {run: not wound for run, wound in winds.items()},
        f"{sum(winds.values())} of {len(winds)} wind up: no less error than backstepping without "
        f"adaptation. Position error: {'; '.join(rows)}",
    )


def order(by_path: Paths) -> Verdict:
    """The thesis' order for each path, with the printed algorithms and the weight of footnote 1."""
    rows, here = (
        {path: error(table["true"]) | error(table[c]) for path, table in by_path.items()}
        for c in (PRINTED, "true")
    )
    numbers = "; ".join(
        f"{path}: " + ", ".join(f"{n} {x:.4f} m" for n, x in row.items()) for path, row in rows.items()
    )
    return Verdict(
        "; ".join(f"{path}: {', '.join(ORDERS[path])} first" for path in rows)
        + " (5.3.2, 5.3.3, 5.4.3)",
        {path: in_order(row, path) for path, row in here.items()},
        f"true states; as printed with the weight 0.1: {numbers}",
        {path: in_order(row, path) for path, row in rows.items()},
    )


def saturated(by_path: Paths) -> Verdict:
    """The effect of samples that were stored while the thrusters saturated."""
    numbers = []
    for path, table in by_path.items():
        gated, stated, untold = (error(table[c]) for c in ("true", "true, ungated", "true, request"))
        numbers += [
            f"{path}, {n}: {x:.5f} m, with the clipped force {stated[n]:.5f} m, with the gate "
            f"{gated[n]:.5f} m"
            for n, x in untold.items()
        ]
    return Verdict(
        "SVD storage is fragile: it keeps wrong samples (5.3.3, Table 5.2)",
        _svd_suffers(by_path["eight"]),
        f"the eight, without any spike: both SVD have {MUCH:g} times the error of WIN, and of their own "
        "with the clipped force. True states, samples of saturated thrusters stored with the requested "
        f"force: {'; '.join(numbers)}",
    )


def _svd_suffers(table: Table) -> bool:
    untold, stated = error(table["true, request"]), error(table["true, ungated"])
    svd, win = ([f"{store}_{by}" for by in ("eps", "z2")] for store in ("svd", "win"))
    return min(untold[n] for n in svd) > MUCH * max([untold[n] for n in win] + [stated[n] for n in svd])


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

    def gated(condition: str) -> dict[str, bool]:
        return {
            path: all(shares[f"{path}, {condition}, {short(n)}"] > 0.0 for n in FOUR) for path in by_path
        }

    return Verdict(
        "Condition 1, full rank of the stored regressors, holds (4.1.2)",
        gated("mdf"),
        f"for all four at some time; σ_min above {FULL:g} at some time in {len(met)} of {len(shares)} "
        f"settings, share of the time: {listing or 'none'}. True states: {'; '.join(why)}",
        gated(PRINTED),
    )


def richer(by_path: Paths) -> list[Verdict]:
    """Which store and which path give the larger smallest singular value (Fig. 5.7)."""
    stores = [short(c) for c in FOUR]
    by_store, by_shape, rows = {}, {}, []
    for condition in ("mdf", PRINTED):
        sigma = {path: error(table[condition], "sigma") for path, table in by_path.items()}
        sense, _, _ = condition.partition(",")
        wound = [
            f"{path}, {n}"
            for path, table in by_path.items()
            for n in stores
            if not error(table[condition])[n] < error(table[sense])["bs"]
        ]
        by_store[condition] = {
            f"{path}, {e}": s[f"svd_{e}"] > s[f"win_{e}"]
            for path, s in sigma.items()
            for e in ("eps", "z2")
        }
        by_shape[condition] = {n: sigma["eight"][n] > sigma["ellipse"][n] for n in stores}
        rows.append(
            f"{condition}: "
            + "; ".join(f"{p}, {n}: {each[n]:.3g}" for p, each in sigma.items() for n in stores)
            + f" (wound up: {'; '.join(wound) or 'none'})"
        )
    numbers = f"σ_min at the end, {'. '.join(rows)}"
    return [
        Verdict(thesis, each["mdf"], numbers, each[PRINTED])
        for thesis, each in (
            ("The SVD store has larger singular values than the window (5.3.3, Fig. 5.7)", by_store),
            ("The eight is richer than the ellipse (5.3.3, Fig. 5.7)", by_shape),
        )
    ]


def store_claims(by_path: Paths) -> list[Verdict]:
    """Every conclusion on the store with its verdict."""
    return [
        *richer(by_path),
        full_rank(by_path),
        stale(
            by_path,
            "stale",
            "Algorithms 1 and 2 as printed, with stored ε_j and weight 1, do not wind up (4.1.3)",
        ),
        stale(by_path, "stale, 0.1", "The weight 0.1 makes the adaptation stable (footnote 1 of 4.1.4)"),
        order(by_path),
        saturated(by_path),
    ]
