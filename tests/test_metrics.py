"""Metrics and pictures of a run."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from cosim.formats.outline import AnnotatedOutline, CommandLimit
from cosim.metrics import main
from cosim.plots import main as plots_main
from cosim.results import (
    MetricsError,
    canvas,
    compute,
    drawing,
    lines,
    over_time,
    performance,
    track,
    tracking,
)
from cosim.results.picture_files import PictureOptions
from cosim.results.run_options import RunOptions
from cosim.scenario import Roles
from cosim.system.system import System

ROLES = Roles()
ARROW = AnnotatedOutline("arrow", 3.0, ((2.0, 0.0), (-1.0, 0.5), (-1.0, -0.5)))

KEYS = [
    "e_pos_rms",
    "e_pos_max",
    "cross_track_rms",
    "heading_rms",
    "ISE",
    "IAE",
    "W",
    "I_tau_dot",
    "IAEW",
    "IAEWWT",
    "IWWT",
    "from",
    "to",
]
OVER_TIME = tuple(KEYS[4:-2])


def circle(n=2001, step=0.01):
    """A ship exactly on a target that goes round a circle of 2 m at 0.1 m/s."""
    time = np.arange(n) * step
    angle = 0.05 * time
    zero = np.zeros(n)
    log = {name: zero.copy() for name in ROLES.columns}
    log["time"] = time
    for prefix, suffix in (("vessel.", ""), ("guidance.", "_t")):
        log[f"{prefix}x{suffix}"] = 2.0 * np.sin(angle)
        log[f"{prefix}y{suffix}"] = -2.0 * np.cos(angle)
        log[f"{prefix}psi{suffix}"] = angle.copy()
    log["vessel.u"] = np.full(n, 0.1)
    return log


def shift(log, ahead, starboard):
    """Move the ship in the frame of the target [m]."""
    psi = log["guidance.psi_t"]
    return {
        **log,
        "vessel.x": log["guidance.x_t"] + np.cos(psi) * ahead - np.sin(psi) * starboard,
        "vessel.y": log["guidance.y_t"] + np.sin(psi) * ahead + np.cos(psi) * starboard,
    }


def wild(seed=0, n=500):
    rng = np.random.default_rng(seed)
    log = {name: rng.normal(size=n) for name in ROLES.columns}
    log["time"] = np.cumsum(rng.uniform(0.01, 0.1, n))
    return log


@pytest.fixture
def folder(tmp_path):
    def write(log):
        np.savetxt(
            tmp_path / "log.csv",
            np.column_stack(list(log.values())),
            delimiter=",",
            header=",".join(log),
            comments="",
            fmt="%.17g",
        )
        return tmp_path

    return write


class TestCompute:
    def test_keys_and_order(self):
        result = compute(wild())
        assert list(result) == KEYS == [metric.name for metric in performance.METRICS]
        assert all(type(value) is float for value in result.values())

    def test_perfect_log_has_no_error(self):
        result = compute(circle())
        assert (result.pop("from"), result.pop("to")) == (0.0, 20.0)
        assert set(result.values()) == {0.0}

    @pytest.mark.parametrize(("start", "stop"), [(None, None), (3.0, 9.0)])
    @pytest.mark.parametrize("force", [ROLES.force, ROLES.requested_force])
    def test_metrics_are_those_of_their_definitions(self, force, start, stop):
        """The force after clipping where the log has it."""
        log = {n: x for n, x in wild().items() if n in force or n not in ROLES.force}
        inside = (log["time"] >= (start or 0.0)) & (log["time"] <= (stop or np.inf))
        time, dx, dy, psi, course, *rest = (
            log[name][inside] - log.get(minus, np.zeros(inside.size))[inside]
            for name, minus in [
                ("time", ""), ("vessel.x", "guidance.x_t"), ("vessel.y", "guidance.y_t"),
                ("vessel.psi", "guidance.psi_t"), ("guidance.psi_t", ""),
                *((name, "") for name in (*force, *ROLES.velocity)),
            ]
        )  # fmt: skip
        tau, nu = np.array(rest[:3]), np.array(rest[3:])
        e, heading = dy * np.cos(course) - dx * np.sin(course), np.angle(np.exp(1j * psi))
        ISE, IAE, W = (
            float(np.sum((y[1:] + y[:-1]) * np.diff(time)) / 2.0)
            for y in (e**2, np.abs(e), np.abs((tau * nu).sum(axis=0)))
        )
        wear = float(np.linalg.norm(np.diff(tau), axis=0).sum())
        rms = {n: np.sqrt((x**2).mean()) for n, x in (("cross_track_rms", e), ("heading_rms", heading))}
        assert compute(log, start, stop) == pytest.approx(
            {
                "e_pos_rms": np.sqrt((dx**2 + dy**2).mean()), "e_pos_max": np.hypot(dx, dy).max(), **rms,
                "ISE": ISE, "IAE": IAE, "W": W, "I_tau_dot": wear, "IAEW": IAE * W,
                "IAEWWT": IAE * W * wear, "IWWT": W * wear, "from": time[0], "to": time[-1],
            }
        )  # fmt: skip

    def test_window_holds_its_ends(self):
        log = circle()
        result = compute(log, 0.1 + 0.2, 12.0 - 1e-12)
        assert (result["from"], result["to"]) == (log["time"][30], log["time"][1200])
        assert compute(log, -5.0, 1e9) == compute(log)

    def test_what_is_outside_the_window_does_not_matter(self):
        log = circle()
        log["vessel.x"] = np.where(log["time"] > 10.0, np.nan, log["vessel.x"])
        assert compute(log, stop=10.0)["ISE"] == 0.0
        with pytest.raises(MetricsError, match=r"vessel\.x is not finite at 10\.01 s"):
            compute(log)

    def test_missing_columns_are_named(self):
        log = circle()
        del log["vessel.r"], log["guidance.psi_t"]
        with pytest.raises(MetricsError, match=r"lacks vessel\.r, guidance\.psi_t$"):
            compute(log)
        with pytest.raises(MetricsError, match=r"lacks time, "):
            compute({})

    @pytest.mark.parametrize(("start", "stop"), [(30.0, None), (5.0, 5.001), (8.0, 3.0), (None, -1.0)])
    def test_empty_window(self, start, stop):
        with pytest.raises(MetricsError, match=r"fewer than two rows .* covers 0 s to 20 s"):
            compute(circle(), start, stop)

    def test_no_rows(self):
        with pytest.raises(MetricsError, match="no rows"):
            compute({name: np.empty(0) for name in ROLES.columns})

    def test_overflow_is_an_error_not_infinity(self):
        log = shift(circle(), 0.0, 1e200)
        with pytest.raises(MetricsError, match=r"diverges.*ISE"):
            compute(log)

    def test_time_must_increase(self):
        log = circle()
        log["time"][7] = log["time"][6]
        with pytest.raises(MetricsError, match=r"does not increase after 0\.06 s"):
            compute(log)


class TestTracking:
    def test_cross_track_is_positive_to_starboard(self):
        north = {**circle(2), "guidance.psi_t": np.zeros(2)}
        assert tracking(shift(north, 0.0, 0.1))["cross_track"] == pytest.approx(0.1)
        assert tracking(shift(circle(), 0.0, -0.1))["cross_track"] == pytest.approx(-0.1)

    @pytest.mark.parametrize("turns", [-3, 0, 1, 40])
    def test_heading_error_is_wrapped(self, turns):
        log = circle(3)
        log["vessel.psi"] = np.array([np.pi - 0.1, -np.pi + 0.1, 0.2]) + 2.0 * np.pi * turns
        log["guidance.psi_t"] = np.array([-np.pi + 0.1, np.pi - 0.1, 0.0])
        assert tracking(log)["heading"] == pytest.approx([-0.2, 0.2, 0.2])

    def test_wrap_keeps_pi_and_small_angles(self):
        given = np.array([np.pi, -np.pi, np.nextafter(np.pi, 4.0), 1e-300, -1e-300, 3.0 * np.pi])
        wrapped = performance.wrap(given)
        assert wrapped[:2].tolist() == [np.pi, np.pi]
        assert wrapped[3:5].tolist() == given[3:5].tolist()
        assert np.all((wrapped > -np.pi) & (wrapped <= np.pi))

    def test_force_rate(self):
        log = circle(4)
        log["thrusters.tau_cmd_X"] = np.array([1.0, 1.03, 1.03, 1.03])
        log["thrusters.tau_cmd_N"] = np.array([1.0, 0.96, 0.96, 0.97])
        assert tracking(log)["tau_dot"] == pytest.approx([0.0, 5.0, 0.0, 1.0])


class TestOverTime:
    def test_last_is_what_compute_gives(self):
        log = wild()
        for start, stop in ((None, None), (5.0, None), (3.0, 9.0)):
            result = compute(log, start, stop)
            grown = over_time(log, start, stop)
            assert grown["time"][-1] == result["to"]
            for name in OVER_TIME:
                assert grown[name][-1] == result[name]

    def test_grows_from_zero(self):
        grown = over_time(wild(), 4.0)
        for name in OVER_TIME:
            assert grown[name][0] == 0.0
            assert np.all(np.diff(grown[name]) >= 0.0)


@pytest.mark.parametrize("limited", [True, False])
def test_columns_that_are_read_are_enough(limited):
    log = {name: values for name, values in wild().items() if limited or name not in ROLES.force}
    names = performance.read_columns(log, ROLES)
    assert compute({name: log[name] for name in names}) == compute(log)


class TestCommand:
    def test_table(self, folder, capsys):
        assert main([str(folder(shift(circle(), 0.0, 0.25)))]) == 0
        out = capsys.readouterr().out
        assert all(metric.name in out for metric in performance.METRICS)
        assert "1.25 " in out  # ISE
        header = next(line for line in out.splitlines() if "metric" in line)
        assert header.startswith("metric"), "columns begin where a line begins"

    def test_json(self, folder, capsys):
        log = wild()
        assert main([str(folder(log)), "--json", "--from", "2", "--to", "6"]) == 0
        assert json.loads(capsys.readouterr().out) == compute(log, 2.0, 6.0)

    def test_out(self, folder, tmp_path, capsys):
        log = wild()
        file = tmp_path / "grown.csv"
        assert main([str(folder(log)), "--out", str(file)]) == 0
        table = np.genfromtxt(file, delimiter=",", names=True)
        assert table.dtype.names == ("time", *OVER_TIME)
        assert table["IAEWWT"] == pytest.approx(over_time(log)["IAEWWT"])
        assert sorted(path.name for path in tmp_path.iterdir()) == ["grown.csv", "log.csv"]

    def test_log_without_thrusters(self, folder, capsys):
        log = {name: values for name, values in wild().items() if name not in ROLES.force}
        assert main([str(folder(log)), "--json"]) == 0
        assert json.loads(capsys.readouterr().out) == compute(log)

    @pytest.mark.parametrize(
        ("change", "arguments", "message"),
        [
            ({}, ["--from", "99"], "fewer than two rows"),
            ({"vessel.x": None}, [], "the log lacks vessel.x"),
            ({}, ["--out", "/nowhere/grown.csv"], "'/nowhere/grown.csv' cannot be written"),
        ],
    )
    def test_bad_input(self, folder, capsys, change, arguments, message):
        log = {name: values for name, values in circle().items() if name not in change}
        assert main([str(folder(log)), *arguments]) == 2
        out, err = capsys.readouterr()
        assert message in err
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert out == ""

    def test_no_folder(self, tmp_path, capsys):
        assert main([str(tmp_path / "nothing")]) == 2
        err = capsys.readouterr().err
        assert err.startswith("error: ")
        assert "nothing" in err
        assert err.count("\n") == 1


class TestPlots:
    ALL = ("trajectory.png", "errors.png", "metrics.png", "forces.png", "model_error.png")

    def names(self, files):
        return tuple(file.name for file in files)

    def test_all_pictures_are_drawn_once(self, tmp_path, monkeypatch):
        """Measuring their letters, or a first pass for their size, would take as long again."""
        from matplotlib.figure import Figure

        draw, drawn = Figure.draw, []
        monkeypatch.setattr(Figure, "draw", lambda *stated: (drawn.append(stated[0]), draw(*stated))[1])
        files = drawing.draw({"a": wild(1, 5000), "b": wild(2)}, tmp_path / "new")
        assert len(drawn) == len(set(drawn)) == len(self.ALL)
        assert self.names(files) == self.ALL
        assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
        assert {path.name for path in (tmp_path / "new").iterdir()} == set(self.ALL)

    @pytest.mark.parametrize(
        ("size", "width", "scale"), [(10.0, 8.0, 1.0), (10.0, 6.0, 3e4), (18.0, 8.0, 1e-3)]
    )
    def test_labels_keep_clear_of_numbers_and_edges(self, size, width, scale):
        """Margins are set, not measured: they follow the size of letters and of the picture."""
        from matplotlib import rc_context

        log = {name: values if name == "time" else scale * values for name, values in wild().items()}
        look = PictureOptions(width=width)
        with rc_context({"font.size": size}):
            for _, figure in drawing.figures({"first run": log, "second run": log}):
                look.sized(figure).draw_without_rendering()
                drawn = figure.get_tightbbox()  # in
                assert np.all(drawn.min > 0.0)
                assert np.all(drawn.max < figure.get_size_inches())
                legend = figure.legends[0].get_window_extent()
                for panel in figure.axes:
                    numbers = [n.get_window_extent() for n in panel.get_yticklabels()]
                    label = panel.yaxis.label.get_window_extent()
                    assert label.width == 0.0 or label.x1 < min(n.x0 for n in numbers)
                    assert panel.get_window_extent().y1 < legend.y0

    @pytest.mark.parametrize("dpi", ["0", "-1", "1001", "many"])
    def test_a_size_that_is_none_is_refused(self, dpi, tmp_path, capsys):
        with pytest.raises(SystemExit) as ended:
            plots_main([str(tmp_path), "--dpi", dpi])
        assert ended.value.code == 2
        assert plots_main([str(tmp_path / "nowhere"), "--dpi", "1000"]) == 2, (
            "allowed, but there is no run"
        )
        assert "nowhere" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("width", "said"), [("1000", "pixels in one direction"), ("0.5", "has no room")]
    )
    def test_a_width_that_cannot_be_drawn_is_refused(self, width, said, folder, tmp_path, capsys):
        assert plots_main([str(folder(wild())), "--out", str(tmp_path / "drawn"), "--width", width]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert said in line

    def test_pictures_without_their_columns_are_left_out(self, tmp_path):
        log = {name: values for name, values in wild().items() if not name.startswith("controller.")}
        assert self.names(drawing.draw({"a": log}, tmp_path)) == self.ALL[:3]
        pose = {name: log[name] for name in ("time", *ROLES.pose)}
        assert self.names(drawing.draw({"a": pose}, tmp_path)) == self.ALL[:1]
        assert drawing.draw({"a": {"time": log["time"]}}, tmp_path) == []
        assert drawing.draw({}, tmp_path) == []

    def test_commands_have_their_limits_and_the_heading_that_is_wanted(self):
        log = wild() | {"thrusters.rudder_delta": np.radians(wild(2)["vessel.u"])}
        log["guidance.psi_t"] = log["vessel.psi"] + 2.0 * np.pi + 0.1
        limits = {"thrusters.rudder_delta": CommandLimit(-0.6, 0.5, "rad")}
        stated = {"a": RunOptions(commands=limits)}
        assert "commands" not in dict(drawing.figures({"a": log}))
        rudder, speed, heading = dict(drawing.figures({"a": log}, stated))["commands"].axes
        assert rudder.get_ylabel() == "rudder_delta [deg]"
        line, low, high, *_ = rudder.get_lines()
        assert line.get_ydata() == pytest.approx(wild(2)["vessel.u"])
        ends = [each.get_ydata()[0] for each in (low, high)]
        assert ends == pytest.approx(np.degrees([-0.6, 0.5]))
        assert speed.get_lines()[0].get_ydata() == pytest.approx(
            np.hypot(log["vessel.u"], log["vessel.v"])
        )
        reached, wanted = heading.get_lines()
        assert wanted.get_ydata() - reached.get_ydata() == pytest.approx(np.degrees(0.1))
        without = {name: values for name, values in log.items() if not name.startswith("guidance.")}
        *_, heading = dict(drawing.figures({"a": without}, stated))["commands"].axes
        assert len(heading.get_lines()) == 1

    def test_lost_thrust_is_part_of_the_model_error(self):
        """(7.7): what was commanded and did not act is missing too; without its columns the hull's stays."""
        log = wild()
        run = canvas.DrawnRun("a", log, {}, RunOptions(roles=ROLES))
        for axis, found in zip("XYN", lines.missing_force(run), strict=True):
            lost = log[f"thrusters.tau_act_{axis}"] - log[f"thrusters.tau_cmd_{axis}"]
            assert found == pytest.approx(log[f"vessel.omega_star_{axis}"] + lost)
        short = {k: v for k, v in log.items() if not k.startswith("thrusters.tau_act")}
        hull = [log[f"vessel.omega_star_{axis}"] for axis in "XYN"]
        assert np.array_equal(lines.missing_force(run._replace(log=short)), hull)

    def test_lines_over_time_are_those_of_the_log(self):
        """Heading off the target in degrees; forces that are zero have no panel; metrics that only grow."""
        a, b = wild(1), wild(2)
        a["vessel.psi"] = a["guidance.psi_t"] + 2.0 * np.pi + 0.1
        drawn = dict(drawing.figures({"a": a, "b": b}))
        heading, aside, away = drawn["errors"].axes
        far = np.hypot(*(a[p] - a[t] for p, t in zip(ROLES.pose[:2], ROLES.target[:2], strict=True)))
        assert away.get_lines()[0].get_ydata() == pytest.approx(far)
        below = drawn["trajectory"].axes[1]
        assert below.get_ylabel() == "distance to target [m]", "tracks that coincide are one line"
        assert below.get_lines()[0].get_ydata() == pytest.approx(far)
        assert len(dict(drawing.figures({"a": a}))["trajectory"].axes) == 1
        line, other, zero = heading.get_lines()
        assert line.get_ydata() == pytest.approx(np.degrees(0.1))
        assert other.get_ydata() == pytest.approx(
            np.degrees(performance.wrap(b["vessel.psi"] - b["guidance.psi_t"]))
        )
        assert list(zero.get_ydata()) == [0.0, 0.0]
        target = [a[name] for name in ROLES.target]
        expected = performance.cross_track(a["vessel.x"], a["vessel.y"], target)
        assert aside.get_lines()[0].get_ydata() == pytest.approx(expected)
        grown = over_time(b, None, None, ROLES)
        for panel, name in zip(
            drawn["metrics"].axes, ("ISE", "IAE", "W", "I_tau_dot", "IAEW", "IAEWWT"), strict=True
        ):
            assert panel.get_ylabel().startswith(f"{name} [")
            assert panel.get_lines()[1].get_ydata()[-1] == pytest.approx(grown[name][-1])
            assert panel.get_ylim()[0] == 0.0
        linear = [a[name] for name in ROLES.linear_force]
        assert drawn["forces"].axes[0].get_lines()[0].get_ydata() == pytest.approx(
            np.linalg.norm(linear, axis=0)
        )
        assert [panel.get_ylabel() for panel in drawn["forces"].axes] == [
            f"{name} ‖τ‖ [N]" for name in ("linear", "nonlinear", "total")
        ]
        for name in ROLES.nonlinear_force:
            a[name] = b[name] = 0.0 * a["time"]
        (_, two), *_ = drawing.figures({"a": a}, names=("forces",))
        assert [panel.get_ylabel() for panel in two.axes] == ["linear ‖τ‖ [N]", "total ‖τ‖ [N]"]
        for name in (*ROLES.linear_force, *ROLES.requested_force):
            a[name] = 0.0 * a["time"]
        (_, one), *_ = drawing.figures({"a": a}, names=("forces",))
        assert [panel.get_ylabel() for panel in one.axes] == ["total ‖τ‖ [N]"]

    def test_model_error_has_a_column_for_each_run_and_its_estimate_in_its_colour(self):
        logs = {"a": wild(1), "b": wild(2)}
        (_, figure), *_ = drawing.figures(logs, names=("model_error",))
        assert len(figure.axes) == 6
        assert [panel.get_title() for panel in figure.axes[:2]] == ["a", "b"]
        for k, panel in enumerate(figure.axes):
            axis, (label, log) = "XYN"[k // 2], [*logs.items()][k % 2]
            true, estimate, *_ = panel.get_lines()
            assert true.get_ydata() == pytest.approx(
                lines.missing_force(canvas.DrawnRun(label, log, {}, RunOptions(roles=ROLES)))[k // 2]
            )
            assert estimate.get_ydata() == pytest.approx(log[f"controller.omega_hat_{axis}"])
            assert (true.get_color(), estimate.get_color()) == ("black", ("blue", "green")[k % 2])
            assert true.get_zorder() > estimate.get_zorder()
        labels = [panel.get_ylabel() for panel in figure.axes[::2]]
        assert labels == ["ω in X [N]", "ω in Y [N]", "ω in N [N m]"]
        assert [t.get_text() for t in figure.legends[0].get_texts()] == ["model error ω", "estimate ω̂"]
        (_, alone), *_ = drawing.figures({"a": logs["a"]}, names=("model_error",))
        assert [panel.get_title() for panel in alone.axes] == [""] * 3

    def test_each_run_has_a_line_of_its_own(self):
        every = [drawing._line(k) for k in range(10)]
        assert len({(line["color"], line["linestyle"]) for line in every}) == 10
        assert [line["color"] for line in every[:4]] == ["blue", "green", "red", "magenta"], (
            "as in the thesis"
        )
        assert drawing._line(10) == drawing._line(4), "then they come again"

    def test_ships_are_drawn_apart_and_a_target_at_rest_is_a_cross(self):
        log = circle()
        log["guidance.x_t"], log["guidance.y_t"] = 0.0 * log["time"] + 1.0, 0.0 * log["time"] + 2.0
        stated = {
            "a": RunOptions(
                outline=ARROW._replace(length=0.3, corners=((0.2, 0.0), (-0.1, 0.05), (-0.1, -0.05)))
            )
        }
        (_, figure), *_ = drawing.figures({"a": log}, stated, names=("trajectory",))
        (panel,) = figure.axes
        (ships,) = panel.collections
        bows = np.array([path.vertices[0] for path in ships.get_paths()])
        assert 4 < len(bows) < track.OUTLINES
        assert np.hypot(*np.diff(bows, axis=0).T).min() > 0.3, "none lies on another"
        drawn = {line.get_label(): line for line in panel.get_lines()}
        assert (drawn["target"].get_xdata().tolist(), drawn["target"].get_ydata().tolist()) == (
            [2.0],
            [1.0],
        )
        assert drawn["target"].get_marker() == "+"
        start = drawn["start"]
        assert (start.get_xdata()[0], start.get_ydata()[0]) == (log["vessel.y"][0], log["vessel.x"][0])
        assert panel.get_title(loc="right") == f"ships drawn full length, every {20.0 / 11:.3g} s"
        stated = {"a": RunOptions(outline=ARROW)}
        (_, figure), *_ = drawing.figures({"a": log}, stated, names=("trajectory",))
        assert figure.axes[0].get_title(loc="right").startswith("ships drawn 1:2, "), (
            "no longer than half of it"
        )

    def test_a_run_that_blew_up_is_drawn_as_far_as_it_goes(self, tmp_path):
        log = wild()
        for name in ROLES.columns[1:]:
            log[name][300:] = 1e300
            log[name][400:] = np.nan
        assert self.names(drawing.draw({"a": log}, tmp_path)) == self.ALL

    @pytest.mark.slow
    def test_a_ship_at_rest(self, tmp_path):
        log = {name: np.zeros(100) for name in ROLES.columns}
        log["time"] = np.arange(100) * 0.1
        assert self.names(drawing.draw({"a": log}, tmp_path)) == self.ALL

    def test_thin_keeps_peaks_and_order(self):
        time = np.arange(123457) * 0.01
        values = np.sin(time)
        values[[0, 4321, 99999, -1]] = [7.0, 5.0, -5.0, 9.0]
        t, v = canvas.thin(time, values)
        assert t.size <= canvas.MAX_POINTS
        assert np.all(np.diff(t) >= 0.0)
        assert {7.0, 5.0, -5.0, 9.0} <= set(v)

    def test_laps_of_a_target_are_drawn_once(self):
        angle = np.linspace(0.0, 2.0 * np.pi, 3000)
        lap = (np.sin(angle), np.cos(angle))
        laps = (np.sin(5.3 * angle), np.cos(5.3 * angle))

        def length(path):
            steps = np.hypot(np.diff(path[0]), np.diff(path[1]))
            return np.nansum(steps)

        assert length(track.once([lap], 2.0)) == pytest.approx(2.0 * np.pi, rel=0.02)
        assert length(track.once([laps, lap], 2.0)) == pytest.approx(2.0 * np.pi, rel=0.02)

    def test_paths_of_ship_and_target_lie_where_they_were(self):
        log = shift(circle(), 0.0, 0.5)
        log["vessel.psi"] = log["vessel.psi"] + 7.0
        (_, figure), *_ = drawing.figures({"a": log}, names=("trajectory",))
        drawn = {line.get_label(): line for line in figure.axes[0].get_lines()}
        for label, name in (("a", "vessel.{}"), ("target", "guidance.{}_t")):
            for axis, values in (("y", drawn[label].get_xdata()), ("x", drawn[label].get_ydata())):
                true = log[name.format(axis)]
                assert np.nanmin(values) == pytest.approx(true.min(), abs=0.02)
                assert np.nanmax(values) == pytest.approx(true.max(), abs=0.02)

    def test_a_target_is_drawn_in_500_steps_for_each_width_of_the_picture(self):
        x, _ = track.once([(np.array([0.0, 30.0]), np.array([1.0, 1.0]))], 3.0)
        known = x[np.isfinite(x)]
        assert np.ptp(known) == 30.0
        assert np.diff(known) == pytest.approx(30.0 / 5001, rel=1e-9)

    def test_hull_is_alike_on_both_sides_and_as_long_and_wide_as_the_ship(self):
        (corners,) = track.hulls(np.zeros((1, 3)), ARROW.corners)
        mirrored = corners * [-1.0, 1.0]
        assert {tuple(c) for c in corners.tolist()} == {tuple(c) for c in (mirrored + 0.0).tolist()}
        assert np.ptp(corners, axis=0) == pytest.approx([1.0, 3.0])
        assert corners[corners[:, 1].argmax()] == pytest.approx([0.0, 2.0])

    def test_a_crossing_stays_whole(self):
        angle = np.linspace(0.1, 2.0 * np.pi + 0.1, 3000)
        x, _ = track.once([(np.sin(2.0 * angle), np.sin(angle))], 2.0)
        assert np.count_nonzero(np.isnan(x[5:-20])) <= 3

    def test_hull_points_where_the_ship_heads(self):
        log = {"time": np.array([0.0, 1.0]), "vessel.x": np.zeros(2), "vessel.y": np.zeros(2)}
        log["vessel.psi"] = np.full(2, np.pi / 2.0)
        (east,) = track.outlines(canvas.DrawnRun("", log, {}, RunOptions(roles=ROLES)), ARROW, 0.5)
        assert east[0] == pytest.approx([1.0, 0.0])
        assert east[1, 1] < 0.0  # starboard of a ship to the east is south


class TestRoles:
    OTHER = Roles(
        pose=("boat.n", "boat.e", "boat.h"),
        target=("aim.n", "aim.e", "aim.h"),
        force=("u.a", "u.b", "u.c"),
    )

    def renamed(self, log):
        """The log of another system, whose columns have names of its own."""
        names = {
            old: new
            for role in ("pose", "target", "force")
            for old, new in zip(ROLES.of(role), self.OTHER.of(role), strict=True)
        }
        return {names.get(name, name): values for name, values in log.items()}

    def test_metrics_do_not_depend_on_names(self):
        log = wild()
        other = self.renamed(log)
        assert compute(other, roles=self.OTHER) == compute(log)
        for name, values in over_time(log, 3.0).items():
            assert np.array_equal(over_time(other, 3.0, roles=self.OTHER)[name], values)
        with pytest.raises(MetricsError, match=r"the log lacks vessel\.x, "):
            compute(other)
        with pytest.raises(MetricsError, match=r"the log lacks boat\.n, "):
            compute(log, roles=self.OTHER)

    def test_energy_is_the_integral_of_the_power_that_is_stated(self):
        log = wild()
        time = log["time"]
        log |= {"thrusters.a_power": 2.0 + 0.0 * time, "thrusters.b_power": 3.0 * time}
        roles = Roles(power=("thrusters.a_power", "thrusters.b_power"))
        found = compute(log, 1.0, 5.0, roles)
        first, last = found["from"], found["to"]
        assert found["energy"] == pytest.approx(2.0 * (last - first) + 1.5 * (last**2 - first**2))
        assert {k: v for k, v in found.items() if k != "energy"} == compute(log, 1.0, 5.0)

    @pytest.mark.parametrize("number", ["nan", "-inf", "x"])
    def test_a_time_is_a_number(self, folder, capsys, number):
        with pytest.raises(SystemExit, match="2"):
            main([str(folder(wild())), f"--from={number}"])
        assert f"needs a number, not '{number}'" in capsys.readouterr().err

    def test_a_log_without_signals_of_a_picture_is_one_line_and_no_folder(self, folder, capsys):
        run = folder({"time": np.arange(3.0), "a.b": np.arange(3.0)})
        assert plots_main([str(run), "--out", str(run / "drawn")]) == 2
        assert capsys.readouterr().err.startswith("error: nothing to draw: ")
        assert not (run / "drawn").exists()

    def test_commands_find_the_roles_of_a_run(self, folder, capsys):
        log = self.renamed(wild())
        run = folder(log)
        chosen = {"metrics": {"from": None, "to": None}, "roles": self.OTHER.model_dump(mode="json")}
        (run / "log.json").write_text(json.dumps({"scenario": chosen}))
        assert main([str(run), "--json"]) == 0
        assert json.loads(capsys.readouterr().out) == compute(log, roles=self.OTHER)
        assert plots_main([str(run), "--out", str(run / "drawn")]) == 0
        assert {path.name for path in (run / "drawn").iterdir()} == set(TestPlots.ALL)


def test_limits_of_commands_are_start_values_or_those_that_the_scenario_gives():
    def real(causality, start=None, unit="rad", kind="Real"):
        unit = unit and SimpleNamespace(name=unit)
        return SimpleNamespace(type=kind, start=start, causality=causality, unit=unit)

    thrusters = {
        "delta": real("input"),
        "delta_max": real("parameter", "0.6"),
        "n": real("output", unit=None),
        "n_max": real("parameter", "9.0"),
        "n_min": real("parameter", "-4.0"),
        "lift": real("local"),
        "lift_max": real("parameter", "1.0"),
        "lag": real("parameter"),
        "lag_max": real("parameter", "1.0"),
        "steps": real("input"),
        "steps_max": real("parameter", "3", kind="Integer"),
        "free": real("input"),
        "free_max": real("parameter"),
    }
    given = [
        (SimpleNamespace(name="n_max", type="Real"), 7.5),
        (SimpleNamespace(name="free_max", type="Integer"), 2),
    ]
    system = SimpleNamespace(
        models={"t": SimpleNamespace(variables=thrusters), "v": SimpleNamespace(variables={})},
        parameters={"t": given},
    )
    assert System.limited.fget(system) == {
        "t.delta": CommandLimit(-0.6, 0.6, "rad"),
        "t.n": CommandLimit(-4.0, 7.5, ""),
    }
