"""Effects beside coefficients as uncertain as stated: evidence by a dense normal density, and both ways."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from diagnosis.search.coefficient_rival import LinearProblem, probability_beside_coefficients

CANDIDATES = 60


def problem(rng, sizes, effect=0.0, rows=200):
    """A yaw-like axis: coefficients of some sizes, and an effect that is nearly their sum."""
    C = 30.0 * rng.standard_normal((rows, len(sizes)))
    E = C.sum(axis=1, keepdims=True) + 3.0 * rng.standard_normal((rows, 1))
    y = C @ sizes + E[:, 0] * effect + rng.standard_normal(rows)
    return LinearProblem(y, E, C, np.zeros(len(sizes)), float(np.log(rows)))


def probability(p, wider):
    without = p._replace(effects=p.effects[:, :0])
    present = [p.log_evidence(w, 1) for w in (np.ones_like(wider), wider)]
    return probability_beside_coefficients(
        present, {1: [without.log_evidence(wider, 0)]}, 1 / CANDIDATES
    )


def test_evidence_of_coefficients_is_their_normal_density():
    rng = np.random.default_rng(1)
    C, y, offset = rng.standard_normal((30, 4)), rng.standard_normal(30), rng.standard_normal(4)
    p = LinearProblem(y, np.zeros((30, 0)), C, offset, 3.0)

    def density(wider):
        return multivariate_normal.logpdf(y, -C @ offset, np.eye(30) + (C * wider**2) @ C.T)

    wider, ones = np.array([1.0, 3.0, 0.5, 10.0]), np.ones(4)
    differs = p.log_evidence(wider, 0) - p.log_evidence(ones, 0)
    assert differs == pytest.approx(density(wider) - density(ones), rel=1e-6)


def test_an_effect_has_the_prior_of_one_sample():
    """A prior far wider than the data, brought to the information of one of n samples."""
    rng = np.random.default_rng(2)
    E, C, y = rng.standard_normal((50, 1)), rng.standard_normal((50, 3)), rng.standard_normal(50)
    p, far, ones = LinearProblem(y, E, C, np.zeros(3), float(np.log(50))), 1e3, np.ones(3)
    wide = multivariate_normal.logpdf(y, np.zeros(50), np.eye(50) + C @ C.T + far**2 * E @ E.T)
    alone = multivariate_normal.logpdf(y, np.zeros(50), np.eye(50) + C @ C.T)
    unit_information = np.log(far) + 0.5 * np.log(float((E.T @ E).item()) / 50)
    without = p._replace(effects=E[:, :0])
    gained = p.log_evidence(ones, 1) - without.log_evidence(ones, 0)
    assert gained == pytest.approx(wide - alone + unit_information, abs=1e-4)


def test_coefficients_off_by_what_is_stated_are_no_effect():
    """All of them off by several tenths, alike: an effect imitates that, and is not sure."""
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        found.append(probability(problem(rng, 5.0 * rng.standard_normal(4)), np.full(4, 5.0)))
    assert max(found) < 0.8
    assert np.mean(found) < 0.2


def test_an_effect_beside_coefficients_that_are_right_within_a_tenth_stays():
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        found.append(probability(problem(rng, rng.standard_normal(4), effect=6.0), np.full(4, 5.0)))
    assert min(found) > 0.5
    assert np.mean(found) > 0.9


def test_more_candidates_make_each_less_likely():
    present, absent = [-10.0], {1: [-15.0]}
    few, many = (probability_beside_coefficients(present, absent, 1 / n) for n in (1, 100))
    assert few == pytest.approx(1 / (1 + np.exp(-5.0)))
    assert many == pytest.approx(1 / (1 + 100 * np.exp(-5.0)))
