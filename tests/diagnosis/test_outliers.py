"""The outlier test against its definition: each sample is compared with the fit without it."""

from functools import cache

import numpy as np
import pytest

from diagnosis.runs.cleaning import Z95
from diagnosis.runs.smoothing.outliers import (
    OUTLIER,
    TooFewError,
    _mostly_outside,
    _of_receivers,
    outlier_test,
    robust,
    robust_weights,
)
from diagnosis.runs.smoothing.penalised import Problem, Rates, Spline, solve
from diagnosis.runs.smoothing.spline import basis, knots

pytestmark = pytest.mark.numerical
SIGMA = np.array([1e-3, 2e-3, 5e-3])
SMOOTH = np.full(3, 10.0)


@cache
def problem(seed=0, step=0.1, gap=False):
    """A smooth motion with noise in one stretch, or in two; the second begins after 20 s."""
    time = np.arange(0.0, 12.0, step)
    if gap:
        time = np.concatenate([time, 20.0 + np.arange(0.0, 4.0, step)])
    starts, ends = ([0.0, 20.0], [12.0, 24.0]) if gap else ([0.0], [12.0])
    grid = knots(np.array(starts), np.array(ends), 0.2)
    motion = 0.05 * np.column_stack([np.sin(0.5 * time), np.cos(0.4 * time), 0.3 * np.sin(0.3 * time)])
    z = motion + SIGMA * np.random.default_rng(seed).standard_normal((time.size, 3))
    intervals = int(grid.intervals.sum())
    spline = Spline(grid, basis(grid, time), np.ones((3, intervals)), Rates.none(grid))
    rows = 7 + np.arange(time.size)
    return Problem(rows, z, SIGMA, np.ones((time.size, 3)), max(1, intervals // 4), spline)


def moved(p, rows, by):
    z = p.z.copy()
    z[rows] += by
    return p._replace(z=z)


def deleted(p, weights, row, k):
    """How far a sample is from the fit without it, in its standard deviations, with the sign."""
    without = weights.copy()
    without[row, k] = 0.0
    fit = solve(p, SMOOTH, without)
    spread = p.spline.b.variance(fit.covariance)[row, k]
    off = p.z[row, k] - p.spline.b(fit.coefficients)[row, k]
    share = p.share[row, k]
    return off / (p.sigma[k] * np.sqrt(1.0 / share + spread / p.sigma[k] ** 2))


def test_a_sample_is_an_outlier_beyond_five_standard_deviations_of_its_deleted_residual():
    """Just beyond, and just below; at the end of a stretch, too, where its leverage is large."""
    p, ones = problem(), np.ones((120, 3))
    for row in (0, 40):
        for k in (0, 2):
            usual = deleted(p, ones, row, k)
            slope = deleted(moved(p, (row, k), 1.0), ones, row, k) - usual
            for side in (-1.0, 1.0):
                for size, kept in ((0.99, 1.0), (1.01, 0.0)):
                    changed = moved(p, (row, k), (side * size * OUTLIER - usual) / slope)
                    found = outlier_test(changed, SMOOTH, ones)
                    assert found[row, k] == kept
                    assert np.delete(found, row, axis=0).all(), "and no other one is"


def test_north_and_east_are_one_sample_and_the_heading_is_another():
    p, ones = moved(problem(), (30, 1), 0.1), np.ones((120, 3))
    found = outlier_test(moved(p, (60, 2), 0.2), SMOOTH, ones)
    assert found[30].tolist() == [0.0, 0.0, 1.0]
    assert found[60].tolist() == [1.0, 1.0, 0.0]
    assert found.sum() == 360 - 3
    weights = np.array([[0.2, 0.7, 0.1], [1.0, 0.3, 0.9]])
    assert _of_receivers(weights).tolist() == [[0.2, 0.2, 0.1], [0.3, 0.3, 0.9]]


def test_neighbours_that_an_outlier_has_drawn_aside_are_kept():
    """The test is repeated without those that it refused, until it refuses the same."""
    p = moved(problem(), (slice(40, 43), 0), [0.5, -0.4, 0.6])
    found = outlier_test(p, SMOOTH, np.ones((120, 3)))
    assert np.flatnonzero(found[:, 0] == 0.0).tolist() == [40, 41, 42]
    again = outlier_test(p, SMOOTH, found)
    assert (again == found).all()


def test_a_sample_that_had_no_weight_is_compared_with_its_prediction():
    p, weights = problem(), np.ones((120, 3))
    weights[50] = 0.0
    assert outlier_test(p, SMOOTH, weights)[50].tolist() == [1.0] * 3
    far = moved(p, (50, slice(0, 3)), 20.0 * SIGMA)
    assert outlier_test(far, SMOOTH, weights)[50].tolist() == [0.0] * 3


@pytest.mark.parametrize(("share", "kept"), [(1.0, 0.0), (0.25, 1.0)])
def test_a_sample_that_is_known_less_may_be_further_off(share, kept):
    p = moved(problem(), (50, 2), 8.0 * SIGMA[2])
    shares = p.share.copy()
    shares[50, 2] = share
    found = outlier_test(p._replace(share=shares), SMOOTH, np.ones((120, 3)))
    assert found[50, 2] == kept


def test_rows_of_a_stretch_in_which_fewer_than_six_agree_are_named():
    p = problem(gap=True)
    rows = np.flatnonzero(p.rows >= 7 + 120)
    z = p.z.copy()
    z[rows, 0] += np.random.default_rng(1).normal(0.0, 3.0, rows.size)
    with pytest.raises(TooFewError) as caught:
        outlier_test(p._replace(z=z), SMOOTH, np.ones((p.rows.size, 3)))
    assert caught.value.rows.tolist() == p.rows[rows].tolist()


def test_samples_within_their_noise_count_fully_and_others_by_their_distance():
    p = moved(problem(), (slice(20, 110, 30), 2), [0.05, 0.1, 0.4])
    weights = robust_weights(p, SMOOTH)
    fit = solve(p, SMOOTH, weights)
    off = np.abs(p.z - p.spline.b(fit.coefficients)) / SIGMA
    expected = _of_receivers(np.where(off > Z95, Z95 / off, 1.0))
    assert weights == pytest.approx(expected, abs=0.15)
    assert weights[20, 2] > weights[50, 2] > weights[80, 2] > 0.0
    assert weights[80, 2] == pytest.approx(Z95 * SIGMA[2] / 0.4, rel=0.05)
    assert (weights == 1.0).mean() > 0.85


@pytest.mark.parametrize(("many", "slow"), [(62, True), (58, False)])
def test_most_samples_are_outside_if_more_than_half_of_those_that_were_made_are(many, slow):
    p = problem()
    weights = np.ones((120, 3))
    weights[:many, 1] = 0.99 * Z95 / OUTLIER
    weights[:, 0] = 1.01 * Z95 / OUTLIER
    assert _mostly_outside(p, weights).tolist() == [False, slow, False]
    shares = p.share.copy()
    shares[many:, 1] = 0.0
    assert _mostly_outside(p._replace(share=shares), weights)[1], "of those that were made, all"
    shares[:, 1] = 0.0
    assert not _mostly_outside(p._replace(share=shares), weights)[1], "none was made"


def test_outliers_and_noise_are_found_from_a_guess_that_is_wrong():
    far = moved(problem(step=0.05), (slice(20, 220, 20), slice(0, 2)), 30.0 * SIGMA[:2])
    for guess in (0.2, 4.0):
        found = robust(far._replace(sigma=guess * SIGMA), np.full(3, 2.0), 1e-9 * SIGMA, True)
        assert np.flatnonzero(found.weights[:, 0] == 0.0).tolist() == [*range(20, 220, 20)]
        assert (found.weights[:, 2] == 1.0).all()
        assert found.problem.sigma == pytest.approx(SIGMA, rel=0.2)
    given = robust(far._replace(sigma=2.0 * SIGMA), np.full(3, 2.0), np.full(3, np.inf), True)
    assert given.problem.sigma.tolist() == (2.0 * SIGMA).tolist(), "noise that is given stays"


def test_a_spline_that_is_too_slow_for_most_samples_is_made_quicker():
    """The ship sways once in 1.5 s: with a smoothness of 1e8 the spline would follow no sample."""
    p = problem(step=0.05)
    time = 0.05 * np.arange(p.rows.size)
    z = p.z + 0.2 * np.sin(2.0 * np.pi * time / 1.5)[:, None]
    found = robust(p._replace(z=z), np.full(3, 1e8), 1e-9 * SIGMA, False)
    assert found.weights.mean() > 0.98
    fit = solve(found.problem, found.smoothness, found.weights)
    assert np.abs(p.z - p.spline.b(fit.coefficients) + z - p.z).std() < 5e-3
