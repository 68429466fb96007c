"""How uncertain the model error is, and where the model fails: said only where the data are sure."""

from dataclasses import replace

import numpy as np
import pytest
from measured import NOISE, sail

from diagnosis import clean, smooth
from diagnosis.clusters import chance, clustered
from diagnosis.covariates import HEADING, SPEED, THRUST, TIME
from diagnosis.model import Model
from diagnosis.uncertainty import omega_std
from diagnosis.weak import integrals, omega
from diagnosis.where import where


def windows(run):
    return integrals(smooth(clean(run)))


def found(seconds=240.0, **hidden):
    """Where the nominal model fails on a run with something hidden in it."""
    w = windows(sail(seconds, h=0.05, **hidden)[0])
    return where([w], [omega(w, Model())], [omega_std(w)])


def of(axis, regions):
    return [r for r in regions if r.axis == axis]


@pytest.mark.parametrize("level", [1.0, 4.0, 10.0])
def test_uncertainty_is_the_spread_over_realisations_of_the_noise(level):
    """The true model, the same motion, other noise: what is left is the noise's doing."""
    run, _ = sail(48.0, noise=0.0)
    left, said = [], []
    for seed in range(6):
        noise = level * NOISE * np.random.default_rng(seed).standard_normal(run.pose.shape)
        pose = run.pose + noise
        pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
        w = windows(replace(run, pose=pose))
        left.append(omega(w, Model()))
        said.append(omega_std(w))
    spread = np.sqrt(np.mean(np.square(left), axis=(0, 1)))
    expected = np.sqrt(np.mean(np.square(said), axis=(0, 1)))
    np.testing.assert_allclose(expected, spread, rtol=0.3)


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


@pytest.mark.parametrize("noise", [1.0, 4.0])
def test_nothing_is_said_of_noise(noise):
    told = found(120.0, noise=noise)
    assert told.regions == []
    assert all("no error seen" in s for s in told.sentences)


@pytest.mark.parametrize(
    ("hidden", "axis", "kind"),
    [
        ({"ship": {"delta_X_absu_u": -20.0}}, "X", SPEED),
        ({"thrusters": {"bow_failure_time": 118.0}}, "Y", TIME),
        ({"thrusters": {"loss_yaw": 0.2}}, "N", THRUST),
        ({"ship": {"V_n": 0.05}}, "Y", HEADING),
    ],
)
def test_the_region_is_where_the_hidden_effect_acts(hidden, axis, kind):
    told = found(**hidden)
    first = of(axis, told.regions)[0]
    assert first.kind is kind
    assert first.rms > 1.4 * first.elsewhere
    said = told.sentences["XYN".index(axis)]
    assert said == first.sentence
    if kind is TIME:
        assert first.high is None
        assert first.low == pytest.approx(118.0, abs=16.0)


def test_an_error_that_is_the_same_everywhere_has_no_region():
    told = found(ship={"body_bias_X": 0.1})
    assert told.regions == []
    assert "nowhere clearly worse" in told.sentences[0]
    assert "0.1 N" in told.sentences[0]


def test_profiles_hold_every_window_once():
    told = found(120.0, ship={"delta_X_u": -3.0})
    for p in told.profiles:
        assert np.nansum(p.share) == pytest.approx(1.0)
        assert len(p.rms) == len(p.uncertainty) == len(p.share) == len(p.ends) - 1
        assert (np.diff(p.ends) > 0.0).all()
    speed = next(p for p in told.profiles if p.kind is SPEED and p.axis == "X")
    assert np.argmax(speed.rms) == len(speed.rms) - 1


def test_slow_noise_seldom_has_a_region():
    """Model error that has nothing to do with anything, correlated over 3 s."""
    w = windows(sail(240.0, h=0.05)[0])
    named = 0
    for seed in range(40):
        e = np.random.default_rng(seed).standard_normal((w.middle.size, 3))
        for k in range(1, len(e)):
            e[k] = 0.85 * e[k - 1] + np.sqrt(1.0 - 0.85**2) * e[k]
        told = where([w], [0.1 * e], [np.full_like(e, 0.003)])
        named += len({r.axis for r in told.regions})
    assert named <= 6  # of 120


def test_runs_have_their_own_time():
    a, b = (windows(replace(sail(64.0, h=0.05, seed=k)[0], name=f"r{k}")) for k in (1, 2))
    told = where([a, b], [omega(w, Model()) for w in (a, b)], [omega_std(w) for w in (a, b)])
    assert {p.run for p in told.profiles if p.kind is TIME} == {"r1", "r2"}
    assert {p.run for p in told.profiles if p.kind is SPEED} == {None}


def test_clustered_mean_of_independent_values_is_that_of_students():
    x = np.random.default_rng(0).standard_normal(50)
    m = clustered(x, np.ones(50))
    assert m.mean == pytest.approx(x.mean())
    assert m.variance == pytest.approx(x.var(ddof=1) / 50)
    assert m.free == 49
    assert chance(m, m) == pytest.approx(0.5)
    # The same values five times are no more than once.
    five = clustered(5.0 * x, np.full(50, 5))
    assert five.variance == pytest.approx(m.variance)
