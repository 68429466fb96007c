"""The check of a learned model in parts: where a hull dissipates less, what paths and decay decide."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.assessment import closed_loop, stability
from diagnosis.assessment.stability import (
    OPERATING,
    OperatingRegion,
    Stability,
    check_stability,
    comes_to_rest,
    dissipation,
    mass,
    sampled_motions,
)
from diagnosis.predictors import Model, ship_with
from fmus.declare import variables
from fmus.hull import Damping

# A hull with linear damping in surge alone, 2 N s/m.
SURGE = {v.name: 0.0 for v in variables(Damping)} | {"X_u": -2.0}
REGION = OperatingRegion(0.4, 0.2, 0.6, 0.1)
AT_REST = "stays below 3 times"


def surge(**changes):
    return Model({**SURGE, **changes})


def compared(model, axis=0, nominal=None):
    start = nominal or surge()
    return stability._compare(axis, model, start, mass(start), REGION)


def inertia(axis=0):
    return mass(surge())[axis, axis]


def test_the_motions_of_a_region_reach_its_border_in_all_directions():
    nu = sampled_motions(REGION)
    assert nu.shape == (21 * 6 * 21 * 21, 3)
    assert (nu.min(axis=0), nu.max(axis=0)) == (
        pytest.approx([-0.1, -0.2, -0.6]),
        pytest.approx([0.4, 0.2, 0.6]),
    )
    share = np.abs(nu / np.where(nu < 0.0, [0.1, 0.2, 0.6], [0.4, 0.2, 0.6])).max(axis=1)
    assert np.unique(share.round(9)) == pytest.approx(np.arange(1, 22) / 21)
    fastest = nu[-6 * 21 * 21 :]
    assert np.abs(fastest / np.where(fastest < 0.0, *np.abs(REGION.edges))).max(axis=1) == pytest.approx(
        1
    )


@pytest.mark.parametrize("axis", range(3))
def test_motions_in_one_axis_alone_go_from_one_border_to_the_other(axis):
    nu = stability.alone(axis, REGION)
    low, high = REGION.edges[:, axis]
    assert not np.delete(nu, axis, axis=1).any()
    assert (len(nu), nu[0, axis], nu[-1, axis]) == (42, low, high)
    negative, positive = nu[:21, axis], nu[21:, axis]
    assert np.diff(negative) == pytest.approx(-low * 2.0 / 41.0)
    assert np.diff(positive) == pytest.approx(high * 2.0 / 41.0)


def test_a_hull_that_is_damped_less_in_surge_is_named_with_its_rate():
    found = compared(surge(X_u=-1.5))
    assert found.startswith("surge from -0.1 to 0.4 m/s: the hull is damped less, ")
    assert f", {1.5 / inertia():.3g} 1/s at " in found
    assert found.endswith(f"(nominal at least {2.0 / inertia():.3g})")
    gains = compared(surge(X_u=0.5))
    assert f"the hull gains energy, {-0.5 / inertia():.3g} 1/s" in gains
    assert compared(surge()) == compared(surge(X_u=-2.5)) == ""
    assert compared(surge(X_u=-1.5), axis=1) == compared(surge(X_u=-1.5), axis=2) == ""


def test_only_speeds_at_which_it_dissipates_less_are_named():
    """X_|u|u = 8 takes 8 |u| off the damping: everywhere less, most at the fastest speed."""
    found = compared(surge(delta_X_absu_u=8.0))
    speeds = stability.alone(0, REGION)[:, 0]
    assert f"{(2.0 - 8.0 * 0.4) / inertia():.3g} 1/s at 0.4 m/s" in found
    # Together with X_u = -4 less only where 8 |u| > 2.
    found = compared(surge(X_u=-4.0, delta_X_absu_u=8.0))
    lost = speeds[8.0 * np.abs(speeds) > 2.0]
    assert found.startswith(f"surge from {lost.min():.2g} to 0.4 m/s: the hull is damped less,")


def stubbed(monkeypatch, far, rests=None):
    """Let the loop lose some models, by their identity, and others come to rest or not."""
    monkeypatch.setattr(stability, "for_each", lambda function, items: [function(x) for x in items])
    monkeypatch.setattr(stability, "largest_distance", far)
    if rests is not None:
        monkeypatch.setattr(stability, "comes_to_rest", lambda model, *_: rests(model))


def test_a_model_that_is_kept_on_both_paths_is_bounded(monkeypatch):
    stubbed(monkeypatch, lambda r, _: 0.25 if r.name == "ellipse" else 0.5)
    steps = []
    found = check_stability(surge(), surge(), steps.append)
    assert (found.bounded, found.closed_loop, found.safe, found.from_start) == (True, True, True, False)
    assert found.notes == (
        "ellipse: at most 0.25 m from the target",
        "figure of eight: at most 0.5 m from the target",
    )
    assert steps == ["dissipation", "closed loop on the ellipse and the figure of eight"]
    least = dissipation(surge(), sampled_motions(OPERATING), mass(surge())).min()
    assert found.nominal_min_dissipation == found.learned_min_dissipation == least
    assert found.region is None


@pytest.mark.parametrize("lost", ["ellipse", "figure of eight"])
def test_a_model_that_is_lost_on_one_path_is_not(monkeypatch, lost):
    learned, nominal = surge(X_u=-3.0), surge()
    stubbed(monkeypatch, lambda r, m: np.inf if m is learned and r.name == lost else 0.5)
    found = check_stability(learned, nominal)
    assert (found.bounded, found.closed_loop, found.from_start, found.safe) == (
        False,
        True,
        False,
        False,
    )
    assert f"{lost}: more than 5 m from the target" in found.notes
    assert stability.NOT_HELD not in found.notes


def test_the_bound_itself_is_lost(monkeypatch):
    bound = closed_loop.bound_of(surge())
    assert bound == pytest.approx(5.0)
    stubbed(monkeypatch, lambda _, m: bound, lambda _: True)
    assert not check_stability(surge(), surge()).closed_loop
    stubbed(monkeypatch, lambda _, m: bound - 1e-6)
    assert check_stability(surge(), surge()).closed_loop


@pytest.mark.parametrize(("one", "bounded"), [(True, False), (False, True)])
def test_where_the_initial_model_is_lost_as_well_the_decay_decides(monkeypatch, one, bounded):
    """On both paths; where it is held on one, that one decides."""
    learned, nominal = surge(X_u=-3.0), surge()

    def far(r, m):
        return 0.5 if one and r.name == "ellipse" and m is nominal else np.inf

    stubbed(monkeypatch, far, lambda _: True)
    found = check_stability(learned, nominal)
    assert (found.bounded, found.closed_loop) == (bounded, one)
    assert stability.NOT_HELD in found.notes


def test_a_force_from_outside_that_is_too_strong_is_named(monkeypatch):
    learned, nominal = surge(F_n=30.0, X_u=-3.0), surge()
    asked = []

    def far(r, m):
        asked.append(m)
        return np.inf if m is nominal or m.vessel.get("F_n") else 0.5

    stubbed(monkeypatch, far, lambda _: True)
    found = check_stability(learned, nominal)
    assert stability.NOT_BY_HULL in found.notes
    assert (found.bounded, found.closed_loop, found.safe) == (False, True, True)
    assert asked[-1].vessel == {k: v for k, v in learned.vessel.items() if k != "F_n"}


@pytest.mark.parametrize("hull_is_lost", [False, True])
def test_thrusters_that_are_too_weak_are_no_reason_to_withhold_a_model(monkeypatch, hull_is_lost):
    """Lost on both paths; the initial model is held on one, the hull by initial thrusters on the same."""
    nominal = surge()
    learned = replace(surge(X_u=-3.0), thrusters={"loss_surge": 0.6})

    def far(r, m):
        by_initial = not m.thrusters and (m is nominal or not hull_is_lost)
        return 0.5 if by_initial and r.name == "ellipse" else np.inf

    stubbed(monkeypatch, far, lambda _: False)
    found = check_stability(learned, nominal)
    assert (found.bounded, found.closed_loop) == (False, True)
    assert found.weak == found.safe == (not hull_is_lost)
    assert (stability.NOT_BY_HULL in found.notes) == (not hull_is_lost)


def test_an_indefinite_mass_matrix_is_never_safe(monkeypatch):
    stubbed(monkeypatch, lambda *_: 0.5)
    found = check_stability(surge(added_mass_X=-20.0), surge())
    assert (found.mass_definite, found.bounded, found.safe) == (False, False, False)
    assert not found.from_start, "what was learned is the reason"
    assert found.notes[0].startswith("the mass matrix is not positive definite")
    stubbed(monkeypatch, lambda *_: 0.5, lambda _: True)
    tanker = Model(ship=ship_with((), "kvlcc2"))
    monkeypatch.setattr(stability, "mass", lambda m: (1.0 if m is tanker else -1.0) * np.eye(3))
    assert not check_stability(tanker.plus({}), tanker).bounded, "whatever its motion does"


def test_motions_of_several_axes_are_named_where_no_axis_alone_shows_less(monkeypatch):
    stubbed(monkeypatch, lambda *_: 0.5)
    start = Model({v.name: 0.0 for v in variables(Damping)} | {"X_u": -2.0, "Y_v": -2.0, "N_r": -0.5})
    learned = start.plus({"delta_N_v": -2.0})
    found = check_stability(learned, start)
    everywhere = sampled_motions(OPERATING)
    after = dissipation(learned, everywhere, mass(start))
    u, v, r = everywhere[np.argmin(after)]
    assert found.region is not None
    assert found.region.startswith(f"motions like u = {u:.2g} m/s, v = {v:.2g} m/s, r = {r:.2g} rad/s: ")
    assert f"{after.min():.3g} 1/s" in found.region
    assert check_stability(start, start).region is None


def test_less_in_two_axes_is_two_parts(monkeypatch):
    stubbed(monkeypatch, lambda *_: 0.5)
    start = Model({v.name: 0.0 for v in variables(Damping)} | {"X_u": -2.0, "Y_v": -2.0, "N_r": -0.5})
    found = check_stability(start.plus({"delta_X_u": 0.5, "delta_N_r": 0.1}), start).region or ""
    assert [part.split()[0] for part in found.split("; ")] == ["surge", "yaw"]


@pytest.mark.parametrize(
    ("definite", "bounded", "from_start", "safe"),
    [(True, True, False, True), (True, False, True, True), (True, False, False, False), (False, True, True, False)],
)  # fmt: skip
def test_safe_is_what_is_definite_and_bounded_or_lost_from_the_start(
    definite, bounded, from_start, safe
):
    assert Stability(definite, 0.0, 0.0, bounded, None, (), True, from_start).safe == safe


@pytest.mark.parametrize(("growth", "kept"), [(0.0, True), (1.95, True), (2.05, False), (np.nan, False)])
def test_a_motion_is_kept_up_to_three_times_the_speeds_of_its_region(monkeypatch, growth, kept):
    """A motion that grows linearly, to (1 + growth) times each speed of the region at the end."""
    model, steps = surge(), []
    first = REGION.edges[1] * np.eye(3)

    def integrate(s, tau, hull, h):
        steps.append(h)
        grown = [
            x + growth * y * h / stability.FORGOTTEN
            for x, y in zip((s.u, s.v, s.r), first.T, strict=True)
        ]
        return s._replace(**dict(zip("uvr", grown, strict=True)))

    state = stability.vessel.State
    monkeypatch.setattr(stability, "vessel", SimpleNamespace(State=state, integrate=integrate))
    notes = []
    # The largest speed of surge is that ahead, 0.4 m/s, whichever way the ship goes.
    assert comes_to_rest(model, first, REGION, notes) == kept
    word = "stays below" if kept else "exceeds"
    assert notes == [
        f"the motion without thrust is checked, and {word} 3 times the speeds of its region"
    ]
    if kept:
        assert sum(steps) == pytest.approx(stability.FORGOTTEN)
    else:
        assert sum(steps) < stability.FORGOTTEN
