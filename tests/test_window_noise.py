"""Noise of the model error in windows that are made up, and pushes beyond it, by independent formulas."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from diagnosis import Model
from diagnosis.predictors import uncertainty
from diagnosis.predictors.uncertainty import (
    FLOOR,
    NOISE_TOLERANCE,
    correlated_windows,
    independent,
    measurement_std,
)
from diagnosis.predictors.weak_form import BLOCK, EVERY, OVERLAP, WIDTH
from diagnosis.runs.run_constants import CHANCE
from diagnosis.search.prediction_fit import disturbance_summary
from fmus.scale import REFERENCE

seeds = st.integers(0, 2**32 - 1)
LONGEST = round(2.0 * BLOCK / EVERY)


def series(rng, count, memory):
    """(count, 3), autoregressive of first order."""
    x = np.zeros((count, 3))
    for k in range(1, count):
        x[k] = memory * x[k - 1] + rng.normal(size=3)
    return x


@given(seeds, st.floats(0.0, 0.99), st.lists(st.integers(1, 200), min_size=1, max_size=3))
@settings(max_examples=40, deadline=None)
def test_windows_that_count_as_one_are_by_the_first_positive_correlations(seed, memory, counts):
    rng = np.random.default_rng(seed)
    parts = [series(rng, n, memory) + 0.1 for n in counts]
    data = [
        SimpleNamespace(middle=100.0 * k + EVERY * np.arange(n), every=EVERY)
        for k, n in enumerate(counts)
    ]
    expected = []
    for k in range(3):
        power = np.concatenate([p[:, k] for p in parts])
        mean_square = (power @ power) / power.size
        tau = 1.0
        for lag in range(1, LONGEST + 1):
            products = [x * y for p in parts for x, y in zip(p[lag:, k], p[:-lag, k], strict=True)]
            rho = sum(products) / max(len(products), 1) / max(mean_square, 1e-300)
            if rho <= 0.0:
                break
            tau += 2.0 * rho
        expected.append(tau)
    error = np.concatenate(parts)
    np.testing.assert_allclose(correlated_windows(data, error), expected, rtol=1e-9)
    np.testing.assert_allclose(independent(data, error), np.maximum(1.0, np.array(expected) / OVERLAP))


def test_what_lasts_is_followed_for_two_blocks():
    w = SimpleNamespace(middle=EVERY * np.arange(8 * LONGEST), every=EVERY)
    tau = correlated_windows([w], np.ones((8 * LONGEST, 3)))
    np.testing.assert_allclose(tau, 1.0 + 2.0 * 2.0 * BLOCK / EVERY)


def test_windows_of_a_gap_are_no_neighbours():
    """Alternate windows are missing: a lag of one has no pairs, so that nothing is correlated."""
    x = series(np.random.default_rng(0), 200, 0.9)
    holed = SimpleNamespace(middle=2.0 * EVERY * np.arange(200), every=EVERY)
    np.testing.assert_array_equal(correlated_windows([holed], x), 1.0)


@cache
def transform():
    """Angular frequencies, and the squared transform of the kernel (1 - s^2)^3 there, by sums."""
    s, w = np.linspace(-1.0, 1.0, 801), np.linspace(0.02, 60.0, 3000)
    kernel = (1.0 - s**2) ** 3
    K = np.trapezoid(kernel * np.cos(w[:, None] * WIDTH / 2 * s), s, axis=1)
    return w, (K / np.trapezoid(kernel, s)) ** 2


def kernel_power(order, corner):
    """Integral of w^2k |K(w)|^2 / (1 + (w / w0)^6) dw / pi."""
    w, K2 = transform()
    return np.trapezoid(w ** (2 * order) * K2 / (1.0 + (w / corner) ** 6), w) / np.pi


@given(
    seeds,
    st.floats(0.02, 0.1),
    st.floats(0.0, 1.5),
    st.sampled_from([0.0, 0.05, 0.5, 1.0]),
    st.floats(0.3, 1.0),
    st.floats(1.0, 20.0),
    st.floats(0.0, 3.0),
    st.sampled_from([1.0, 4.0]),
)
@settings(max_examples=20, deadline=None)
def test_noise_of_a_window_is_what_its_samples_leave_through_the_kernel(
    seed, period, psi, used, dense, corner, slope, unit
):
    """Samples at uneven times, some of which do not count, of a ship that rests at a heading psi.

    Each channel has a rate of its own, as a receiver's 5 Hz and a compass' 10 Hz. A window of a larger ship is as many times as long, in a unit of time of its own.
    """
    rng = np.random.default_rng(seed)
    n, windows = 300, 4
    time = np.cumsum(dense * period * rng.uniform(0.6, 1.4, n))
    weights = rng.uniform(0.0, 1.0, (windows, n))
    weights /= weights.sum(axis=1, keepdims=True)
    periods = period * rng.choice([0.5, 1.0, 3.0], 3)
    counts = rng.uniform(size=(n, 3)) < used * period / np.maximum(periods, period)
    noise = np.array([2e-3, 5e-3, 1e-3])
    std = np.sqrt(noise**2 * period * corner / 3.0) * np.ones((n, 3))  # R w0 / 3
    smoothed = SimpleNamespace(
        scale=SimpleNamespace(time=unit, forces=np.array([unit, unit, unit**2])),
        track=SimpleNamespace(periods=periods, usual_rounding=np.zeros(3)),
        time=time,
        agrees=counts,
        noise=noise,
        jerk=np.full(3, 1e-30),  # so slow a motion that no gap is long
        eta_std=std,
        eta=np.tile([0.0, 0.0, psi], (n, 1)),
    )
    w = SimpleNamespace(
        smoothed=smoothed,
        scale=smoothed.scale,
        smooth=weights,
        known=np.ones(n, bool),
        width=WIDTH * unit,
        middle=np.arange(windows),
        motion=(np.zeros((n, 3)), np.zeros((n, 3))),
    )
    model, F = Model(), np.full((windows, 3, 3), slope)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(uncertainty, "_slope", lambda w, model: F)
        found = measurement_std(w, model)
    mass = model.reference_mass
    for k in range(windows):
        rate = np.zeros(3)  # of samples [1/s]
        for i in range(n):  # each sample stands for half of the way to both neighbours
            before, after = time[max(i - 1, 0)], time[min(i + 1, n - 1)]
            gap = (after - before) / (2.0 if 0 < i < n - 1 else 1.0)
            rate += weights[k, i] * counts[i] / gap
        rate = np.minimum(np.maximum(rate, 1.0 / WIDTH / unit), 1.0 / periods)
        density = noise**2 / rate
        w0 = np.clip(corner * rate * period * unit, 0.02, 60.0)
        c, s = np.cos(psi), np.sin(psi)
        turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        acceleration, velocity = (
            np.diag(turned @ np.diag(density * [kernel_power(order, x) for x in w0]) @ turned.T)
            / unit ** (2 * order + 1)
            for order in (2, 1)
        )
        expected = mass**2 @ acceleration + F[k] ** 2 @ velocity + (FLOOR * smoothed.scale.forces) ** 2
        np.testing.assert_allclose(found[k], np.sqrt(expected), rtol=0.02)


@given(seeds, st.integers(0, 2), st.floats(0.3, 3.0), st.floats(0.5, 3.0), st.integers(20, 180))
@settings(max_examples=60, deadline=None)
def test_a_push_is_told_where_it_is_beyond_the_noise_and_what_is_usual(seed, axis, factor, level, at):
    """The error that is left is compared with the larger of its noise and its usual size, in all windows."""
    rng = np.random.default_rng(seed)
    count = 200
    middle = EVERY * np.arange(count)
    sizes = np.array([1.0, 3.0, 0.3])  # each axis has a size of its own
    left = rng.choice([-1.0, 1.0], (count, 3)) * rng.uniform(0.5, 1.5, (count, 3)) * sizes
    std = np.full((count, 3), level) * sizes
    usual = norm.ppf(0.75) ** -1 * np.median(np.abs(left), axis=0)
    scale = max(NOISE_TOLERANCE * level * sizes[axis], usual[axis])
    limit = norm.isf(CHANCE / left.size / 2.0)
    rows = slice(at - 3, at + 4)
    left[rows, axis] = factor * limit * scale
    # The push itself is among what is usual.
    usual = norm.ppf(0.75) ** -1 * np.median(np.abs(left), axis=0)
    beyond = np.abs(left) > limit * np.maximum(NOISE_TOLERANCE * std, usual)
    w = SimpleNamespace(
        middle=middle, width=WIDTH, every=EVERY, scale=REFERENCE, run=SimpleNamespace(name="a")
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(disturbance_summary, "omega", lambda w, model: left)
        patch.setattr(disturbance_summary, "omega_std", lambda w, model: std)
        found = disturbance_summary.unrecorded([w], Model(), None, {})
    assert len(found.stretches) == beyond[:, axis].any()
    assert {s.axis for s in found.stretches} <= {"XYN"[axis]}
    for s in found.stretches:
        assert s.size > 0.0
        assert s.start < middle[at] < s.end


@given(seeds)
def test_slopes_are_by_axis_of_the_force_and_then_by_speed(seed):
    rng = np.random.default_rng(seed)
    A, weights = rng.normal(size=(3, 3)), rng.random((4, 30))
    weights /= weights.sum(axis=1, keepdims=True)
    w = SimpleNamespace(
        smoothed=SimpleNamespace(nu_std=rng.random((30, 3)) + 0.01),
        known=rng.random(30) < 0.7,
        scale=REFERENCE,
        motion=(None, rng.normal(size=(30, 3))),
    )
    w.known[0] = True
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(uncertainty, "modelled_force", lambda w, model, nu: weights @ nu @ A.T + 1.0)
        found = uncertainty._by_steps(w, Model())
    np.testing.assert_allclose(found, np.broadcast_to(A, (4, 3, 3)), rtol=1e-8, atol=1e-8)
