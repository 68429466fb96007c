"""The lessons learned of 6.5: the result of our runs on each, and its cause."""

from math import inf, isfinite

import numpy as np

from fmus.hull import Inertia, mass_matrix
from studies.study_report import Verdict

from ..tracking.verdict import finite_ratio, listed, worse
from .causes import of_causes
from .found import FAULTY, REGULAR, SAME, TrialRuns, alike, kept, label, lost, mean, share, values
from .observations import surely_between
from .trials import ABS, CLE, CLZ, HARD, LABELS, RBS, TRIALS

LESS = 0.9  # 1, share of the first lap's lag below which it falls; chosen


def guidance(found: TrialRuns) -> Verdict:
    """The fault against the same true speed set properly, and how much it must cost in surge."""
    shares = {
        f"{t.name}, {LABELS[c]}": share(runs[c], found.trials[t.name, REGULAR][c])
        for t in TRIALS
        for c, runs in [(c, found.trials[t.name, FAULTY]) for c in (RBS, ABS)]
    }
    ellipse = TRIALS[0]
    a, b = (mean(found.trials[ellipse.name, f][RBS], "lag") for f in (FAULTY, REGULAR))
    m11 = mass_matrix(Inertia())[0][0]
    K_p, K_d = HARD["p_x"], HARD["d_u"]
    must = 0.75 * ellipse.u_t * (K_d + m11 * K_p) / (1.0 + K_d * K_p)
    return Verdict(
        "Guidance was four times as fast as desired, and worsens the tracking",
        worse(shares),
        f"position error with over without the fault, at the same true speed: {listed(shares)}. "
        "Cause: the derivatives of the target are those of a quarter of its speed: the law brakes. In "
        "surge that lengthens the lag by ¾ u_t (K_d + m11 K_p) / (1 + K_d K_p) = "
        f"{must:.3f} m at {ellipse.u_t:g} m/s; the runs (RBS) have {b.mean - a.mean:.3f} m",
    )


def adaptive(found: TrialRuns) -> Verdict:
    """Backstepping with and without adaptation."""
    shares = {label(*key): share(runs[ABS], runs[RBS]) for key, runs in found.trials.items()}
    aside = {
        label(*key): share(runs[ABS], runs[RBS], "cross_track") for key, runs in found.trials.items()
    }
    surge = [
        float(np.mean(np.square(kept(runs[c], "along"))) / np.mean(np.square(kept(runs[c], "position"))))
        for runs in found.trials.values()
        for c in (RBS, ABS)
        if kept(runs[c], "along")
    ]
    falls = ", ".join(
        f"{label(*key)}: {lost(runs[RBS])} of RBS and {lost(runs[ABS])} of ABS"
        for key, runs in found.trials.items()
        if lost(runs[RBS]) or lost(runs[ABS])
    )
    return Verdict(
        "The performance difference of BS and ABS was not significant",
        {setting: alike(x) for setting, x in shares.items()},
        f"within {100 * SAME:g} %, or the interval holds 1; both must keep up. Position error of ABS "
        f"over RBS: {listed(shares)}. Cross-track error: {listed(aside)}. "
        f"Fell behind for good: {falls or 'none'}. Cause: the error along the ship, in which neither "
        f"adapts, makes {100 * min(surge):.0f} to {100 * max(surge):.0f} % of the mean square",
    )


def surge_error(found: TrialRuns) -> list[Verdict]:
    """Size of the model error in surge, the lag that it must cause, and the side of the path."""
    rows, lags, sides = [], {}, {}
    stiffness = 1.0 + HARD["p_x"] * HARD["d_u"]
    for trial in TRIALS:
        runs = found.trials[trial.name, REGULAR][RBS]
        omega, lag = mean(runs, "omega_X"), mean(runs, "lag")
        lags[trial.name] = lag.high < 0.0
        rows.append(
            f"{trial.name}: {omega.mean:.2f} N, z1_x {lag.mean:.3f} m "
            f"(−ω/(1 + K_d K_p) = {-omega.mean / stiffness:.3f} m)"
        )
    for speed in (t for t in TRIALS if t.path == "ellipse"):
        for faulty in (REGULAR, FAULTY):
            for c in (RBS, ABS):
                name = f"{label(speed.name, faulty)}, {LABELS[c]}"
                sides[name] = mean(found.trials[speed.name, faulty][c], "inside")
    return [
        Verdict(
            "Large model-error, especially in surge: the ship lags",
            lags,
            f"z1_x below zero with its interval; mean magnitude of ω in surge and lag, RBS: "
            f"{'; '.join(rows)}. The thesis has 0.4 N at 0.08 and 0.5 N at 0.16 m/s",
        ),
        Verdict(
            "RBS and ABS run inside of the ellipse (6.4.2, 6.5)",
            {name: surely_between(side, 0.0, inf) for name, side in sides.items()},
            f"inside by [m], above zero with its interval: {listed(sides)}",
        ),
    ]


def no_surge(found: TrialRuns) -> Verdict:
    """The estimate in surge, and the lag from one half of a run to the other."""
    everything = [run for runs in found.trials.values() for each in runs.values() for run in each]
    largest = max(run.omega_hat_X for run in everything if isfinite(run.omega_hat_X))
    slow = found.trials[TRIALS[0].name, REGULAR]
    laps = {
        LABELS[c]: finite_ratio(
            np.abs(values(runs, "lag")).tolist(), np.abs(values(runs, "first")).tolist()
        )
        for c, runs in slow.items()
    }
    falls = any(s.high < LESS for s in laps.values())
    return Verdict(
        "The parametrisation (2.32) makes adaptation in surge impossible",
        largest == 0.0 and not falls,
        f"largest |ω̂| in surge in {len(everything)} runs of every controller: {largest:g} N. z1_x on "
        f"the second lap over the first, none surely below {LESS:g}, {TRIALS[0].name}: "
        f"{listed(laps)}. Cause: the first row of Φ is empty; with (7.1) the lag goes (`python -m "
        "thesis.improved`)",
    )


def fallen(found: TrialRuns) -> Verdict:
    """Which controllers fall behind at the higher speed (6.4.4)."""
    rows, fast = [], TRIALS[2].name
    for faulty in (REGULAR, FAULTY):
        runs = found.trials[fast, faulty]
        each = ", ".join(f"{LABELS[c]} {lost(r)} of {len(r)}" for c, r in runs.items())
        rows.append(f"{label(fast, faulty)}: {each}")
    runs = found.trials[fast, FAULTY]
    ahead = min(lost(runs[c]) for c in (CLZ, CLE)) > max(lost(runs[c]) for c in (RBS, ABS))
    return Verdict(
        "Outside of the model's domain, at 0.16 m/s, CLZ and CLE fail, RBS and ABS do not (6.4.4)",
        ahead,
        f"judged with the guidance fault, as in the basin; runs that fell back by more than 2 m: "
        f"{'; '.join(rows)}",
    )


def of_trials(found: TrialRuns) -> list[Verdict]:
    """The lessons that the trials alone tell, in the order of 6.5."""
    return [guidance(found), fallen(found), adaptive(found), *surge_error(found), no_surge(found)]


def lessons(found: TrialRuns) -> list[Verdict]:
    """Every lesson with its verdict, those of the experiments where they were made."""
    return of_trials(found) + (of_causes(found) if found.spiked else [])
