"""The summary of the benchmark: targets beside the numbers that were reached."""

import os
import platform
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import median

from .cost import Cost
from .draw import FOREIGN
from .results import Row

Rows = Sequence[Row]
HEAD = """# Does the diagnosis find hidden effects?

Written by `python -m benchmarks.hidden_effects`; every cell is in [results.csv](results.csv). A cell is
a ship with effects hidden in it on three manoeuvres of 240 s at 50 Hz (ellipse, figure of eight,
multisine) to learn from, and one held out. Noise n1 is 0.5 mm and 0.05 deg, n4 and n10 are 4 and 10
times that; there are freezes of up to 1 s and spikes. The diagnosis gets the columns of a measurement
and nothing else. With coefficients "wrong", every nominal coefficient of the plant is up to 10 % off,
and the prior is 0.1.

Two effects are *separable* where the best fit of one leaves at least 5 % of the other's true force,
computed from the true motion without noise, with coefficients free to change by 10 % where they are
nuisance parameters. There the right effect must come first; everywhere it must be in the reported set.

The fall of the held-out error stands beside that with the true model, and that with the
true model from the true state at the beginning of each window. Then nothing but the noise of the
measurement is left, and no method can do better.
"""


def single(rows: Rows) -> Rows:
    """Cells with one effect hidden."""
    return [r for r in rows if " + " not in r.effect and r.effect != "none" and not r.note]


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


def lines(rows: Rows, cost: Cost | None) -> list[tuple[str, str, str]]:
    """Measure, target, and what was reached."""
    one = single(rows)
    exact = [r for r in one if r.coefficients == "exact"]
    wrong = [r for r in one if r.coefficients == "wrong"]
    two = [r for r in rows if " + " in r.effect and not r.note]
    none = [r for r in rows if r.effect == "none" and not r.note]

    def first(some: Rows, *noise: str) -> str:
        return share((r for r in some if r.separable and r.noise in noise), lambda r: r.right)

    every = ("n1", "n4", "n10")
    found = [
        ("right effect first where separable, exact, n1 and n4", ">= 97 %", first(exact, "n1", "n4")),
        ("the same, n10", ">= 93 %", first(exact, "n10")),
        ("right effect first where separable, coefficients wrong", ">= 92 %", first(wrong, *every)),
        ("right effect in the reported set, everywhere", ">= 97 %", share(one, lambda r: r.in_set)),
        (
            "the same, or nothing where changes of nominal coefficients could do the same",
            "",
            share(one, lambda r: r.in_set or (r.absorbed and not r.found)),
        ),
        ("median size of the reported set", "<= 3", _median(len(r.reported) for r in one if r.found)),
    ]
    for kind in ("exact", "wrong"):
        some = [r for r in none if r.coefficients == kind]
        found.append((f"false finding, {kind}", "<= 3 %", share(some, lambda r: bool(r.found))))
    for noise, target in zip(every, ("50x", "20x", "10x"), strict=True):
        some = [r for r in exact if r.noise == noise]
        found.append(
            (
                f"held-out position error falls, exact, {noise}",
                target,
                fall(some),
            )
        )
    found.append(("the same, wrong, all noises", "5x", fall(wrong)))
    apart = [r for r in two if r.separable]
    found.append(
        ("two effects, both separable, found in 2 steps", ">= 85 %", share(apart, lambda r: r.right))
    )
    found.append(("two effects, all", "", share(two, lambda r: r.right)))
    both = [r for r in one if r.separable and r.sindy]
    found.append(("right effect first where separable: PySINDy", "", share(both, by("sindy"))))
    found.append(("the same cells: PLS", "", share(both, by("pls"))))
    found.append(("the same cells: the diagnosis", "", share(both, lambda r: r.right)))
    found.append(("processor time of a cell to the answer (3 runs), median", "", _seconds(rows)))
    if cost is not None:
        found.append(("time of 4 runs x 240 s x 50 Hz", "<= 20 s", f"{cost.seconds:.1f} s"))
        found.append(("memory, one hour at 100 Hz", "< 1 GB", f"{cost.megabytes:.0f} MB"))
    return found


def by(peer: str) -> Callable[[Row], bool]:
    """Whether a peer's first effect is the right one."""
    return lambda r: getattr(r, peer) in FOREIGN.get(r.effect, (r.effect,))


def _median(numbers: Iterable[float]) -> str:
    found = list(numbers)
    return f"{median(found):g}" if found else "-"


def _seconds(rows: Rows) -> str:
    return _median(round(r.seconds, 1) for r in rows if r.seconds == r.seconds) + " s"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    cells = [list(head), ["---"] * len(head), *([c.replace("|", "\\|") for c in row] for row in rows)]
    return "\n".join(f"| {' | '.join(row)} |" for row in cells)


def by_effect(rows: Rows) -> list[list[str]]:
    """For each effect, how often it was found and what came in its place."""
    found = []
    one = single(rows)
    for effect in sorted({r.effect for r in one}):
        mine = [r for r in one if r.effect == effect]
        apart = [r for r in mine if r.separable]
        instead = Counter(r.found[0] if r.found else "nothing" for r in mine if not r.right).most_common(
            3
        )
        right, kept = sum(r.right for r in apart), sum(r.in_set for r in mine)
        others = ", ".join(f"{name} {count}x" for name, count in instead)
        found.append([effect, f"{right}/{len(apart)}", f"{kept}/{len(mine)}", fall(mine), others])
    return found


def write(folder: Path, rows: Rows, cost: Cost | None) -> Path:
    """Write the summary.

    Returns:
        Its path.
    """
    seeds = sorted({r.seed % 100 for r in rows})
    used = ["numpy", "scipy"] + ["pysindy", "scikit-learn"] * any(r.sindy for r in rows)
    packages = ", ".join(f"{n} {version(n)}" for n in used)
    machine = f"{platform.machine()} {platform.system()}, {os.cpu_count()} cores"
    failed = [r for r in rows if r.note]
    ran = f"{len(rows)} cells, seeds {seeds[0]}-{seeds[-1]}; " if rows else "No cells yet; "
    parts = [
        HEAD + f"\n{ran}CPython {platform.python_version()} on {machine}; {packages}.",
        table(("", "target", "reached"), lines(rows, cost)),
        "## Effect by effect\n",
        table(
            ("hidden", "first where separable", "in the set", "held-out error falls", "first instead"),
            by_effect(rows),
        ),
    ]
    if failed:
        parts += ["## Without a result\n", *(f"- {r.effect}, {r.noise}: {r.note}" for r in failed)]
    path, part = folder / "summary.md", folder / ".summary.part"
    part.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    os.replace(part, path)
    return path
