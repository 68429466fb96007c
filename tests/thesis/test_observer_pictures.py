"""Pictures of observers: the windows of time, the lines and the limits that the truth sets."""

import numpy as np
import pytest
from matplotlib.colors import same_color

from thesis.observers.estimates_replayed import SIGNALS
from thesis.observers.pictures import COLORS, compared, freeze, wrap

H, N = 0.1, 600
TIME = H * np.arange(N)


def columns(size):
    """A signal for each name, of another frequency each."""
    return {name: size * np.sin((0.2 + 0.1 * k) * TIME) for k, name in enumerate(SIGNALS)}


def log(turn=None):
    psi = np.angle(np.exp(1j * (0.0 * TIME + 1.0 if turn is None else np.pi + 0.1 * (TIME - turn))))
    pose = {"x_m": TIME, "y_m": -TIME, "psi_m": psi}
    return {
        "time": TIME,
        **{f"vessel.{name}": x for name, x in columns(1.0).items()},
        **{f"observer.{name}": x for name, x in pose.items()},
    }


def estimates():
    pose = {"x_hat": TIME + 1.0, "y_hat": -TIME, "psi_hat": np.pi + 0.1 * (TIME - 30.0)}
    return {"mdf": columns(1.1) | pose, "kalman": columns(0.9) | pose}


def lines(panel):
    return {line.get_label(): line for line in panel.get_lines()}


@pytest.mark.parametrize("reference", [None, "smoother"])
def test_velocities_are_compared_over_twenty_seconds_from_the_middle(reference):
    known = None if reference is None else columns(2.0)
    figure = compared(log(), estimates(), known)
    label, size = ("truth", 1.0) if reference is None else ("smoother", 2.0)
    assert [p.get_ylabel() for p in figure.axes] == ["u [m/s]", "v [m/s]", "r [rad/s]"]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    part = slice(N // 2, N // 2 + 200)
    for panel, name in zip(figure.axes, "uvr", strict=True):
        drawn = lines(panel)
        assert {*drawn} == {"mdf", "kalman", label}
        for observer, factor in (("mdf", 1.1), ("kalman", 0.9), (label, size)):
            assert drawn[observer].get_xdata() == pytest.approx(TIME[part])
            assert drawn[observer].get_ydata() == pytest.approx(columns(factor)[name][part])
        for observer in ("mdf", "kalman"):
            assert same_color(drawn[observer].get_color(), COLORS[observer])
        assert drawn["kalman"].get_linewidth() > drawn["mdf"].get_linewidth()
        assert drawn[label].get_linestyle() == "--"
        true = columns(size)[name][part]
        low, high = panel.get_ylim()
        margin = 0.5 * np.ptp(true) + (0.02 if name == "r" else 0.01)
        assert (low, high) == pytest.approx((true.min() - margin, true.max() + margin))
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["mdf", "kalman", label]


@pytest.mark.parametrize(("first", "start"), [(100, 90), (5, 0)])
def test_a_freeze_is_shaded_between_a_second_before_and_two_after_it(first, start):
    figure = freeze(log(), estimates(), first, first + 30)
    assert [p.get_ylabel().split()[0] for p in figure.axes] == ["u", "v", "u_dot", "v_dot"]
    for panel in figure.axes:
        assert lines(panel)["truth"].get_xdata() == pytest.approx(TIME[start : first + 50])
        (shade,) = panel.patches
        ends = shade.get_x(), shade.get_x() + shade.get_width()
        assert ends == pytest.approx((TIME[first], TIME[first + 29]))


def test_a_wrap_is_shown_with_the_measured_pose_and_headings_in_one_turn():
    assert wrap(log(), estimates()) is None
    turned = log(turn=30.0)
    figure = wrap(turned, estimates())
    assert [p.get_ylabel().split()[0] for p in figure.axes] == ["x_m", "y_m", "psi_m", "r", "r_dot"]
    row = int(np.argmax(np.abs(np.diff(turned["observer.psi_m"])) > np.pi)) + 1
    drawn = lines(figure.axes[2])
    time = drawn["truth"].get_xdata()
    assert abs(time[0] - (TIME[row] - 1.0)) <= 1.5 * H
    assert time[-1] - time[0] == pytest.approx(4.0 - H)
    assert np.abs(drawn["mdf"].get_ydata()).max() <= np.pi
    assert drawn["truth"].get_ydata() == pytest.approx(turned["observer.psi_m"][np.isin(TIME, time)])
    assert lines(figure.axes[0])["mdf"].get_ydata() == pytest.approx(time + 1.0)
    assert figure.axes[2].get_ylim() == (-3.5, 3.5)
