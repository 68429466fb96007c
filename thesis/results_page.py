"""The page of results with its numbers: ``python -m thesis.results_page > docs/thesis_results.md``.

Every number comes from the ``results.json`` beside a study's report. A test compares the page with the
output of this command.
"""

import json
import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from studies.study_report import Verdict, overall, said

from .tracking.verdict import FOUR, PRINTED

STUDIES = Path(__file__).parent.parent / "docs" / "studies"
SIX = ("win_eps", "svd_eps", "win_z2", "svd_z2", "abs", "bs")
TEMPLATE = "thesis_results.txt"
STALE = "stale, ungated, request"
JUDGED = {  # study -> section of the thesis
    "chapter5": "5",
    "store_weight": "4.1.4",
    "chapter6": "6.4, 6.5",
    "chapter6_learned": "6.4, 6.5, learned ship",
    "estimators": "6.3.3",
    "observer_gains": "6.3.3, K_1 and K_2",
    "allocation": "6.3.4",
    "realtime": "6.3.2",
    "chapter7": "7.1 to 7.4",
    "lost_thrust": "7.2.5",
    "improved": "7.5",
    "stored_samples": "8.1",
}
PATHS, SENSES = ("ellipse", "eight"), ("mdf", "kalman")

Results = Mapping[str, Any]
Numbers = dict[str, str]


def ends(values: Iterable[float], form: str = ".0f") -> str:
    """The least and the largest: ``3 to 5``, or one number where they are the same."""
    kept = [x for x in values if math.isfinite(x)]
    low, high = format(min(kept), form), format(max(kept), form)
    return low if low == high else f"{low} to {high}"


def cells(results: Results, first: str) -> list[list[Any]]:
    """Rows of all tables whose first column has a name."""
    return [row for t in results["tables"] if t["header"][0] == first for row in t["rows"]]


def verdict(results: Results, key: str, begin: str) -> Mapping[str, Any]:
    """The verdict on the statement that begins so."""
    return next(v for v in results[key] if v["thesis"].startswith(begin))


def judged(results: Results) -> list[Verdict]:
    """Every verdict of a study."""
    lists = (x for x in results.values() if isinstance(x, list))
    return [
        Verdict(**row) for rows in lists for row in rows if isinstance(row, dict) and "thesis" in row
    ]


def summary(found: Mapping[str, Results]) -> Numbers:
    """How many statements hold, study by study."""
    rows = []
    for name, section in JUDGED.items():
        verdicts = judged(found[name])
        answers = [v.holds for v in verdicts]
        printed = [overall(v.printed) for v in verdicts if v.printed != {}]
        rows.append(
            f"| {section} | [report](studies/{name}/report.md) | {answers.count(True)} | "
            f"{answers.count(False)} | {answers.count(None)} | "
            f"{f'{printed.count(True)} of {len(printed)}' if printed else '–'} |"
        )
    return {"summary": "\n".join(rows)}


def lost_thrust(r: Results, analysis: Results) -> Numbers:
    """Estimates of the loss of thrust by passes, least squares, estimates of motion, and gains."""
    columns = next(t["header"] for t in analysis["tables"] if t["header"][0] == "coefficient")
    sysid = {row[0]: dict(zip(columns, row, strict=True)) for row in cells(analysis, "coefficient")}

    def delta(estimates: str, ending: str = "") -> str:
        values = [round(sysid[f"delta_{a}{ending}"][estimates], 3) + 0.0 for a in "XYN"]
        return ", ".join(f"{x:.3f}".replace("-", "−") for x in values)

    r2 = [float(sysid[f"R² of ω {a}"][e]) for a in "XYN" for e in ("true states", "smoothed", "mdf")]
    # Of the simulated runs, whose table is the first.
    spikes = next(row for row in cells(analysis, "model") if row[0].startswith("identified"))
    places = r["places"]
    every = [p["r2"] for each in places.values() for p in each]
    slope, offset = r["line"]

    def place(name: str, k: int) -> str:
        return f"{places[name][k]['delta_N']:.3f}"

    return {
        "delta_true": delta("true states"),
        "delta_smoothed": delta("smoothed"),
        "delta_mdf": delta("mdf"),
        "delta_least": delta("mdf", ", least squares"),
        "delta_r2": f"{min(r2):.2f}",
        "delta_condition": ", ".join(sysid[f"condition number {a}"]["mdf"] for a in "XYN"),
        "delta_spikes": ", ".join(f"{x:.2f}" for x in spikes[-3:]),
        "line": f"N_r = {offset:.2f} + {slope:.2f} δ_N".replace("-", "−"),
        "line_r2": f"{min(every):.3f} to {max(every):.4f}",
        "delta_gain": place("MDF, 1", 1),
        "delta_quarter": place("MDF, 0.25", 1),
        "delta_four": place("true states, 1", 1),
    }


def failing(found: Mapping[str, Any]) -> str:
    """In how many of its settings a statement does not hold."""
    answers = list(found["here"].values())
    return f"{answers.count(False)} of {len(answers)}"


def chapter5(r: Results) -> Numbers:
    outcomes = r["outcomes"]

    def ratio(path: str, sense: str, a: str, b: str) -> float:
        x, y = ([run["position"] for run in outcomes[path][sense][f"controller_{n}"]] for n in (a, b))
        return float(np.exp(np.mean(np.log(np.divide(x, y)))))

    def less(sense: str) -> str:
        shares = [ratio(p, sense, c.removeprefix("controller_"), "abs") for p in PATHS for c in FOUR]
        return ends(100.0 * (1.0 - x) for x in shares)

    pairs = [("cl_win_eps", "cl_win_z2"), ("cl_svd_eps", "cl_svd_z2")]
    by_eps = [ratio(p, s, *pair) for p, s, pair in product(PATHS, SENSES, pairs)]
    by_store = [
        ratio("eight", s, f"cl_svd_{e}", f"cl_win_{e}") - 1.0 for s, e in product(SENSES, ("eps", "z2"))
    ]
    sigma = [outcomes[p][PRINTED]["controller_cl_svd_eps"][0]["sigma"] for p in PATHS]
    gated = [
        run["rank"] for p in PATHS for s in (*SENSES, "true") for c in FOUR for run in outcomes[p][s][c]
    ]
    stores = [
        any(run["rank"] for run in runs[c])
        for table in outcomes.values()
        for runs in table.values()
        for c in FOUR
        if c in runs
    ]
    above = sum(
        outcomes["eight"][PRINTED][c][0]["position"]
        > outcomes["eight"]["true"]["controller_abs"][0]["position"]
        for c in FOUR
    )
    few = verdict(r, "claims", "Only a few")["numbers"]
    return {
        "c5_seeds": str(len(r["seeds"])),
        "conclusions": "\n".join(
            f"| {v.thesis} | {v.cells[0]} | {v.cells[1]} |" for v in judged(r) if v.printed != {}
        ),
        "abs_ellipse": f"{100.0 * (1.0 - ratio('ellipse', 'mdf', 'abs', 'bs')):.0f}",
        "abs_eight": f"{100.0 * (1.0 - ratio('eight', 'mdf', 'abs', 'bs')):.0f}",
        "cl_mdf": less("mdf"),
        "cl_kalman": less("kalman"),
        "eps_or_z2": f"{100.0 * max(abs(1.0 - x) for x in by_eps):.0f}",
        "window": ends(100.0 * x for x in by_store),
        "wound_1": failing(verdict(r, "claims", "Algorithms 1 and 2")),
        "wound_01": failing(verdict(r, "claims", "The weight 0.1")),
        "printed_worse": f"{above} of {len(FOUR)}",
        "converged": few.partition(" within")[0].removeprefix("as printed "),
        "sigma_ellipse": f"{sigma[0]:.2g}",
        "sigma_eight": f"{sigma[1]:.2g}",
        "condition_1": f"{sum(stores)} of {len(stores)}",
        "condition_1_gated": f"{sum(x > 0.0 for x in gated)} of {len(gated)}",
        "smoothest": said(verdict(r, "claims", "CL-SVD-ε has the smoothest")["printed"]),
    }


def store_weight(r: Results) -> Numbers:
    def position(path: str, name: str, form: str = "as it is", weight: str = "1") -> float:
        return r[path][f"controller_{name}|{form}|{weight}"][0]["position"]

    six = [
        position("ellipse", f"cl_{n}", STALE, "0.1") if "_" in n else position("ellipse", n) for n in SIX
    ]
    four = [c.removeprefix("controller_") for c in FOUR]
    window, svd = (
        [position("eight", n, form, "0.1") for form in forms for n in four if kind in n]
        for kind, forms in (("win", (STALE,)), ("svd", (STALE, "stale, ungated")))
    )
    stated = [position("eight", n, "stale, ungated", "0.1") for n in four if "win" in n]
    fresh = {p: [1e3 * position(p, n, "fresh, ungated") for n in four] for p in PATHS}
    orders = [row[-1] for row in cells(r, "stored errors, samples, weight") if row[-1] in ("yes", "no")]
    half = len(orders) // 2
    return {
        "six": ", ".join(f"{x:.4f} m ({n})" for n, x in zip(SIX, six, strict=True)),
        "weight_1": ends((position("ellipse", n, STALE, "1") for n in four), ".1f"),
        "eight_window": ends(window, ".1f"),
        "eight_window_told": ends(stated, ".4f"),
        "eight_svd": ends(svd, ".2f"),
        "fresh_ellipse": ends(fresh["ellipse"], ".1f"),
        "fresh_eight": f"{max(fresh['eight']):.1g}",
        "request_svd": f"{position('eight', 'cl_svd_eps', 'fresh, ungated, request'):.3f}",
        "orders_ellipse": f"{orders[:half].count('yes')} of {half}",
        "orders_eight": f"{orders[half:].count('yes')} of {half}",
    }


def trial_mean(r: Results, trial: str, controller: str, number: str) -> float:
    """Mean over the runs that kept up."""
    runs = [run for run in r["trials"][trial][f"controller_{controller}"] if not run["lost"]]
    return float(np.mean([run[number] for run in runs])) if runs else float("nan")


def chapter6(r: Results, learned: Results) -> Numbers:
    rows = [
        f"| {a['thesis']} | {said(a['here'])} | {said(b['here'])} |"
        for a, b in zip(r["observations"], learned["observations"], strict=True)
    ]

    def relation(results: Results) -> str:
        off = [
            trial_mean(results, t, "abs", "position") / trial_mean(results, t, "bs", "position") - 1.0
            for t in results["trials"]
        ]
        return ends([100.0 * abs(x) for x in off if math.isfinite(x)])

    slow = "ellipse 0.08, False"
    faults = [
        trial_mean(r, f"{t}, True", c, "position") / trial_mean(r, f"{t}, False", c, "position")
        for t in ("ellipse 0.08", "eight 0.16", "ellipse 0.16", "eight 0.32")
        for c in ("bs", "abs")
    ]
    stores = {
        c: {k: float(np.mean([s[k] for s in each])) for k in each[0]} for c, each in r["stores"].items()
    }
    old = [np.mean([s["oldest"] for c, s in stores.items() if kind in c]) for kind in ("svd", "win")]
    return {
        "c6_seeds": str(len(r["seeds"])),
        "observations": "\n".join(rows),
        "omega_slow": f"{trial_mean(r, slow, 'bs', 'omega_X'):.2f}",
        "lag": f"{-trial_mean(r, slow, 'bs', 'lag'):.2f}",
        "lag_learned": f"{-trial_mean(learned, slow, 'bs', 'lag'):.2f}",
        "inside": f"{1e3 * trial_mean(r, slow, 'bs', 'inside'):.0f}",
        "inside_learned": f"{-1e3 * trial_mean(learned, slow, 'bs', 'inside'):.0f}",
        "abs_or_bs": relation(r),
        "abs_or_bs_learned": relation(learned),
        "fault": ends(faults, ".2f"),
        "stored": ends(100.0 * s["stored"] for s in stores.values()),
        "older": f"{old[0] / old[1]:.0f}",
        "delay": said(verdict(r, "lessons", "Aggressive tuning")["here"]),
    }


def chapter7(r: Results) -> Numbers:
    rows = [row for t in r["tables"] if t["header"][:1] == ["recipe"] for row in t["rows"]]
    first, eight = rows[:4], rows[4:8]
    shares = [[100.0 * float(str(row[1 + k]).partition(" /")[0]) for row in first] for k in range(3)]
    q2 = [next(row for row in part if row[0] == "PLS2") for part in (first, eight)]
    loops = {row[0]: row for row in cells(r, "model in the plant")}
    lags = [float(re.findall(r"-?[\d.]+", c)[1]) for n in ("PLS3", "PLS4") for c in loops[n][3:7]]
    far = [float(re.findall(r"[\d.]+", c)[0]) for c in loops["PLS2"][3:]]
    sysid = {row[0]: row for row in cells(r, "coefficient")}
    return {
        "pls_X": ends(shares[0]),
        "pls_Y": ends(shares[1]),
        "pls_N": ends(shares[2]),
        "q2_ellipse": ", ".join(str(x).rpartition(" ")[2] for x in q2[0][1:4]),
        "q2_eight": ", ".join(str(x).rpartition(" ")[2] for x in q2[1][1:4]),
        "eigenvalue": str(loops["PLS2"][1]).partition(",")[0].replace("-", "−"),
        "far": ends(far, ".1f"),
        "lag_fault": ends((-x for x in (lags[0], lags[4])), ".2f"),
        "lag_models": ends((-x for x in (*lags[1:4], *lags[5:])), ".2f"),
        "sysid": ", ".join(
            f"{n} {sysid[n][2]:.3g} ({sysid[n][1]:g})" for n in ("Y_r", "N_r", "delta_X")
        ),
    }


def improved(r: Results) -> Numbers:
    def lags(names: Sequence[str]) -> list[float]:
        return [
            abs(float(np.mean([lap["mean"] for lap in runs[n]])))
            for runs in r["laps"].values()
            for n in names
        ]

    old = [f"controller_{n}" for n in ("cl_win_eps", "cl_win_z2", "abs", "bs")]
    return {
        "c75_seeds": str(len(r["seeds"])),
        "old_lag": ends(lags(old), ".2f"),
        "new_lag": ends((1e3 * x for x in lags(["controller_cl_improved"])), ".1f"),
        "surge_lag": ends((1e3 * x for x in lags(["controller_cl_win_eps_surge"])), ".1f"),
    }


def observers(r: Results, gains: Results, allocation: Results) -> Numbers:
    better = [1.0 / x["mean"] for row in r["kalman_to_best"].values() for x in row.values()]
    rows = {tuple(row[:3]): row[3:] for row in cells(gains, "observer")}

    def of(*key: str, column: int = 0) -> float:
        return float(str(rows[key][column]).partition(" ")[0])

    swift = ("nonlinear", "9.9", "50")
    width = [re.findall(r"-?[\d.e-]+", row[2]) for row in cells(allocation, "true point of attack [m]")]
    return {
        "estimator_seeds": str(len(r["seeds"])),
        "kinds": str(len(r["kalman_to_best"])),
        "kalman": f"{min(better):.2g} to {float(f'{max(better):.2g}'):.0f}",
        "swift": f"{of(*swift):.2f}",
        "filter": f"{of('mdf', '–', '–'):.2f}",
        "noisier": f"{100.0 * (of(*swift, column=1) / of('mdf', '–', '–', column=1) - 1.0):.0f}",
        "slow": f"{of('nonlinear', '6.0', '9'):.2f}",
        "attack": f"{max(0.5 * (float(x[2]) - float(x[1])) for x in width):.2f}",
        "allocation_seeds": str(len(allocation["seeds"])),
    }


def numbers(folder: Path = STUDIES) -> Numbers:
    """Every number of the page by its name in the template."""

    def of(name: str) -> Results:
        return json.loads((folder / name / "results.json").read_text("utf-8"))

    return {
        **summary({name: of(name) for name in JUDGED}),
        **lost_thrust(of("lost_thrust"), of("chapter7")),
        **chapter5(of("chapter5")),
        **store_weight(of("store_weight")),
        **chapter6(of("chapter6"), of("chapter6_learned")),
        **chapter7(of("chapter7")),
        **improved(of("improved")),
        **observers(of("estimators"), of("observer_gains"), of("allocation")),
    }


def page(folder: Path = STUDIES) -> str:
    """The page: the template with its numbers."""
    return (folder / TEMPLATE).read_text("utf-8").format_map(numbers(folder))


if __name__ == "__main__":
    sys.stdout.write(page())
