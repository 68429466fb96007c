"""The fixed-point smoother of stored samples: its filter is the optimal one, and what follows helps."""

import math
from itertools import pairwise

import numpy as np
import pytest
from support.loops import closed_loop, multisine_target
from support.project import COMPONENTS

from fmus.controller.fixed_point import SETTLES, SOON, FixedPoint, Now, advanced, body, covariance, later
from fmus.controller.models import ROTATIONAL
from fmus.hull import Damping, Hull, Inertia, inverse_mass, motion
from fmus.signals import Force
from fmus.vessel import vessel

H = 0.02
SPAN = 1.0
HULL = Hull(Inertia(), inverse_mass(Inertia()), Damping())


def voyage(seconds=40.0):
    """Times, states, accelerations and forces of a ship that is pushed about."""
    s, rows = vessel.State(5.0, 2.0, 0.3, 0.1), []
    tau = Force(0.0, 0.0, 0.0)
    for k in range(round(seconds / H)):
        t = k * H
        rows.append((t, s, motion(s.u, s.v, s.r, tau, HULL), tau))
        tau = Force(
            0.5 + 0.4 * math.sin(0.7 * t), 0.4 * math.sin(0.5 * t) - s.v, 0.2 * math.sin(0.9 * t) - s.r
        )
        s = vessel.integrate(s, tau, HULL, H)
    return rows


def smoothed(rows, noise=0.0, usable=lambda t: True):
    """Samples that are final; the filter's own (time, velocity and acceleration) when each began."""
    rng = np.random.default_rng(0)
    s, final, begun = FixedPoint(), [], []
    for t, x, _, tau in rows:
        pose = np.array(x[:3]) + noise * rng.normal(size=3)
        now = Now(t, tuple(map(float, pose)), x[3:6], tuple(tau))
        s, sample, done = advanced(ROTATIONAL, ROTATIONAL.controller_model, s, now, SPAN, H, usable(t))
        if done:
            final.append(sample)
        if s.age == SOON:
            begun.append((t, *body(s.axes, s.driven)))
    return final, begun


def wrong(rows, found):
    """Errors of velocity and acceleration (n, 6) of (time, nu, nu_dot)."""
    truth = {round(t, 6): (x[3:6], nu_dot) for t, x, nu_dot, _ in rows}
    pairs = [(truth[round(t, 6)], (nu, nu_dot)) for t, nu, nu_dot in found]
    return np.array([np.subtract(np.ravel(b), np.ravel(a)) for a, b in pairs])


@pytest.mark.parametrize("w", [0.5, 6.0])
def test_covariance_is_that_of_the_steady_optimal_filter(w):
    """Riccati: A P + P A' + Q - P C'C P = 0 for a triple integrator driven by white noise."""
    P, A = np.array(covariance(w)), np.eye(3, k=1)
    residual = A @ P + P @ A.T - np.outer(P[:, 0], P[:, 0])
    residual[2, 2] += w**6
    assert np.abs(residual).max() < 1e-9 * np.abs(P).max() * w
    assert np.linalg.eigvalsh(P).min() > 0.0


def test_what_a_later_innovation_tells_fades_within_the_span():
    sigma = P = covariance(SETTLES / SPAN)
    for _ in range(round(SPAN / H)):
        sigma = later(sigma, P[0], H)
    assert (np.abs(sigma) < 0.15 * np.sqrt(np.outer(np.diag(P), np.diag(P)))).all()


def test_samples_are_better_than_those_of_their_instant():
    rows = voyage()
    final, begun = smoothed(rows, noise=2e-4)
    assert len(final) >= 30
    after = wrong(rows, [(s.time, s.nu, s.nu_dot) for s in final])
    before = wrong(rows, begun[: len(final)])
    size = np.std([nu_dot for *_, nu_dot, _ in rows], axis=0)
    ratio = np.sqrt(np.mean(after**2, axis=0) / np.mean(before**2, axis=0))
    assert (ratio < 0.5).all()
    assert (np.sqrt(np.mean(after[:, 3:] ** 2, axis=0)) < 0.1 * size).all()


def test_a_sample_has_the_force_and_the_heading_of_its_instant():
    rows = voyage(10.0)
    final, _ = smoothed(rows)
    there = {round(t, 6): (x, tau) for t, x, _, tau in rows}
    for s in final:
        x, tau = there[round(s.time, 6)]
        assert s.tau == tuple(tau)
        assert s.psi == pytest.approx(x.psi, abs=1e-3)


def test_what_may_not_be_learned_from_ends_the_sample_under_way():
    rows = voyage(10.0)
    final, _ = smoothed(rows, usable=lambda t: not 4.0 < t < 5.0)
    times = np.array([s.time for s in final])
    # A sample needs a settled filter before its instant, and the span after it.
    assert not ((times > 4.0 - SPAN + 2 * H) & (times < 5.0 + SPAN - 2 * H)).any()
    assert times.max() > 6.0


@pytest.mark.parametrize("name", ["controller_cl_win_eps", "controller_cl_svd_z2"])
def test_controllers_store_smoothed_samples_of_the_past(name):
    component = COMPONENTS[name]
    p = component.params()
    p = p._replace(samples=p.samples._replace(fixed_point=SPAN))
    *_, (_, _, law, out) = closed_loop(component, p, 12.0, H, multisine_target(2.0))
    times = [row.time for row in law.state.store.rows if row.filled]
    assert len(times) >= 5
    assert out.learning.stored_at == max(times)
    assert max(times) <= 12.0 - SPAN + 2 * H
    times.sort()
    assert min(b - a for a, b in pairwise(times)) >= SPAN - 2 * H
