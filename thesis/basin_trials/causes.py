"""Lessons of 6.5 that need experiments of their own: stored spikes, the blocker, delay and gains."""

import numpy as np

from studies.study_report import Verdict

from ..tracking.verdict import listed, worse
from .found import BLOCKED, FRESH, OPENED, PRINTED, REGULAR, TrialRuns, kept, lost, mean, share
from .margin import margins
from .store_contents import StoreContents
from .trials import ABS, CLE, CLZ, LABELS, RBS, TRIALS

DELAYS = (0.0, 0.1, 0.3, 0.5, 1.0)
SWINGS = 3.0  # times the swing without delay that count as an oscillation


def spikes(found: TrialRuns) -> list[Verdict]:
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
            "CL storage algorithms stored spikes; SVD does not discard them (6.5, 6.3.6)",
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


def eight(found: TrialRuns) -> Verdict:
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


def oscillation(found: TrialRuns) -> Verdict:
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
        "`python -m thesis.estimators` runs them through freezes, lost poses and spikes",
    )


def of_causes(found: TrialRuns) -> list[Verdict]:
    """The lessons that need the experiments on spikes, stores and delay."""
    return [*spikes(found), eight(found), estimators(), oscillation(found)]
