"""A plan that can be carried out: what is expected of it, and its files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..execution.result_folder import together
from ..execution.short_text import ShortRepr
from ..report.formatting import write_json
from ..runs.cleaning import Z95
from ..runs.run_constants import LEVEL
from .designing import Designer, ScoredPlan
from .information import CRITERIA, Knowledge, pairs, projected
from .manoeuvre_library import TEXTS
from .run_files import commands_file, draw, picture_file, scenario_file, write_run
from .spread import Spread

JSON, PAGE = "next.json", "plan.md"
MOST_RUNS = 9  # 1, of a plan; chosen


def files(count: int) -> list[str]:
    """The names of all files of a plan with so many runs."""
    each = range(1, count + 1)
    return [
        JSON,
        PAGE,
        *(f for n in each for f in (scenario_file(n), commands_file(n), picture_file(n))),
    ]


@dataclass(frozen=True, eq=False, repr=False)
class PlannedRun(ShortRepr):
    """One run of a plan.

    Attributes:
        designer: by which it was found.
        scored: its target and information.
        before: what is known before it.
        spread: its tracks.
        sure: probability that the right candidate has more than LEVEL afterwards [1].
        usual: usual run of the same length -> the same probability, and its information.
    """

    designer: Designer
    scored: ScoredPlan
    before: Knowledge
    spread: Spread
    sure: float
    usual: Mapping[str, tuple[float, ScoredPlan]]

    @property
    def minutes(self) -> float:
        return self.designer.limits.seconds / 60.0

    @property
    def commands_text(self) -> str:
        """What its table of commands has."""
        if self.designer.orders is None:
            return (
                "the set points for the controller of a real ship, and the force that the likeliest "
                "model needs"
            )
        return "the orders for the actuators, and the track of the likeliest model"

    @property
    def worst(self) -> float:
        """Least squared distance of a pair after refitting, over posterior samples of the truth [1]."""
        k, rng, G = self.before, np.random.default_rng(0), self.before.G + self.scored.gram
        found = [np.inf]
        for i, j in pairs(k):
            h, e = k.hypotheses[i], k.estimates[i]
            for x in rng.multivariate_normal(e.mean[h.columns], e.covariance, 8, method="eigh"):
                z = np.zeros(e.mean.size)
                z[h.columns] = x
                found.append(projected(k, i, j, z, G))
        return min(found)

    def intervals(self) -> list[dict[str, Any]]:
        """Half widths of the effects' 95 % intervals: before, after, and after usual runs."""
        space, found = self.designer.space, []
        after = {"after": self.scored.gram} | {name: s.gram for name, (_, s) in self.usual.items()}
        for n in self.spread.ids:
            h = self.before.hypotheses[n]
            stds = {"before": self._std(n, np.zeros_like(self.scored.gram))}
            stds |= {name: self._std(n, gram) for name, gram in after.items()}
            for effect in h.ids:
                block, place = space.blocks[effect], space.places()[effect][1:]
                for name, step, at in zip(block.names, block.steps, place, strict=True):
                    unit = space.start.declared(name).unit
                    half = {key: Z95 * step * float(std[at]) for key, std in stds.items()}
                    found.append({"hypothesis": h.name, "name": name, "unit": unit, "half_width": half})
        return found

    def _std(self, n: int, gram: np.ndarray) -> np.ndarray:
        h, std = self.before.hypotheses[n], np.zeros(len(gram))
        std[h.columns] = np.sqrt(np.diag(self.before.plus(gram).estimate(h).covariance))
        return std

    def content(self, number: int) -> dict[str, Any]:
        """For ``next.json``."""
        k, ids = self.before, self.spread.ids
        return {
            "scenario": scenario_file(number),
            "commands": commands_file(number),
            "minutes": self.minutes,
            "sure": self.sure,
            "usual": {name: sure for name, (sure, _) in self.usual.items()},
            "manoeuvres": [s.content() for s in self.scored.steps],
            "criteria": {name: of(k, self.scored.gram) for name, of in CRITERIA.items()},
            "worst_distance": self.worst,
            "margin": {
                k.hypotheses[n].name: float(m) for n, m in zip(ids, self.spread.margin, strict=True)
            },
            "intervals": self.intervals(),
        }


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """What to run next.

    Attributes:
        runs: in their order.
        knowledge: the hypotheses and their weights before all of them.
        inseparable: pairs of names that no manoeuvre within the limits separates.
        advice: what would separate them, and what to know of the runs, a line each.
        seed, criterion: by which it was found.
        ship: as a scenario names it; None: the default ship.
    """

    runs: Sequence[PlannedRun]
    knowledge: Knowledge
    inseparable: Sequence[tuple[tuple[str, ...], tuple[str, ...]]]
    advice: Sequence[str]
    seed: int
    criterion: str
    ship: str | None = None

    def content(self) -> dict[str, Any]:
        """The content of ``next.json``."""
        k = self.knowledge
        return {
            "runs": [r.content(n) for n, r in enumerate(self.runs, 1)],
            "inseparable": [sorted({*a, *b}) for a, b in self.inseparable],
            "advice": list(self.advice),
            "hypotheses": [
                {"ids": list(h.ids), "weight": float(w)}
                for h, w in zip(k.hypotheses, k.weights, strict=True)
            ],
            "criterion": self.criterion,
            "seed": self.seed,
        }

    def lines(self) -> list[str]:
        """The plan for a terminal."""
        k = self.knowledge
        shown = ["Candidates"]
        shown += [f"  {w:6.1%}  {h.name}" for h, w in zip(k.hypotheses, k.weights, strict=True)]
        if self.inseparable:
            shown.append("No run within the limits discriminates")
            for pair in self.inseparable:
                shown.append("  " + " and ".join(" + ".join(ids) or "no effect" for ids in pair))
        shown += list(self.advice)
        for n, r in enumerate(self.runs, 1):
            shown.append(f"Run {n}: {r.minutes:.3g} min")
            shown += [f"  {s.seconds:5.0f} s  {TEXTS[s.name]}" for s in r.scored.steps]
            least = float(r.spread.margin.min())
            shown.append(f"  least distance from the walls, under any likely candidate: {least:.2f} m")
            shown.append(f"  probability that the right candidate is above {LEVEL:.0%} afterwards")
            each = {"this run": r.sure} | {name: sure for name, (sure, _) in r.usual.items()}
            shown += [f"    {sure:4.0%}  {name}" for name, sure in each.items()]
            beyond = [name for name in r.designer.usual_runs if name not in r.usual]
            shown += [f"       -  {name}, which exceeds the limits" for name in beyond]
        return shown

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def write(self, out: str | Path) -> list[str]:
        """Write all files into a folder, all or none; returns their names.

        Raises:
            InputError: nothing can be written there.
        """
        written = files(len(self.runs))
        with together(Path(out), files(MOST_RUNS)) as new:
            for n, r in enumerate(self.runs, 1):
                write_run(r.designer, r.scored, n, new, self.ship)
                draw(r.designer, r.before, r.scored.motion, r.spread, new / picture_file(n))
            (new / PAGE).write_text(page(self), encoding="utf-8")
            write_json(new / JSON, self.content())
        return written


def page(plan: Plan) -> str:
    """The plan on one page, as Markdown."""
    parts = ["# What to run next", "", "```", *plan.lines(), "```", ""]
    for n, r in enumerate(plan.runs, 1):
        like = r.designer.data[0].smoothed.track
        basin = r.designer.basin
        parts += [
            f"## Run {n}",
            "",
            f"![Track of run {n}]({picture_file(n)})",
            "",
            f"- Simulate it: `cybership run {scenario_file(n)}`.",
            f"- `{commands_file(n)}` has {r.commands_text}.",
            "- Begin at rest at the first set point. Log pose and commands at "
            f"{1.0 / like.period:.3g} Hz, the rate of the runs so far.",
            f"- Basin: north {basin.north[0]:.2f} to {basin.north[1]:.2f} m, east {basin.east[0]:.2f} "
            f"to {basin.east[1]:.2f} m. The hull keeps {r.spread.margin.min():.2f} m from the walls "
            "under every candidate above 5 %.",
            "",
            "| parameter | half of the 95 % interval before | after | " + " | ".join(r.usual) + " |",
            "|---|--:|--:|" + "--:|" * len(r.usual),
        ]
        for row in r.intervals():
            cells = " | ".join(f"{x:.3g}" for x in row["half_width"].values())
            parts.append(f"| {row['name']} [{row['unit']}] of {row['hypothesis']} | {cells} |")
        parts.append("")
    return "\n".join(parts)
