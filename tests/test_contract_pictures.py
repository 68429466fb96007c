"""What pictures of a run show, without drawing them: tracks, hulls, lines over time, margins, legends."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import InputError
from cosim.formats.outline import AnnotatedOutline, CommandLimit
from cosim.results import canvas, drawing, lines, track
from cosim.results.canvas import DrawnRun
from cosim.results.run_options import RunOptions
from cosim.scenario import Roles

ROLES = Roles()
NONE = {"color": "blue"}
SHIP = AnnotatedOutline("ship", 1.0, ((0.5, 0.0), (-0.5, 0.2), (-0.5, -0.2)))
LETTER = 10.0 / 72.0  # in, size of the usual font


def log_of(rows=12, seed=0):
    """A log with all columns, of random numbers."""
    rng = np.random.default_rng(seed)
    log = {name: rng.normal(size=rows) for name in ROLES.columns}
    return log | {"time": np.cumsum(rng.uniform(0.1, 1.0, rows))}


def drawn(log, **more):
    return DrawnRun("a", log, NONE, RunOptions(roles=ROLES, **more))


def data(panel, k=0):
    return np.asarray(panel.get_lines()[k].get_ydata(), float)


# Lines over time


@settings(max_examples=10)
@given(st.integers(0, 10**6), st.sampled_from([2000, 2001, 2999, 5000]))
def test_a_long_line_keeps_the_ends_of_each_stretch(seed, rows):
    values = np.random.default_rng(seed).normal(size=rows)
    time = np.arange(rows) * 0.5
    at, shown = canvas.thin(time, values)
    length = int(np.ceil(rows / 1000)) if rows > 2000 else 1
    parts = [range(k, min(k + length, rows)) for k in range(0, rows, length)]
    if length == 1:
        assert (at is time, shown is values) == (True, True)
        return
    each = [sorted((min(p, key=lambda k: values[k]), max(p, key=lambda k: values[k]))) for p in parts]
    # A stretch of one sample has it twice.
    assert at.tolist() == [0.5 * k for pair in each for k in pair]
    assert shown.tolist() == [values[k] for pair in each for k in pair]


def test_errors_are_those_of_the_pose_from_its_target():
    log = log_of()
    figure = lines.errors([drawn(log)])
    heading, across, away = figure.axes
    x, y, psi = (log[a] - log[b] for a, b in zip(ROLES.pose, ROLES.target, strict=True))
    turn = np.exp(1j * psi)
    assert data(heading) == pytest.approx(np.degrees(np.angle(turn)))
    aside = ((x + 1j * y) * np.exp(-1j * log[ROLES.target[2]])).imag
    assert data(across) == pytest.approx(aside)
    assert data(away) == pytest.approx(np.abs(x + 1j * y))
    assert [panel.get_ylabel() for panel in figure.axes] == [
        "heading error [deg]", "cross-track error e [m]", "distance to target [m]",
    ]  # fmt: skip
    assert [panel.get_xlabel() for panel in figure.axes] == ["", "", "time [s]"]
    assert all(data(panel, 1).tolist() == [0.0, 0.0] for panel in figure.axes)


def test_a_flat_line_has_a_range_about_it():
    log = log_of()
    log |= dict(zip(ROLES.target, (log[name] for name in ROLES.pose), strict=True))
    for panel in lines.errors([drawn(log)]).axes:
        low, high = panel.get_ylim()
        assert high - low >= 1e-4
        assert 0.5 * (low + high) == pytest.approx(0.0, abs=1e-12)


def test_commands_have_their_limits_in_their_unit():
    log = log_of() | {"t.rudder_delta": np.linspace(-0.3, 0.4, 12), "t.engine_n": np.arange(12.0)}
    log[ROLES.target[2]] = log[ROLES.pose[2]] - 4.0 * np.pi - 0.2
    limits = {"t.rudder_delta": CommandLimit(-0.6, 0.5, "rad"), "t.engine_n": CommandLimit(0, 20, "1/s")}
    run = drawn(log, commands=limits)
    rudder, engine, speed, heading = lines.commands([run]).axes
    factor = 180.0 / np.pi
    assert data(rudder) == pytest.approx(factor * log["t.rudder_delta"])
    assert [data(rudder, k)[0] for k in (1, 2)] == pytest.approx([-0.6 * factor, 0.5 * factor])
    assert data(engine) == pytest.approx(log["t.engine_n"])
    assert [data(engine, k)[0] for k in (1, 2)] == [0.0, 20.0]
    assert [p.get_ylabel() for p in (rudder, engine)] == ["rudder_delta [deg]", "engine_n [1/s]"]
    u, v, _ = ROLES.velocity
    assert data(speed) ** 2 == pytest.approx(log[u] ** 2 + log[v] ** 2)
    assert data(heading) == pytest.approx(factor * np.unwrap(log[ROLES.pose[2]]))
    assert data(heading, 1) - data(heading) == pytest.approx(-0.2 * factor)
    labels = [text.get_text() for text in rudder.figure.legends[0].get_texts()]
    assert labels == ["a", "limit", "heading wanted"]
    other = drawn(log | {"t.engine_n": log["t.engine_n"] + 1.0}, commands=limits)
    without = {k: v for k, v in log.items() if k != ROLES.target[2]}
    one = drawn(without, commands={"t.engine_n": limits["t.engine_n"]})
    rudder, engine, _, heading = lines.commands([other, one]).axes
    assert (len(engine.get_lines()) - len(rudder.get_lines()), len(heading.get_lines())) == (1, 3)


def test_metrics_end_with_those_of_the_run():
    log = log_of()
    run = drawn(log, start=log["time"][2], stop=log["time"][9])
    figure = lines.metrics([run])
    time, across = log["time"][2:10], lines.errors([run]).axes[1].get_lines()[0].get_ydata()[2:10]
    mean = np.diff(time) * 0.5
    squares = np.concatenate([[0.0], np.cumsum(mean * (across[1:] ** 2 + across[:-1] ** 2))])
    assert data(figure.axes[0]) == pytest.approx(squares)
    assert all(panel.get_ylim()[0] == 0.0 for panel in figure.axes)
    assert [panel.get_ylabel().partition(" ")[0] for panel in figure.axes] == [
        "ISE", "IAE", "W", "I_tau_dot", "IAEW", "IAEWWT",
    ]  # fmt: skip


def test_forces_that_are_zero_have_no_panel():
    log = log_of()
    for name in ROLES.nonlinear_force:
        log[name] *= 0.0
    figure = lines.forces([drawn(log)])
    assert [p.get_ylabel() for p in figure.axes] == ["linear ‖τ‖ [N]", "total ‖τ‖ [N]"]
    for panel, names in zip(figure.axes, (ROLES.linear_force, ROLES.requested_force), strict=True):
        assert data(panel) == pytest.approx(np.linalg.norm([log[n] for n in names], axis=0))
        assert panel.get_ylim()[0] == 0.0
    assert figure.get_figheight() == pytest.approx(1.0 + 2 * 1.85)
    other = log_of(seed=3)
    assert len(lines.forces([drawn(log), drawn(other)]).axes) == 3, "it is not zero in the second run"


def test_the_model_error_stands_with_its_estimate_for_each_run():
    logs = [log_of(seed=1), log_of(seed=2)]
    figure = lines.model_error([drawn(logs[0]), drawn(logs[1])._replace(label="b")])
    for k, panel in enumerate(figure.axes):
        axis, log = "XYN"[k // 2], logs[k % 2]
        lost = log[f"thrusters.tau_act_{axis}"] - log[f"thrusters.tau_cmd_{axis}"]
        assert data(panel) == pytest.approx(log[f"vessel.omega_star_{axis}"] + lost)
        assert data(panel, 1) == pytest.approx(log[f"controller.omega_hat_{axis}"])
        true, estimate = panel.lines[:2]
        assert true.get_linewidth() < 0.6 * estimate.get_linewidth(), "each is seen beside the other"
        assert true.get_zorder() > estimate.get_zorder()
    assert [p.get_title() for p in figure.axes] == ["a", "b", "", "", "", ""]
    units = ["ω in X [N]", "", "ω in Y [N]", "", "ω in N [N m]", ""]
    assert [p.get_ylabel() for p in figure.axes] == units
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["model error ω", "estimate ω̂"]
    hull = {k: v for k, v in logs[0].items() if not k.startswith("thrusters.tau_act")}
    single = lines.model_error([drawn(hull)])
    assert data(single.axes[2]) == pytest.approx(hull["vessel.omega_star_N"])
    assert single.axes[0].get_title() == ""
    assert [text.get_text() for text in single.legends[0].get_texts()] == labels


# Tracks


@given(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0), st.floats(-4.0, 4.0))
def test_a_hull_is_turned_and_moved(x, y, psi):
    corners = np.array(SHIP.corners)
    (found,) = track.hulls(np.array([[x, y, psi]]), SHIP.corners)
    at = (x + 1j * y) + (corners[:, 0] + 1j * corners[:, 1]) * np.exp(1j * psi)
    assert found == pytest.approx(np.column_stack([at.imag, at.real]))


def test_points_along_a_path_are_equally_far_apart():
    x, y = np.array([0.0, 3.0, 3.0]), np.array([0.0, 0.0, 4.0])  # 7 m with a corner
    north, east = track._along(x, y, 0.5)
    assert north.size == 16
    way = np.where(east > 0.0, 3.0 + east, north)
    assert way == pytest.approx(np.linspace(0.0, 7.0, 16))
    north, _ = track._along(x, y, 0.5, 4)
    assert north.size == 6


def laps(count, radius=1.0, middle=0.0):
    angle = np.linspace(0.0, 2.0 * np.pi * count, 400 * count)
    return middle + radius * np.sin(angle), radius * np.cos(angle)


def length_of(x, y):
    return np.nansum(np.hypot(np.diff(x), np.diff(y)))


def test_laps_are_drawn_once():
    for count in (1, 3):
        x, y = track.once([laps(count)], 2.0)
        assert length_of(x, y) == pytest.approx(2.0 * np.pi, rel=0.05)
        seen = np.isfinite(x)
        assert np.hypot(x, y)[seen] == pytest.approx(1.0, abs=1e-3)
    both = track.once([laps(1), laps(1)], 2.0)
    assert length_of(*both) == pytest.approx(2.0 * np.pi, rel=0.05)


def test_tracks_that_cross_are_both_drawn_and_not_connected():
    way = np.linspace(-1.0, 1.0, 200)
    x, y = track.once([(way, 0.0 * way), (0.0 * way, way)], 2.0)
    assert length_of(x, y) == pytest.approx(4.0, rel=0.02)
    gaps = np.flatnonzero(np.isnan(x))
    assert gaps.size == 2
    assert np.abs(y[: gaps[0]]).max() == np.abs(x[gaps[0] + 1 : gaps[1]]).max() == 0.0


def straight(rows=121, speed=0.5):
    """A ship that goes north, and a target beside it."""
    time = np.linspace(0.0, 60.0, rows)
    log = {name: np.zeros(rows) for name in (*ROLES.pose, *ROLES.target)}
    log |= {"time": time, ROLES.pose[0]: speed * time, ROLES.target[0]: speed * time}
    log[ROLES.target[1]] = np.full(rows, 0.3)
    return log


def test_hulls_are_drawn_at_equal_times_and_none_twice():
    found = track.outlines(drawn(straight()), SHIP, 1.0)
    assert found.shape == (12, 3, 2)
    assert np.diff(found[:, 0, 1]) == pytest.approx(0.5 * 60.0 / 11.0, abs=0.26)
    assert found[0, 0] == pytest.approx([0.0, 0.5])
    assert found[-1, 0] == pytest.approx([0.0, 30.5])
    half = track.outlines(drawn(straight()), SHIP, 0.5)
    assert half[0, 0] == pytest.approx([0.0, 0.25])
    assert len(track.outlines(drawn(straight(speed=0.0)), SHIP, 1.0)) == 1
    # Every 0.91 m: each second one is a whole length from the last that is drawn.
    slow, long = drawn(straight(speed=1.0 / 6.0)), SHIP._replace(length=2.0)
    assert [len(track.outlines(slow, *s)) for s in ((SHIP, 1.0), (long, 1.0), (long, 0.5))] == [6, 4, 6]
    turning = straight(speed=0.0)
    turning[ROLES.pose[2]] = np.linspace(0.0, 2.2, 121)
    assert len(track.outlines(drawn(turning), SHIP, 1.0)) == 3, "each radian"


def test_a_track_is_seen_to_scale_with_room_about_it():
    log = straight(speed=0.5)  # 30 m north, 0.3 m east
    figure = track.trajectory([drawn(log, outline=SHIP)])
    (panel,) = figure.axes
    assert panel.get_ylim() == pytest.approx((15.0 - 0.58 * 30.0, 15.0 + 0.58 * 30.0))
    assert panel.get_xlim() == pytest.approx((0.15 - 0.28 * 30.0, 0.15 + 0.28 * 30.0))
    assert panel.get_aspect() == 1.0
    assert figure.get_size_inches() == pytest.approx([8.0, 10.0])  # no higher than 9 in, and a legend
    assert panel.get_title(loc="right") == "ships drawn full length, every 5.45 s"
    start = panel.get_lines()[1]
    assert (start.get_xdata()[0], start.get_ydata()[0], start.get_label()) == (0.0, 0.0, "start")
    (ships,) = panel.collections
    assert len(ships.get_paths()) == 12
    target = panel.get_lines()[2]
    assert np.nanmax(target.get_ydata()) == pytest.approx(30.0)
    assert np.asarray(target.get_xdata())[0] == pytest.approx(0.3)


def test_a_ship_longer_than_half_of_its_track_is_drawn_smaller():
    long = SHIP._replace(length=20.0)
    panel = track.trajectory([drawn(straight(), outline=long)]).axes[0]
    assert panel.get_title(loc="right").startswith("ships drawn 1:2,")
    short = SHIP._replace(length=14.9)
    panel = track.trajectory([drawn(straight(), outline=short)]).axes[0]
    assert panel.get_title(loc="right").startswith("ships drawn full length,")
    assert track.trajectory([drawn(straight())]).axes[0].get_title(loc="right") == ""


def test_a_target_that_stands_is_a_cross_and_several_runs_have_their_distance():
    log = straight()
    for name in ROLES.target[:2]:
        log[name] = np.full(121, 2.0)
    one = track.trajectory([drawn(log)]).axes[0].get_lines()[-1]
    assert (one.get_marker(), one.get_label()) == ("+", "target")
    assert (one.get_xdata()[0], one.get_ydata()[0]) == (2.0, 2.0)
    panel, below = track.trajectory([drawn(log), drawn(straight())]).axes
    assert data(below, 1) == pytest.approx(0.3)
    assert data(below) == pytest.approx(np.hypot(0.5 * log["time"] - 2.0, 2.0))
    assert below.get_ylim()[0] == 0.0
    labels = [line.get_label() for line in panel.get_lines()]
    assert labels.count("target") == 1
    assert labels.count("start") == 1


# Which runs are drawn, and how


def test_rows_that_cannot_be_drawn_are_left_out():
    log = log_of()
    log["vessel.x"][3], log["vessel.y"][5], log["vessel.u"][7] = np.nan, 1e9, np.inf
    part = drawing._usable(log, (("pose", "target"),), RunOptions())
    assert part.keys() == {"time", *ROLES.pose, *ROLES.target}
    kept = [k for k in range(12) if k not in (3, 5)]
    assert part["time"].tolist() == log["time"][kept].tolist()
    assert part["vessel.psi"].tolist() == log["vessel.psi"][kept].tolist()
    first = {name: values[3:5] for name, values in log.items()}
    assert drawing._usable(first, (("pose",),), RunOptions()) is None, "one row is no line"
    without = {name: values for name, values in log.items() if not name.startswith("guidance.")}
    choices = (("pose", "target"), ("pose",))
    assert drawing._usable(without, choices, RunOptions()).keys() == {"time", *ROLES.pose}
    assert drawing._usable(without, choices[:1], RunOptions()) is None
    commands = RunOptions(commands={"vessel.u": CommandLimit(-1.0, 1.0, "m/s")})
    asked = (("commands", "pose"),)
    assert drawing._usable(log, asked, commands).keys() == {"time", *ROLES.pose, "vessel.u"}
    assert drawing._usable(log, asked, RunOptions()) is None


def test_runs_differ_by_their_lines():
    styles = [(line["color"], line["linestyle"]) for line in map(drawing._line, range(12))]
    assert styles[:4] == [("blue", "-"), ("green", "--"), ("red", "--"), ("magenta", "-.")]
    assert len(set(styles[:10])) == 10
    assert [color for color, _ in styles[4:]] == [
        *("tab:orange", "tab:brown", "tab:cyan", "tab:olive", "tab:purple", "tab:gray"),
        *("tab:orange", "tab:brown"),
    ]
    assert {style for _, style in styles[4:]} == {"-"}


def test_margins_are_those_of_letters_whatever_the_size():
    for height in (5.0, 9.0):
        figure, panels = canvas.stacked(2, 2, height)
        for panel in panels.flat:
            panel.set_ylabel("y")
        panels[0, 0].plot([0.0, 1.0], label="a line")
        canvas.legend(figure, panels[0, 0], 1)
        legend = figure.legends[0].get_window_extent().height / figure.dpi
        canvas.arrange(figure)
        first, second, third, last = (panel.get_position() for panel in panels.flat)
        assert 8.0 * first.x0 == pytest.approx(6.6 * LETTER)
        assert 8.0 * (1.0 - second.x1) == pytest.approx(1.5 * LETTER)
        assert 8.0 * (second.x0 - first.x1) == pytest.approx(6.6 * LETTER)
        assert height * third.y0 == pytest.approx(4.0 * LETTER)
        assert height * (first.y0 - third.y1) == pytest.approx(2.2 * LETTER)
        assert height * (1.0 - first.y1) == pytest.approx(1.8 * LETTER + legend)
        assert last.x1 - last.x0 == pytest.approx(first.x1 - first.x0)
        label = panels[0, 0].yaxis.label
        ahead = (panels[0, 0].transAxes.transform((0.0, 0.5))[0] - label.get_transform().transform(
            label.get_position())[0]) / figure.dpi  # fmt: skip
        assert ahead == pytest.approx(5.0 * LETTER)


def test_panels_share_a_time_axis_that_ends_just_beyond_the_runs():
    _, panels = canvas.stacked(2, 1, 5.0)
    panels[0, 0].plot([10.0, 60.0], [0.0, 1.0])
    for panel in panels.flat:
        assert panel.get_xlim() == pytest.approx((9.5, 60.5))


@pytest.mark.parametrize(
    ("count", "letters", "columns"), [(2, 6, 2), (4, 26, 3), (3, 200, 1), (9, 6, 8)]
)
def test_a_legend_has_as_many_columns_as_there_is_room_for(count, letters, columns):
    figure, panels = canvas.stacked(1, 1, 4.0)
    for k in range(count):
        panels[0, 0].plot([0.0, k], label=f"{k}" + "x" * (letters - 1))
    canvas.legend(figure, panels[0, 0], count)
    assert figure.legends[0]._ncols == columns
    assert len(figure.legends[0].get_texts()) == count


def test_only_several_runs_have_a_legend():
    runs = [drawn(log_of()), drawn(log_of(seed=1))]
    assert not lines.errors(runs[:1]).legends
    assert len(lines.errors(runs).legends[0].get_texts()) == 2


def test_a_picture_of_too_many_pixels_is_refused():
    canvas.check_size(canvas.blank(2.0, 100.0), 100.0)
    with pytest.raises(InputError, match="10001 pixels in one direction; at most 10000"):
        canvas.check_size(canvas.blank(2.0, 100.01), 100.0)
