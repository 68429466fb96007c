"""The smoother: the same as Kalman's and Rauch's, honest about its uncertainty, hard on spikes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import cholesky_banded
from scipy.sparse import csr_matrix
from support.measured import DATA, NOISE, base, changed, needs_data, sail, smoothed, true_nu

from diagnosis import InputError, Run, clean, read, smooth
from diagnosis.runs.columns.unit_check import LARGEST
from diagnosis.runs.smoothing import smoother
from diagnosis.runs.smoothing.likelihood import criteria, deviance, likeliest
from diagnosis.runs.smoothing.penalised import JERK as PENALTY
from diagnosis.runs.smoothing.penalised import LinearSystem, Problem, Rates, Spline, solve
from diagnosis.runs.smoothing.spline import (
    SplineCovariance,
    basis,
    inverse_band,
    knots,
    middles,
    roughness,
    third,
)
from fmus.frames import rotate_to_body

pytestmark = pytest.mark.numerical
N = 3000
INNER = slice(100, -100)
JERK = np.array([2e-5, 5e-6, 2e-4])


@cache
def smooth_base():
    return smoothed(base())


def white_jerk(time, seed):
    """A run driven by white jerk, and its true pose, velocity and acceleration, each (n, 3)."""
    rng = np.random.default_rng(seed)
    state = np.zeros((3, 3))  # derivative, channel
    truth = []
    for h in np.diff(time, append=time[-1] + 0.02):
        truth.append(state)
        F, Q = transition(h)
        state = F @ state + np.linalg.cholesky(Q) @ rng.standard_normal((3, 3)) * np.sqrt(JERK)
    truth = np.array(truth).transpose(1, 0, 2)
    pose = 1.0 + truth[0] + NOISE * rng.standard_normal((time.size, 3))
    return Run("white", time, pose, np.zeros((time.size, 3))), truth


def transition(h):
    """Transition matrix and covariance of a third derivative that is white noise of density 1."""
    F = np.array([[1.0, h, h**2 / 2], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    Q = [[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]]
    return F, np.array(Q)


def kalman_and_rauch(time, z, valid, q, sigma):
    """Mean (n, 3) and variance (n, 3) of value, rate and change, by the textbook."""
    x, P = np.array([z[0], 0.0, 0.0]), np.diag([1.0, 1.0, 1.0])
    predicted, filtered = [], []
    for k in range(time.size):
        F, Q = transition(time[k] - time[k - 1]) if k else (np.eye(3), np.zeros((3, 3)))
        x, P = F @ x, F @ P @ F.T + q * Q
        predicted.append((F, x, P))
        if valid[k]:
            gain = P[:, 0] / (P[0, 0] + sigma**2)
            x, P = x + gain * (z[k] - x[0]), P - np.outer(gain, P[0])
        filtered.append((x, P))
    found = [(x, P)]
    for (F, later, covariance), (x0, P0) in zip(predicted[:0:-1], filtered[-2::-1], strict=True):
        G = P0 @ F.T @ np.linalg.inv(covariance)
        x, P = x0 + G @ (x - later), P0 + G @ (P - covariance) @ G.T
        found.append((x, P))
    return np.array([x for x, _ in found[::-1]]), np.array([np.diag(P) for _, P in found[::-1]])


def test_same_as_kalman_filter_and_rauch_smoother(monkeypatch):
    monkeypatch.setattr(
        "diagnosis.runs.smoothing.likelihood.ROUNDS", 0
    )  # the jerk is equally strong throughout
    time = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.03, 1000))
    run, _ = white_jerk(time, 2)
    run = changed(run, slice(400, 440), np.nan)
    s = smooth(clean(run))
    for c in range(3):
        mean, var = kalman_and_rauch(time, s.track.pose[:, c], s.used, s.jerk[c], s.noise[c])
        for k, (found, std) in enumerate(
            [(s.eta, s.eta_std), (s.eta_dot, s.eta_dot_std), (s.eta_ddot, s.eta_ddot_std)]
        ):
            # Between its knots the spline has no jerk of its own: the acceleration differs a little.
            near, same = (0.05, 0.02) if k < 2 else (0.3, 0.1)
            off = np.abs(found[INNER, c] - mean[INNER, k]) / np.sqrt(var[INNER, k])
            assert np.sqrt(np.mean(off**2)) < near
            np.testing.assert_allclose(std[INNER, c], np.sqrt(var[INNER, k]), rtol=same)


def test_uncertainty_is_honest_and_parameters_are_found():
    time = 0.02 * np.arange(1000)
    normalised, jerk, spikes = [], [], 0
    for seed in range(6):
        run, (eta, eta_dot, eta_ddot) = white_jerk(time, seed)
        s = smooth(clean(run))
        turns = 2.0 * np.pi * np.round((eta[0] + 1.0 - s.eta[0]) / (2.0 * np.pi))
        normalised.append(
            [
                (s.eta + turns - 1.0 - eta) / s.eta_std,
                (s.eta_dot - eta_dot) / s.eta_dot_std,
                (s.eta_ddot - eta_ddot) / s.eta_ddot_std,
            ]
        )
        jerk.append(s.jerk)
        spikes += s.counts.spikes
        np.testing.assert_allclose(s.noise, NOISE, rtol=0.15)
    found = np.array(normalised)[:, :, INNER]
    np.testing.assert_allclose(np.sqrt(np.mean(found**2, axis=(0, 2))), 1.0, atol=0.25)
    assert np.abs(found.mean(axis=(0, 2))).max() < 0.25
    np.testing.assert_allclose(np.median(jerk, axis=0), JERK, rtol=0.5)
    assert spikes <= 1, "of 6,000 samples"


def test_velocity_of_a_ship_is_unbiased_and_sharp():
    error = (smooth_base().nu - true_nu())[INNER]
    assert np.abs(error.mean(axis=0)).max() < 5e-5
    rms = np.sqrt(np.mean(error**2, axis=0))
    assert (rms < (5e-4, 5e-4, 1e-3)).all(), "below half a millimetre per second"
    normalised = np.sqrt(np.mean((error / smooth_base().nu_std[INNER]) ** 2, axis=0))
    assert ((normalised > 0.5) & (normalised < 1.6)).all()


def test_an_error_of_the_heading_is_one_of_the_body_s_velocity():
    """Of states whose pose and rate have independent errors, and are seen from the body."""
    s, row, rng = smooth_base(), 700, np.random.default_rng(4)
    eta, rate = (
        x[row] + std[row] * rng.normal(size=(200_000, 3))
        for x, std in ((s.eta, s.eta_std), (s.eta_dot, s.eta_dot_std))
    )
    nu = np.column_stack([*rotate_to_body(eta[:, 2], *rate.T[:2]), rate[:, 2]])
    (found,) = s.state_covariance(np.array([row]))
    expected, size = np.cov(np.hstack([eta, nu]).T), np.sqrt(found.diagonal())
    np.testing.assert_allclose(expected / np.outer(size, size), found / np.outer(size, size), atol=0.02)
    assert abs(found[2, 3:5]).max() > 0.1 * size[2] * size[3:5].min(), "they go together"
    np.testing.assert_allclose(size[3:], s.nu_std[row])


def test_without_noise_nothing_is_lost():
    run, nu = sail(30.0, noise=0.0)
    s = smooth(clean(run))
    assert s.counts.spikes == 0
    assert np.abs(s.nu - nu)[INNER].max() < 2e-5


def test_channel_that_rests_is_no_trouble():
    pose = base().pose.copy()
    pose[:, 1] = 2.0
    s = smooth(clean(replace(base(), pose=pose)))
    assert np.abs(s.eta_dot[:, 1]).max() < 5e-8
    # Such a run contradicts the ship's description: gains are fitted, and the yaw rate is a little different.
    assert (np.abs(s.nu - smooth_base().nu)[INNER, 2] < 2.0 * smooth_base().nu_std[INNER, 2]).all()


def test_same_ship_elsewhere_and_later_gives_the_same_velocity():
    turn = 1.2
    c, d = np.cos(turn), np.sin(turn)
    x, y, psi = base().pose.T
    pose = np.column_stack([40.0 + c * x - d * y, d * x + c * y - 7.0, psi + turn])
    s = smooth(clean(replace(base(), pose=pose, time=base().time + 1e5)))
    assert np.abs(s.nu - smooth_base().nu)[INNER].max() < 5e-4  # noise of x and y is weighted anew


def test_origin_does_not_matter():
    moved = smooth(clean(replace(base(), pose=base().pose + np.array([1e4, -1e4, 0.0]))))
    np.testing.assert_allclose(moved.nu, smooth_base().nu, atol=1e-9)
    np.testing.assert_allclose(moved.nu_std, smooth_base().nu_std, rtol=1e-8)
    np.testing.assert_allclose(moved.jerk, smooth_base().jerk, rtol=1e-8)


def test_start_of_time_does_not_matter():
    s = smooth(clean(replace(base(), time=base().time + 1e6)))
    np.testing.assert_allclose(s.nu, smooth_base().nu, atol=1e-8)
    np.testing.assert_allclose(s.jerk, smooth_base().jerk, rtol=1e-6)  # time stamps of 1e-10 s


def test_smoothness_has_the_largest_likelihood():
    """The root of the derivative is a minimum of -2 log L, and the derivative that of its differences."""
    grid = knots(np.array([0.0]), np.array([20.0]), 0.05)
    time = 0.02 * np.arange(1000)
    z = 1e3 + np.sin(time)[:, None] + 1e-3 * np.random.default_rng(0).standard_normal((1000, 3))
    even = np.ones((1000, 3))
    spline = Spline(grid, basis(grid, time), np.ones((3, 400)), Rates.none(grid))
    p = Problem(np.arange(1000), z, np.full(3, 1e-3), even, 160, spline)
    best = likeliest(p, even)
    again = likeliest(p, even, 30.0 * best)
    np.testing.assert_allclose(again, best, rtol=1e-7)
    found = criteria(p, even)
    values = [
        sum(f.cost(np.log10(s) + off) for f, s in zip(found, best, strict=True)) for off in (-0.1, 0.1)
    ]
    assert min(values) > deviance(p, even, best) + 1e-3
    for f, s in zip(found, best, strict=True):
        at, h = np.log10(s) + 0.5, 1e-3
        slope = (f.cost(at + h) - f.cost(at - h)) / (2.0 * h * np.log(10.0))
        expected = slope / np.expm1(f.excess(at))  # of the roughness; the slope is what is beyond it
        system = LinearSystem(p.equations(even)[found.index(f)], p.precision(0, 10.0**at))
        assert grid.rank - system.trace(PENALTY) == pytest.approx(expected, rel=1e-4)


def test_spikes_are_found_and_nothing_else():
    sound = np.flatnonzero(smooth_base().spikes)
    rows = np.arange(75, N, 150)
    rows = rows[~np.isin(rows, sound)]
    far = 12.0 * NOISE * np.random.default_rng(0).choice([-1, 1], (rows.size, 3))
    s = smooth(clean(changed(base(), rows, base().pose[rows] + far)))
    assert set(np.flatnonzero(s.spikes)) == {*rows, *sound}
    assert s.counts.used == N - rows.size - sound.size
    assert np.abs(s.nu - smooth_base().nu).max() < 3e-3


@pytest.mark.parametrize("size", [0.05, 1e6, 1e300])
def test_bursts_and_absurd_values_do_no_harm(size):
    rows = np.r_[500:503, 1000, 1500:1506]
    pose = base().pose[rows] + [size, 0.0, 0.0]
    s = smooth(clean(changed(base(), rows, pose)))
    beyond = size > LARGEST  # such a value is no measurement: dropped, not a spike
    assert (~s.track.fresh[rows, 0] if beyond else s.spikes[rows]).all()
    assert s.counts.dropped == smooth_base().counts.dropped + rows.size * beyond
    assert s.counts.spikes <= rows.size + 2
    assert np.abs(s.nu - smooth_base().nu).max() < 5e-3


def test_uncertainty_grows_in_a_gap_and_a_long_one_is_left_out():
    s = smooth(clean(changed(base(), np.r_[500:600, 1500:1800], np.nan)))
    inside, outside = s.eta_std[550], s.eta_std[400]
    assert (inside > 3.0 * outside).all()
    assert (np.abs(s.eta[550, :2] - base().pose[550, :2]) < 6.0 * inside[:2] + 5.0 * NOISE[:2]).all()
    assert np.isnan(s.eta[1500:1800]).all()
    assert np.isfinite(s.eta[1800:]).all()
    assert not s.used[1500:1800].any()


def test_stretch_in_which_nothing_agrees_is_refused_as_spikes():
    wild = changed(base(), np.r_[1000:1200, 1400:1600], np.nan)
    wild = changed(wild, slice(1200, 1400), 3.0 * np.random.default_rng(0).standard_normal((200, 3)))
    s = smooth(clean(wild))
    assert s.spikes[1200:1400].mean() > 0.9
    assert np.abs(s.nu - smooth_base().nu)[:900].max() < 1e-3


def test_run_of_crumbs_is_refused():
    crumbs = np.full_like(base().pose, np.nan)
    for k in range(0, N, 400):
        crumbs[k : k + 10] = base().pose[k : k + 10]
    with pytest.raises(InputError, match="fewer than 20 samples between long gaps"):
        smooth(clean(replace(base(), pose=crumbs)))


def test_rows_of_the_roughness_have_the_times_of_their_intervals():
    """Those of all intervals of a stretch, and two behind it, a spacing apart."""
    grid = knots(np.array([1.0, 20.0]), np.array([2.0, 20.3]), 0.1)
    found = middles(grid)
    assert found.size == len(roughness(grid, np.ones(13))[0].values) == 17
    np.testing.assert_allclose(found[:12], np.arange(1.05, 2.2, 0.1))
    np.testing.assert_allclose(found[12:], [20.05, 20.15, 20.25, 20.35, 20.45])


def test_spline_is_exact_for_a_quintic():
    grid = knots(np.array([2.0, 9.0]), np.array([5.0, 10.0]), 0.25)
    time = np.r_[2.0:5.0:0.01, 9.0:10.0:0.01]
    b = basis(grid, time)
    np.testing.assert_allclose(b.values.sum(axis=1), 1.0)
    dense = np.zeros((time.size, grid.size))
    np.put_along_axis(dense, b.first[:, None] + np.arange(6), b.values, axis=1)
    wanted = np.polynomial.Polynomial([1.0, -2.0, 0.3, 0.5, -0.2, 0.02])
    c = np.linalg.lstsq(dense, wanted(time), rcond=None)[0][:, None]
    np.testing.assert_allclose(b(c)[:, 0], wanted(time), atol=1e-8)
    for k in (1, 2):
        np.testing.assert_allclose(basis(grid, time, k)(c)[:, 0], wanted.deriv(k)(time), atol=1e-5)
    middle = np.concatenate([2.125 + 0.25 * np.arange(12), 9.125 + 0.25 * np.arange(4)])
    np.testing.assert_allclose(third(grid, c)[:, 0], wanted.deriv(3)(middle), atol=1e-3)
    np.testing.assert_allclose(b.matrix.toarray(), dense)
    band = b.gram(np.ones(time.size))
    np.testing.assert_allclose(full(band), dense.T @ dense, atol=1e-12)
    square = (wanted.deriv(3) ** 2).integ()
    integral = square(5.0) - square(2.0) + square(10.0) - square(9.0)
    rough, band = roughness(grid, np.ones(16))
    stiff = full(band) / 0.25**5
    np.testing.assert_allclose(band, rough.gram(np.ones(20)), atol=1e-12)
    np.testing.assert_allclose((rough(c)[:, 0] ** 2).sum() / 0.25**5, integral, rtol=1e-6)
    assert (c.T @ stiff @ c).item() == pytest.approx(integral, rel=1e-5)
    assert np.linalg.matrix_rank(stiff, tol=1e-9 * np.abs(stiff).max()) == grid.rank


def full(band):
    """The symmetric matrix of a lower band."""
    lower = sum(np.diag(row[: row.size - k], -k) for k, row in enumerate(band))
    return lower + np.tril(lower, -1).T


def test_band_of_the_inverse_is_that_of_the_inverse():
    rng = np.random.default_rng(0)
    grid = knots(np.array([0.0]), np.array([40.0]), 0.05)
    time = np.sort(rng.uniform(0.0, 40.0, 1500))
    b = basis(grid, time[(time < 20.0) | (time > 22.5)])
    bands = [
        b.gram(np.ones(b.first.size)) + s * roughness(grid, np.ones(800))[1] for s in (1e-2, 1.0, 1e4)
    ]
    found = inverse_band(np.array([cholesky_banded(band, lower=True) for band in bands]))
    for c, band in enumerate(bands):
        inverse = np.linalg.inv(full(band))
        for k in range(6):
            np.testing.assert_allclose(
                found[k, : grid.size - k, c], np.diag(inverse, -k), atol=1e-8 * np.abs(inverse).max()
            )
        rows = np.zeros((b.first.size, grid.size))
        np.put_along_axis(rows, b.first[:, None] + np.arange(6), b.values, axis=1)
        expected = (rows @ inverse * rows).sum(axis=1)
        np.testing.assert_allclose(b.variance(found)[:, c], expected, rtol=1e-6)


@pytest.mark.slow
@needs_data
def test_measured_runs_are_smoothed():
    for path in sorted((DATA / "cse1").glob("*.mat"))[::2]:  # the response to the commands has them, too
        s = smoothed(read(path))
        assert s.counts.used > 0.8 * s.counts.samples
        assert (s.noise < (2e-4, 2e-4, 1e-3)).all(), "a tenth of a millimetre"
        assert np.nanmax(np.abs(s.nu)) < 2.0
        assert sum(s.counts[1:]) == s.counts.samples


@pytest.mark.parametrize("period", [0.025, 0.1, 0.4])
@pytest.mark.parametrize("every", [1, 3])
def test_outliers_are_first_looked_for_with_a_spline_of_two_sampling_periods(period, every, monkeypatch):
    """Through the filter 1 / (1 + (w / w0)^6) a sample counts w0 T / 3 for itself: a sixth at w0 = 1 / 2T.

    The heading is measured in every row, or in every third.
    """
    time = np.arange(0.0, 400.0 * period, period)
    pose = np.column_stack([0.1 * time, 0.05 * np.sin(0.3 * time), 0.02 * time])
    pose += NOISE * np.random.default_rng(0).standard_normal(pose.shape)
    track = clean(Run("even", time, pose, np.zeros_like(pose)))
    track.fresh[:, 2] &= np.arange(time.size) % every == 0
    seen = []

    def first(p, local, *_):
        seen.append((p, local))
        raise LookupError

    monkeypatch.setattr(smoother, "robust", first)
    with pytest.raises(LookupError):
        smoother._judged(track)
    ((p, local),) = seen
    weights = (p.share > 0.0).astype(float)
    fit = solve(p, local, weights)
    leverage = (p.share * p.spline.b.variance(fit.covariance) / p.sigma**2)[100:-100]
    for k, rows in enumerate((p.share > 0.0)[100:-100].T):
        assert np.mean(leverage[rows, k]) == pytest.approx(1.0 / 6.0, rel=0.05)


def test_the_variance_of_a_sum_is_that_of_the_coefficients():
    """a^T (L L^T)^-1 a, a the sum of the basis functions, in stretches and for each channel of its own."""
    rng = np.random.default_rng(5)
    grid = knots(np.array([0.0, 30.0]), np.array([20.0, 45.0]), 0.5)
    bands = rng.uniform(-0.3, 0.3, (3, 6, grid.size))
    bands[:, 0] = rng.uniform(1.0, 2.0, (3, grid.size))
    time = np.sort(np.concatenate([rng.uniform(0.0, 20.0, 60), rng.uniform(30.0, 45.0, 50)]))
    weights = np.zeros((4, time.size))
    for row, first in enumerate((0, 20, 40, 70)):
        weights[row, first : first + 9] = rng.normal(size=9)
    covariance = SplineCovariance(grid, bands, 7.0)
    for derivative in (0, 1, 2):
        found = covariance.variance(csr_matrix(weights), time + 7.0, derivative)
        a = weights @ basis(grid, time, derivative).matrix.toarray()
        for channel, band in enumerate(bands):
            L = sum(np.diag(b[: grid.size - k], -k) for k, b in enumerate(band))
            expected = np.einsum("ki,ij,kj->k", a, np.linalg.inv(L @ L.T), a)
            assert found[:, channel] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("speeds", "at_rest"),
    [
        ((0.0, 0.0, 0.0), True),
        ((0.1, 0.0, 0.0), False),
        ((0.0, 0.1, 0.0), False),
        ((0.0, 0.0, 0.1), False),
    ],
)
def test_a_ship_begins_at_rest_only_if_it_neither_moves_nor_turns(monkeypatch, speeds, at_rest):
    """A ship that drifts straight on, or turns on the spot, had commands before the run began."""
    time, seen = np.arange(0.0, 30.0, 0.1), []
    pose = time[:, None] * speeds + NOISE * np.random.default_rng(5).standard_normal((time.size, 3))
    pose[:, 0] += 0.1 * np.maximum(time - 10.0, 0.0)  # a log of a ship that never moves is refused
    given = smoother.Commands

    def kept(*parts):
        seen.append(parts[3])
        return given(*parts)

    monkeypatch.setattr(smoother, "Commands", kept)
    smooth(clean(Run("steady", time, pose, np.zeros((time.size, 3)))))
    assert set(seen) == {at_rest}
