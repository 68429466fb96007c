"""The targets of the benchmark, and the numbers that were reached."""

from collections.abc import Callable, Iterable, Sequence
from statistics import mean, median

from .draw import FOREIGN
from .reliability_diagram import interval, mean_and_error
from .results import Row
from .simulated_runs import NOISE

Rows = Sequence[Row]
KINDS_SHOWN = ("single", "pair", "none", "foreign", "outages", "process noise")
LEAVES_REMAINDER = ("waves",)  # the ship moves with them, but no model predicts them
SURE, CERTAIN = (
    0.9,
    0.95,
)  # confidences above which a wrong finding misleads, and a right one is as good as sure


def single(rows: Rows) -> Rows:
    """Cells with one effect hidden."""
    return [r for r in rows if r.kind == "single" and not r.note]


def share(rows: Iterable[Row], good: Callable[[Row], bool]) -> str:
    """How many rows are good, in percent."""
    found = [good(r) for r in rows]
    return f"{100.0 * sum(found) / len(found):.1f} % ({sum(found)}/{len(found)})" if found else "-"


def fall(rows: Iterable[Row]) -> str:
    """Median fall of the held-out error, that of the true model, and that of it from the true state."""
    known = [r for r in rows if r.possible == r.possible]
    if not known:
        return "-"
    falls = [(r.fall, r.possible, r.limit) for r in known]
    mine, truth, limit = (median(column) for column in zip(*falls, strict=True))
    return f"{mine:.1f}x of {truth:.1f}x of {limit:.1f}x ({len(known)})"


def lines(rows: Rows) -> list[tuple[str, str, str]]:
    """Measure, target, and what was reached."""
    good = [r for r in rows if not r.note]
    one, two, none, foreign, outages, noisy = ([r for r in good if r.kind == k] for k in KINDS_SHOWN)
    exact, wrong = ([r for r in one if r.coefficients == kind] for kind in ("exact", "wrong"))
    alone = [r for r in one if r.right and r.effect not in LEAVES_REMAINDER and r.remainder]
    found = [
        ("right effect first where separable, exact", ">= 97 %", first(exact)),
        ("the same, coefficients wrong, the same coefficient counts", ">= 95 %", first(wrong)),
        ("right effect in the reported set, everywhere", "", share(one, lambda r: r.in_set)),
        (
            "the same, or nothing where changes of nominal coefficients could do the same",
            "",
            share(one, lambda r: r.in_set or (r.absorbed and not r.found)),
        ),
        ("median size of the reported set", "<= 3", _median(len(r.reported) for r in one if r.found)),
        ("separable, exact, n1: found at confidence >= 0.95", ">= 80 %", doubt(exact)),
        ("two effects, both separable, found in 2 steps, exact", ">= 90 %", both(two, "exact")),
        ("the same, coefficients wrong", "reported", both(two, "wrong")),
        ("two effects, all", "", share(two, lambda r: r.right)),
        (
            "foreign physics: reported as unexplained, nothing wrong at >= 0.9",
            ">= 95 %",
            unknown(foreign),
        ),
        ("of these: something wrong at >= 0.9", "", share(foreign, lambda r: r.surest >= SURE)),
        ("outages at other times in each run: right, and when", "", share(outages, _right)),
        ("of these: held-out predictions worse", "none", share(outages, lambda r: bool(r.worse))),
        (
            "no significant remainder where nothing is hidden",
            ">= 95 %",
            share((r for r in none if r.remainder), lambda r: r.remainder == "0"),
        ),
        (
            "no significant remainder after a right single finding",
            ">= 95 %",
            share(alone, lambda r: r.remainder == "0"),
        ),
        ("false finding where nothing is hidden", "<= 2 %", share(none, lambda r: bool(r.found))),
        (
            "fall of held-out error, of what the true model reaches, exact, median",
            ">= 0.9",
            reached(exact),
        ),
        ("the same, wrong", "", reached(wrong)),
    ]
    found.append(
        (
            "held-out predictions worse by more than two paired standard errors",
            "0",
            share(good, lambda r: bool(r.worse)),
        )
    )
    found.append(("a wrong finding at >= 0.9", "0", share(good, lambda r: r.surest >= SURE)))
    for noise in NOISE:
        some = [r for r in exact if r.noise == noise]
        found.append((f"held-out position error falls, exact, {noise}", "", fall(some)))
    found.append(("the same, wrong, all noises", "", fall(wrong)))
    rest = [r for r in good if r.kind != "process noise"]
    found.append(("95 % intervals that hold the true value", "93-97 %", coverage(rest)))
    found.append(("the same in process noise, of all that was fitted", "92-98 %", coverage(noisy)))
    found.append(
        ("there: damping is off by, mean in standard deviations", "0 within error", bias(noisy))
    )
    peers = [r for r in one if r.separable and r.sindy]
    if peers:
        found.append(("right effect first where separable: PySINDy", "", share(peers, by("sindy"))))
        found.append(("the same cells: PLS", "", share(peers, by("pls"))))
        found.append(("the same cells: the diagnosis", "", share(peers, lambda r: r.right)))
    found.append(("processor time of a cell to the answer (4 runs), median", "", _seconds(rows)))
    return found


def first(rows: Rows) -> str:
    """How often the right effect came first where that is possible, and for each noise."""
    apart = [r for r in rows if r.separable]
    each = ", ".join(
        f"{n} {share((r for r in apart if r.noise == n), _right)}" for n in NOISE if _any(apart, n)
    )
    return f"{share(apart, _right)}" + (f": {each}" if each else "")


def _any(rows: Rows, noise: str) -> bool:
    return any(r.noise == noise for r in rows)


def _right(r: Row) -> bool:
    return r.right


def both(rows: Rows, kind: str) -> str:
    """How often two separable effects came in two steps."""
    return share((r for r in rows if r.separable and r.coefficients == kind), _right)


def doubt(rows: Rows) -> str:
    """How often a separable effect at n1 is reported as good as certain."""
    return share(
        (r for r in rows if r.separable and r.noise == "n1"),
        lambda r: r.right and bool(r.confidences) and float(r.confidences[0]) >= CERTAIN,
    )


def unknown(rows: Rows) -> str:
    """How often physics that no candidate has is reported as such, all of them and each kind."""

    def good(r: Row) -> bool:
        return (r.verdict == "unexplained" or r.remainder == "1") and r.surest < SURE

    kinds = sorted({r.effect for r in rows})
    each = ", ".join(f"{k} {sum(good(r) for r in rows if r.effect == k)}" for k in kinds)
    return share(rows, good) + (f": {each}" if each else "")


def reached(rows: Rows) -> str:
    """Median share of the true model's fall."""
    known = [r.reached for r in rows if r.reached == r.reached]
    return f"{median(known):.2f} ({len(known)})" if known else "-"


def bias(rows: Rows) -> str:
    """Mean of how far damping is off, with its standard error.

    Motion tells force over mass: the coefficients of one ship are off together, and count as one.
    """
    off = [mean(float(z) for z in r.damping) for r in rows if r.damping]
    if len(off) < 2:
        return "-"
    return "{:.2f} +- {:.2f} ({} ships)".format(*mean_and_error(off), len(off))


def coverage(rows: Rows) -> str:
    """Share of intervals that hold the true value, with its binomial interval."""
    intervals = sum(r.intervals for r in rows)
    if not intervals:
        return "-"
    covered = sum(r.covered for r in rows)
    low, high = interval(covered, intervals)
    rate = 100.0 * covered / intervals
    return f"{rate:.1f} % ({covered}/{intervals}; {100 * low:.0f}-{100 * high:.0f} %)"


def by(peer: str) -> Callable[[Row], bool]:
    """Whether a peer's first effect is the right one."""
    return lambda r: getattr(r, peer) in FOREIGN.get(r.effect, (r.effect,))


def _median(numbers: Iterable[float]) -> str:
    found = list(numbers)
    return f"{median(found):g}" if found else "-"


def _seconds(rows: Rows) -> str:
    return _median(round(r.seconds, 1) for r in rows if r.seconds == r.seconds) + " s"
