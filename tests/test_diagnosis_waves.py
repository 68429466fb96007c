"""Waves: found where there are some, and not where commands are quicker than what noise lets one follow."""

import measured
import numpy as np
import pytest

from diagnosis import clean, smooth
from diagnosis.model import Model
from diagnosis.waves import MASS, followed, waves


def seen(monkeypatch, quick=0.0, ship=None, noise=1.0, seed=1):
    """A smoothed run of 150 s; ``quick`` [N] of its commands are a sine of 0.85 Hz."""
    slow = measured.commands

    def commands(t):
        return slow(t) + quick * np.sin(2.0 * np.pi * 0.85 * t)[:, None] * [1.0, 1.0, 0.3]

    monkeypatch.setattr(measured, "commands", commands)
    run, _ = measured.sail(150.0, ship=ship, noise=noise, seed=seed)
    monkeypatch.undo()
    return smooth(clean(run))


def test_waves_are_found_with_their_peak(monkeypatch):
    run = seen(monkeypatch, ship={"wave_force": 0.1, "wave_peak": 4.0})
    found = waves([run], Model(), np.random.default_rng(0))
    assert found is not None
    assert found.peak == pytest.approx(4.0, abs=0.6)
    assert 0.03 < found.force < 0.2
    assert found.confidence > 0.9


@pytest.mark.parametrize("noise", [1.0, 4.0, 10.0])
@pytest.mark.parametrize("quick", [0.0, 0.3])
def test_commands_are_no_waves(monkeypatch, noise, quick):
    """The smoother follows quick commands only in part where there is noise; the rest is none of the sea's."""
    for seed in (1, 2):
        run = seen(monkeypatch, quick=quick, noise=noise, seed=seed)
        assert waves([run], Model(), np.random.default_rng(seed)) is None


def test_half_of_a_motion_is_followed_where_a_quarter_of_the_noise_is_left():
    f = np.linspace(0.0, 5.0, 126)
    white = np.array([1e-8, 1e-8, 1e-8])
    S = 1.0 / (1.0 + (f[:, None] / [0.5, 0.9, 1.2]) ** 6)
    noise = S**2 * np.diag(MASS) ** 2 * white * (2.0 * np.pi * f[:, None]) ** 4
    np.testing.assert_allclose(followed(f, noise, white), S, atol=0.12)
    assert (followed(f, noise / S**2, white) == 1.0).all(), "without a corner all is followed"
