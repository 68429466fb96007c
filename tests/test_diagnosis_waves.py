"""Waves: found where there are some, and not where commands are quicker than what noise lets one follow."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter
from support.cases import slow
from support.measured import sail, smoothed

from diagnosis.execution.progress import silent
from diagnosis.predictors import Model
from diagnosis.search import forward_selection
from diagnosis.search.findings import Finding, Findings, Suspect
from diagnosis.search.nonlinear.waves import (
    BAND,
    CONSTANT,
    PEAK,
    Peak,
    changes_per_second,
    command_interval,
    constancy,
    find_waves,
    followed,
    follows_commands,
    inside,
    peak,
    segments_above,
)
from fmus.effects.environment import surface

H = 0.05  # s
MASS = Model().reference_mass


def test_waves_are_found_with_their_peak():
    run = smoothed(sail(240.0, H, ship={"wave_force": 0.1, "wave_peak": 4.0})[0])
    found = find_waves([run], Model(), np.random.default_rng(0))
    assert found is not None
    assert found.peak == pytest.approx(4.0, abs=0.6)
    assert 0.03 < found.force < 0.2
    assert found.confidence > 0.9


def test_a_run_of_few_segments_does_not_make_sure():
    """Each of its segments shows the waves, and so does each bootstrap replicate."""
    run = smoothed(sail(80.0, H, ship={"wave_force": 0.1, "wave_peak": 4.0})[0])
    found = find_waves([run], Model(), np.random.default_rng(0))
    assert found is not None
    assert found.confidence < 0.9


def held(run, seconds):
    """The run with commands that were recorded once in some seconds, and held."""
    count = round(seconds / H)
    return replace(run, tau_cmd=run.tau_cmd[np.arange(run.time.size) // count * count])


@pytest.mark.parametrize(("seconds", "sure"), [(0.3, True), (0.8, True), (1.0, False)])
def test_of_commands_that_were_recorded_rarely_waves_are_not_sure(seconds, sure):
    """The waves have a period of 1.6 s; held for longer than half of it, commands make a peak of their own."""
    run = sail(240.0, H, ship={"wave_force": 0.1, "wave_peak": 4.0})[0]
    found = find_waves([smoothed(held(run, seconds))], Model(), np.random.default_rng(0))
    assert (found is not None) == sure
    if found is not None:
        assert found.peak == pytest.approx(4.0, abs=0.3)
        assert found.force == pytest.approx(0.1, rel=0.4)
        assert 0.3 < found.share < 1.0
        assert found.confidence > 0.8


def test_what_a_model_makes_wrong_of_a_zig_zag_is_no_wave():
    """A rudder force on sway and yaw that the model lacks a part of, at the third harmonic too."""
    run = sail(240.0, H)[0]
    order = np.sign(np.sin(1.35 * run.time))[:, None] * [0.0, 1.0, 0.1]
    zigzag = replace(run, tau_cmd=np.median(run.tau_cmd, axis=0) + 0.1 * order)
    assert changes_per_second(zigzag) == pytest.approx(1.35 / np.pi, rel=0.05)
    assert find_waves([smoothed(zigzag)], Model(), np.random.default_rng(0)) is None


def test_what_follows_commands_has_one_gain_and_phase_in_all_stretches():
    rng, t = np.random.default_rng(2), 0.1 * np.arange(900)
    commands = [np.sign(np.sin(1.3 * t + p))[:, None] for p in (0.0, 1.0)]
    late = [np.roll(c[:, 0], 5) + 0.1 * rng.standard_normal(t.size) for c in commands]
    at, row = 3.9 / 2.0 / np.pi, 0.04
    assert follows_commands(late, commands, 0.1, at, row)
    assert not follows_commands([late[0], -late[1]], commands, 0.1, at, row), (
        "another sign in the second"
    )
    waves = [np.sin(3.9 * t + p) for p in (0.5, 3.5 + np.pi)]
    assert not follows_commands(waves, commands, 0.1, at, row), "a phase of its own in each"


def test_an_oscillation_of_constant_period_may_be_that_of_an_actuator():
    run = sail(240.0, H)[0]
    hunting = 0.1 * np.sin(4.0 * run.time)[:, None] * [0.0, 1.0, 0.1]
    hunts = smoothed(replace(run, tau_cmd=run.tau_cmd + hunting))
    found = find_waves([hunts], Model(), np.random.default_rng(0))
    assert found is not None
    assert found.peak == pytest.approx(4.0, abs=0.3)
    assert found.confidence == 0.5


@pytest.mark.parametrize(("axis", "confidence"), [("body", 0.5), ("earth", None)])
def test_an_antenna_on_a_mast_that_rolls_is_not_surely_moved_by_waves(axis, confidence):
    """It moves to the sides of the ship, which turns round; eight frequencies are no line."""
    run = sail(240.0, H)[0]
    psi = run.pose[:, 2] if axis == "body" else np.full(run.time.size, 0.8)
    roll = 0.004 * np.array([surface(t, 4.0) for t in run.time])
    pose = run.pose + np.column_stack([-roll * np.sin(psi), roll * np.cos(psi), 0.0 * roll])
    found = find_waves([smoothed(replace(run, pose=pose))], Model(), np.random.default_rng(0))
    assert found is not None
    assert found.peak == pytest.approx(4.0, abs=0.6)
    assert found.confidence == 0.5 if confidence else found.confidence > 0.8


def test_the_period_of_a_sine_is_constant_and_that_of_waves_is_not():
    """Its amplitude may change, and its sign, as where a thruster turns that oscillates."""
    t, rng = H * np.arange(2400), np.random.default_rng(0)
    near = 4.1 / (2.0 * np.pi)
    sine = [a * np.sin(4.0 * t + a) + rng.normal(0.0, 0.3 * a, t.size) for a in (1.0, 3.0)]
    assert constancy(sine, H, near) > 0.95
    assert constancy([x * np.cos(0.1 * t) for x in sine], H, near) > 0.95
    waves = np.array([surface(x, 4.0) for x in t])
    assert constancy([waves, waves[:1200]], H, near) < 0.8
    assert constancy([waves * np.cos(0.1 * t)], H, near) < 0.8
    assert constancy([0.0 * t], H, near) == 0.0


def test_irregular_waves_have_no_constant_period():
    """Of a second-order filter with a damping of 0.1, over 38 periods."""
    rng, h, count = np.random.default_rng(0), 0.1, 600
    filtered = cont2discrete(([1.0, 0.0], [1.0, 0.8, 16.0]), h)
    drawn = lfilter(filtered[0].ravel(), filtered[1], rng.standard_normal((100, 2000 + count)))[:, 2000:]
    found = [constancy([x], h, 4.0 / (2.0 * np.pi)) for x in drawn]
    assert max(found) < CONSTANT
    assert np.median(found) < 0.7


def test_the_interval_of_commands_is_that_of_a_recorder_and_not_of_steps():
    run = sail(150.0, H)[0]
    assert command_interval(run) == 0.0
    assert command_interval(held(run, 1.0)) == pytest.approx(1.0)
    rng = np.random.default_rng(0)
    steps = np.searchsorted(np.cumsum(rng.uniform(1.0, 20.0, 40)), run.time)
    at_times = replace(run, tau_cmd=rng.normal(size=(41, 3))[steps])
    assert command_interval(at_times) == 0.0
    assert command_interval(replace(run, tau_cmd=np.ones_like(run.tau_cmd))) == 0.0


@pytest.mark.parametrize(
    ("quick", "noise", "seed"), [(0.0, 1.0, 1), (0.3, 4.0, 1), slow((0.3, 10.0, 2))]
)
def test_commands_are_no_waves(quick, noise, seed):
    """The smoother follows quick commands only in part where there is noise; the rest is none of the sea's."""
    run = smoothed(sail(150.0, H, quick=quick, noise=noise, seed=seed)[0])
    assert find_waves([run], Model(), np.random.default_rng(seed)) is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 11])
def test_a_drawing_of_noise_makes_no_waves_of_what_is_missing(seed):
    """Drag and lost force are in the model error; of these drawings lines of the floor are low by chance."""
    run = smoothed(sail(96.0, H, ship={"delta_X_u": -3.0}, thrusters={"loss_yaw": 0.3})[0])
    assert find_waves([run], Model(), np.random.default_rng(seed)) is None


def test_half_of_a_motion_is_followed_where_a_quarter_of_the_noise_is_left():
    f = np.linspace(0.0, 5.0, 126)
    white = np.array([1e-8, 1e-8, 1e-8])
    S = 1.0 / (1.0 + (f[:, None] / [0.5, 0.9, 1.2]) ** 6)
    noise = S**2 * np.diag(MASS) ** 2 * white * (2.0 * np.pi * f[:, None]) ** 4
    np.testing.assert_allclose(followed(f, noise, white, MASS), S, atol=0.12)
    assert (followed(f, noise / S**2, white, MASS) == 1.0).all(), "without a corner all is followed"
    other = followed(f, noise * [1.0, 10.0, 1.0], white, MASS)
    assert np.array_equal(other[:, [0, 2]], followed(f, noise, white, MASS)[:, [0, 2]]), "axis by axis"


@pytest.mark.parametrize(("line", "found"), [(0.0, False), (30.0, True)])
def test_the_flank_of_a_slow_motion_is_no_peak(line, found):
    """A spectrum that falls steeply into the band is above its median there; a line on it is a peak."""
    frequency = np.arange(126) * 0.04
    slow = 1.0 + 1e3 * np.exp(-frequency / 0.06) * (1.0 + 0.2 * np.cos(60.0 * frequency))
    slow[0] = 0.0  # the mean is taken off
    power = slow * (1.0 + line * np.exp(-(((frequency - 0.5) / 0.04) ** 2)))
    ones = np.ones((frequency.size, 3))
    band = inside(frequency)[:, None] & np.ones((1, 3), bool)
    _, highest = peak(frequency, power[:, None] * ones, ones, band, float(np.ptp(BAND)))
    assert (highest.height > PEAK) == found
    if found:
        assert frequency[highest.row] == pytest.approx(0.5, abs=0.05)


def test_a_burst_is_above_the_spectrum_in_one_segment_and_waves_are_in_most():
    drawn = np.random.default_rng(3).exponential(size=(126, 3, 6))
    level, at = np.ones((126, 3)), Peak(12, 1, 20.0)
    drawn[11:14, 1] *= 0.1  # quiet but for one
    drawn[12, 1, 2] = 100.0
    assert segments_above(drawn, at, level) == 1
    drawn[12, 1] = 20.0 * np.random.default_rng(4).exponential(size=6)
    assert segments_above(drawn, at, level) >= 5


@pytest.mark.parametrize("others", [0, 1])
def test_beside_waves_alone_no_coefficient_is_suspect(monkeypatch, others):
    """Without another effect the model is the first one; suspects are those of a model with the effects."""
    effects = [Finding("X_u", {"delta_X_u": -1.0}, {}, 0.9, [], 0.9, 0.9)] * others
    first, other = Model(), Model().plus({"delta_X_u": -1.0})
    found = Findings(
        effects, suspects=[Suspect("m", 3.0, 20.0)], fold_models=[other] * 4, run_models=[other] * 2
    )
    done = SimpleNamespace(model=Model(), findings=lambda ids=None: found)
    peak = SimpleNamespace(peak=3.0, force=1.0, confidence=0.9, share=0.5)
    monkeypatch.setattr(forward_selection, "search", lambda *_: done)
    monkeypatch.setattr(forward_selection, "find_waves", lambda *_: peak)
    learned = forward_selection.ForwardSelection().fit([], first, None, silent, 0)
    assert [f.id for f in learned.effects] == ["waves", "X_u"][: 1 + others]
    assert len(learned.suspects) == others
    # What is predicted without a fold is what was learned, and not other coefficients.
    expected = other if others else first
    assert all(m is expected for m in [*learned.fold_models, *learned.run_models])
    assert (len(learned.fold_models), len(learned.run_models)) == (4, 2)
