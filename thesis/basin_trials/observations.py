"""The observations of 6.4.2 to 6.4.5 on the basin trials, each with what our runs show."""

from collections.abc import Sequence
from math import isnan

from studies.study_report import Verdict

from ..monte_carlo import SampleMean
from ..tracking.verdict import below as below_one
from ..tracking.verdict import listed
from .found import FAULTY, REGULAR, Runs, TrialRuns, lost, mean, share
from .trials import ABS, CLE, CLZ, LABELS, RBS, SLOW, TRIALS, path_swing

MUCH = 1.5  # times that count as "substantially"; chosen
HIDDEN = 0.5  # 1, share of an error below which a signal does not show it; chosen
LITTLE = 0.5  # 1, share of the model error below which an estimate explains little; chosen


def surely_below(ratios: Sequence[SampleMean]) -> bool | None:
    """Whether all ratios are surely below 1; no where one surely is not; None: open, or no run."""
    answers = [below_one(s) for s in ratios]
    return False if False in answers else True if all(answers) else None


def surely_between(m: SampleMean, low: float, high: float) -> bool | None:
    """Whether a mean lies between two limits with its whole interval; no if none of it does."""
    if low < m.low and m.high < high:
        return True
    return False if m.high <= low or m.low >= high else None


def no_run(answer: bool, ratio: SampleMean) -> bool | None:
    """The answer, or None where no run kept up."""
    return None if isnan(ratio.mean) else bool(answer)


def as_in_the_basin(found: TrialRuns, trial: int) -> dict[str, Runs]:
    """The runs of a trial with the guidance fault, as in the basin, and without."""
    name = TRIALS[trial].name
    return {"with the fault": found.trials[name, FAULTY], "without": found.trials[name, REGULAR]}


def below(found: TrialRuns, thesis: str, trial: int, number: str, *pairs: tuple[str, str]) -> Verdict:
    """Whether a number of the first of each pair of controllers is surely below that of the second."""
    here, rows = {}, []
    for name, runs in as_in_the_basin(found, trial).items():
        ratios = {f"{LABELS[a]}/{LABELS[b]}": share(runs[a], runs[b], number) for a, b in pairs}
        here[name] = surely_below(list(ratios.values()))
        rows.append(f"{name}: {listed(ratios)}")
    return Verdict(thesis, here, f"{number}, {TRIALS[trial].name}, {'; '.join(rows)}")


def held(
    found: TrialRuns, thesis: str, trial: int, number: str, low: float, high: float, note: str = ""
) -> Verdict:
    """Whether the mean of a number surely lies between two limits, for each controller that kept up."""
    here, rows = {}, []
    for name, runs in as_in_the_basin(found, trial).items():
        means = {LABELS[c]: mean(each, number) for c, each in runs.items()}
        here |= {f"{name}, {c}": surely_between(m, low, high) for c, m in means.items()}
        rows.append(f"{name}: {listed(means)}")
    limits = f"between {low:g} and {high:g} with its interval"
    return Verdict(thesis, here, f"{number}, {TRIALS[trial].name}, {limits}{note}; {'; '.join(rows)}")


def follow(found: TrialRuns, trial: int) -> Verdict:
    """Whether every controller keeps up in every run."""
    runs = as_in_the_basin(found, trial)
    fell = {name: {LABELS[c]: lost(r) for c, r in each.items()} for name, each in runs.items()}
    return Verdict(
        "The controllers are able to follow the figure-eight",
        {name: not any(each.values()) for name, each in fell.items()},
        f"{TRIALS[trial].name}, runs lost, "
        + "; ".join(f"{n}: {', '.join(f'{c} {k}' for c, k in e.items())}" for n, e in fell.items()),
    )


def other_sections(found: TrialRuns) -> dict[str, Sequence[Verdict]]:
    """What the thesis says of the other three trials, by section."""
    old, new = (RBS, ABS), (CLZ, CLE)
    both = [(a, b) for a in old for b in new]
    ways = [(b, a) for a, b in both]
    crossed = ((RBS, ABS), (CLE, CLZ))
    return {
        "The ellipse at 0.08 m/s (6.4.2)": (
            held(found, "The ship is inside of the desired trajectory", 0, "inside", 0.0, float("inf")),
            below(found, "Oscillations are stronger with concurrent learning", 0, "swing", *both),
            below(found, "IAEWWT does not show them: it is less with CL", 0, "iaewwt", *ways),
            below(found, "CLZ tracks best", 0, "cross_track", *((CLZ, c) for c in (RBS, ABS, CLE))),
            held(found, "No controller adapts in surge", 0, "omega_hat_X", -1e-12, 1e-12),
        ),
        "The eight at 0.16 (6.4.3)": (
            follow(found, 1),
            below(found, "RBS and ABS get closer to the path than CLZ and CLE", 1, "cross_track", *both),
            below(found, "RBS and ABS come best out of the metrics", 1, "iaewwt", *both),
            below(found, "ABS is a bit more energy efficient than RBS", 1, "work", (ABS, RBS)),
            below(found, "CLE is the worst", 1, "iaewwt", *((c, CLE) for c in (RBS, ABS, CLZ))),
            *sway_error(found),
            struggling(found),
        ),
        "The eight at 0.32 (6.4.5)": (
            follow(found, 3),
            below(found, "ABS and CLZ oscillate more than RBS and CLE", 3, "swing", *crossed),
            below(found, "So IAEWWT of ABS surpasses that of RBS, CLZ's CLE's", 3, "iaewwt", *crossed),
            held(
                found,
                "The period of the oscillation is near 0.1 s",
                3,
                "frequency",
                5.0,
                20.0,
                f" [Hz]; near {SLOW:g} Hz, the filter's edge, it is a harmonic of the path",
            ),
        ),
    }


def sway_error(found: TrialRuns) -> list[Verdict]:
    """Whether concurrent learning keeps an error across the slow eight, which z1 does not show."""
    here, shown, rows = {}, {}, []
    for name, runs in as_in_the_basin(found, 1).items():
        size = {
            c: [r._replace(bias=abs(r.bias), z1_y=abs(r.z1_y)) for r in each] for c, each in runs.items()
        }
        pairs = {
            f"{LABELS[a]}/{LABELS[b]}": share(size[a], size[b], "bias")
            for a in (RBS, ABS)
            for b in (CLZ, CLE)
        }
        here[name] = surely_below(list(pairs.values()))
        bias, z1 = ({c: mean(size[c], n).mean for c in (CLZ, CLE)} for n in ("bias", "z1_y"))
        shown |= {
            f"{name}, {LABELS[c]}": z1[c] < HIDDEN * bias[c] if bias[c] > 0.0 else None for c in bias
        }
        means = ", ".join(f"{LABELS[c]} {bias[c]:.3g} and {z1[c]:.3g}" for c in bias)
        rows.append(f"{name}: {listed(pairs)}; e and z1_y [m]: {means}")
    numbers = f"magnitude of the mean of e, {TRIALS[1].name}, {'; '.join(rows)}"
    return [
        Verdict("CLZ and CLE keep a constant error in sway, more than RBS and ABS", here, numbers),
        Verdict("z1 does not show that error", shown, f"z1_y below {HIDDEN:g} of e; as above"),
    ]


def struggling(found: TrialRuns) -> Verdict:
    """Whether the estimates explain little of the model error of the slow eight."""
    here, rows = {}, []
    for name, runs in as_in_the_basin(found, 1).items():
        known = {LABELS[c]: [mean(runs[c], f"known_{a}").mean for a in "YN"] for c in (ABS, CLZ, CLE)}
        here |= {f"{name}, {c}": None if isnan(x[0]) else max(x) < LITTLE for c, x in known.items()}
        rows.append(f"{name}: " + ", ".join(f"{c} {y:.2f}, {n:.2f}" for c, (y, n) in known.items()))
    return Verdict(
        "The adaptive controllers struggle to estimate the model error",
        here,
        f"share of the mean square of ω in sway and yaw that ω̂ explains, little below {LITTLE:g}: "
        f"{'; '.join(rows)}",
    )


def settings(found: TrialRuns) -> dict[str, tuple[Runs, Runs]]:
    """With the guidance fault, as in the basin, and without: the slow runs and the fast ones."""
    slow, fast = (as_in_the_basin(found, trial) for trial in (0, 2))
    return {name: (slow[name], fast[name]) for name in slow}


def grown(
    found: TrialRuns, thesis: str, number: str, unit: str, gone: bool | None, path: float = 1.0
) -> Verdict:
    """Whether a number of every controller grows much more than that of the path with the speed.

    ``gone`` is the answer where no run of a controller kept up.
    """
    here, rows = {}, []
    for name, (slow, fast) in settings(found).items():
        ratios = {c: share(fast[c], slow[c], number) for c in (RBS, ABS, CLZ, CLE)}
        here |= {
            f"{name}, {LABELS[c]}": gone if isnan(r.mean) else r.mean > MUCH * path
            for c, r in ratios.items()
        }
        for c, r in ratios.items():
            size = f"{mean(slow[c], number).mean:.3g}→{mean(fast[c], number).mean:.3g} {unit}"
            fell = f", lost {lost(fast[c])} of {len(fast[c])}" if lost(fast[c]) else ""
            rows.append(f"{LABELS[c]} {name} {size} (×{r.mean:.2g}{fell})")
    rows += [f"that of the path itself ×{path:.2g}"] if path != 1.0 else []
    rows += [f"limit ×{MUCH * path:.2g}"]
    return Verdict(thesis, here, "; ".join(rows))


def failing(found: TrialRuns) -> Verdict:
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
    return Verdict(
        "CLZ and CLE fail compared with RBS and ABS",
        here,
        f"more runs lost, or a cross-track error surely above {MUCH:g} times that of RBS: "
        f"{'; '.join(rows)}",
    )


def improving(found: TrialRuns) -> Verdict:
    """Whether adaptive backstepping still tracks better than backstepping."""
    here, rows = {}, []
    for name, (_, fast) in settings(found).items():
        ratio = share(fast[ABS], fast[RBS])
        here[name] = below_one(ratio)
        aside = share(fast[ABS], fast[RBS], "cross_track")
        rows.append(f"{name}: position {ratio}, cross-track {aside}")
    return Verdict(
        "ABS still manages to show improved performance compared to RBS",
        here,
        f"ABS over RBS, {'; '.join(rows)}",
    )


def surge(found: TrialRuns) -> Verdict:
    """Whether the model error in surge grows less than in proportion to the speed."""
    here, rows = {}, []
    for name, (slow, fast) in settings(found).items():
        ratio = share(fast[RBS], slow[RBS], "omega_X")
        here[name] = no_run(ratio.mean < MUCH, ratio)
        a, b = mean(slow[RBS], "omega_X").mean, mean(fast[RBS], "omega_X").mean
        rows.append(f"{name}: {a:.2f}→{b:.2f} N (×{ratio.mean:.2f})")
    return Verdict(
        "The error in surge has not increased that much (0.4 N to 0.5 N)",
        here,
        f"RBS, limit ×{MUCH:g}, {'; '.join(rows)}",
    )


def sway(found: TrialRuns) -> Verdict:
    """Whether the mean model error in sway leaves zero at the higher speed."""
    here, rows = {}, []
    for name, (slow, fast) in settings(found).items():
        a, b = (mean(runs[RBS], "omega_Y") for runs in (slow, fast))
        here[name] = no_run(abs(b.mean) > MUCH * abs(a.mean), b)
        rows.append(f"{name}: {a.mean:.3f}→{b.mean:.3f} N")
    return Verdict(
        "The error in sway has drifted to the side",
        here,
        f"its mean, RBS, limit ×{MUCH:g}, {'; '.join(rows)}. The thesis suspects the bow thruster above "
        "0.15 m/s; rotational damping alone makes a mean error on a path that turns one way",
    )


def observations(found: TrialRuns) -> list[Verdict]:
    """The observations in the order of 6.4.4."""
    path = path_swing(TRIALS[2]) / path_swing(TRIALS[0])
    return [
        grown(found, "Tracking is substantially decreased", "position", "m", gone=True),
        grown(found, "The oscillations have increased", "swing", "rad/s", None, path),
        failing(found),
        improving(found),
        surge(found),
        sway(found),
    ]
