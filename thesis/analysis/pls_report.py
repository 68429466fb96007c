"""A PLS regression as results for people and programs: ``pls.json`` and its page."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from diagnosis.report import Document, Plot, ReportSection, Table, number, numbers, percent

from . import analysis_figures as pictures
from .constrained_fit import Stable
from .into_the_plant import goes_into_the_plant, thrust_of
from .partial_least_squares import AXES, AxesRegression, Regressed
from .principal_components import BLOCKS


def content(r: Regressed, estimates: str, stable: Stable | None = None) -> dict[str, Any]:
    """The content of ``pls.json``."""
    axes = list(AXES)
    std, signs = (np.vstack([getattr(p, name) for p in r.parts]) for name in ("std", "sign_changes"))
    thrust = thrust_of(r)
    return {
        "recipe": r.recipe.name,
        "estimates": estimates,
        "runs": r.samples.names,
        "samples": r.samples.time.size,
        "folds": BLOCKS,
        "factors": r.by_axis("factors"),
        "r2": r.by_axis("r2"),
        "q2": r.by_axis("q2"),
        "constant": dict(zip(axes, r.c, strict=True)),
        "coefficients": {
            axis: {
                name: {"value": r.B[k, j], "std": std[k, j], "sign_changes": int(signs[k, j])}
                for j, name in enumerate(r.columns)
            }
            for k, axis in enumerate(axes)
        },
        "clipped": r.clipped,
        "thrust": {
            "eigenvalues": [float(x.real) for x in thrust.eigenvalues],
            "least": thrust.least,
            "holds": thrust.holds,
        },
        "model": goes_into_the_plant(r.columns),
        "stable": None if stable is None else _stable(stable),
    }


def _stable(s: Stable) -> dict[str, Any]:
    """The stable model nearest to the regression."""
    rows = zip(AXES, s.B, strict=True)
    return {
        "changed": s.changed,
        "r2": dict(zip(AXES, s.r2, strict=True)),
        "constant": dict(zip(AXES, s.c, strict=True)),
        "coefficients": {axis: dict(zip(s.columns, b, strict=True)) for axis, b in rows},
    }


def sentences(r: Regressed, stable: Stable | None = None) -> Iterator[str]:
    """What was found, a line each."""
    factors, r2, q2 = (r.by_axis(name) for name in ("factors", "r2", "q2"))
    each = "; ".join(f"{a}: {number(r2[a])} / {number(q2[a])} by {factors[a]} factors" for a in AXES)
    yield f"{r.recipe.name}, {r.samples.time.size} samples, {len(r.columns)} columns. R² / Q² {each}."
    weak = insignificant(r)
    if weak:
        yield (
            "Coefficients less than two standard deviations from zero, or of another sign in another "
            f"fold: {weak}."
        )
    outside = {n: x for n, x in r.clipped.items() if x > 0.0}
    if outside:
        stated = ", ".join(f"{n} {percent(x)}" for n, x in outside.items())
        yield f"Outside of the ranges of Table 1, and clipped: {stated}."
    if goes_into_the_plant(r.columns):
        yield thrust_of(r).sentence
    if stable is not None:
        yield (
            f"The nearest stable model explains R² {', '.join(numbers(list(stable.r2)))}, this one "
            f"{', '.join(numbers(list(stable.given_r2)))}."
            if stable.changed
            else "The model is already stable."
        )


def insignificant(r: Regressed) -> str:
    """For each axis the columns whose coefficient is not sure over the folds."""
    found = []
    std, signs = (np.vstack([getattr(p, name) for p in r.parts]) for name in ("std", "sign_changes"))
    if r.recipe.kind != "quadratic":
        return ""
    for k, axis in enumerate(AXES):
        unsure = (np.abs(r.B[k]) < 2.0 * std[k]) | (signs[k] > 0)
        names = [n for n, bad in zip(r.columns, unsure, strict=True) if bad]
        if names:
            found.append(f"{axis}: {', '.join(names)}")
    return "; ".join(found)


def document(r: Regressed, estimates: str, stable: Stable | None = None) -> Document:
    """The page."""
    first, *rest = sentences(r, stable)
    parts = [_part(r, part) for part in r.parts]
    shown = pictures.model_error_over_time(r.samples.omega, {r.recipe.name: r.predicted}, r.samples.time)
    fit = ReportSection(
        "Model error", rest, (), [Plot(shown, "Model error, and its prediction by the model.")]
    )
    made = {
        "runs": ", ".join(r.samples.names),
        "estimates": estimates,
        "cross-validation": f"{BLOCKS} sequential blocks",
    }
    return Document(f"Partial least squares: {r.recipe.name}", first, [fit, *parts], made)


def _part(r: Regressed, part: AxesRegression) -> ReportSection:
    """The regression of one axis, or of all."""
    axes = [AXES[k] for k in part.axes]
    header = ["factors", *(f"Q² {a}" for a in axes)]
    rows = [[str(k + 1), *numbers(q, 4)] for k, q in enumerate(part.by_factors)]
    scale = r.X.std(axis=0, ddof=1)
    coefficients = [
        [n]
        + [
            f"{number(part.B[k, j])} ± {number(part.std[k, j], 2)}"
            + (f", {part.sign_changes[k, j]} of {BLOCKS} of other sign" * bool(part.sign_changes[k, j]))
            for k in range(len(axes))
        ]
        for j, n in enumerate(r.columns)
    ]
    shown = pictures.share_of_variance(
        part.r2_by_factors.mean(axis=1), part.by_factors.mean(axis=1), part.factors, "factors"
    )
    bars = [Plot(shown, "Explained variance, mean of the axes (Figs. 7.6a, 7.8a, 7.9).")]
    bars += [
        Plot(
            pictures.coefficient_bars(part.B[k] * scale, part.std[k] * scale, r.columns, axis),
            f"Force by one standard deviation of each column, {axis}.",
        )
        for k, axis in enumerate(axes)
    ]
    points, names = correlations(r, part)
    if points.shape[1] > 1:
        bars.append(Plot(pictures.loadings(points, names, "factor"), "Correlation loadings."))
    return ReportSection(
        f"Coefficients of {', '.join(axes)}",
        ["In the units of the columns, with the standard deviation over the folds."],
        [Table(header, rows), Table(["column", *axes], coefficients)],
        bars,
    )


def correlations(r: Regressed, part: AxesRegression) -> tuple[np.ndarray, Sequence[str]]:
    """Correlation of each column, and of the model error, with the first two factors (m + p, 2)."""
    Z = part.model.transform(r.X)[:, :2]
    both = np.hstack([r.X, r.samples.omega[:, part.axes]])
    a = (both - both.mean(axis=0)) / both.std(axis=0)
    b = (Z - Z.mean(axis=0)) / Z.std(axis=0)
    return a.T @ b / len(a), [*r.columns, *(f"omega_{AXES[k]}" for k in part.axes)]
