"""What is aimed at in reading logs as they come, and how much of it is reached.

A log that was recorded in some way keeps verdict and cause of the clean one if its verdict is the same
and the same effects are found, but for those that the way itself has. Where one run determines no cause,
that says little: then the effect counts that explains most of the clean log's error, of those that the
diagnosis lists as found or possible. It is kept if it is listed again, be it as one that is
indistinguishable from another.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from .recorded import Recorded
from .ways_to_log import POSE

CLEAN = "clean"
WITHIN = 0.3  # of the noise that there is: the estimate counts as right, and as one that is known
KEPT, WORSE = 0.8, 1.3  # share of the ways that keep verdict and cause; error over the clean one
SURE = 0.8  # confidence from which on a cause that is not there is wrong


def line(o: Recorded, clean: Recorded | None) -> str:
    """A row of the table that is printed; in parentheses a noise that is unknown, or a bound (<)."""
    each = zip(o.noise, o.rel_std, o.at_most, strict=True)
    ratio = " ".join(
        "-" if np.isnan(r) else f"{r:.2f}" if std <= WITHIN and not bound else f"({'<' * bound}{r:.2f})"
        for r, std, bound in each
    )
    said = ", ".join(f"{e} {'-' if c is None else f'{c:.2f}'}" for e, c in o.found.items())
    doubt = f"; doubted: {' '.join(o.doubted)}" if o.doubted else ""
    error = f"{o.error / clean.error:.2f}" if clean is not None and o.error > 0.0 else "-"
    return f"| {o.way} | {o.refused or ratio}{doubt} | {o.verdict} {said} | {error} | {o.seconds:.0f} |"


def aims(found: Sequence[Recorded], there: Sequence[str] | None) -> Iterator[tuple[str, str]]:
    """Each aim, and how much of it is reached.

    Args:
        found: what was made of each way.
        there: effects that there are; None: those that the clean log is sure of, if it was learned from.
    """
    read_ones = [o for o in found if not o.refused]
    yield "none refused", f"{len(found) - len(read_ones)} of {len(found)} refused"
    each = [
        c for o in read_ones if not o.misstated for c in zip(o.noise, o.rel_std, o.at_most, strict=True)
    ]
    white = [c for c in each if np.isfinite(c[0])]
    known = [abs(np.log(r)) < np.log1p(WITHIN) for r, std, bound in white if std <= WITHIN and not bound]
    bounds = [np.log(r) > -np.log1p(WITHIN) for r, _, bound in white if bound]
    if white:
        unknown = f"{len(white) - len(known) - len(bounds)} are said to be unknown"
        yield f"noise within {WITHIN:.0%}", f"{sum(known)} of {len(known)} channels; {unknown}"
    if bounds:
        yield f"noise below its upper bound + {WITHIN:.0%}", f"{sum(bounds)} of {len(bounds)} channels"
    wrong = [o for o in read_ones if o.misstated]
    if wrong:
        doubted = sum({*o.misstated} <= {*o.doubted} for o in wrong)
        yield "a noise that is given wrongly is doubted, with odds", f"{doubted} of {len(wrong)}"
    rights = [o for o in read_ones if not o.misstated]
    unduly = sum(len(o.doubted) for o in rights)
    yield "no other is", f"{unduly} channels of {len(POSE) * len(rights)}"
    clean = next((o for o in found if o.way == CLEAN), None)
    if clean is None or not clean.verdict:
        return
    others = [o for o in read_ones if o is not clean]
    limited = [o for o in others if not o.misstated]
    kept = sum(o.verdict == clean.verdict and o.physics == {*clean.found} for o in limited)
    yield f"{KEPT:.0%} keep verdict and cause", f"{kept} of {len(limited)}"
    if listed := {e: share for e, share in clean.listed.items() if share is not None}:
        leading = max(listed, key=lambda e: listed[e])
        again = sum(leading in o.listed for o in limited)
        yield (
            f"list the effect that explains most of the clean log ({leading})",
            f"{again} of {len(limited)}",
        )
    true = {e for e, c in clean.found.items() if (c or 0.0) >= SURE} if there is None else {*there}
    sure = [o.way for o in others if {e for e in o.physics if (o.found[e] or 0.0) >= SURE} - true]
    yield f"none sure ({SURE}) of an absent cause", f"{len(sure)} of {len(others)}: {', '.join(sure)}"
    errors = {o.way: o.error / clean.error for o in limited if np.isfinite(o.error)}
    if errors:
        worst = max(errors, key=lambda way: errors[way])
        median = f"{np.median([*errors.values()]):.2f}, worst {errors[worst]:.2f} ({worst})"
        yield f"held-out error over the clean one, median at most {WORSE}", median
