"""Fits a map from a confidence as it is told to the rate at which such findings are right.

Logistic in the logit (Platt 1999, with his prior on the targets): two numbers, fitted by maximum
likelihood to the cells that are set aside for it (:func:`.cells.for_fitting`), which no diagram shows.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit

from cosim import InputError, atomic_write

from .cells import for_fitting
from .reliability_diagram import LEAST, Told, told
from .results import Row

MOST = 1e-3  # from 0 and from 1, where a logit has no value: a bootstrap of some hundred tells no finer


def fitted(findings: Sequence[Told]) -> tuple[float, float]:
    """Intercept and slope of logit(rate) over logit(confidence)."""
    confidence = np.array([f.confidence for f in findings])
    right = np.array([f.true for f in findings])
    x = logit(np.clip(confidence, MOST, 1.0 - MOST))
    count, good = right.size, int(right.sum())
    # Platt's targets, those of a uniform prior: a sample without an error does not tell a certainty.
    target = np.where(right, (good + 1.0) / (good + 2.0), 1.0 / (count - good + 2.0))

    def loss(p: np.ndarray) -> float:
        z = p[0] + p[1] * x
        return float(np.sum(np.logaddexp(0.0, z) - target * z))

    intercept, slope = minimize(loss, np.array([0.0, 1.0]), method="Nelder-Mead").x
    return float(intercept), float(slope)


def calibrated(confidence: float, intercept: float, slope: float) -> float:
    """The rate at which findings of a confidence are right."""
    return float(expit(intercept + slope * logit(np.clip(confidence, MOST, 1.0 - MOST))))


def write_fit(rows: Sequence[Row], path: Path) -> Path:
    """Fit the map to the cells that are set aside, and write it with what it was fitted to.

    Raises:
        InputError: too few findings.
    """
    mine = [r for r in rows if for_fitting(r.effect, r.seed) and not r.note]
    findings = told(mine)
    if len(findings) < LEAST:
        raise InputError(
            f"{len(findings)} findings to fit the calibration to, {LEAST} are needed: "
            "run cells of seeds from 50 on"
        )
    intercept, slope = fitted(findings)
    content = {
        "intercept": intercept,
        "slope": slope,
        "findings": len(findings),
        "right": sum(f.true for f in findings),
        "cells": len(mine),
        "seeds": sorted({r.seed % 100 for r in mine}),
        "effects": sorted({r.effect for r in mine}),
    }
    with atomic_write(path) as part:
        part.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    return path
