"""Errors of a pose that last: told from white noise and from motion, and counted where velocities are."""

from dataclasses import replace

import numpy as np
import pytest
from support.measured import base, smoothed, true_nu

from diagnosis.runs.smoothing.correlated_noise import correlated, hadamard

pytestmark = pytest.mark.numerical
N, PERIOD, LONGEST = 4000, 0.1, 3.0
TIME = PERIOD * np.arange(N)
WHITE, LASTING, T = 0.001, 0.004, 1.2  # m, m, s


def lasting(rng, size, time, n=N, period=PERIOD):
    """First-order autoregressive noise (n,)."""
    keep = np.exp(-period / time)
    x, noise = np.zeros(n), size * rng.standard_normal(n)
    x[0] = noise[0]
    for k in range(1, n):
        x[k] = keep * x[k - 1] + np.sqrt(1.0 - keep**2) * noise[k]
    return x


def moved_by_white_force(rng, size):
    """Position (N,) of a mass that a white force accelerates: the least smooth motion there is."""
    speed = np.cumsum(size * np.sqrt(PERIOD) * rng.standard_normal(N))
    return np.cumsum(speed * PERIOD)


def test_hadamard_variance_of_white_noise_is_twenty_times_its_own():
    z = WHITE * np.random.default_rng(0).standard_normal(N)
    z[::50] += 1.0  # spikes
    time = np.delete(TIME, np.arange(7, N, 29))
    h, variance, std, period = hadamard(time, np.delete(z, np.arange(7, N, 29)), LONGEST)
    assert period == pytest.approx(PERIOD)
    assert h[0] == pytest.approx(PERIOD)
    assert h[-1] <= LONGEST
    off = variance / (20.0 * WHITE**2) - 1.0
    assert np.abs(off - 0.2).max() < 0.1 + 4.0 * std.max(), "spikes add a fifth: eight of a hundred"


@pytest.mark.parametrize("force", [0.0, 3e-4, 3e-2])
def test_white_noise_of_a_ship_that_any_force_moves_does_not_last(force):
    found = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        z = moved_by_white_force(rng, force) + WHITE * rng.standard_normal(N)
        found.append(correlated(TIME, z + np.sin(0.2 * TIME), LONGEST) is not None)
    assert np.mean(found) <= 0.05


@pytest.mark.parametrize("force", [0.0, 3e-4])
def test_noise_that_lasts_has_the_density_that_it_has(force):
    frequency = np.array([0.8, 2.0])
    density = WHITE**2 + LASTING**2 * 2.0 * T / PERIOD / (1.0 + (frequency * T) ** 2)
    ratio = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        z = lasting(rng, LASTING, T) + WHITE * rng.standard_normal(N)
        z += moved_by_white_force(rng, force) + np.sin(0.2 * TIME)
        noise = correlated(TIME, z, LONGEST)
        assert noise is not None
        ratio.append([noise.as_white(f) for f in frequency] / np.sqrt(density))
    assert np.abs(np.log(ratio)).max() < np.log(2.0)
    usual = np.exp(np.mean(np.log(ratio), axis=0))
    assert ((usual > 0.65) & (usual < 1.1)).all(), "what it has at the longest lags may be motion"


def test_uneven_samples_are_not_judged():
    time = np.cumsum(np.random.default_rng(0).uniform(0.02, 0.3, N))
    assert correlated(time, lasting(np.random.default_rng(1), LASTING, T), LONGEST) is None


def test_velocity_is_as_uncertain_as_noise_that_lasts_makes_it():
    run, rng = base(), np.random.default_rng(3)
    slow = np.column_stack(
        [size * lasting(rng, 1.0, 0.6, run.time.size, 0.02) for size in (2e-3, 2e-3, 2e-3)]
    )
    found = smoothed(replace(run, pose=run.pose + slow))
    inner = slice(100, -100)
    off = (found.nu - true_nu())[inner] / found.nu_std[inner]
    assert (np.sqrt(np.mean(off**2, axis=0)) < 2.0).all()
    assert (found.noise > 2e-3).all()
    scatter = np.std((found.track.pose - found.eta)[inner], axis=0)
    assert (scatter < found.noise).all(), "of white noise it were as large"


def test_given_noise_stays():
    run, rng = base(), np.random.default_rng(3)
    pose = run.pose + 2e-3 * lasting(rng, 1.0, 0.6, run.time.size, 0.02)[:, None]
    found = smoothed(replace(run, pose=pose, noise={"x": 1e-3, "y": 1e-3, "psi": 1e-3}))
    np.testing.assert_allclose(found.noise, 1e-3)


def test_a_gap_of_years_counts_as_one_of_minutes():
    z = np.random.default_rng(4).standard_normal(N)
    late = np.arange(N) >= N // 2
    minutes, years = (hadamard(TIME + late * gap, z, LONGEST) for gap in (100.0, 1e9))
    for a, b in zip(minutes, years, strict=True):
        np.testing.assert_allclose(a, b)
