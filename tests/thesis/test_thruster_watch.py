"""The detector of failing thrusters: its statistic, in a closed loop, and on a file of the same run."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from support.cse1 import EFFECTS, SHIP
from support.project import ROOT

import cosim
from benchmarks.watch_delay import Told, outcome
from benchmarks.watched_runs import cases
from fmus.actuators.weighted_allocation import solution
from fmus.controller.backstepping import Applied, Inputs
from fmus.signals import Force
from fmus.watch import thruster_watch as watch
from thesis.open_loop import thruster_report
from thesis.watch import main

WATCH = watch.make(EFFECTS, SHIP.description)
F = np.random.default_rng(0).normal(size=(watch.ROWS, 3))


def window(share, axes, since=watch.ROWS):
    """A window in which thrusters lost a share of their force ``since`` so many samples, no noise."""
    rows = []
    for k, f in enumerate(F.tolist()):
        g = [-share * x if axis in axes and k < since else 0.0 for axis, x in enumerate(f)]
        rows.append(watch.WatchedSample(1.0, 100.0 - 0.5 * k, f=tuple(f), g=tuple(g)))
    return tuple(rows)


def test_the_first_sample_comes_after_its_time_and_two_of_the_low_pass():
    """By 0.1 s; a sample each 5 s, or as soon as the low pass has settled."""
    inputs = WATCH.inputs()
    for sample_time, filter_time, first in ((5.0, 1.0, 5.0), (0.5, 1.0, 2.0)):
        p = WATCH.params(sample_time=sample_time, filter_time=filter_time)
        s, times = WATCH.init(inputs, p), []
        while len(times) < 2:
            s, _ = WATCH.step(s, inputs, p, 0.1)
            if s.waited == 0.0:
                times.append(s.time)
        assert times == pytest.approx([first, first + sample_time])


@pytest.mark.parametrize("axes", [(0, 1), (2,)])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_share_and_time_of_a_loss_are_found(axes, share):
    rows = window(share, axes, since=8)
    _, best, lost, since = watch.evidence(rows, watch.Usual(), axes, 0.15)
    assert best > 30.0
    assert lost == pytest.approx(share)
    assert since == pytest.approx(100.0 - 0.5 * 7)
    other = (2,) if axes == (0, 1) else (0, 1)
    assert watch.evidence(rows, watch.Usual(), other, 0.15)[1] == 0.0


@pytest.mark.parametrize("share", [-0.5, 0.1])
def test_more_force_or_a_small_loss_is_no_failure(share):
    assert watch.evidence(window(share, (2,)), watch.Usual(), (2,), 0.15)[1] == 0.0


@pytest.mark.parametrize("share", [0.0, 0.16, 0.2, 0.3])
def test_probability_is_that_of_bayes(share):
    """Of two hypotheses with Gaussian errors: no loss, and the loss that fits best, so rare beforehand."""
    p, usual = WATCH.params(), watch.Usual(judged=1e9)
    size = 0.2  # so that no error counts as an outlier
    rows = tuple(
        row._replace(f=tuple(size * x for x in row.f), g=tuple(size * x for x in row.g))
        for row in window(share, (2,))
    )
    deviation = np.sqrt(usual.square[2] * rows[0].unsure)
    f, g = (np.array([getattr(row, name)[2] for row in rows]) / deviation for name in "fg")
    assert np.abs(g).max() < watch.HUBER
    gain = max(
        np.sum(g[:k] ** 2 - (g[:k] + share * f[:k]) ** 2)
        for k in range(watch.LEAST_ROWS, watch.ROWS + 1)
    )
    before = p.failure_rate * p.sample_time
    odds = before * np.exp(0.5 * gain)
    _, stated = watch.judged(rows, usual, p)
    assert stated.failed[1] == pytest.approx(odds / (1.0 + odds + before), rel=1e-9)


def test_one_bad_sample_counts_little():
    rows = list(window(0.0, (2,)))
    rows[2] = rows[2]._replace(g=(0.0, 0.0, -100.0 * rows[2].f[2]))
    assert watch.evidence(tuple(rows), watch.Usual(), (2,), 0.0)[1] < watch.HUBER**2


def test_usual_is_what_least_squares_with_its_prior_finds():
    p = WATCH.params(memory=1e12)
    rng = np.random.default_rng(1)
    true = rng.normal(size=(3, watch.COUNT))
    usual, z, g = watch.Usual(), rng.normal(size=(40, watch.COUNT)), []
    z[:, 0] = 1.0
    for x in z.tolist():
        g.append(true @ x)
        row = watch.WatchedSample(1.0, nu=tuple(x[1:4]), f=tuple(x[4:]), g=tuple(g[-1].tolist()))
        usual = watch.learned(usual, row, p)
    prior = np.diag((watch.NOISE / np.array(watch.SPREAD)) ** 2)
    expected = np.linalg.solve(z.T @ z + prior, z.T @ np.array(g)).T
    assert np.array(usual.weights) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_what_stands_out_counts_as_three_standard_deviations():
    """Of each mean square, however far it is off; what is less counts as it is."""
    rng = np.random.default_rng(2)
    usual = watch.Usual(square=tuple(rng.uniform(0.5, 2.0, 3)), ratios=tuple(rng.uniform(0.5, 2.0, 2)))

    def means(deviations):
        square, ratios = np.array(usual.square), np.array(usual.ratios)
        error = deviations * np.sqrt(4.0 * square)
        row = watch.WatchedSample(
            error=tuple(error), unsure=4.0, ratios=tuple(deviations**2 * ratios), fair=1.0
        )
        after = watch.learned(usual, row, WATCH.params())
        return np.array([*after.square, *after.ratios]) / [*square, *ratios] - 1.0

    assert means(300.0) == pytest.approx(means(3.0), rel=1e-9)
    assert (means(0.0) < 0.0).all()
    assert means(2.0) == pytest.approx(3.0 / 8.0 * means(3.0))
    assert means(1.0) == pytest.approx(0.0, abs=1e-12)


def test_nothing_is_told_without_the_applied_force():
    c = WATCH
    p, inputs = c.params(), Inputs(applied=Applied())
    state = c.init(inputs, p)
    for k in range(120):
        e = inputs.estimate._replace(u_hat=0.1 * np.sin(k), v_hat=0.05 * np.cos(k))
        state, out = c.step(state, inputs._replace(estimate=e), p, 0.5)
        assert max(out.failed_vsp, out.failed_bow) < 0.5


def test_a_ship_that_force_does_not_move_misses_all_of_it():
    c, tau = WATCH, Force(0.5, -0.3, 0.2)
    p, inputs = c.params(), Inputs(applied=Applied(*tau))
    state = c.init(inputs, p)
    for _ in range(400):
        state, _ = c.step(state, inputs, p, 0.05)
    row = state.rows[0]
    assert row.f == pytest.approx(solution(SHIP.description, tau, p.allocation), rel=1e-6)
    assert row.g == pytest.approx([-f for f in row.f], rel=1e-6)
    assert row.nu == (0.0, 0.0, 0.0)


def test_outcome_counts_alarms_delays_and_thrusters():
    (bow,) = [c for c in cases(6, 0, 1) if (c.thruster, c.share) == ("bow", 1.0)]
    time = 0.1 * np.arange(1, 2401)
    score = np.zeros((time.size, 2))
    score[(time > 60.0) & (time < 65.0), 0] = 0.9  # a false one
    score[time > bow.time + 4.0, 1] = 0.9
    found = outcome([Told(bow, time, score)], 0.5, 1.0)
    assert found.per_hour == pytest.approx(3600.0 / bow.time, rel=0.01)
    assert (found.found, found.right) == (1.0, 1.0)
    assert found.delay == pytest.approx(4.05, abs=0.1)


@pytest.mark.slow
def test_dead_bow_thruster_is_told_in_the_loop_and_from_its_log(tmp_path):
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    content["fmus"]["watch"] = {"path": "watch_thrusters.fmu"}
    content["connections"] += [
        ["observer.*", "watch.*"],
        ["thrusters.tau_cmd_*", "watch.tau_cmd_*"],
    ]
    content["events"] = [
        {
            "time": 90.0,
            "model": "thrusters",
            "variable": "loss_bow",
            "action": "override",
            "value": 1.0,
        }
    ]
    cosim.simulate(cosim.load_scenario(content | {"stop": 110.0}), tmp_path / "run")
    log = cosim.read_log(tmp_path / "run")
    stated = np.flatnonzero(np.maximum(log["watch.failed_bow"], log["watch.failed_vsp"]) > 0.5)
    assert 90.0 < log["time"][stated[0]] < 100.0
    assert (log["watch.failed_bow"][stated] > 0.5).all()
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "out")]) == 0
    found = json.loads((tmp_path / "out" / "watch.json").read_text())
    assert found["thruster"] == "bow"
    assert found["noticed"] == pytest.approx(log["time"][stated[0]], abs=0.02)
    assert found["time"] == pytest.approx(90.0, abs=3.0)
    assert found["confidence"] == pytest.approx(log["watch.failed_bow"].max())
    assert "<svg" in (tmp_path / "out" / "report.html").read_text()


def watched(vsp, bow=()):
    """A run from 1000 s on, of 100 s, in which failures (from, to, probability, share) are told."""
    time = np.arange(0.0, 100.0)
    log = {"time": time, "controller.since": np.maximum(time - 5.0, 0.0)}
    for name, stretches in (("vsp", vsp), ("bow", bow)):
        for what in ("failed", "lost"):
            log[f"controller.{what}_{name}"] = np.full(100, 0.01)
        for first, last, sure, share in stretches:
            log[f"controller.failed_{name}"][first : last + 1] = [
                *np.linspace(0.6, sure, last - first),
                0.55,
            ]
            log[f"controller.lost_{name}"][last - 1] = share
    track = SimpleNamespace(run=SimpleNamespace(time=1000.0 + time))
    source = SimpleNamespace(name="trial", track=track)
    loop = SimpleNamespace(observer={"path": "observer.fmu"})
    return SimpleNamespace(log=log, source=source, loop=loop, notes=["a note"])


def test_failures_are_told_by_their_surest_instant_the_longest_first():
    played = watched([(10, 20, 0.9, 0.25)], [(40, 80, 0.99, 1.0)])
    bow, vsp = thruster_report.alarms(played)
    assert (bow.thruster, bow.since, bow.noticed, bow.until) == ("bow", 1074.0, 1040.0, 1080.0)
    assert (vsp.thruster, vsp.since, vsp.noticed, vsp.until) == ("vsp", 1014.0, 1010.0, 1020.0)
    assert (bow.confidence, bow.lost, vsp.confidence, vsp.lost) == (0.99, 1.0, 0.9, 0.25)
    assert [*thruster_report.sentences(played)] == [
        "Run trial: the bow thruster lost 100 % of its force at 1074 s (probability 0.99, detected at 1040 s, "
        "reported until 1080 s).",
        "Run trial: the VSP lost 25 % of its force at 1014 s (probability 0.9, detected at 1010 s, reported until "
        "1020 s).",
        "a note",
    ]
    content = thruster_report.content(played)
    assert content["alarms"] == [vars(bow), vars(vsp)]
    first = {k: content[k] for k in ("thruster", "time", "noticed", "confidence", "lost")}
    assert first == {
        "thruster": "bow",
        "time": 1074.0,
        "noticed": 1040.0,
        "confidence": 0.99,
        "lost": 1.0,
    }
    assert (content["run"], content["observer"]["path"], content["notes"]) == (
        "trial",
        "observer.fmu",
        ["a note"],
    )
    (section,) = thruster_report.document(played).sections
    (table,) = section.tables
    assert [row[0] for row in table.rows] == ["the bow thruster", "the VSP"]
    for plot, what in zip(section.plots, ("failed", "lost"), strict=True):
        (panel,) = plot.figure.axes
        lines = {line.get_label(): line for line in panel.get_lines()}
        for label, name in (("the VSP", "vsp"), ("the bow thruster", "bow")):
            assert lines[label].get_xdata() == pytest.approx(1000.0 + np.arange(100.0))
            assert lines[label].get_ydata() == pytest.approx(played.log[f"controller.{what}_{name}"])
        assert panel.get_ylim() == (-0.1, 1.1)


def test_of_a_run_without_a_failure_the_largest_probability_is_told():
    played = watched([])
    assert [*thruster_report.sentences(played)] == [
        "Run trial: no failed thruster detected (probability at most 0.01).",
        "a note",
    ]
    content = thruster_report.content(played)
    assert (content["thruster"], content["time"], content["confidence"]) == (None, None, 0.01)
    assert content["alarms"] == thruster_report.document(played).sections[0].tables == []
