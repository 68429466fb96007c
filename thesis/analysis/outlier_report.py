"""PCA of measured runs as results for people and programs: ``pca.json`` and its page."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from diagnosis.report import Document, Plot, ReportSection, Table, number, numbers, percent

from . import analysis_figures as pictures
from .principal_components import (
    BLOCKS,
    LEVEL,
    PrincipalComponents,
    Removed,
    fit_components,
    outliers,
    removals,
    validated,
)
from .samples import NU, OMEGA, TAU, Samples, joined

VARIABLES = [*OMEGA, *NU, *TAU]
LISTED = 30  # removals that the page lists; the JSON file has all


@dataclass(frozen=True, eq=False)
class OutlierComponents:
    """The components of runs in a row.

    Attributes:
        samples: of all runs.
        X: (n, 9), model error, velocity, force.
        model: the components.
        q2: (9,), cross-validated share of the variance.
        removed: outliers.
        kept: (n,), the other samples.
    """

    samples: Samples
    X: np.ndarray
    model: PrincipalComponents
    q2: np.ndarray
    removed: list[Removed]
    kept: np.ndarray


def analyse(runs: Sequence[Samples], components: int | None = None) -> OutlierComponents:
    """Components and outliers of runs in a row.

    Args:
        runs: of the same ship.
        components: number of components kept; by default the fewest that explain 90 %.

    Raises:
        InputError: a column is constant, or so many components there are not.
    """
    s = joined(runs)
    X = np.hstack([s.omega, s.nu, s.tau])
    model = fit_components(X, VARIABLES, components)
    removed = removals(model, X, VARIABLES, s.run)
    return OutlierComponents(s, X, model, validated(X, VARIABLES), removed, ~outliers(model, X))


def content(a: OutlierComponents, estimates: str) -> dict[str, Any]:
    """The content of ``pca.json``."""
    m = a.model
    return {
        "variables": VARIABLES,
        "estimates": estimates,
        "samples": m.samples,
        "components": m.kept,
        "explained": m.explained,
        "q2": a.q2,
        "loadings": m.loadings[:, : m.kept].T,
        "mean": m.mean,
        "scale": m.scale,
        "level": LEVEL,
        "t2_limit": m.t2_limit,
        "q_limit": m.q_limit,
        "removed_share": float(1.0 - a.kept.mean()),
        "removed": [
            {
                "run": a.samples.run[r.first],
                "from": a.samples.time[r.first],
                "to": a.samples.time[r.last],
                "samples": r.last - r.first + 1,
                "why": r.why,
                "variable": r.variable,
            }
            for r in a.removed
        ],
    }


def sentences(a: OutlierComponents) -> Iterator[str]:
    """What was found, a line each."""
    m = a.model
    yield (
        f"{m.kept} components explain {percent(m.explained[m.kept - 1])} of the variance of "
        f"{len(VARIABLES)} variables in {m.samples} samples, "
        f"cross-validated {percent(a.q2[m.kept - 1])}."
    )
    above = np.flatnonzero(a.q2 > m.explained + 1e-9) + 1
    if above.size:
        yield (
            f"Q² exceeds R² with {', '.join(map(str, above))} components: the explained part "
            "varies more in some left-out blocks than in the rest; there Q² does not indicate "
            "their number."
        )
    gone = int((~a.kept).sum())
    yield (
        f"Beyond the 99 % limits of T² ({number(m.t2_limit)}) or Q ({number(m.q_limit)}): {gone} "
        f"samples, {100.0 * gone / m.samples:.1f} %, in {len(a.removed)} places."
    )


def document(a: OutlierComponents, estimates: str) -> Document:
    """The page."""
    m, s = a.model, a.samples
    stated = " ".join(sentences(a))
    Z = m.scores(a.X)
    plane = m.loadings[:, :2] * np.sqrt(m.variance[:2])
    share = ReportSection(
        "Components",
        [
            "Columns are centred and divided by their standard deviations. R² is the share of the "
            f"variance that the first components explain, Q² the same of {BLOCKS} sequential blocks, "
            "each left out in turn and projected on loadings found without it, (3.13)-(3.15).",
        ],
        [
            Table(
                ["components", "R²", "Q²"],
                [[str(k + 1), *numbers([m.explained[k], a.q2[k]], 4)] for k in range(len(VARIABLES))],
            ),
            Table(
                ["variable", *(f"p{k + 1}" for k in range(m.kept))],
                [[n, *numbers(row[: m.kept])] for n, row in zip(VARIABLES, m.loadings, strict=True)],
            ),
        ],
        [
            Plot(pictures.share_of_variance(m.explained, a.q2, m.kept), "Explained variance."),
            Plot(pictures.loadings(plane, VARIABLES, "component"), "Correlations with the components."),
            *(
                [Plot(pictures.cloud(Z[:, 0], Z[:, 1], ("score 1", "score 2")), "Scores.")]
                if m.kept > 1
                else []
            ),
        ],
    )
    rows = [
        [
            s.run[r.first],
            *numbers([s.time[r.first], s.time[r.last]], 6),
            r.last - r.first + 1,
            r.why,
            r.variable,
        ]
        for r in sorted(a.removed, key=lambda r: r.first - r.last)[:LISTED]
    ]
    listed = f" The {LISTED} longest of {len(a.removed)} are listed." if len(a.removed) > LISTED else ""
    gone = ReportSection(
        "Outliers",
        [
            "T² is the distance of a sample within the plane of the model, in variances of the "
            "scores; Q its squared distance from that plane. Limits: F distribution, and Jackson and "
            "Mudholkar (1979). Good samples exceed either limit once in a hundred." + listed,
        ],
        [Table(["run", "from [s]", "to [s]", "samples", "why", "variable"], rows)] if rows else [],
        [
            Plot(pictures.against_limit(m.t2(a.X), m.t2_limit, "T²"), "Hotelling's T²."),
            Plot(pictures.against_limit(m.q(a.X), m.q_limit, "Q"), "Q residual."),
            Plot(pictures.before_and_after(s.nu, a.kept), "Velocity, with the removed samples."),
        ],
    )
    made = {"runs": ", ".join(s.names), "estimates": estimates}
    return Document("Principal components", stated, [share, gone], made)
