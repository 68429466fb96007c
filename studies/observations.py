"""The observations of 6.4.4, on the ellipse at twice the speed, each with what our runs show."""

from .found import FAULTY, REGULAR, Found, Runs, lost, mean, share
from .trials import ABS, CLE, CLZ, LABELS, RBS, TRIALS
from .verdict import Verdict

MUCH = 1.5  # times that count as "substantially"; chosen


def answered(answers: dict[str, bool | None]) -> str:
    """One word for each setting; None: no run kept up."""
    words = {True: "yes", False: "no", None: "no run kept up"}
    return "; ".join(f"{setting}: {words[a]}" for setting, a in answers.items())


def settings(found: Found) -> dict[str, tuple[Runs, Runs]]:
    """With the guidance fault, as in the basin, and without: the slow runs and the fast ones."""
    slow, fast = TRIALS[0].name, TRIALS[2].name
    return {
        name: (found.trials[slow, faulty], found.trials[fast, faulty])
        for name, faulty in (("with the fault", FAULTY), ("without", REGULAR))
    }


def grown(found: Found, thesis: str, number: str, unit: str) -> Verdict:
    """Whether a number of every controller is much larger than at half the speed."""
    here, rows = {}, []
    for name, (slow, fast) in settings(found).items():
        ratios = {c: share(fast[c], slow[c], number) for c in (RBS, ABS, CLZ, CLE)}
        alive = [r.mean > MUCH for r in ratios.values() if r.mean == r.mean]
        here[name] = all(alive) if alive else None
        for c, r in ratios.items():
            size = f"{mean(slow[c], number).mean:.3g}→{mean(fast[c], number).mean:.3g} {unit}"
            fell = f", lost {lost(fast[c])} of {len(fast[c])}" if lost(fast[c]) else ""
            rows.append(f"{LABELS[c]} {name} {size} (×{r.mean:.2g}{fell})")
    return Verdict(thesis, answered(here), "; ".join(rows))


def failing(found: Found) -> Verdict:
    """Whether concurrent learning loses the ship more often than the others."""
    here, rows = {}, []
    for name, (_, fast) in settings(found).items():
        fell = {c: lost(fast[c]) for c in (RBS, ABS, CLZ, CLE)}
        worse = {c: share(fast[c], fast[RBS], "cross_track") for c in (CLZ, CLE)}
        here[name] = min(fell[CLZ], fell[CLE]) > max(fell[RBS], fell[ABS]) or all(
            s.low > MUCH for s in worse.values()
        )
        each = ", ".join(f"{LABELS[c]} {n} of {len(fast[c])}" for c, n in fell.items())
        ratios = ", ".join(f"{LABELS[c]} {s}" for c, s in worse.items())
        rows.append(f"{name}: lost {each}; cross-track error over that of RBS: {ratios}")
    return Verdict("CLZ and CLE fail compared with RBS and ABS", answered(here), "; ".join(rows))


def improving(found: Found) -> Verdict:
    """Whether adaptive backstepping still tracks better than backstepping."""
    here, rows = {}, []
    for name, (_, fast) in settings(found).items():
        ratio = share(fast[ABS], fast[RBS])
        here[name] = ratio.high < 1.0 if ratio.mean == ratio.mean else None
        aside = share(fast[ABS], fast[RBS], "cross_track")
        rows.append(f"{name}: position {ratio}, cross-track {aside}")
    return Verdict(
        "ABS still manages to show improved performance compared to RBS",
        answered(here),
        f"ABS over RBS, {'; '.join(rows)}",
    )


def surge(found: Found) -> Verdict:
    """Whether the model error in surge grows less than in proportion to the speed."""
    here, rows = {}, []
    for name, (slow, fast) in settings(found).items():
        ratio = share(fast[RBS], slow[RBS], "omega_X")
        here[name] = ratio.mean < MUCH if ratio.mean == ratio.mean else None
        a, b = mean(slow[RBS], "omega_X").mean, mean(fast[RBS], "omega_X").mean
        rows.append(f"{name}: {a:.2f}→{b:.2f} N (×{ratio.mean:.2f})")
    return Verdict(
        "The error in surge has not increased that much (0.4 N to 0.5 N)",
        answered(here),
        f"RBS, {'; '.join(rows)}",
    )


def sway(found: Found) -> Verdict:
    """Whether the mean model error in sway leaves zero at the higher speed."""
    here, rows = {}, []
    for name, (slow, fast) in settings(found).items():
        a, b = (mean(runs[RBS], "omega_Y") for runs in (slow, fast))
        here[name] = abs(b.mean) > MUCH * abs(a.mean) if b.mean == b.mean else None
        rows.append(f"{name}: {a.mean:.3f}→{b.mean:.3f} N")
    return Verdict(
        "The error in sway has drifted to the side",
        answered(here),
        f"its mean, RBS, {'; '.join(rows)}. The thesis suspects the bow thruster above 0.15 m/s; "
        "rotational damping alone makes a mean error on a path that turns one way",
    )


def observations(found: Found) -> list[Verdict]:
    """The observations in the order of 6.4.4."""
    return [
        grown(found, "Tracking is substantially decreased", "position", "m"),
        grown(found, "The oscillations have increased", "swing", "rad/s"),
        failing(found),
        improving(found),
        surge(found),
        sway(found),
    ]
