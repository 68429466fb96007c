"""Reports, pictures and commands of the studies, of numbers and logs that were made up: nothing sails."""

import itertools
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import cosim
from cosim.dispatch import FinishedRun
from fmus.hull import RotationalDamping
from studies.measured import ship_tables
from studies.measured.expected import BY_HAND, STEERED, Fall
from studies.study_report import Report, Verdict
from thesis import (
    analysis,
    chapter5,
    chapter6,
    chapter7,
    estimators,
    improved,
    lost_thrust,
    observer_gains,
    realtime,
)
from thesis.analysis import concurrent_passes
from thesis.basin_trials import chapter6_runs, store_contents, sysid4, trials
from thesis.basin_trials.store_contents import StoreContents
from thesis.error_models import lap_pictures, model_loops
from thesis.observers import claims, estimates_replayed, pictures
from thesis.observers.estimates_replayed import OBSERVERS, SIGNALS
from thesis.tracking.outcome import AXES, LEARNED_FROM, TrackingOutcome
from thesis.tracking.verdict import CONTROLLERS, FOUR, PRINTED


class MadeUp(dict):
    """A log that has every column that is asked for, each another wave."""

    def __init__(self, seconds=198.0, step=0.1, shift=0.0, **columns):
        t = np.arange(round(seconds / step)) * step
        self.shift = shift
        super().__init__({"time": t} | {n.replace("__", "."): 0.0 * t + x for n, x in columns.items()})

    def __missing__(self, name):
        k = sum(map(ord, name)) % 97
        self[name] = 0.1 * np.sin((0.1 + 0.01 * k) * self["time"] + k + self.shift)
        return self[name]


@pytest.fixture
def figures(monkeypatch):
    """Name -> figure and caption of a report, which are not drawn to a file."""
    found = {}

    def keep(report, name, figure, caption):
        if report.draws:
            found[name] = figure() if callable(figure) else figure, caption
        report.picture(f"{name}.png", caption)

    monkeypatch.setattr(Report, "figure", keep)
    return found


@pytest.fixture
def read(monkeypatch):
    """Folders whose logs were read; each log is made up."""
    found = []

    def log(folder):
        found.append(folder)
        made = MadeUp()
        for name in ("controller.z1_x", "controller.z1_y", "controller.z1_psi", *LEARNED_FROM):
            made[name]
        return made

    monkeypatch.setattr(cosim, "read_log", log)
    return found


@pytest.fixture
def drawn(monkeypatch):
    """Folder -> runs whose logs would be drawn."""
    found = {}

    def draw(report, name, runs):
        if report.draws:
            found[name] = set(runs)

    monkeypatch.setattr(Report, "draw", draw)
    return found


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def shown(text):
    """The pictures of a report."""
    return [line.split("](")[1].rstrip(")") for line in text.splitlines() if line.startswith("![")]


def written(report, tmp_path):
    """Text and results of a report, in which nothing is missing."""
    text = report.read_text(encoding="utf-8")
    assert not re.search(r"(?<!\. )\bNone\b", text)
    return text, json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))


# Chapter 5


def test_conditions_of_chapter_5_are_what_they_say():
    made = chapter5.variants("ellipse", 60.0)
    assert set(made["mdf"]) == set(made["kalman"]) == set(made["true"]) == set(CONTROLLERS)
    name = FOUR[0]

    def of(condition):
        content = made[condition][name]
        assert content["fmus"]["controller"]["path"] == f"{name}.fmu"
        assert (content["stop"], content["metrics"]) == (60.0, {"from": 30.0})
        stated = "optional_connections" not in content or bool(content["optional_connections"])
        values = content["fmus"]["controller"].get("parameters", {})
        return values, stated, bool(content["faults"])

    gate, stale = {"tau_max": 1e6}, {"tau_max": 1e6, "stale": 1.0}
    for sense, faults in (("mdf", True), ("true", False)):
        assert of(sense) == ({}, True, faults)
        assert of(f"{sense}, ungated") == (gate, True, faults)
        assert of(f"{sense}, request") == (gate, False, faults)
        assert of(f"{sense}, stale") == (stale, False, faults)
        assert of(f"{sense}, stale, 0.1") == (stale | {"store_weight": 0.1}, False, faults)
    assert made["kalman"][name]["fmus"]["observer"]["path"] == "observer_kalman.fmu"
    assert ["vessel.u", "controller.u_hat"] in made["true"][name]["connections"]


def test_singular_values_are_drawn_down_to_a_ten_millionth(monkeypatch):
    t = np.arange(3.0)
    sigma = np.array([0.0, 1e-3, 1.0])
    monkeypatch.setattr(cosim, "read_log", lambda _: {"time": t, "controller.sigma_min": sigma})
    figure = chapter5.singular_values(Path("logs"), "today")
    drawn = lines(figure.axes[0])
    assert drawn["svd_eps, eight"].get_ydata().tolist() == [1e-7, 1e-3, 1.0]
    styles = [drawn[f"win_z2, {path}"].get_linestyle() for path in chapter5.PATHS]
    assert styles == ["-.", "-"]
    assert drawn["win_z2, eight"].get_color() == drawn["win_z2, ellipse"].get_color() == "magenta"
    assert figure.axes[0].get_yscale() == "log"


def test_report_of_chapter_5(tmp_path, monkeypatch, figures, drawn, read):
    asked = {}

    def run_each(todo, seeds, analyse, processes, advance):
        asked.update(seeds)
        run = TrackingOutcome(True, *[0.1] * 24, phi=(0.1,) * 8)
        return {key: [run for _ in seeds[key]] for key in todo}

    monkeypatch.setattr(chapter5, "run_each", run_each)
    monkeypatch.setattr(chapter5, "run_all", lambda contents, *_: asked.update(dict.fromkeys(contents)))
    text, results = written(chapter5.study(tmp_path, range(5), 60.0, None), tmp_path)
    assert [len(asked["eight", c, FOUR[0]]) for c in ("mdf", "true", "mdf, stale", PRINTED)] == [
        5,
        1,
        3,
        1,
    ]
    assert len(results["claims"]) == 33
    assert "| thesis | today | as printed | numbers and reason |" in text
    assert "eight, against, today: model error (seed 0, Fig. 5.13)" in text
    assert text.index(" of 33 (as printed ") < text.index("Seeds 0-4.")
    assert set(results["outcomes"]) == {"ellipse", "eight"}
    assert set(figures) == {"singular_values_today", "singular_values_printed"}
    assert len(lines(figures["singular_values_today"][0].axes[0])) == 2 * len(FOUR)
    assert len(drawn) == 8
    assert drawn["eight_variants_today"] == {"cl_svd_eps", "svd_eps"} & drawn["eight_variants_today"] | {
        chapter5.short(c) for c in FOUR
    }
    assert {f"{name}/errors.png" for name in drawn} <= set(shown(text))
    assert len(read) == 4 * len(FOUR), "for the singular values"
    assert chapter5.study(tmp_path, range(1), None, None, again=True).read_text("utf-8") == text


# Chapter 6


def test_gains_are_those_of_the_table_times_a_factor():
    assert trials.gains(trials.HARD)["controller.K_d_r"] == trials.HARD["d_r"]
    assert trials.gains(trials.HARD, 2.0)["controller.K_p_x"] == 2.0 * trials.HARD["p_x"]


def found_by(settings, seeds, analyse):
    """What ``run_all`` gives where all runs are alike: one result for each seed."""
    kept = StoreContents(1.0, 0.1, 0.2, 3.0, 0.4)
    alike = trials.Sailed(*[0.0] * 21)._replace(
        position=0.2, cross_track=0.1, swing=0.1, iaew=1.0, along=0.1, lag=-0.1, first=-0.1, omega_X=0.4,
        heading=0.1, iae=1.0, iaewwt=1.0, work=1.0, frequency=0.5, inside=0.1, omega_Y=0.1,
    )  # fmt: skip
    return {
        name: [kept if analyse.__name__ == "store_contents" else alike for _ in seeds]
        for name in settings
    }


def test_report_of_chapter_6(tmp_path, monkeypatch, figures, drawn, read):
    asked = []

    def run_all(settings, seeds, analyse, logs, jobs, advance):
        asked.append((len(settings), list(seeds), logs, jobs))
        return found_by(settings, seeds, analyse)

    monkeypatch.setattr(chapter6_runs, "run_all", run_all)
    text, results = written(chapter6.study(tmp_path, range(5), 0.5, 3), tmp_path)
    trials_, rest, spiked, eight, delayed, stores = asked
    assert trials_ == (4 * 2 * 4, [0], tmp_path / "logs", 3), "logs of the first seed stay"
    assert rest == (4 * 2 * 4, [1, 2, 3, 4], None, 3)
    assert [few[1] for few in (spiked, delayed, stores)] == [[0, 1, 2]] * 3
    assert eight[1] == [0, 1, 2, 3, 4]
    assert stores[2:] == (None, 3)
    assert {len(runs) for each in results["trials"].values() for runs in each.values()} == {5}
    assert list(drawn.values()) == [set(trials.LABELS.values())] * 4
    assert len(shown(text)) == 24
    assert {name for name in figures if name.endswith("_z1")} == set(figures)
    assert set(lines(figures["ellipse_016_1_z1"][0].axes[1])) == set(trials.LABELS.values())
    captions = [text.index(f"(seed 0, Fig. 6.{n})") for n in ("10", "11b", "15b", "19b", "23b", "25")]
    assert captions == sorted(captions)
    assert [path.name for path in read] == ["0"] * 16, "z1 of four controllers in four trials"
    assert len(results["lessons"]) == 13
    assert chapter6.study(tmp_path, range(1), 0.5, 3, again=True).read_text("utf-8") == text
    assert "model error (seed 0, Fig. 6.13)" in text
    assert "Experiments on delay and stores: 3 seeds at most." in text


def test_report_of_chapter_6_without_experiments(tmp_path, monkeypatch, figures, drawn, read):
    monkeypatch.setattr(
        chapter6_runs, "run_all", lambda some, seeds, how, *_: found_by(some, seeds, how)
    )
    text, results = written(chapter6.study(tmp_path, range(1), 0.5, None, None, causes=False), tmp_path)
    assert chapter6.LEFT_OUT in text
    assert len(results["lessons"]) == 6
    assert results["spiked"] == results["stores"] == {}


def test_store_of_a_run_with_spikes():
    log = MadeUp(40.0)
    log["observer.x_m"] = 0.05 * log["time"]
    log["observer.x_m"][[100, 250]] += 0.1
    content = {"fmus": {"controller": {"path": "controller_cl_win_z2.fmu"}}}
    for name in store_contents.logged("controller_cl_win_z2.fmu"):
        log[name]
    held = store_contents.store_contents(FinishedRun(content, log=log))
    assert held.spikes == 2.0
    assert held.time == pytest.approx(20 / 399)
    sigma, state = store_contents.replayed(
        store_contents.controller("controller_cl_win_z2.fmu"), log, {}
    )
    taken = np.array([row.time for row in state.store.rows if row.filled > 0.5])
    assert taken.size > 5
    near = store_contents.echo(taken, np.array([10.0, 25.0]))
    assert held.stored == pytest.approx(near.mean())
    assert held.oldest == pytest.approx((log["time"][-1] - taken[near]).max(initial=0.0))
    assert 0.0 <= held.gained <= 1.0
    assert sigma.size == 400


# Chapter 7 and 7.5


def test_samples_of_the_true_states_have_the_force_of_the_step_before(monkeypatch):
    log = MadeUp(10.0)
    monkeypatch.setattr(cosim, "read_log", lambda _: log)
    s = chapter7.true_samples("run")
    assert (s.nu == np.column_stack([log[f"vessel.{n}"] for n in ("u", "v", "r")])).all()
    assert (s.nu_dot == np.column_stack([log[f"vessel.{n}_dot"] for n in ("u", "v", "r")])).all()
    for k, axis in enumerate(AXES):
        assert (s.tau[1:, k] == log[f"thrusters.tau_cmd_{axis}"][:-1]).all()
    again = lost_thrust.samples(log, "vessel", "", 0.0)
    assert s.omega[log["time"] >= lost_thrust.SETTLED][:, 0] == pytest.approx(
        again.omega[:, 0] + again.tau[:, 0] - s.tau[log["time"] >= lost_thrust.SETTLED][:, 0]
    ), "(7.7) of the same motion, by another force"


def test_scenarios_of_chapter_7():
    made = chapter7.scenarios(40.0)
    basin = {*trials.CONTROLLERS, *(f"{c}_eight" for c in trials.CONTROLLERS)}
    assert set(made) == {*basin, "true", "eight"}
    for name, content in made.items():
        assert content["stop"] == 40.0
        assert set(chapter7.FORCE) <= set(content["log"]["signals"])
        assert bool(content["faults"]) == (name in basin)
        assert ("eight" in name) == ("eight" in content["fmus"]["guidance"]["path"])


def test_last_lap_is_the_last_99_seconds():
    late = np.arange(0.0, 300.0, 0.5) >= 299.5 - improved.LAP
    zero = {f"controller__omega_hat_{a}": 0.0 for a in AXES}
    zero |= {f"{n}_{a}": 0.0 for n in ("vessel__omega_star", "thrusters__tau_act") for a in AXES}
    log = MadeUp(300.0, 0.5, **zero, **{f"thrusters__tau_cmd_{a}": 1.0 for a in AXES})
    log["controller.z1_x"] = np.where(late, np.where(np.arange(600) % 2, 0.3, 0.1), 9.0)
    log["controller.z1_y"] = np.where(late, -0.2, 9.0)
    assert "controller.phi_hat_14" not in log
    lap = improved.last_lap(FinishedRun({}, log=log))
    assert late.sum() == 199
    assert lap.mean == pytest.approx(0.2, abs=1e-3)
    assert lap.size == pytest.approx(np.sqrt(0.05), rel=5e-3)
    assert lap.aside == pytest.approx(0.2)
    assert lap.error == pytest.approx([1.0] * 3), "the thrust that is lost is not estimated"
    assert lap.phi == lap.parts == ()
    for k, true in enumerate(sysid4.PHI, start=1):
        log[f"controller.phi_hat_{k}"] = np.full(600, true + 0.5 * (k == 2) + 0.1 * (k == 12))
    log |= {"vessel.u": np.full(600, 0.1), "vessel.r": np.full(600, 0.0)}
    learned = improved.last_lap(FinishedRun({}, log=log))
    assert learned.parts == pytest.approx((0.05, -0.1, -0.05))
    assert learned.phi[1] == pytest.approx(sysid4.PHI[1] + 0.5)
    with pytest.raises(cosim.SimulationError, match="lost"):
        improved.last_lap(FinishedRun({}, status="failed", message="lost"))


def laps(improved_=0.001, others=0.3):
    phi = {"phi": sysid4.PHI, "parts": (0.1, -0.1, 0.0)}
    return {
        sense: {
            name: [
                improved.Lap(size, abs(size), 0.1 * size, (0.1, 0.1, 0.1), **phi)
                for size in [(improved_ if name in improved.CONTROLLERS[:2] else others) * (1.0 + 1e-4 * k) for k in range(3)]
            ]
            for name in improved.CONTROLLERS
        }
        for sense in improved.SENSES
    }  # fmt: skip


def test_report_of_the_improved_controller(tmp_path, monkeypatch, figures, drawn, read):
    made = laps()

    def runs(todo, seeds, analyse, *_):
        at = {key: tuple(key.split("/")) for key in todo}
        count = {key: len(seeds[key]) if isinstance(seeds, dict) else len(seeds) for key in todo}
        return {key: made[s][n][: count[key]] for key, (s, n) in at.items()}

    monkeypatch.setattr(improved, "run_all", runs)
    monkeypatch.setattr(improved, "run_each", runs)
    text, results = written(improved.study(tmp_path, range(3), 198.0, None), tmp_path)
    assert len(results["laps"]["mdf"][improved.IMPROVED]) == 3
    assert len(results["laps"]["true"][improved.IMPROVED]) == 1
    assert set(figures) == {f"{n}_{s}" for n in ("errors", "model_error") for s in ("mdf", "kalman")}
    assert list(drawn.values()) == [{n.removeprefix("controller_") for n in improved.CONTROLLERS}] * 2
    assert len(shown(text)) == 12
    of = [path.relative_to(tmp_path / "logs").as_posix() for path in read]
    both = ("mdf", "kalman")
    shown_names = [*improved.CONTROLLERS, *improved.CONTROLLERS[:2]]
    assert of == [f"{sense}/{name}/0" for sense in both for name in shown_names]
    assert improved.study(tmp_path, range(1), 1.0, None, again=True).read_text("utf-8") == text
    for k, c in enumerate(improved.SURGE.coefficients):
        line = f"| {c.name} | {c.unit} | {sysid4.PHI[k]:g} | {sysid4.PHI[k]:.3g} ["
        assert line in text
    assert "| mdf | 0.1 [0.1, 0.1] | -0.1 [-0.1, -0.1] | 0 [0, 0] |" in text


def test_pictures_of_laps_show_each_run_in_one_width():
    logs = {"a": MadeUp(20.0), "b": MadeUp(20.0)}
    figure = lap_pictures.errors_picture(logs)
    for panel, name in zip(figure.axes, ("x", "y", "psi"), strict=True):
        drawn = lines(panel)
        assert set(drawn) == set(logs)
        assert {line.get_linewidth() for line in drawn.values()} == {1.0}
        assert (drawn["a"].get_ydata() == logs["a"][f"controller.z1_{name}"]).all()
    figure = lap_pictures.force_picture(logs)
    for panel, axis in zip(figure.axes, AXES, strict=True):
        solid = [line for line in panel.get_lines() if line.get_linestyle() == "-"]
        dashed = [line for line in panel.get_lines() if line.get_linestyle() == "--"]
        assert {line.get_linewidth() for line in panel.get_lines()} == {1.0}
        assert [line.get_color() for line in solid] == [line.get_color() for line in dashed]
        assert (dashed[0].get_ydata() == logs["a"][f"controller.omega_hat_{axis}"]).all()
        low, high = panel.get_ylim()
        assert low < solid[0].get_ydata().min() < solid[0].get_ydata().max() < high
        ends = [
            np.quantile(
                np.concatenate([line.get_ydata()[logs["a"]["time"] > 1.99] for line in kind]),
                [0.005, 0.995],
            )
            for kind in (solid, dashed)
        ]
        first, last = min(ends[0][0], ends[1][0]), max(ends[0][1], ends[1][1])
        assert (0.5 * (low + high), high - low) == pytest.approx(
            (0.5 * (first + last), 2.0 * (last - first) + 0.04)
        )


def test_tracks_lie_over_the_target():
    logs = {"a": MadeUp(20.0), "b": MadeUp(20.0)}
    axes = model_loops.tracks(logs).axes[0]
    drawn = lines(axes)
    assert set(drawn) == {"target", "a", "b"}
    assert (drawn["b"].get_xdata() == logs["b"]["vessel.y"]).all(), "east to the right"
    assert axes.get_aspect() == 1.0
    assert {text.get_fontsize() for text in axes.get_legend().get_texts()} == {7}


# Loss of thrust


def test_failure_rises_in_both_axes_or_is_not_seen():
    log = MadeUp(198.0)
    late = np.where(log["time"] > lost_thrust.FAILS, 0.4, 0.0)
    log |= {"controller.phi_hat_12": 0.0 * late, "controller.phi_hat_13": late}
    log["controller.phi_hat_14"] = 0.5 * late
    assert lost_thrust.seen(lost_thrust.around(log))[0].here == {"Y": True, "N": False}
    log["controller.phi_hat_14"] = late
    assert lost_thrust.seen(lost_thrust.around(log))[0].holds is True


def test_picture_of_the_failure_shows_its_time():
    log = MadeUp(198.0)
    figure = lost_thrust.failure_picture(log)
    assert [panel.get_ylabel() for panel in figure.axes] == [
        "pose [m, m, rad]",
        "z1 [m, m, rad]",
        "ω [N, N, N m]",
        "δ̂",
    ]
    for panel in figure.axes:
        *drawn, fails = panel.get_lines()
        assert [line.get_linewidth() for line in drawn] == [1.0] * 3
        assert list(fails.get_xdata()) == [lost_thrust.FAILS] * 2
        assert fails.get_linewidth() < drawn[0].get_linewidth()
    assert list(lines(figure.axes[-1]))[:3] == list(AXES)


def test_force_late_by_the_delay_is_that_of_earlier_samples():
    log = MadeUp(20.0, 0.05)
    s = lost_thrust.samples(log, "observer", "_hat", 0.45)
    late = log["time"] >= lost_thrust.SETTLED
    assert s.names == ["ellipse"]
    assert (s.time == log["time"][late]).all()
    assert (s.nu[:, 1] == log["observer.v_hat"][late]).all()
    assert (s.nu_dot[:, 1] == log["observer.v_dot_hat"][late]).all()
    assert (s.tau[9:, 2] == log["thrusters.tau_cmd_N"][late][:-9]).all()


def test_passes_go_on_from_where_the_last_one_ended():
    """The truth is where every pass stands; from zero a quicker loss of thrust takes more of the moment."""
    s = lost_thrust.samples(MadeUp(20.0, 0.05), "observer", "_hat", 0.0)
    s.omega[:] = analysis.regressors(s) @ np.array(sysid4.PHI)
    slow, quick = (list(lost_thrust.places(s, pace)) for pace in (0.01, 1.0))
    assert len(quick) == len(slow) == len(lost_thrust.PASSES)
    for k, (count, place) in enumerate(zip(lost_thrust.PASSES, quick, strict=True)):
        phi = np.zeros(14)
        for _ in range(count):
            phi = concurrent_passes.one_pass(phi, concurrent_passes.material(s))
        assert place == pytest.approx((phi[13], phi[8], analysis.explained([s], phi)[2]))
        assert abs(slow[k].delta_N) < abs(place.delta_N)
    assert analysis.NAMES[lost_thrust.N_R] == "N_r"
    assert analysis.NAMES[lost_thrust.DELTA_N] == "delta_N"


def test_estimates_and_paces_of_a_run_are_tried_in_pairs(monkeypatch):
    asked = []
    monkeypatch.setattr(lost_thrust, "samples", lambda log, *how: how)
    monkeypatch.setattr(lost_thrust, "places", lambda s, pace: asked.append((s, pace)) or iter([pace]))
    found = lost_thrust.analyse(FinishedRun({}, log={}))
    assert list(found) == [f"{n}, {p:g}" for n in lost_thrust.ESTIMATES for p in lost_thrust.PACES]
    assert asked == [(how, p) for how in lost_thrust.ESTIMATES.values() for p in lost_thrust.PACES]
    assert found["true states, 1"] == [1.0]
    for analyse in (lost_thrust.analyse, lost_thrust.whole, chapter7.folder):
        with pytest.raises(cosim.SimulationError, match="why"):
            analyse(FinishedRun({}, status="failed", message="why"))
    assert lost_thrust.whole(FinishedRun({}, log={"time": 1.0})) == {"time": 1.0}
    assert [chapter5.done(FinishedRun({}, status=s)) for s in ("done", "failed")] == [True, False]


def test_runs_of_the_lost_thrust_hide_sysid4_or_stop_the_bow_thruster():
    hidden, failing = lost_thrust.scenario(), lost_thrust.failure()
    assert hidden["fmus"]["thrusters"]["parameters"]["loss_yaw"] == 0.31
    assert hidden["fmus"]["controller"]["path"] == "controller_bs.fmu"
    assert {"vessel.r_dot", "observer.u_dot_hat", "thrusters.tau_cmd_N"} <= set(hidden["log"]["signals"])
    (event,) = failing["events"]
    assert (event["time"], event["model"], event["variable"], event["value"]) == (
        140.0,
        "thrusters",
        "loss_bow",
        1.0,
    )
    assert failing["fmus"]["controller"]["path"] == "controller_cl_improved.fmu"
    assert hidden["faults"] == failing["faults"] == []
    for content in (hidden, failing):
        cosim.load_scenario(content)


def test_report_of_the_lost_thrust(tmp_path, monkeypatch, figures):
    at = [lost_thrust.PassResult(d, -1.0 - 2.0 * d, 0.9) for d in (0.1, 0.2, 0.3)]
    given = iter(
        [
            {f"{name}, {pace:g}": at for name in lost_thrust.ESTIMATES for pace in lost_thrust.PACES},
            MadeUp(),
        ]
    )
    asked = []

    def run_all(contents, seeds, analyse):
        asked.append(("events" in contents[""], seeds, analyse))
        return {"": [next(given)]}

    monkeypatch.setattr(lost_thrust, "run_all", run_all)
    text, results = written(lost_thrust.study(tmp_path), tmp_path)
    assert asked == [(False, [0], lost_thrust.analyse), (True, [0], lost_thrust.whole)]
    assert results["line"] == pytest.approx([-2.0, -1.0])
    assert "N_r = -1.00 + -2.00 delta_N; at delta_N = 0.07 it has N_r = -1.14." in text
    assert "The largest distance from it is 0.00 in N_r." in text
    assert len(results["places"]) == len(lost_thrust.ESTIMATES) * len(lost_thrust.PACES)
    assert results["places"]["MDF, 1"][0] == {"delta_N": 0.1, "N_r": -1.2, "r2": 0.9}
    assert results["failure"][0]["thesis"].startswith("When the bow thruster fails")
    assert lost_thrust.study(tmp_path, again=True).read_text("utf-8") == text
    assert "| MDF, force 0.45 s late | 0.25 | 0.100, -1.20, 0.9000 |" in text
    assert set(figures) == {"failure"}


# Observers


def observers(**numbers):
    """Measures of every observer in three runs that are nearly alike."""
    base = dict.fromkeys(
        [f"{m}_{n}" for m in ("lag", "noise", "after_freeze", "after_wrap") for n in ("u", "v", "r")]
        + [f"rms_{s}" for s in SIGNALS]
        + ["held", "stuck"],
        0.1,
    )
    return [
        {o: {k: (numbers.get(o, {}).get(k, x)) * (1.0 + 1e-3 * j * (o != "mdf")) for k, x in base.items()} for o in OBSERVERS}
        for j in range(3)
    ]  # fmt: skip


def test_less_is_surely_less_seed_by_seed():
    def less(a, b):
        found = {"run": [{"x": {"m": i}, "y": {"m": j}} for i, j in zip(a, b, strict=True)]}
        return claims._less(found, "run", "m", "x", "y")

    nan = float("nan")
    assert less([1.0, 1.1, 0.9], [2.0, 2.1, 1.9])
    assert not less([2.0, 2.1, 1.9], [1.0, 1.1, 0.9])
    assert not less([1.0, 1.1, 3.0], [2.0, 2.1, 1.9]), "not sure"
    assert less([1.0], [2.0]), "one seed has no interval"
    assert not less([2.0], [1.0])
    assert not less([nan], [nan])
    assert not less([1.0, nan], [2.0, 2.1]), "not the same seeds"


def test_report_of_the_estimators(tmp_path, monkeypatch, figures):
    swift = {"lag_u": 0.01, "noise_u": 0.2, "after_freeze_u": 0.3, "stuck": 1.0}
    made = observers(
        mdf={"held": 1.0, "after_wrap_r": 0.01, "after_freeze_u": 0.05, "stuck": 0.0},
        df={"held": 0.0, "after_wrap_r": 2.0, "after_freeze_u": 0.1},
        kalman={"rms_u": 0.01},
        nonlinear=swift,
        luenberger=swift,
    )
    monkeypatch.setattr(estimators, "run_all", lambda runs, *_, **__: dict.fromkeys(runs, made))
    monkeypatch.setattr(estimators, "examples", lambda *_: None)
    text, results = written(estimators.study(tmp_path, 3, None, False, None), tmp_path)
    assert [Verdict(**row).holds for row in results["claims"]] == [True] * 6
    assert text.count("| **0.01") == len(results["simulated"]), "the least of each column is bold"
    assert len(results["simulated"]) == 7 + 2 * len(estimators.HIDDEN)


def test_runs_of_the_estimators_differ_by_freezes_upsets_and_what_is_hidden():
    made = estimators.variants(60.0)
    kinds = {name: {fault["kind"] for fault in content["faults"]} for name, content in made.items()}
    assert all(
        ("freeze" in kind) == (", no freezes" not in name and "upsets" not in name)
        for name, kind in kinds.items()
    )
    assert kinds["ellipse, upsets"] > {"dropout", "spikes"}
    assert made["rich, drag"]["fmus"]["vessel"]["parameters"]["delta_X_u"] == -4.0
    assert all(content["stop"] == 60.0 for content in made.values())
    hidden, damping = estimators.HIDDEN["damping"], RotationalDamping()
    assert damping.Y_r + hidden["vessel.delta_Y_r"] == 0.0, "none in sway is left"
    assert damping.N_r + hidden["vessel.delta_N_r"] == pytest.approx(-0.9), "and half of it in yaw"


def test_pictures_of_observers_have_the_truth_on_top():
    log = MadeUp(60.0, 0.05)
    estimates = {o: MadeUp(60.0, 0.05) for o in OBSERVERS}
    for estimate in estimates.values():
        for name in (*SIGNALS, "x_hat", "y_hat", "psi_hat"):
            estimate[name]
    figure = pictures.compared(log, estimates)
    for panel, name in zip(figure.axes, ("u", "v", "r"), strict=True):
        drawn = lines(panel)
        assert [*drawn] == [*OBSERVERS, "truth"]
        assert (drawn["truth"].get_linestyle(), drawn["truth"].get_linewidth()) == ("--", 1.0)
        assert np.ptp(drawn["truth"].get_xdata()) == pytest.approx(20.0, abs=0.1)
        assert (drawn["truth"].get_ydata() == log[f"vessel.{name}"][600:1000]).all()
        assert drawn["kalman"].get_linewidth() > drawn["mdf"].get_linewidth()
    for name in SIGNALS:
        log[f"vessel.{name}"]
    frozen = pictures.freeze(log, estimates, 300, 340)
    assert [len(panel.patches) for panel in frozen.axes] == [1] * 4
    assert pictures.wrap(log, estimates) is None
    log["observer.x_m"], log["observer.y_m"]
    log["observer.psi_m"] = np.angle(np.exp(1j * 0.2 * log["time"]))
    wrapped = pictures.wrap(log, estimates)
    heading = wrapped.axes[2]
    assert heading.get_ylim() == (-3.5, 3.5)
    for panel, name in zip(wrapped.axes[:2], ("x", "y"), strict=True):
        drawn = lines(panel)
        rows = np.searchsorted(log["time"], drawn["truth"].get_xdata())
        assert (drawn["truth"].get_ydata() == log[f"observer.{name}_m"][rows]).all()
        assert (drawn["mdf"].get_ydata() == estimates["mdf"][f"{name}_hat"][rows]).all()


def test_largest_error_after_a_freeze_also_where_the_estimate_is_lost():
    t = np.arange(0.0, 20.0, 0.1)
    log = {"time": t, "vessel.u": 0.0 * t}
    u = np.where((t > 12.0) & (t < 12.5), 0.3, 0.1)
    assert estimates_replayed.peak_after(log, {"u": u}, [115], "u") == pytest.approx(0.3)
    assert estimates_replayed.peak_after(log, {"u": u}, [150], "u") == pytest.approx(0.1)
    u[118] = np.nan
    assert estimates_replayed.peak_after(log, {"u": u}, [115], "u") == np.inf
    assert np.isnan(estimates_replayed.peak_after(log, {"u": u}, [], "u"))


def test_gains_of_the_observers_are_tried_in_pairs():
    log = MadeUp(11.0, 0.05, observer__tau_X=0.0, observer__tau_Y=0.0, observer__tau_N=0.0)
    found = observer_gains.analyse(FinishedRun({}, log=log))
    pairs = itertools.product(observer_gains.CORRECTING, observer_gains.K_2, observer_gains.DAMPING)
    assert list(found) == ["df", "mdf", *(observer_gains.name_of(*pair) for pair in pairs)]
    assert len({b.noise for b in found.values()}) > 10, "other gains, another noise"


def test_verdicts_on_the_gains(tmp_path):
    def made(swift, jumpy):
        names = ["df", "mdf"]
        names += [
            observer_gains.name_of(*pair)
            for pair in itertools.product(
                observer_gains.CORRECTING, observer_gains.K_2, observer_gains.DAMPING
            )
        ]
        corrects = observer_gains.Behaviour(0.1, 0.2 if swift else 0.05, 0.3 if jumpy else 0.1)
        one = dict.fromkeys(names, corrects) | dict.fromkeys(
            names[:2], observer_gains.Behaviour(0.2, 0.1, 0.2)
        )
        return {observer_gains.CLEAN: [one] * 2, observer_gains.FROZEN: [one] * 2}

    for swift, jumpy in itertools.product((True, False), repeat=2):
        rows = observer_gains.claims(made(swift, jumpy))
        assert [row.holds for row in rows] == [swift, jumpy]
        assert next(iter(rows[0].here)) == "(2.8 2)"
    report = Report(tmp_path, "t")
    observer_gains.table(report, made(swift=True, jumpy=True))
    assert "| nonlinear | 6.0 | 9 |" in report.write().read_text(encoding="utf-8")


def test_report_of_the_gains(tmp_path, monkeypatch):
    pairs = itertools.product(observer_gains.CORRECTING, observer_gains.K_2, observer_gains.DAMPING)
    names = ["df", "mdf", *(observer_gains.name_of(*pair) for pair in pairs)]
    one = {n: observer_gains.Behaviour(0.1, 0.2, 0.3) for n in names}

    def run_all(runs, seeds, analyse, processes, advance):
        assert {content["stop"] for content in runs.values()} == {30.0}
        assert (analyse, processes) == (observer_gains.analyse, 2)
        return {name: [one] * len(seeds) for name in runs}

    monkeypatch.setattr(observer_gains, "run_all", run_all)
    text, results = written(observer_gains.study(tmp_path, range(3), 30.0, 2), tmp_path)
    assert "Seeds 0-2." in text
    assert "| df | – | – | 0.1 [0.1, 0.1] | 0.2 [0.2, 0.2] | 0.3 [0.3, 0.3] |" in text
    assert text.count("\n| nonlinear | ") == text.count("\n| luenberger | ") == 8
    assert len(results["claims"]) == 2
    assert set(results["gains"]) == {observer_gains.CLEAN, observer_gains.FROZEN}
    assert observer_gains.study(tmp_path, range(1), 30.0, 2, again=True).read_text("utf-8") == text
    assert "damping ζ = 1 and 0.7" in text
    log = MadeUp(20.0, 0.05, vessel__u=0.1)
    behaviour = observer_gains.behaviour(log, {"u": 0.0 * log["time"] + 0.1})
    assert behaviour.lag == 0.0
    assert np.isnan(behaviour.after_freeze), "there is none"


# Real time


@pytest.mark.parametrize("status", ["done", "failed", "interrupted"])
def test_paced_run_tells_its_lateness(tmp_path, monkeypatch, status):
    (tmp_path / "log.csv").write_text("time\n0\n")
    pace = {"deadline_misses": 3, "lateness_max": 0.5, "jitter_rms": 0.25}
    ended = SimpleNamespace(status=status, message="why", pace=pace)
    monkeypatch.setattr(cosim, "simulate", lambda *_, realtime: ended)
    monkeypatch.setattr(cosim, "load_scenario", lambda content: content)
    content = {"stop": 2.0, "step": 0.01}
    if status == "done":
        assert realtime.run(content, 2.0, tmp_path)[:4] == (3, 200, 0.5, 0.25)
        ended.pace = None
        assert realtime.run(content, None, tmp_path)[:4] == (0, 200, 0.0, 0.0)
    else:
        wrong = KeyboardInterrupt if status == "interrupted" else cosim.SimulationError
        with pytest.raises(wrong):
            realtime.run(content, 2.0, tmp_path)


def test_report_of_the_paced_runs(tmp_path, monkeypatch, figures):
    def run(content, factor, folder):
        log = "other" if factor == 10.0 else "same"
        return realtime.Paced(1, 200, 0.002 * (factor or 0.0), 0.001, log)

    monkeypatch.setattr(realtime, "run", run)
    text, _ = written(realtime.study(tmp_path, 2.0, (1.0, 10.0), ("controller_bs",)), tmp_path)
    assert "| controller_bs | 1 | 1 of 200 | 2 | 1 | same |" in text
    assert "| controller_bs | 10 | 1 of 200 | 20 | 1 | different |" in text
    left, right = figures["pace"][0].axes
    assert lines(left)["controller_bs"].get_ydata() == pytest.approx([1.0, 1.0])
    assert lines(right)["controller_bs"].get_ydata() == pytest.approx([2.0, 20.0])
    assert lines(left)["deadline: one step"].get_ydata() == pytest.approx([10.0, 1.0])
    assert left.get_shared_y_axes().joined(left, right)
    assert realtime.study(tmp_path, 2.0, (), (), again=True).read_text("utf-8") == text


# The real ship


def test_fall_of_the_heading_is_told_beside_that_with_the_run_learned_from(tmp_path):
    def evaluation(fall):
        return SimpleNamespace(
            before=SimpleNamespace(heading=1.0), after=SimpleNamespace(heading=1.0 / fall)
        )

    def said(out, seen):
        report = Report(tmp_path, "t")
        folds = [
            SimpleNamespace(evaluation=evaluation(a), seen=b and evaluation(b))
            for a, b in zip(out, seen, strict=True)
        ]
        ship_tables.write_heading(report, folds)
        return report.write().read_text(encoding="utf-8")

    text = said([1.0, 4.0], [2.0, 8.0])
    assert "2.00× left out, 4.00× with the run in the training data" in text
    assert "no candidate" not in text
    assert "no candidate explains the rotation of the ship" in said([1.0, 1.0], [1.5, 1.5])
    assert "reduction of the heading error" not in said([1.0], [None])


def test_falls_are_told_beside_their_targets(tmp_path, monkeypatch):
    def fold(name, kind, *falls):
        rms = SimpleNamespace(omega_rms=np.array([0.4, 0.3, 0.2]))
        evaluation = SimpleNamespace(weak_windows=None, before=rms, after=rms)
        return SimpleNamespace(name=name, evaluation=evaluation, kind=kind, falls=falls)

    high, low = Fall(8.0, 9.0, 99.0, 0.1, 0.1), Fall(0.5, float("nan"), 99.0, 0.1, 0.1)
    monkeypatch.setattr(ship_tables, "falls", lambda f: f.falls)
    monkeypatch.setattr(ship_tables, "kind", lambda f: f.kind)
    monkeypatch.setattr(ship_tables, "at_full_power", lambda _: [1.0, 2.0, 3.0])
    report = Report(tmp_path, "t")
    ship_tables.write_falls(
        report, [fold("a", STEERED, high, high, high), fold("b", BY_HAND, high, low, low)]
    )
    text, results = written(report.write(), tmp_path)
    assert "| a, dynamic positioning | surge [N] | 0.4 (1) | 0.4 | 8.00× | 4×: reached | 9.00× |" in text
    assert "| b, by hand | surge [N] | 0.4 (1) | 0.4 | 8.00× | – | 9.00× |" in text
    assert "| b, by hand | yaw [N m] | 0.2 (3) | 0.2 | 0.50× | 2.5×: not reached | – |" in text
    assert "it allows 99× or more" in text
    assert "worse than the nominal one in sway of b, yaw of b." in text
    assert "- b, sway (0.50× of 7×): not known." in text
    assert results["falls"]["b"]["axes"]["yaw"]["before_without_power"] == 3.0


def test_windows_are_told_with_those_that_are_worse_or_run_away(tmp_path):
    def errors(position, heading):
        return SimpleNamespace(position=position, heading=heading)

    def fold(name, after, seen):
        evaluation = SimpleNamespace(before=errors(0.1, 0.2), after=after)
        return SimpleNamespace(name=name, evaluation=evaluation, seen=seen and SimpleNamespace(
            before=errors(0.1, 0.2), after=seen
        ))  # fmt: skip

    report = Report(tmp_path, "t")
    better, worse = errors(0.05, 0.1), errors(float("inf"), 0.4)
    ship_tables.write_windows(report, [fold("a", better, better), fold("b", worse, None)])
    text, _ = written(report.write(), tmp_path)
    assert "| a | 100 | 50 | 50 | 11.5 | 5.73 | 5.73 |" in text
    assert "| b | 100 | diverges | – | 11.5 | 22.9 | – |" in text
    for quantity in ("position", "heading"):
        assert (
            f"The prediction error of the {quantity} is larger than with the nominal model in b." in text
        )
    assert "In b the learned model diverges" in text
    assert (
        "Geometric mean of the reduction of the heading error: 1.00× left out, 2.00× with the run"
        in text
    )


# Commands


@pytest.mark.parametrize(
    ("module", "arguments", "given"),
    [
        (chapter5, ["--seeds", "3", "--jobs", "2"], [range(3), None, 2, False]),
        (chapter5, ["--quick"], [range(2), 60.0, None, False]),
        (chapter6, ["--seeds", "3"], [range(3), 1.0, None, None, True, False]),
        (chapter6, ["--quick", "--trials"], [range(2), 0.25, None, None, False, False]),
        (chapter7, ["--quick", "--jobs", "1"], [60.0, 1, None]),
        (improved, ["--again"], [range(10), 198.0, None, True]),
        (lost_thrust, [], [False]),
        (observer_gains, [], [range(3), estimators.STOP, None, False]),
        (observer_gains, ["--quick"], [range(1), estimators.QUICK_STOP, None, False]),
        (
            realtime,
            ["--factor", "2", "5", "--seconds", "3"],
            [3.0, [2.0, 5.0], realtime.CONTROLLERS, False],
        ),
        (realtime, ["--quick"], [2.0, [100.0], realtime.CONTROLLERS, False]),
    ],
)
def test_command_asks_for_its_study(module, arguments, given, monkeypatch, tmp_path, capsys):
    asked = []
    monkeypatch.setattr(module, "run_study", asked.append)
    module.main(["--out", str(tmp_path), *arguments])
    (work,) = asked
    assert work.func is module.study
    assert [*work.args] == [tmp_path, *given]
    with pytest.raises(SystemExit):
        module.main(["--help"])
    name = module.__name__
    assert f"usage: python -m {name} " in capsys.readouterr().out
    module.main(arguments)
    assert asked[1].args[0].as_posix() == f"results/study_{name.rpartition('.')[2]}"
