"""The summary of the benchmark: targets beside the numbers that were reached."""

import os
import platform
from collections import Counter
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path

from .reliability_diagram import Bin, tables
from .targets import Rows, fall, lines, single

HEAD = """# Does the diagnosis find hidden effects?

Written by `python -m benchmarks.hidden_effects`; every cell is in [results.csv](results.csv). A cell is
a ship with effects hidden in it on three manoeuvres of 240 s at 50 Hz (ellipse, figure of eight,
multisine) to learn from, and one held out. Noise n1 is 0.5 mm and 0.05 deg, n4 and n10 are 4 and 10
times that; there are freezes of up to 1 s and spikes. The diagnosis gets the columns of a measurement
and nothing else. With coefficients "wrong", every nominal coefficient of the plant is up to 10 % off,
and the prior is 0.1.

Two effects are *separable* where the best fit of one leaves at least 5 % of the other's true force,
computed from the true motion without noise, with coefficients free to change by 10 % where they are
nuisance parameters. There the right effect must come first; two must come within two steps.

*Process noise* is a force of nobody's on all axes, 2 to 10 % of the commanded one, correlated over 1 to
5 s; there nominal coefficients, where wrong, are normal with the prior's standard deviation.

*Foreign physics* is in no candidate of the diagnosis: nothing that it names is a true cause.

The fall of the held-out error is next to that with the true model, and that with the
true model from the true state at the beginning of each window. Then nothing but the noise of the
measurement is left, and no method can do better.
"""


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


def several(rows: Rows) -> list[list[str]]:
    """Cells with two effects or with foreign physics, line by line."""
    some = [r for r in rows if r.kind in ("pair", "foreign") and not r.note]
    return [
        [
            r.effect,
            r.coefficients,
            r.noise,
            "yes" if r.separable else "no",
            "yes" if r.right else "no" if r.kind == "pair" else "-",
            ", ".join(f"{f} {c}" for f, c in zip(r.found, r.confidences, strict=True)) or "nothing",
            r.verdict + {"1": ", remainder", "0": ", no remainder"}.get(r.remainder, ""),
        ]
        for r in sorted(some, key=lambda r: (r.kind, r.effect, r.coefficients, r.noise, r.seed))
    ]


def reliability(panels: dict[str, list[Bin]]) -> list[list[str]]:
    """The bins of the diagram."""
    return [
        [
            kind,
            f"{b.confidence:.3f}",
            f"{b.right}/{b.count}",
            f"{b.low:.2f}-{b.high:.2f}",
            "yes" if b.calibrated else "no",
        ]
        for kind, some in panels.items()
        for b in some
    ]


def write(folder: Path, rows: Rows) -> Path:
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
        table(("", "target", "reached"), lines(rows)),
        "## Effect by effect\n",
        table(
            ("hidden", "first where separable", "in the set", "held-out error falls", "first instead"),
            by_effect(rows),
        ),
        "## Pairs and foreign physics\n",
        table(
            ("hidden", "coefficients", "noise", "separable", "right", "found", "verdict"), several(rows)
        ),
        "## Are confidences what they say?\n",
        "Findings of cells that no calibration was fitted on, other seeds and other effects: how "
        "often those of a confidence are true causes, with the binomial 95 % interval. "
        "[Diagram](reliability.png)\n",
        table(("cells", "confidence", "right", "interval", "within"), reliability(tables(rows))),
    ]
    if failed:
        parts += ["## Without a result\n", *(f"- {r.effect}, {r.noise}: {r.note}" for r in failed)]
    path, part = folder / "summary.md", folder / ".summary.part"
    part.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    os.replace(part, path)
    return path
