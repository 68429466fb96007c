"""The parts of windows that models are fitted on (diagnosis/predictors/shooting.py)."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.predictors import shooting
from diagnosis.predictors.shooting import (
    INSTANTS,
    MOST_PARTS,
    PARTS,
    UNKNOWN,
    Shooting,
    _off,
    _seen,
    _slopes,
    _squares,
)
from diagnosis.runs.run_constants import NEGLIGIBLE
from fmus.scale import REFERENCE, Scale
from fmus.vessel import vessel

H, N = 0.1, 300
TIME = 3.0 + H * np.arange(N)


def state(*values):
    return vessel.State._make([*values, 0.0 * values[0]])


def seconds(scale=REFERENCE, used=None):
    """A smooth cubic motion, measured with noise; the heading goes round."""
    rng = np.random.default_rng(0)
    eta = np.column_stack([0.5 * TIME, 0.1 * TIME**2, 3.0 + 0.02 * TIME])
    rate = np.column_stack([np.full(N, 0.5), 0.2 * TIME, np.full(N, 0.02)])
    pose = eta + 0.05 * rng.standard_normal((N, 3))
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    return SimpleNamespace(
        time=TIME,
        eta=eta,
        eta_dot=rate,
        used=np.ones(N, bool) if used is None else used,
        track=SimpleNamespace(pose=pose),
        noise=np.array([0.1, 0.2, 0.3]),
        scale=scale,
    )


@pytest.mark.parametrize("reach", [0.26, 0.04])
def test_a_pose_is_the_smooth_one_and_the_mean_distance_of_the_samples_around(reach):
    """Within half of the time between two instants; the variance falls with their number."""
    s = seconds()
    times = np.array([[10.02, 12.51], [20.0, 25.03]])
    pose, noise = _seen(s, times, reach)
    for w in range(2):
        for k in range(2):
            t = times[w, k]
            smooth = [0.5 * t, 0.1 * t**2, 3.0 + 0.02 * t]
            near = np.abs(TIME - t) < reach
            off = s.track.pose[near] - s.eta[near]
            off[:, 2] = np.angle(np.exp(1j * off[:, 2]))
            assert pose[w, k] == pytest.approx(smooth + off.mean(axis=0), abs=1e-6)
            assert noise[w, k] == pytest.approx(s.noise**2 / near.sum())


@pytest.mark.parametrize("length", [1.0, 4.0])
def test_an_instant_without_a_sample_is_not_known(length):
    """Its pose is the smooth one; the variance of a place is that of the size of the ship."""
    used = np.ones(N, bool)
    used[60:80] = False
    s = seconds(Scale(length), used)
    s.track.pose[60:80] = 99.0
    pose, noise = _seen(s, np.array([[TIME[70]]]), 0.5)
    area = s.scale.length**2
    assert noise[0, 0] == pytest.approx([UNKNOWN * area, UNKNOWN * area, UNKNOWN])
    assert pose[0, 0] == pytest.approx(s.eta[70], abs=1e-6)


def test_a_motion_that_is_not_known_in_some_rows_is_on_the_curve_between():
    s = seconds()
    s.eta[100:104] = np.nan
    s.used[100:104] = False
    pose, _ = _seen(s, np.array([[TIME[102]]]), 0.01)
    assert pose[0, 0] == pytest.approx(
        [0.5 * TIME[102], 0.1 * TIME[102] ** 2, 3.0 + 0.02 * TIME[102]], abs=1e-6
    )


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_headings_differ_by_less_than_half_a_turn(a, b):
    off = _off(np.array([1.0, 5.0, a]), np.array([3.0, 2.0, b]))
    assert off[:2].tolist() == [-2.0, 3.0]
    assert abs(off[2]) <= np.pi + 1e-9
    assert np.cos(off[2]) == pytest.approx(np.cos(a - b))
    assert np.sin(off[2]) == pytest.approx(np.sin(a - b), abs=1e-9)


def test_squares_are_of_place_and_heading_but_for_windows_that_run_away():
    off = np.random.default_rng(0).standard_normal((5, 4, 3))
    expected = (off[[0, 1, 3, 4]] ** 2).sum(axis=(0, 1))
    off[2, 1, 0] = np.nan
    assert _squares(off) == pytest.approx([expected[0] + expected[1], expected[2]])


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_slopes_are_derivatives_of_the_rates_of_pose_and_velocity(seed):
    """Of the pose in closed form, of the velocity between both sides of a reach: exact for a parabola."""
    rng = np.random.default_rng(seed)
    A, B = rng.standard_normal((3, 4)), rng.standard_normal((3, 4))
    at = state(*rng.standard_normal((6, 2, 5)))
    reach = rng.uniform(0.1, 0.5, (4, 5))

    def disturbed(s, tau, hull):
        y = np.stack([s.psi, s.u, s.v, s.r])
        return [
            np.einsum("k,ktw->tw", a, y) + np.einsum("k,ktw->tw", b, y**2)
            for a, b in zip(A, B, strict=True)
        ]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shooting, "thrust_at", lambda at, i, b: (None, None))
        patch.setattr(shooting.vessel, "disturbed", disturbed)
        found = _slopes(at, None, None, reach)
    assert found.shape == (5, 2, 6, 6)
    y = np.stack([at.psi, at.u, at.v, at.r])
    for w in range(5):
        for t in range(2):
            own = A + 2.0 * B * y[:, t, w]
            assert found[w, t, 3:, 2:] == pytest.approx(own, abs=1e-9)
            psi, u, v = at.psi[t, w], at.u[t, w], at.v[t, w]
            c, s = np.cos(psi), np.sin(psi)
            pose = np.zeros((3, 6))
            pose[0, 2:5], pose[1, 2:5], pose[2, 5] = [-s * u - c * v, c, -s], [c * u - s * v, s, c], 1.0
            assert found[w, t, :3] == pytest.approx(pose)
            assert (found[w, t, 3:, :2] == 0.0).all()


# Steps


def made(error):
    """Windows whose residuals are one, and an error that falls with the number of steps."""

    class Windows(Shooting):
        def __init__(self, runs, length):
            self.every = length / INSTANTS
            self.starts = Starts(self.every / PARTS, INSTANTS * PARTS)
            self._thrust = {"kept": 1}

        def residuals(self, model):
            return np.ones((2, INSTANTS, 3)) + error(self.parts)

    return Windows


class Starts:
    def __init__(self, h, steps):
        self.h, self.steps = h, steps

    def __replace__(self, **changes):
        return Starts(**{"h": self.h, "steps": self.steps} | changes)


@pytest.fixture(autouse=True)
def _replaced(monkeypatch):
    whole = shooting.replace

    def replace(of, **changes):
        return of.__replace__(**changes) if isinstance(of, Starts) else whole(of, **changes)

    monkeypatch.setattr(shooting, "replace", replace)


@pytest.mark.parametrize("size", [0.5, 2.0, 30.0, 1e3])
def test_steps_are_halved_until_predictions_hardly_change(size):
    """By less than a twentieth of the residuals."""
    found = made(lambda parts: size / parts**2).accurate([], 8.0, None)
    parts = PARTS
    while parts < MOST_PARTS and size / parts**2 - size / (2 * parts) ** 2 > NEGLIGIBLE * (
        1.0 + size / (2 * parts) ** 2
    ):
        parts *= 2
    assert found.parts == parts
    assert found.starts.h == pytest.approx(8.0 / INSTANTS / parts)
    assert found.starts.steps == INSTANTS * parts


@pytest.mark.parametrize("k", [slice(0, 2), 2])
def test_place_and_heading_must_both_hardly_change(k):
    def error(parts):
        found = np.zeros(3)
        found[k] = 30.0 / parts**2
        return found

    assert made(error).accurate([], 8.0, None).parts > PARTS


def test_windows_with_other_steps_are_the_same_but_for_their_thrust():
    first = made(lambda parts: 0.0)([], 8.0)
    other = first.in_parts(12)
    assert (first.parts, other.parts) == (PARTS, 12)
    assert other._thrust == {}
    assert first._thrust == {"kept": 1}
    assert other.every == first.every
