"""Uncertainty of the model error, and regions where the model fails: only significant ones are reported."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.cases import slow
from support.measured import NOISE, jumps, sail, smoothed

from diagnosis import Model, omega_std
from diagnosis.assessment.covariates import EAST, HEADING, NORTH, SPEED, THRUST, TIME, YAW_RATE
from diagnosis.assessment.regions import Region, _Design, cluster_mean, find_regions, welch_p_value
from diagnosis.assessment.residual.remainder import remaining
from diagnosis.predictors import omega, uncertainty, weak_windows
from diagnosis.predictors.ship_model import SampledForce
from diagnosis.predictors.uncertainty import bridged
from diagnosis.predictors.weak_form import halfway
from diagnosis.runs.run_constants import BLOCK


def windows(run):
    return weak_windows(smoothed(run))


def found(seconds=240.0, **hidden):
    """Where the nominal model fails on a run with something hidden in it."""
    w = windows(sail(seconds, h=0.1, **hidden)[0])
    return find_regions([w], [omega(w, Model())], [omega_std(w)])


def of(axis, regions):
    return [r for r in regions if r.axis == axis]


FAR = (
    40.0,
    40.0,
    0.2,
)  # a position to centimetres beside a good heading: the sway velocity is uncertain


@pytest.mark.parametrize(("level", "held"), [(4.0, 1), (FAR, 1), (4.0, 10)])
def test_uncertainty_is_the_spread_over_realisations_of_the_noise(level, held):
    """With the true model and the same motion under other noise, the model error left is that of the noise.

    The position may be held for some rows, as that of a slow receiver, while each row has a new heading.
    """
    run, _ = sail(48.0, noise=0.0)
    left, stated = [], []
    for seed in range(4):
        noise = np.multiply(level, NOISE) * np.random.default_rng(seed).standard_normal(run.pose.shape)
        pose = run.pose + noise
        pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
        pose[:, :2] = pose[np.arange(len(pose)) // held * held, :2]
        w = windows(replace(run, pose=pose))
        left.append(omega(w, Model()))
        stated.append(omega_std(w))
    spread = np.sqrt(np.mean(np.square(left), axis=(0, 1)))
    expected = np.sqrt(np.mean(np.square(stated), axis=(0, 1)))
    # A little too much is claimed, most of a position that is rare: the smoother knows the commands.
    assert (expected > 0.7 * spread).all()
    assert (expected < spread * (1.4 if held == 1 else 1.5)).all()


def test_a_force_is_as_uncertain_as_its_velocity_whether_a_coefficient_or_given():
    run = sail(48.0)[0]
    w = windows(run)
    slope = np.zeros((run.time.size, 3, 6))
    slope[:, 2, 4] = 5.0  # N m by v
    given = Model(given={run.name: SampledForce(np.zeros((run.time.size, 3)), slope)})
    a, b, without = (omega_std(w, m) for m in (given, Model({"delta_N_v": 5.0}), Model()))
    np.testing.assert_allclose(a, b, rtol=1e-6)
    assert (a[:, 2] > without[:, 2]).all()


def test_a_force_that_goes_with_speed_is_taken_halfway_between_samples():
    """The mean over each step of what is straight in time; beside a sample that is not known, its own."""
    nu = np.arange(12.0).reshape(4, 3)
    known = np.array([True, True, True, False])
    between = halfway(SimpleNamespace(known=known), nu)
    np.testing.assert_allclose(between[:2], 0.5 * (nu[:2] + nu[1:3]))
    np.testing.assert_array_equal(between[2:], nu[2:])


def test_uncertainty_grows_with_the_noise_and_where_samples_are_missing():
    run, _ = sail(48.0)
    noisy, _ = sail(48.0, noise=4.0)
    w = windows(run)
    assert (np.median(omega_std(windows(noisy)), axis=0) > 2.0 * np.median(omega_std(w), axis=0)).all()
    hole = run.pose.copy()
    hole[1200:1250] = np.nan
    holed = windows(replace(run, pose=hole))
    around = np.abs(holed.middle - 24.5) < 0.6
    assert around.any()
    assert (omega_std(holed)[around] > omega_std(w)[np.isin(w.middle, holed.middle[around])]).all()


def dropped_out(run, channels, seed):
    """The run with gaps of 0.5 to 2.9 s, 3 to 9 s apart, in some channels of the pose."""
    rng, pose, begin = np.random.default_rng(seed), run.pose.copy(), 4.0
    while begin < run.time[-1] - 8.0:
        end = begin + rng.uniform(0.5, 2.9)
        pose[(run.time > begin) & (run.time < end), channels] = np.nan
        begin = end + rng.uniform(3.0, 9.0)
    return replace(run, pose=pose)


@pytest.mark.parametrize(("noise", "channels"), [(0.1, np.s_[:]), slow((1.0, np.s_[2:]))])
def test_uncertainty_is_the_error_where_a_gap_is_bridged(noise, channels):
    """The true model's error in windows with a gap is one standard deviation, within a factor of 1.5.

    Commands jump in the gaps, so that the splines do not know what happens there. By the mean rate and
    the mean variance of a window, as in windows without a gap, its yaw error is 2 to 2.5 of them.
    """
    ratio, gaps = [], []
    for seed in range(4):
        run, _ = sail(120.0, h=0.05, noise=noise, seed=seed, given=jumps)
        w = windows(dropped_out(run, channels, seed))
        ratio.append(omega(w, Model()) / omega_std(w))
        gaps.append(bridged(w).any(axis=1))
    with_gap = np.concatenate(gaps)
    assert 100 < with_gap.sum() < with_gap.size - 100
    for rows in (with_gap, ~with_gap):
        rms = np.sqrt(np.mean(np.concatenate(ratio)[rows] ** 2, axis=0))
        assert (rms > 1.0 / 1.5).all(), rms
        assert (rms < 1.5).all(), rms


def without_rows(run, seed):
    """The run without a fifth of its rows."""
    kept = np.random.default_rng(seed).random(run.time.size) > 0.2
    kept[[0, -1]] = True
    return run.rows(kept)


def test_uncertainty_is_the_error_where_rows_are_missing():
    """A command that jumps may have done so in a missing row: held, it is late, and so is its force.

    Of the noise alone the model error is six to nine standard deviations.
    """
    ratio, jumped = [], []
    for seed in range(4):
        run, _ = sail(120.0, h=0.05, noise=0.1, seed=seed, given=jumps)
        w = windows(without_rows(run, seed))
        std = omega_std(w)
        ratio.append(omega(w, Model()) / std)
        jumped.append((std > 2.0 * uncertainty.measurement_std(w, Model())).any(axis=1))
    late = np.concatenate(jumped)
    assert 50 < late.sum() < 0.5 * late.size
    for rows in (late, ~late):
        rms = np.sqrt(np.mean(np.concatenate(ratio)[rows] ** 2, axis=0))
        assert (rms > 1.0 / 1.5).all(), rms
        assert (rms < 1.5).all(), rms


def test_the_true_model_leaves_nothing_with_or_without_dropouts():
    run = sail(150.0, h=0.05, noise=0.1, seed=3, given=jumps)[0]
    for each in (run, dropped_out(run, np.s_[:], 0), without_rows(run, 0)):
        w = windows(each)
        left = remaining([w], Model(), Model())
        assert not any(axis.beyond_chance for axis in left.values()), left


def test_the_posterior_is_the_same_where_no_sample_is_missing(monkeypatch):
    """What a window with a gap gets goes over into what the density of the noise gives."""
    w = windows(sail(120.0, h=0.05, given=jumps)[0])
    assert not bridged(w).any()
    by_density = omega_std(w)
    monkeypatch.setattr(uncertainty, "bridged", lambda w: np.ones((w.middle.size, 3), bool))
    by_posterior = omega_std(w)
    assert (by_posterior != by_density).all()
    np.testing.assert_allclose(by_posterior, by_density, rtol=0.1)


@pytest.mark.parametrize("noise", [1.0, slow(4.0)])
def test_noise_alone_has_no_region(noise):
    result = found(120.0, noise=noise)
    assert result.regions == []
    assert all("no model error detected" in s for s in result.sentences)


@pytest.mark.parametrize(
    ("hidden", "axis", "covariate"),
    [
        ({"ship": {"delta_X_absu_u": -20.0}}, "X", SPEED),
        ({"thrusters": {"bow_failure_time": 118.0}}, "Y", TIME),
        slow(({"ship": {"V_n": 0.05}}, "Y", HEADING)),
    ],
)
def test_the_region_is_where_the_hidden_effect_acts(hidden, axis, covariate):
    result = found(**hidden)
    first = of(axis, result.regions)[0]
    assert first.covariate is covariate
    assert first.rms > 1.4 * first.elsewhere
    assert result.sentences["XYN".index(axis)] == first.sentence
    if covariate is TIME:
        assert first.high is None
        assert first.low == pytest.approx(118.0, abs=16.0)


def test_an_error_that_is_the_same_everywhere_has_no_region():
    result = found(ship={"body_bias_X": 0.1})
    assert result.regions == []
    assert "no region is significantly worse" in result.sentences[0]
    assert "0.1 N" in result.sentences[0]


def test_profiles_hold_every_window_once():
    result = found(120.0, ship={"delta_X_u": -3.0})
    for p in result.profiles:
        assert np.nansum(p.share) == pytest.approx(1.0)
        assert len(p.rms) == len(p.uncertainty) == len(p.share) == len(p.edges) - 1
        assert (np.diff(p.edges) > 0.0).all()
    speed = next(p for p in result.profiles if p.covariate is SPEED and p.axis == "X")
    assert np.argmax(speed.rms) == len(speed.rms) - 1


@pytest.mark.slow
def test_slow_noise_seldom_has_a_region():
    """Model error that depends on no covariate, correlated over 3 s."""
    w = windows(sail(240.0, h=0.05)[0])
    named = 0
    for seed in range(20):
        e = np.random.default_rng(seed).standard_normal((w.middle.size, 3))
        for k in range(1, len(e)):
            e[k] = 0.85 * e[k - 1] + np.sqrt(1.0 - 0.85**2) * e[k]
        result = find_regions([w], [0.1 * e], [np.full_like(e, 0.003)])
        named += len({r.axis for r in result.regions})
    assert named <= 3  # of 60


def test_runs_have_their_own_time():
    a, b = (windows(replace(sail(64.0, h=0.05, seed=k)[0], name=f"r{k}")) for k in (1, 2))
    result = find_regions([a, b], [omega(w, Model()) for w in (a, b)], [omega_std(w) for w in (a, b)])
    assert {p.run for p in result.profiles if p.covariate is TIME} == {"r1", "r2"}
    assert {p.run for p in result.profiles if p.covariate is SPEED} == {None}


def test_cluster_mean_of_independent_values_has_the_usual_standard_error():
    x = np.random.default_rng(0).standard_normal(50)
    m = cluster_mean(x, np.ones(50))
    assert m.mean == pytest.approx(x.mean())
    assert m.variance == pytest.approx(x.var(ddof=1) / 50)
    assert m.dof == 49
    assert welch_p_value(m, m) == pytest.approx(0.5)
    # The same values five times are no more than once.
    five = cluster_mean(5.0 * x, np.full(50, 5))
    assert five.variance == pytest.approx(m.variance)


@pytest.mark.parametrize(
    ("covariate", "count"),
    [
        (SPEED, 6),  # three bins from below, three from above
        (EAST, 9),  # 10 intervals of four bins, less the whole
        (NORTH, 9),
        (TIME, 9),
        (HEADING, 12),  # from each of the four bins one, two or three
    ],
)
def test_which_intervals_a_region_may_be(covariate, count):
    cells = np.zeros((4, 1))
    tried = list(_Design(SimpleNamespace(covariate=covariate), cells, cells, cells).intervals())
    assert len(set(tried)) == len(tried) == count
    assert all(1 <= after - first < 4 for first, after in tried)
    if covariate is SPEED:
        assert all(first == 0 or after == 4 for first, after in tried)
    assert any(after > 4 for _, after in tried) == (covariate is HEADING)


@pytest.mark.parametrize(
    ("covariate", "low", "high", "phrase"),
    [
        (TIME, 10.0, None, "after 10 s"),
        (SPEED, 0.05, 0.1, "at surge speeds of 0.05 to 0.1 m/s"),
        (YAW_RATE, None, 0.1, "at turn rates below 5.73°/s"),
        (THRUST, 0.25, None, "at thrusts above 25 % of the most"),
        (THRUST, 0.25, 0.5, "at thrusts of 25 to 50 % of the most"),
        (HEADING, -0.5 * np.pi, 0.25 * np.pi, "on headings of -90 to 45°"),
        (NORTH, None, -2.0, "south of -2 m"),
        (EAST, 2.0, None, "east of 2 m"),
        (EAST, 412013.26, None, "east of 412013.3 m"),
    ],
)
def test_a_region_in_words(covariate, low, high, phrase):
    region = Region("N", covariate, None, low, high, 0.31, 0.122, 0.25, 1e-3, 1.0, 30.0)
    assert region.phrase == phrase
    assert (
        region.sentence
        == f"Yaw: the error is largest {phrase}: 0.31 N m, compared with 0.12 N m elsewhere, for 25 % of the time."
    )
    assert replace(region, run="b").phrase == f"in run b {phrase}"
    large = replace(region, rms=52345.6, elsewhere=126.3)
    assert "52346 N m, compared with 126 N m" in large.sentence


def test_bins_are_eighths_of_the_windows_of_the_circle_or_fifteen_seconds():
    assert SPEED.bin_edges(np.arange(81.0) ** 2, BLOCK) == pytest.approx((10.0 * np.arange(9.0)) ** 2)
    assert SPEED.bin_edges(np.ones(81), BLOCK).tolist() == [1.0]
    assert HEADING.bin_edges(np.zeros(3), BLOCK) == pytest.approx(0.25 * np.pi * np.arange(-4, 5))
    for seconds, bins in ((14.0, 1), (29.0, 1), (31.0, 2), (100.0, 6), (1e4, 16)):
        edges = TIME.bin_edges(7.0 + np.array([0.0, 0.3, 1.0]) * seconds, BLOCK)
        assert edges == pytest.approx(np.linspace(7.0, 7.0 + seconds, bins + 1))
