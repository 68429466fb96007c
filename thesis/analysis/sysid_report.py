"""SysID by concurrent learning as results for people and programs: ``sysid.json`` and its page."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from diagnosis.report import Document, Plot, ReportSection, Table, number, numbers
from fmus.controller.models import SURGE

from . import analysis_figures as pictures
from .concurrent_passes import Identified, explained, identify, regressors, thinned
from .into_the_plant import EffectiveThrust, effective_thrust
from .partial_least_squares import AXES
from .samples import Samples, joined
from .table_7_1 import LOSSES, NAMES, TABLE_7_1

# Condition number from which collinearity does harm (Belsley, Kuh and Welsch 1980).
HARMFUL = 30.0
# Share of a column that must be its own; as SEPARATION of the identification.
SEPARATION = 0.05
PRODUCTS = 1e-3  # relative difference below which |r|v = -|v|r is as good as exact (chosen)


@dataclass(frozen=True, eq=False)
class SysidResult:
    """A model of (7.1)-(7.5) and how good it is.

    Attributes:
        name: ``identified``, or the row of Table 7.1.
        phi: (14,).
        found: of the passes; None for a row of the table.
        runs, others: samples that it was made of, and others.
        own, other: (3,), R2 of omega on these; None without runs.
        warnings: a line each.
    """

    name: str
    phi: np.ndarray
    found: Identified | None
    runs: Sequence[Samples]
    others: Sequence[Samples]
    own: np.ndarray | None
    other: np.ndarray | None
    warnings: list[str]

    @property
    def thrust(self) -> EffectiveThrust:
        """What the model makes of the thrusters' force."""
        return effective_thrust(-np.diag(self.phi[-LOSSES:]))


def result(
    runs: Sequence[Samples], others: Sequence[Samples], row: np.ndarray | None, name: str
) -> SysidResult:
    """Identify a model from runs, or hold a row of Table 7.1 against them."""
    found = identify(runs) if row is None else None
    phi = found.phi if found is not None else np.asarray(row)
    own = explained(runs, phi) if runs else None
    other = explained(others, phi) if others else None
    return SysidResult(name, phi, found, runs, others, own, other, list(warnings(found, runs)))


def warnings(found: Identified | None, runs: Sequence[Samples]) -> Iterator[str]:
    """What a reader must know before believing the coefficients."""
    if found is None:
        return
    if not found.settled:
        yield (
            f"The estimate still changes by {100.0 * found.change:.1f} % in pass {found.passes}: "
            "it has not converged."
        )
    s = joined(runs)
    v, r = s.nu[:, 1], s.nu[:, 2]
    a, b = np.abs(r) * v, np.abs(v) * r
    if np.linalg.norm(a + b) < PRODUCTS * np.linalg.norm(a):
        yield (
            "|r|v = −|v|r in all samples, because sway and yaw always have opposite signs: only "
            "the differences of their coefficients are identifiable; Table 7.1's pair (−1.44, "
            "1.4) has the same property. Add turns both ways and drift without turning; until "
            "then compare ω."
        )
    for axis, indices in enumerate(SURGE.pattern):
        if found.condition[axis] > HARMFUL:
            weak = [NAMES[k] for k in indices if found.own[k] < SEPARATION]
            yield (
                f"{AXES[axis]}: condition number {number(found.condition[axis], 2)}; these data "
                f"hardly discriminate {', '.join(weak) or 'its coefficients'}. Compare ω, not "
                "these coefficients."
            )
    for k, axis in enumerate(AXES, len(NAMES) - LOSSES):
        if found.own[k] < SEPARATION and abs(found.phi[k]) > SEPARATION:
            yield (
                f"{NAMES[k]} = {number(found.phi[k])} may be spurious: here the force in {axis} is "
                "nearly a function of the velocity, so a loss of thrust and damping are "
                f"indistinguishable. Pulse the force in {axis}; a lag of the velocity estimates "
                "has the same effect."
            )


def content(r: SysidResult, estimates: str) -> dict[str, Any]:
    """The content of ``sysid.json``."""

    def named(phi: np.ndarray | None) -> dict[str, float] | None:
        return None if phi is None else dict(zip(NAMES, phi.tolist(), strict=True))

    def by_axis(x: np.ndarray | None) -> dict[str, float] | None:
        return None if x is None else dict(zip(AXES, x.tolist(), strict=True))

    f = r.found
    return {
        "recipe": r.name,
        "estimates": estimates,
        "runs": [n for s in r.runs for n in s.names],
        "others": [n for s in r.others for n in s.names],
        "parameters": named(r.phi),
        "r2": {"own": by_axis(r.own), "other": by_axis(r.other)},
        "least_squares": named(f.least_squares if f else None),
        "ridge": named(f.ridge if f else None),
        "condition": by_axis(f.condition if f else None),
        "passes": f.passes if f else None,
        "change": f.change if f else None,
        "warnings": r.warnings,
        "thrust": {"least": r.thrust.least, "holds": r.thrust.holds},
    }


def sentences(r: SysidResult) -> Iterator[str]:
    """What was found, a line each."""
    passes = f", {r.found.passes} passes" if r.found else ""
    own = "" if r.own is None else f"; R² of ω in X, Y, N: {', '.join(numbers(list(r.own)))}"
    other = "" if r.other is None else f", on other runs {', '.join(numbers(list(r.other)))}"
    yield f"{r.name}{passes}{own}{other}."
    yield ", ".join(f"{n} = {number(x)}" for n, x in zip(NAMES, r.phi.tolist(), strict=True))
    for line in r.warnings:
        yield f"warning: {line}"
    yield r.thrust.sentence


def document(r: SysidResult, estimates: str) -> Document:
    """The page."""
    first, _, *rest = sentences(r)
    header = ["coefficient", "unit", r.name]
    columns = [r.phi]
    if r.found is not None:
        header += ["least squares", "ridge", "its own share"]
        columns += [r.found.least_squares, r.found.ridge, r.found.own]
    header += list(TABLE_7_1)
    columns += [np.array(x) for x in TABLE_7_1.values()]
    rows = [
        [name, c.unit, *numbers([float(x[k]) for x in columns])]
        for k, (name, c) in enumerate(zip(NAMES, SURGE.coefficients, strict=True))
    ]
    text = [
        "The surge coefficients add to g(ν), those of sway and yaw are totals, δ is the lost "
        "share of thrust. For comparison: least squares and ridge on the same samples, and Table "
        "7.1."
    ]
    sections = [
        ReportSection("Notes", rest),
        ReportSection("Coefficients", text, [Table(header, rows)]),
    ]
    if r.runs:
        s = joined([thinned(x) for x in r.runs])
        shown = {"model": regressors(s) @ r.phi}
        plot = pictures.model_error_over_time(s.omega, shown, s.time)
        sections.append(
            ReportSection("Model error", (), (), [Plot(plot, "Model error and the model (Fig. 7.2).")])
        )
    made = {"runs": ", ".join(n for s in r.runs for n in s.names) or "none", "estimates": estimates}
    return Document("System identification by concurrent learning", first, sections, made)
