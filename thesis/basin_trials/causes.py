"""Lessons of 6.5 that need experiments of their own: stored spikes, the blocker, delay and gains."""

from math import inf

import numpy as np

from studies.study_report import Verdict

from ..tracking.verdict import listed, worse
from .found import (
    BLOCKED,
    FRESH,
    OPENED,
    PRINTED,
    REGULAR,
    SAME,
    TrialRuns,
    alike,
    kept,
    lost,
    mean,
    share,
)
from .margin import margins
from .store_contents import StoreContents
from .trials import ABS, CLE, CLZ, LABELS, RBS, TRIALS

DELAYS = (0.0, 0.1, 0.3, 0.5, 1.0)
SOON = 0.5  # s of delay, by which an oscillation counts; chosen
MORE = 3.0  # times its part of the time by which a kind of samples is stored more often; chosen
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
    spoilt = f"cross-track error with spikes over that without, {TRIALS[0].name}: {'. '.join(parts)}"
    stale = {
        c: share(runs, found.spiked[FRESH, False][c], "cross_track")
        for c, runs in found.spiked[PRINTED, False].items()
    }
    kept = {c: StoreContents(*np.mean(each, axis=0)) for c, each in found.stores.items()}
    time = float(np.mean([h.time for h in kept.values()]))
    oldest = {kind: [h.oldest for c, h in kept.items() if kind in c] for kind in ("svd", "win")}
    held = "; ".join(
        f"{short(c)}: {100 * h.stored:.0f} % of the samples, the oldest of them {h.oldest:.0f} s, and "
        f"{100 * h.gained:.0f} % of the growth of σ_min"
        for c, h in kept.items()
    )
    return [
        Verdict(
            "CL storage algorithms stored spikes (6.5, 6.3.6)",
            {short(c): h.stored > MORE * time for c, h in kept.items()},
            f"samples taken within a second after a spike, more than {MORE:g} times their part of the "
            f"time, {100 * time:.1f} %; in the store at the end of {TRIALS[0].name}: {held}",
        ),
        Verdict(
            "SVD does not discard them (6.5)",
            min(oldest["svd"]) > max(oldest["win"]),
            "the oldest of them, with every SVD older than with every window: as above",
        ),
        Verdict(
            "Spikes in the store spoil the adaptation (7.2.2)",
            worse({short(c): x for (store, c), x in hurt.items() if store == FRESH}),
            spoilt,
            worse({short(c): x for (store, c), x in hurt.items() if store == PRINTED}),
        ),
        Verdict(
            "The blocker of Algorithm 4 cures it (7.2.2)",
            {short(c): alike(x) for (store, c), x in hurt.items() if store == f"{FRESH}, blocker"},
            f"no difference: within {100 * SAME:g} %, or the interval holds 1; as above",
            {short(c): alike(x) for (store, c), x in hurt.items() if store == f"{PRINTED}, blocker"},
        ),
        Verdict(
            "(here) stored errors that go stale are worse than errors formed anew, without any spike",
            worse({short(c): x for c, x in stale.items()}),
            f"cross-track error as printed over formed anew: "
            f"{listed({short(c): x for c, x in stale.items()})}",
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
    early = {name: any(begins.get((name, c), inf) <= SOON for c in (ABS, CLZ)) for name in margins()}
    return Verdict(
        "Aggressive tuning lead to an underdamped control system when there is delay",
        {name: early[name] and not early["Table 5.1"] for name in ("Table 6.4", "twice Table 6.4")},
        f"oscillation: {SWINGS:g} times the swing without delay, or a ship that is lost, by {SOON:g} s "
        "of delay, but not with the gains of Table 5.1. RMS of the yaw rate above 0.1 Hz as a multiple "
        "of that without delay, and where its spectrum is highest (at 0.1 Hz, the filter's edge, it is "
        f"the path's): {'; '.join(numbers)}. None has the period of 0.1 s of 6.4.5: no crossover of "
        "these gains is near 10 Hz",
    )


def of_causes(found: TrialRuns) -> list[Verdict]:
    """The lessons that need the experiments on spikes, stores and delay."""
    return [*spikes(found), eight(found), oscillation(found)]
