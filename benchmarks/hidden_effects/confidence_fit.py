"""Fits the constants of the map from evidence to confidence, ``diagnosis/verdict/confidence.py``.

There a finding has the confidence
``bagged / (1 + exp(PER_DOUBT (left + varies) - SURE))``. The two constants are fitted by maximum
likelihood to findings of the cells that are set aside for it (:func:`.cells.for_fitting`), which no
diagram shows. They are written to a file, and entered there by hand.
"""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from cosim import InputError, atomic_write

from .cells import for_fitting
from .reliability_diagram import LEAST
from .results import Row

START = (4.0, 10.0)
MOST_SURE = 12.0  # 6e-6 of doubt: more than any number of findings here can tell


class Judged(NamedTuple):
    """The evidence of a finding, in the order of the diagnosis, and whether it is a true cause."""

    bagged: float
    left: float
    varies: float
    true: bool


def judged(rows: Iterable[Row]) -> list[Judged]:
    """All findings of some cells of which the diagnosis tells the evidence."""
    found = []
    for r in rows:
        for stated, true in zip(r.evidence, r.true, strict=True):
            if stated:
                bagged, left, varies, *_ = map(float, stated.split())
                found.append(Judged(bagged, left, varies, true == "1"))
    return found


def confidence(
    bagged: np.ndarray, left: np.ndarray, varies: np.ndarray, p: Sequence[float]
) -> np.ndarray:
    """Confidences by the constants p = (SURE, PER_DOUBT)."""
    return bagged * expit(p[0] - p[1] * (left + varies))


def fitted(findings: Sequence[Judged]) -> tuple[float, float]:
    """SURE and PER_DOUBT."""
    bagged, left, varies, right = np.array(findings, dtype=float).T
    good = int(right.sum())
    # The targets of J. Platt (Probabilistic outputs for support vector machines, 1999), those of a
    # uniform prior: a sample without an error does not tell a certainty.
    target = np.where(right > 0.0, (good + 1.0) / (good + 2.0), 1.0 / (right.size - good + 2.0))

    def loss(p: np.ndarray) -> float:
        rate = np.clip(confidence(bagged, left, varies, p.tolist()), 1e-9, 1.0 - 1e-9)
        return -float(np.sum(target * np.log(rate) + (1.0 - target) * np.log1p(-rate)))

    limits = [(0.0, MOST_SURE), (0.0, None)]
    sure, per_doubt = minimize(loss, START, method="L-BFGS-B", bounds=limits).x.tolist()
    return sure, per_doubt


def write_fit(rows: Sequence[Row], path: Path) -> Path:
    """Fit the constants to the cells that are set aside, and write them with what they were fitted to.

    Raises:
        InputError: too few findings.
    """
    mine = [r for r in rows if for_fitting(r.effect, r.seed) and not r.note]
    findings = judged(mine)
    if len(findings) < LEAST:
        raise InputError(
            f"{len(findings)} findings with evidence to fit the calibration to, {LEAST} are needed: "
            "run cells of seeds from 50 on"
        )
    names = ("SURE", "PER_DOUBT")
    content = dict(zip(names, fitted(findings), strict=True)) | {
        "findings": len(findings),
        "right": sum(f.true for f in findings),
        "cells": len(mine),
        "seeds": sorted({r.seed % 100 for r in mine}),
        "effects": sorted({r.effect for r in mine}),
    }
    with atomic_write(path) as part:
        part.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    return path
