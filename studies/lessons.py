"""The lessons learned of 6.5: the result of our runs on each, and an experiment that shows the cause."""

from collections.abc import Mapping
from math import isfinite

import numpy as np

from fmus.hull import Inertia, mass_matrix

from .found import (
    BLOCKED,
    FAULTY,
    FRESH,
    OPENED,
    PRINTED,
    REGULAR,
    Found,
    kept,
    label,
    lost,
    mean,
    share,
    values,
)
from .margin import margins
from .monte_carlo import Interval
from .store_contents import StoreContents
from .trials import ABS, CLE, CLZ, HARD, LABELS, RBS, TRIALS
from .verdict import Verdict, finite_ratio, judged, listed

DELAYS = (0.0, 0.1, 0.3, 0.5, 1.0)
SWINGS = 3.0  # times the swing without delay that count as an oscillation


def worse(shares: Mapping[str, Interval]) -> str:
    """Reproduced where every share is surely above 1, reversed where surely below, else mixed."""
    return judged(
        {k: Interval(1.0 / s.mean, 1.0 / s.high, 1.0 / (s.low or 1e-9)) for k, s in shares.items()}
    )


def guidance(found: Found) -> Verdict:
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


def adaptive(found: Found) -> Verdict:
    """Backstepping with and without adaptation."""
    shares = {label(*key): share(runs[ABS], runs[RBS]) for key, runs in found.trials.items()}
    aside = {
        label(*key): share(runs[ABS], runs[RBS], "cross_track") for key, runs in found.trials.items()
    }
    surge = [
        float(np.mean(kept(runs[c], "lag"))) ** 2 / float(np.mean(np.square(kept(runs[c], "position"))))
        for runs in found.trials.values()
        for c in (RBS, ABS)
        if kept(runs[c], "lag")
    ]
    near = {run: abs(s.mean - 1.0) < 0.05 or s.low <= 1.0 <= s.high for run, s in shares.items()}
    here = "reproduced" if all(near.values()) else f"in {sum(near.values())} of {len(near)} settings"
    falls = ", ".join(
        f"{label(*key)}: {lost(runs[RBS])} of RBS and {lost(runs[ABS])} of ABS"
        for key, runs in found.trials.items()
        if lost(runs[RBS]) or lost(runs[ABS])
    )
    return Verdict(
        "The performance difference of BS and ABS was not significant",
        f"{here} (within 5 %, or the interval holds 1)",
        f"position error of ABS over RBS: {listed(shares)}. Cross-track error: {listed(aside)}. "
        f"Fell behind for good: {falls or 'none'}. Cause: the error along the ship, in which neither "
        f"adapts, makes {100 * min(surge):.0f} to {100 * max(surge):.0f} % of the mean square",
    )


def surge_error(found: Found) -> Verdict:
    """Size of the model error in surge, the lag that it must cause, and the side of the path."""
    rows, lags, sides = [], [], []
    stiffness = 1.0 + HARD["p_x"] * HARD["d_u"]
    for trial in TRIALS:
        runs = found.trials[trial.name, REGULAR][RBS]
        omega, lag = mean(runs, "omega_X"), mean(runs, "lag")
        lags.append(lag.high < 0.0)
        rows.append(
            f"{trial.name}: {omega.mean:.2f} N, z1_x {lag.mean:.3f} m "
            f"(−ω/(1 + K_d K_p) = {-omega.mean / stiffness:.3f} m)"
        )
    for speed in (t for t in TRIALS if t.path == "ellipse"):
        for faulty in (REGULAR, FAULTY):
            for c in (RBS, ABS):
                side = mean(found.trials[speed.name, faulty][c], "inside")
                sides.append((f"{label(speed.name, faulty)}, {LABELS[c]}", side))
    known = [s for _, s in sides if isfinite(s.mean)]
    within = sum(s.low > 0.0 for s in known)
    return Verdict(
        "Large model-error, especially in surge; the ship lags and runs inside of the ellipse",
        f"{'lag reproduced' if all(lags) else 'lag not everywhere'}; inside in {within} of {len(known)}",
        f"mean magnitude of ω in surge and lag, RBS: {'; '.join(rows)}. The thesis has 0.4 N at 0.08 "
        f"and 0.5 N at 0.16 m/s. Inside of the ellipse by [m]: {listed(dict(sides))}",
    )


def no_surge(found: Found) -> Verdict:
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
    falls = any(s.high < 0.9 for s in laps.values())
    return Verdict(
        "The parametrisation (2.32) makes adaptation in surge impossible",
        "reproduced" if largest == 0.0 and not falls else "not reproduced",
        f"largest |ω̂| in surge in {len(everything)} runs of every controller: {largest:g} N. z1_x on "
        f"the second lap over the first, {TRIALS[0].name}: {listed(laps)}. Cause: the first row of Φ is "
        "empty; with (7.1) the lag goes (`python -m studies.improved`)",
    )


def spikes(found: Found) -> list[Verdict]:
    """Spikes with and without the blocker and stale errors; what the stores hold in the end."""
    parts, hurt = [], {}
    for store in dict.fromkeys(store for store, _ in found.spiked):
        numbers = []
        for c, runs in found.spiked[store, True].items():
            clean = found.spiked[store, False][c]
            hurt[store, c] = share(runs, clean, "cross_track")
            fell = f", lost {lost(clean)}→{lost(runs)}" if lost(clean) or lost(runs) else ""
            size = f"{mean(clean, 'cross_track').mean:.3f}→{mean(runs, 'cross_track').mean:.3f} m"
            numbers.append(f"{short(c)} {hurt[store, c]} ({size}{fell})")
        parts.append(f"{store}: {'; '.join(numbers)}")
    surely = {store: [s.low > 1.0 for (of, _), s in hurt.items() if of == store] for store, _ in hurt}
    bare, gated = surely[FRESH], surely[f"{FRESH}, blocker"]
    printed = [
        round(mean(runs, "cross_track").mean / mean(found.spiked[FRESH, False][c], "cross_track").mean)
        for c, runs in found.spiked[PRINTED, False].items()
    ]
    kept = {c: StoreContents(*np.mean(each, axis=0)) for c, each in found.stores.items()}
    time = float(np.mean([h.time for h in kept.values()]))
    ages = [[h.oldest for c, h in kept.items() if kind in c] for kind in ("svd", "win")]
    held = "; ".join(
        f"{short(c)}: {100 * h.stored:.0f} % of the samples, the oldest of them {h.oldest:.0f} s, and "
        f"{100 * h.gained:.0f} % of the growth of σ_min"
        for c, h in kept.items()
    )
    stored = all(h.stored > 3.0 * time for h in kept.values())
    return [
        Verdict(
            "CL storage algorithms stored spikes; SVD does not let go of them (6.5, 6.3.6)",
            f"{'reproduced' if stored else 'not reproduced'}; SVD keeps them "
            f"{'longer' if min(ages[0]) > max(ages[1]) else 'no longer'} than the window",
            f"samples taken within a second after a spike, which is {100 * time:.1f} % of the time, in "
            f"the store at the end of {TRIALS[0].name}: {held}",
        ),
        Verdict(
            "Spikes in the store spoil the adaptation, the blocker of Algorithm 4 cures it (7.2.2)",
            f"with errors formed anew spikes surely hurt {sum(bare)} of {len(bare)} controllers without "
            f"the blocker and {sum(gated)} of {len(gated)} with it",
            "cross-track error as printed, with stored errors that go stale, and without any spike: "
            f"{min(printed)} to {max(printed)} times that with errors formed anew. Spikes over none, "
            f"{TRIALS[0].name}: {'. '.join(parts)}",
        ),
    ]


def eight(found: Found) -> Verdict:
    """The slow eight, where CLE was by far the worst: with spikes, without, and with the blocker."""
    trial = TRIALS[1].name
    runs = found.trials[trial, REGULAR]
    spiked = {c: share(runs[c], runs[RBS], "iaew") for c in (ABS, CLZ, CLE)}
    cause = [
        f"{LABELS[c]} {share(each[c], runs[RBS], 'iaew')} {name}"
        for name, each in (
            ("without spikes", found.eight[OPENED, False]),
            ("with spikes and the blocker", found.eight[BLOCKED, True]),
        )
        for c in (CLZ, CLE)
    ]
    return Verdict(
        "On the slow eight CLZ and CLE keep an error in sway and come worst out of the metrics (6.4.3)",
        worse({LABELS[c]: spiked[c] for c in (CLZ, CLE)}),
        f"IAEW over that of RBS, {trial}: {listed({LABELS[c]: s for c, s in spiked.items()})}. Cause: "
        f"stored spikes; {'; '.join(cause)}",
    )


def short(controller: str) -> str:
    return controller.removeprefix("controller_cl_")


def oscillation(found: Found) -> Verdict:
    """Delay and gains."""
    numbers, begins = [], {}
    for name, (T, hertz) in margins().items():
        for c, undelayed in found.delayed[name, 0.0].items():
            swings = []
            for delay in DELAYS:
                runs = found.delayed[name, delay][c]
                factor = share(runs, undelayed, "swing").mean
                if factor > SWINGS or lost(runs):
                    begins.setdefault((name, c), delay)
                rate = np.median(kept(runs, "frequency") or [float("nan")])
                swings.append(f"{delay:g} s ×{factor:.2g} ({rate:.2f} Hz)")
            numbers.append(f"{name}, {LABELS[c]}: {', '.join(swings)}")
        numbers.append(f"{name}: margin of one axis alone {T:.2f} s at {hertz:.2f} Hz")
    hard = [begins.get(("Table 6.4", c)) for c in (ABS, CLZ)]
    soft = [begins.get(("Table 5.1", c)) for c in (ABS, CLZ)]
    twice = [begins.get(("twice Table 6.4", c)) for c in (ABS, CLZ)]
    if any(x is not None and x <= 0.5 for x in hard) and all(x is None or x > 0.5 for x in soft):
        here = "reproduced"
    elif any(x is not None and x <= 0.5 for x in twice):
        here = "only with more than the gains of Table 6.4"
    else:
        here = "not reproduced"
    return Verdict(
        "Aggressive tuning lead to an underdamped control system when there is delay",
        here,
        "RMS of the yaw rate above 0.1 Hz as a multiple of that without delay, and where its spectrum "
        f"is highest: {'; '.join(numbers)}. None has the period of 0.1 s of 6.4.5: no crossover of "
        "these gains is near 10 Hz",
    )


def estimators() -> Verdict:
    return Verdict(
        "The nonlinear estimators had insufficient robustness",
        "see the study of the estimators",
        "`python -m studies.estimators` runs them through freezes, lost poses and spikes",
    )


def fallen(found: Found) -> Verdict:
    """Which controllers fall behind at the higher speed (6.4.4)."""
    rows, fast = [], TRIALS[2].name
    for faulty in (REGULAR, FAULTY):
        runs = found.trials[fast, faulty]
        each = ", ".join(f"{LABELS[c]} {lost(r)} of {len(r)}" for c, r in runs.items())
        rows.append(f"{label(fast, faulty)}: {each}")
    runs = found.trials[fast, REGULAR]
    ahead = min(lost(runs[c]) for c in (CLZ, CLE)) > max(lost(runs[c]) for c in (RBS, ABS))
    return Verdict(
        "Outside of the model's domain, at 0.16 m/s, CLZ and CLE fail, RBS and ABS do not (6.4.4)",
        "reproduced" if ahead else "not reproduced",
        f"runs that fell back by more than 2 m: {'; '.join(rows)}",
    )


def of_trials(found: Found) -> list[Verdict]:
    """The lessons that the trials alone tell, in the order of 6.5."""
    return [guidance(found), fallen(found), adaptive(found), surge_error(found), no_surge(found)]


def of_causes(found: Found) -> list[Verdict]:
    """The lessons that need the experiments on spikes, stores and delay."""
    return [*spikes(found), eight(found), estimators(), oscillation(found)]


def lessons(found: Found) -> list[Verdict]:
    """Every lesson with its verdict, those of the experiments where they were made."""
    return of_trials(found) + (of_causes(found) if found.spiked else [])
