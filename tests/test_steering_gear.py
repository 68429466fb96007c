"""Rate limit and play of commanded angles: what they do to a command, and that they are candidates."""

from math import pi

import numpy as np
import pytest

from diagnosis import Model, Run
from diagnosis.predictors import ship_with
from diagnosis.predictors.thrust import Response
from fmus.effects.steering_gear import dragged, rate_limited
from fmus.ship import ship
from fmus.ships.ship_file import read_ship


def after(effect, commands, value, h=0.5):
    """The commands (n, k) that an effect with a memory makes of some (n, k)."""
    past, found = effect.memory.start(commands.shape[1]), []
    for row in commands.tolist():
        past, moved = effect(past, tuple(row), h, value)
        found.append(moved)
    return np.array(found)


def test_an_angle_turns_at_its_rate_and_stops_where_it_is_wanted():
    angle, found = 0.0, []
    for _ in range(5):
        angle, _ = rate_limited(angle, 0.5, 0.4, 0.5, False)
        found.append(angle)
    assert found == pytest.approx([0.2, 0.4, 0.5, 0.5, 0.5])


@pytest.mark.parametrize("wanted", [-0.3, 0.1, 0.7])
@pytest.mark.parametrize("steps", [1, 2, 60])
def test_the_mean_of_an_angle_that_turns_does_not_depend_on_the_steps(wanted, steps):
    """The way at 0.4 rad/s, then at rest where it is wanted: its integral over 1 s from 0.2 rad."""
    time = abs(wanted - 0.2) / 0.4
    still = min(time, 1.0)
    end = 0.2 + np.copysign(0.4 * still, wanted - 0.2)
    angle, integral = 0.2, 0.0
    for _ in range(steps):
        angle, mean = rate_limited(angle, wanted, 0.4, 1.0 / steps, False)
        integral += mean / steps
    assert angle == pytest.approx(end)
    assert integral == pytest.approx(0.5 * (0.2 + end) * still + wanted * (1.0 - still))


def test_an_angle_with_play_waits_until_its_command_has_gone_through_it():
    wanted = [0.0, 0.3, 0.5, 0.45, 0.35, 0.2, 0.25]
    angle, found = 0.0, []
    for x in wanted:
        angle, _ = dragged(angle, x, 0.2, 0.5, False)
        found.append(angle)
    assert found == pytest.approx([0.0, 0.2, 0.4, 0.4, 0.4, 0.3, 0.3])


@pytest.mark.parametrize(
    ("move", "value", "expected"), [(rate_limited, 0.2, 3.2), (dragged, 0.1, pi + 0.09159)]
)
def test_an_angle_that_goes_round_takes_the_shorter_way(move, value, expected):
    """From 3.1 rad to -3.0, which is 3.283 on the way across the stern."""
    wrapped, _ = move(3.1, -3.0, value, 0.5, True)
    assert np.cos(wrapped) == pytest.approx(np.cos(expected), abs=1e-5)
    assert np.sin(wrapped) == pytest.approx(np.sin(expected), abs=1e-5)
    assert abs(move(3.1, -3.0, value, 0.5, False)[0]) < 3.1


@pytest.mark.parametrize("kind", ["rate", "play"])
def test_only_the_own_angles_are_changed_and_those_of_twins_alike(kind):
    effects = ship(description=read_ship("cybership2")).effects
    commands = np.random.default_rng(7).uniform(-0.6, 0.6, (30, 5))
    port, starboard, both = (
        after(effects[f"{kind}_{name}"], commands, 0.2)
        for name in ("port_rudder", "starboard_rudder", "port_rudder_starboard_rudder")
    )
    np.testing.assert_array_equal(port[:, [0, 1, 2, 4]], commands[:, [0, 1, 2, 4]])
    assert np.abs(port[:, 3] - commands[:, 3]).max() > 0.05
    np.testing.assert_array_equal(both, np.column_stack([port[:, :4], starboard[:, 4]]))


def test_actuators_without_an_angle_have_no_steering_gear():
    effects = ship(description=read_ship("otter")).effects
    assert not [name for name in effects if name.startswith(("rate_", "play_"))]
    assert "rate_azimuth" in ship(description=read_ship("gunnerus")).effects


def test_the_diagnosis_steps_a_play_as_the_thrusters_do():
    """In parts side by side, each from a time before it, with the same result as row by row."""
    of = ship_with((), "cybership2")
    helm = np.repeat(np.random.default_rng(9).uniform(-0.5, 0.5, 200), 20)
    commands = np.zeros((4000, 5))
    commands[:, 3] = commands[:, 4] = helm
    time = 0.1 * np.arange(4000)
    pose = np.column_stack([0.5 * time, 0.0 * time, 0.0 * time])
    run = Run("play", time, pose, of.commanded_force(commands), commands, ship=of.description)
    arriving = Response(run, Model(ship=of).plus({"play_port_rudder": 0.2})).between_samples[-1]
    np.testing.assert_allclose(arriving[4], helm, atol=1e-9)
    angle, expected = 0.0, []
    for x in helm.tolist():
        angle, _ = dragged(angle, x, 0.2, 0.1, False)
        expected.append(angle)
    assert np.abs(arriving[3] - helm).max() > 0.09
    np.testing.assert_allclose(arriving[3], expected, atol=1e-9)


def test_a_play_is_behind_the_rate_limit_of_the_file():
    """Turned back, the gear goes through the play at its rate before the angle follows."""
    of, h, play = ship_with((), "gunnerus"), 0.1, 0.2
    wanted = np.repeat([0.6, 0.0, -0.4, 0.3], 100)
    commands = np.column_stack([wanted, np.full(wanted.size, 2.0)])
    time = h * np.arange(wanted.size)
    pose = np.column_stack([5.0 * time, 0.0 * time, 0.0 * time])
    run = Run("play", time, pose, of.commanded_force(commands), commands, ship=of.description)
    model = Model(ship=of)
    rate = model.value("plant_azimuth_alpha_rate")
    model = model.plus({"play_azimuth": play, "lag_azimuth": -model.value("lag_azimuth")})
    acting = Response(run, model).between_samples[-1][0]
    gear, angle, expected = 0.0, 0.0, []
    for x in wanted.tolist():
        gear, mean = rate_limited(gear, x, rate, h, True)
        angle, _ = dragged(angle, mean, play, h, True)
        expected.append(angle)
    np.testing.assert_allclose(acting, expected, atol=2e-3)
    turned = np.flatnonzero(np.abs(acting - 0.5) < 1e-3)  # held at half of the play below 0.6 rad
    assert turned[-1] - 100 == pytest.approx(play / rate / h, abs=1.5)
