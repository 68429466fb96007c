"""What a model leaves, on windows that are made up: noise, a size that is too large, a force that lasts."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from diagnosis import Model
from diagnosis.assessment.residual.remainder import (
    CHANCE_OF_ONE,
    SPAN,
    axis_remainders,
    chance,
    noise_freedom,
    spans,
)
from diagnosis.predictors.uncertainty import NOISE_TOLERANCE, SHARE_OF_COMMAND
from diagnosis.predictors.weak_form import EVERY, OVERLAP
from diagnosis.runs.run_constants import NEGLIGIBLE

K, NOISE = 100 * SPAN, 0.02


def windows(count=K, first=0.0, command=0.1, uncertain=(0.0, 0.0, 0.0), at_most=False):
    tau = np.full((count, 3), command)
    middle = first + EVERY * np.arange(count)
    run = SimpleNamespace(tau_cmd=tau)
    known = {"noise_rel_std": np.array(uncertain), "noise_at_most": np.full(3, at_most)}
    smoothed = SimpleNamespace(**known)
    return SimpleNamespace(middle=middle, every=EVERY, held=np.eye(count), run=run, smoothed=smoothed)


def noise(count=K, seed=0):
    return NOISE * np.random.default_rng(seed).normal(size=(count, 3))


def left(after, before=0.1, command=0.1, **known):
    """The remainders of one run by axis, whose first model error is constant."""
    std = np.full_like(after, NOISE)
    data = [windows(len(after), command=command, **known)]
    return axis_remainders(data, [np.full_like(after, before)], [after], [std], Model())


def test_spans_are_of_twelve_windows_of_one_run():
    a, b = windows(2 * SPAN + 3), windows(SPAN)
    groups = spans([a, b])
    assert np.bincount(groups).tolist() == [SPAN, SPAN, 3, SPAN]
    assert (np.diff(groups) >= 0).all()
    gap = windows(2 * SPAN)
    gap.middle[SPAN:] += 100.0
    assert set(spans([gap])[:SPAN]).isdisjoint(spans([gap])[SPAN:]), "no mean over a gap"


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_remainder(seed):
    for found in left(noise(seed=seed)).values():
        assert not found.significant
        assert not found.beyond_chance
        assert found.p_value > 10.0 * CHANCE_OF_ONE
        assert found.uncertainty == pytest.approx(NOISE)
        assert found.rms == pytest.approx(NOISE, rel=0.1)


@pytest.mark.parametrize("axis", range(3))
def test_what_is_larger_than_noise_is_told_on_its_axis_alone(axis):
    """Of one size and alternating sign, so that only its size shows."""
    after = noise()
    after[:, axis] += 0.06 * (-1.0) ** np.arange(K)
    found = left(after)
    assert [r.significant for r in found.values()] == [k == axis for k in range(3)]
    one = list(found.values())[axis]
    assert one.rms == pytest.approx(np.hypot(0.06, NOISE), rel=0.02)
    assert one.share == pytest.approx((one.rms / 0.1) ** 2)
    assert one.slow < 0.3 * NOISE


@pytest.mark.parametrize("force", [0.01, -0.01])
def test_a_force_below_the_noise_is_told_if_it_lasts(force):
    after = noise()
    after[:, 1] += force
    found = left(after)
    assert [r.significant for r in found.values()] == [False, True, False]
    assert found["Y"].slow == pytest.approx(abs(force), rel=0.15)
    assert found["Y"].rms < 1.3 * NOISE, "its size is not what tells it"
    hardly = left(noise() + 0.1 * force)
    assert not any(r.significant for r in hardly.values())


def test_a_residual_is_compared_with_a_noise_as_uncertain_as_it_is():
    """Noise that was estimated three times too small, from samples that hardly determine it."""
    after = 3.0 * noise()
    assert all(r.significant for r in left(after).values())
    found = left(after, uncertain=(0.05, 0.05, 0.6))
    assert [r.significant for r in found.values()] == [True, True, False]
    assert not any(r.significant for r in left(after, uncertain=[np.inf] * 3).values())
    # A place by one channel that is uncertain is as uncertain as that.
    found = left(after, uncertain=(0.6, 0.05, 0.05))
    assert [r.significant for r in found.values()] == [False, False, True]
    assert all(r.significant for r in left(after, uncertain=[np.inf] * 3, at_most=True).values())


def test_the_noise_of_several_runs_is_better_known_than_that_of_one():
    data, std = [windows(uncertain=[0.4] * 3)] * 4, [np.full((K, 3), NOISE)] * 4
    of_one, of_four = noise_freedom(data[:1], std[:1]), noise_freedom(data, std)
    np.testing.assert_allclose(of_one, 0.5 / 0.4**2)
    np.testing.assert_allclose(of_four, 4.0 * of_one)


def test_a_variance_of_normal_samples_has_the_freedom_that_its_uncertainty_gives():
    sigma = np.random.default_rng(0).normal(size=(20000, 9)).std(axis=1, ddof=1)
    v = float(np.std(sigma**2) / np.mean(sigma**2)) / 2.0
    assert 0.5 / v**2 == pytest.approx(8.0, rel=0.1)
    assert chance(5.0, 3.0, 8.0) > chance(5.0, 3.0, 800.0) > chance(5.0, 3.0, np.inf)
    assert chance(5.0, 3.0, np.inf) == pytest.approx(chi2.sf(15.0, 5))


def test_a_force_that_changes_sign_from_span_to_span_lasts_too():
    after = noise()
    after[:, 0] += 0.015 * np.repeat((-1.0) ** np.arange(K // SPAN), SPAN)
    assert left(after)["X"].significant
    assert left(after)["X"].slow == pytest.approx(0.015, rel=0.1)


@pytest.mark.parametrize(
    ("before", "command"), [(0.02 / NEGLIGIBLE, 0.01), (0.01, 0.02 / SHARE_OF_COMMAND)]
)
def test_what_is_little_beside_the_first_error_or_the_command_does_not_matter(before, command):
    after = noise()
    after[:, 0] += 0.01
    found = left(after, before, command)["X"]
    assert found.least == pytest.approx(0.02)
    assert found.beyond_chance
    assert not found.significant
    assert left(after, before=0.15, command=0.01)["X"].significant


def test_runs_that_are_too_short_for_a_span_have_no_slow_part():
    after = noise(SPAN // 2 - 1) + 0.02
    assert left(after)["X"].slow == 0.0
    assert left(noise(SPAN // 2) + 0.1)["X"].slow == pytest.approx(0.1, rel=0.3)


@pytest.mark.parametrize(("size", "matters"), [(2.0, False), (4.0, True)])
def test_noise_of_windows_with_gaps_is_no_residual_that_matters(size, matters):
    """Beyond chance in windows without a gap, by a small force; the RMS is that of noise in others."""
    gap = np.arange(K) % 10 == 0
    std = np.where(gap, 5.0 * NOISE, 0.1 * NOISE)[:, None] * np.ones(3)
    after = std * np.where(gap, 1.0, size)[:, None] * np.where(np.arange(K) % 4 < 2, 1.0, -1.0)[:, None]
    found = axis_remainders([windows()], [np.full_like(after, 0.1)], [after], [std], Model())["X"]
    assert found.rms > found.least == pytest.approx(0.005)
    assert found.beyond_chance
    assert found.significant == matters


def test_without_a_first_error_there_is_no_share():
    assert left(noise(), before=0.0)["X"].share == 0.0


@given(st.integers(0, 99), st.floats(1.0, 1.6), st.lists(st.floats(0.3, 3.0), min_size=3, max_size=3))
def test_the_two_p_values_are_those_of_chi_square(seed, level, sizes):
    """Of all windows, four of which count as one, and of the means over spans; noise is known to 30 %."""
    rng, count = np.random.default_rng(seed), 10 * SPAN
    std = NOISE * rng.uniform(0.5, 2.0, (count, 3))
    after = std * rng.normal(size=(count, 3)) * level * np.array(sizes)
    found = axis_remainders([windows(count)], [after], [after], [std], Model())
    for k, axis in enumerate("XYN"):
        z = after[:, k] / std[:, k] / NOISE_TOLERANCE
        by_size = chi2.sf(z @ z / OVERLAP, count / OVERLAP)
        means = after[:, k].reshape(-1, SPAN).mean(axis=1)
        variance = (std[:, k] ** 2).reshape(-1, SPAN).mean(axis=1) / SPAN
        by_slowness = chi2.sf(np.sum(means**2 / variance) / NOISE_TOLERANCE**2, 10)
        assert found[axis].p_value == pytest.approx(min(by_size, by_slowness), rel=1e-9, abs=1e-300)
        assert found[axis].slow == pytest.approx(
            max(np.mean(means**2 - variance), 0.0) ** 0.5, abs=1e-12
        )
        assert found[axis].share == pytest.approx(1.0)
