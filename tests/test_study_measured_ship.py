"""The study of the real ship: pulls, folds and expectations on made-up inputs, and the whole of it."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat, savemat
from support.closed_form import Allocation, allocate
from support.cse1 import FIVE, Inputs
from support.cse1 import THRUSTERS as COMPONENT
from support.measured import DATA, needs_data, sail
from support.project import ROOT

import diagnosis
from cosim import InputError
from diagnosis import Evaluation, Finding, Findings, Model, PredictionError, omega, session, weak_windows
from diagnosis.execution.progress import silent
from diagnosis.predictors import DescribedShip
from diagnosis.search import Suspect
from fmus.signals import Force, VelocityInCurrent
from studies import measured_ship
from studies.measured import bollard, expected, leave_one_out, ship_tables
from studies.measured.data_folder import measured_files
from studies.measured.expected import BY_HAND, STEERED, Fall
from studies.study_report import Report

CURVE = {"thrust_curve_ahead": 0.2, "thrust_curve_astern": -0.1, "thrust_curve_deadband": 0.2}
COMMANDS = np.linspace(-1.0, 1.0, 11)


def five(run):
    """The commands of both VSP, each with half of the force, and of the bow."""
    x, y, bow = allocate(*run.tau_cmd.T, Allocation())
    return np.column_stack([x / 2, y / 2, x / 2, y / 2, bow])


def windows(commands=None, power=None, seconds=64.0):
    run, _ = sail(seconds, h=0.05)
    given = five(run) if commands is None else commands(run)
    run = replace(run, commands=given, signals=FIVE, power=power)
    return weak_windows(diagnosis.smooth(diagnosis.clean(run)))


# What the propellers give


def test_nominal_force_is_a_straight_line():
    assert bollard.surge_force(Model(), COMMANDS) == pytest.approx(1.165 * COMMANDS)


def test_force_is_that_of_the_fmu_at_rest():
    model = Model().plus(
        {**CURVE, "deadband": 0.05, "loss_surge": 0.1, "plant_F_vsp": 0.2, "inflow_vsp_x": 0.5}
    )
    p = model.drive.params
    for command in COMMANDS:
        inputs = Inputs(Force(1.165 * command, 0.0, 0.0), VelocityInCurrent())
        _, out = COMPONENT.advance(COMPONENT.init(inputs, p), inputs, COMPONENT.prepared(p), 0.01)
        force = bollard.surge_force(model, np.array([command]))
        assert force == pytest.approx([out.tau_act_X], abs=1e-12)


def test_difference_is_none_to_the_model_itself_and_the_factor_is_found():
    model = Model().plus(CURVE)
    pulls = bollard.Pulls(COMMANDS, bollard.surge_force(model, COMMANDS))
    assert bollard.difference(model, pulls) == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    found = bollard.difference(model, pulls._replace(force=1.5 * pulls.force))
    assert found.rms > 0.1
    assert found.factor == pytest.approx(1.5)
    assert found.scaled == pytest.approx(0.0, abs=1e-12)


def test_only_pulls_within_the_range_count():
    far = np.abs(COMMANDS) > bollard.WITHIN
    pulls = bollard.Pulls(COMMANDS, 1.165 * COMMANDS + 9.0 * far)
    assert bollard.difference(Model(), pulls).rms == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"pitch": [0.1], "F_per_vps": [0.1]}, "F_per_vsp"),
        ({"pitch": [0.1, "x"], "F_per_vsp": [0.1, 0.2]}, "not numbers"),
        ({"pitch": [0.9], "F_per_vsp": [1.2]}, "at most 0.7"),
    ],
)
def test_pulls_that_are_none(tmp_path, table, said):
    (tmp_path / "cse1_static").mkdir()
    pd.DataFrame(table).to_csv(tmp_path / bollard.PULLS, index=False)
    with pytest.raises(InputError, match=said):
        bollard.read(tmp_path)


# What bounds the fall


def test_who_steers_is_told_by_the_sway_commands():
    assert leave_one_out.steered(windows())

    def other(run):
        commands = five(run)
        commands[:, 3] += 0.01
        return commands

    assert not leave_one_out.steered(windows(other))


def test_power_that_is_full_changes_nothing():
    w = windows()
    known = np.sqrt(np.mean(omega(w, Model()) ** 2, axis=0))
    assert leave_one_out.at_full_power(w) == pytest.approx(known)
    half = windows(power=np.full((w.run.time.size, 2), 0.5))
    # The smoother takes quick commands for half as strong there.
    assert leave_one_out.at_full_power(half) == pytest.approx(known, rel=0.2)
    assert np.sqrt(np.mean(omega(half, Model())[:, 0] ** 2)) > 1.2 * known[0]


def delayed(time, commands, delay):
    """Mean over each interval of commands (n, k) that are held, ``delay`` [s] ago; zero before the first."""
    edges = np.append(time, 2.0 * time[-1] - time[-2])
    sums = np.vstack([0.0 * commands[:1], np.cumsum(commands * np.diff(edges)[:, None], axis=0)])
    at = np.column_stack([np.interp(edges - delay, edges, column) for column in sums.T])
    return np.diff(at, axis=0) / np.diff(edges)[:, None]


def test_single_commands_explain_what_is_made_of_them_and_nothing_else():
    def crossed(run):
        commands = five(run)
        turn = 0.2 * np.sin(0.7 * run.time)
        return commands + np.column_stack([turn, 0.0 * turn, -turn, 0.0 * turn, 0.0 * turn])

    w = windows(crossed, seconds=160.0)
    model = Model().plus({"delay": 0.2})
    arriving = delayed(w.run.time, w.run.commands[:, [0, 2]], 0.2)
    omega_left = np.random.default_rng(0).normal(size=(w.middle.size, 3))
    omega_left[:, 1] = w.held @ (arriving[:, 0] - arriving[:, 1])
    error = PredictionError(omega_left, np.zeros((0, 3)), None)
    e = Evaluation(DescribedShip(Model()), w, None, error, error, use="test")
    found = leave_one_out.commanded(e, model)
    assert found.single[1] == pytest.approx(1.0)
    assert max(*found.both, found.single[0], found.single[2]) < 0.1


@pytest.mark.parametrize(
    ("fall", "said"),
    [
        (Fall(2.0, 2.2, 2.3, 0.1, 0.9), "noise alone allows 2.3×"),
        (Fall(2.0, 6.0, 99.0, 0.1, 0.9), "do not suffice"),
        (Fall(2.0, 2.2, 99.0, 0.1, 0.9), "90 % .* one common law"),
        (Fall(2.0, float("nan"), 99.0, 0.1, 0.9), "not known"),
    ],
)
def test_reason_follows_the_numbers(fall, said):
    assert re.search(said, expected.reason(fall, 2.5))
    assert "together" not in expected.reason(fall._replace(both=0.8), 2.5)
    assert "VSP" not in expected.reason(fall._replace(single=0.0), 2.5)


def test_targets_are_those_that_the_kept_report_states_for_its_runs():
    """They were set before the study."""
    report = (ROOT / "docs" / "studies" / "measured_ship" / "report.md").read_text("utf-8")
    cell = r" ([^|]*) \|"
    stated = re.findall(rf"^\| \w+, (.+) \| (\w+) \[N(?: m)?\] \|{cell * 4}", report, re.MULTILINE)
    assert {row[:2] for row in stated} == {(k, a) for k in (STEERED, BY_HAND) for a in expected.AXES}
    for kind, axis, *_, fall, target in stated:
        wanted = expected.wanted(axis, kind)
        reached = (
            f"{wanted:g}×: {'' if wanted <= float(fall[:-1]) else 'not '}reached" if wanted else "–"
        )
        assert target == reached


def found(*effects, suspects=()):
    made = []
    for name, value, alike in effects:
        coefficient = {"delay": SimpleNamespace(value=value)}
        made.append(SimpleNamespace(id=name, coefficients=coefficient, indistinguishable=alike))
    named = [SimpleNamespace(name=n, value=v) for n, v in suspects]
    return SimpleNamespace(accepted=made, suspect_coefficients=named)


def test_expectations_say_what_came():
    full = found(
        ("curve_vsp_x(c)", 0.0, []), ("delay", 0.4, []), ("N_r", 1.0, []), suspects=[("Y_r", 0.566)]
    )
    early = found(("deadband", 0.0, ["thrust_curve"]), ("delay", 0.1, []))
    rows = expected.expectations([full, early, found(("lag", 0.3, []))])
    assert [row.came for row in rows] == [
        ["curve_vsp_x(c)", "only as indistinguishable (thrust_curve)", "no"],
        ["Y_r = 0.566", "no", "no"],
        ["N_r", "no", "no"],
        ["0.4 s", "0.1 s, not as expected", "no; lag in its place"],
    ]


def test_error_of_a_model_that_runs_away():
    assert ship_tables.window_error(0.0123, 1000.0) == "12.3"
    assert ship_tables.window_error(float("inf"), 1000.0) == "diverges"
    assert ship_tables.window_error(float("nan"), 1000.0) == "–"


# Folds


def left_out(
    name="run2", before=(4.0, 3.0, 2.0), after=(2.0, 1.0, 4.0), std=((3.0, 4.0, 0.0), (4.0, 3.0, 1.0))
):
    """A fold whose last evaluation is that of the run left out."""
    e = SimpleNamespace(
        name=name,
        before=SimpleNamespace(omega_rms=np.array(before)),
        after=SimpleNamespace(omega_rms=np.array(after)),
        weak_windows="windows",
        smoothed=SimpleNamespace(delay=0.25),
    )
    other = SimpleNamespace(name="learned from")
    comparison = SimpleNamespace(evaluations=[other, e], omega_std=[None, np.array(std)])
    return leave_one_out.LeftOutRun(
        SimpleNamespace(comparison=comparison, learned=SimpleNamespace(model="learned"))
    )


def test_a_fold_is_judged_on_the_run_that_it_leaves_out():
    fold = left_out()
    assert (fold.name, fold.model, fold.seen) == ("run2", "learned", None)
    assert fold.fall == pytest.approx([2.0, 3.0, 0.5])
    assert fold.ceiling == pytest.approx([4.0 / np.sqrt(12.5), 3.0 / np.sqrt(12.5), 2.0 / np.sqrt(0.5)])
    (again,) = measured_ship.with_all([fold], left_out(after=(1.0, 1.0, 1.0)).found)
    assert again.found is fold.found
    assert leave_one_out.fall(again.seen) == pytest.approx([4.0, 3.0, 2.0])


def test_falls_have_all_that_bounds_them(monkeypatch):
    shares = leave_one_out.CommandedShares(np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.5, 0.6]))
    monkeypatch.setattr(ship_tables, "commanded", lambda e, model: shares)
    fold = left_out(std=((1.0, 1.0, 1.0),))
    first, *_, last = ship_tables.falls(replace(fold, seen=left_out(after=(1.0, 1.0, 1.0)).evaluation))
    assert first == Fall(2.0, 4.0, 4.0, 0.1, 0.4)
    assert last == Fall(0.5, 2.0, 2.0, 0.3, 0.6)
    assert np.isnan([x.seen for x in ship_tables.falls(fold)]).all()
    for steered, kind in ((True, STEERED), (False, BY_HAND)):
        monkeypatch.setattr(ship_tables, "steered", lambda w, steered=steered: steered)
        assert ship_tables.kind(fold) == kind


def test_each_run_is_left_out_of_those_learned_from(monkeypatch):
    asked, reported = [], []

    def diagnose(runs, out, prior, advance):
        advance("fit")
        asked.append((runs, out, prior))

    monkeypatch.setattr(diagnosis, "diagnose", diagnose)
    runs = [SimpleNamespace(run=SimpleNamespace(name=n)) for n in "abc"]
    a, b, c = runs
    assert len(measured_ship.learned(runs, 0.1, False, reported.append)) == 3
    assert asked == [([b, c], [a], 0.1), ([a, c], [b], 0.1), ([a, b], [c], 0.1)]
    assert reported == ["without a: fit", "without b: fit", "without c: fit"]
    assert len(measured_ship.learned(runs, None, True, reported.append)) == 1
    monkeypatch.setattr(diagnosis, "gather", lambda files, advance: (files, advance))
    assert leave_one_out.gather(["x", "y"], print) == (["x", "y"], print)


def test_runs_without_commands_of_each_vsp_explain_nothing():
    w = windows()
    joint = replace(
        w,
        smoothed=replace(w.smoothed, track=replace(w.smoothed.track, run=replace(w.run, commands=None))),
    )
    assert not leave_one_out.apart(joint)
    assert not leave_one_out.steered(joint)
    found = leave_one_out.commanded(SimpleNamespace(weak_windows=joint), Model())
    assert [*found.both, *found.single] == [0.0] * 6


# Tables


def reported(tmp_path, write, *given):
    """Text and results of a report with one part."""
    report = Report(tmp_path, "t")
    write(report, *given)
    text = report.write().read_text(encoding="utf-8")
    return text, json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))


def test_findings_are_told_with_their_shares_or_that_there_are_none(tmp_path):
    stability = SimpleNamespace(
        nominal_min_dissipation=0.25, learned_min_dissipation=0.125, bounded=True, region="|r| > 1"
    )
    effect = SimpleNamespace(
        id="lag",
        equation="x = 1 (0, 2)",
        confidence=0.9,
        share_of_error=None,
        indistinguishable=["delay", "Y_r"],
    )
    alone = SimpleNamespace(
        id="N_r", equation="y", confidence=None, share_of_error=0.5, indistinguishable=[]
    )
    suspects = [SimpleNamespace(name="m", value=23.456, z=4.04)]
    content = SimpleNamespace(
        accepted=[effect, alone], suspect_coefficients=suspects, stability=stability
    )
    text, _ = reported(tmp_path, ship_tables.write_findings, "Learned", content)
    assert "## Learned" in text
    assert "| `lag` | x = 1 (0, 2) | 0.90 | 0.00 | delay, Y_r |" in text
    assert "| `N_r` | y | 0.00 | 0.50 | none |" in text
    assert "probably wrong: m = 23.5 (z = 4.0)." in text
    assert "A controller holds the learned ship" in text
    assert "Least dissipation 0.125 1/s (nominal 0.25). Less than nominal: |r| > 1." in text
    content.accepted, content.suspect_coefficients, stability.bounded, stability.region = (
        [],
        [],
        False,
        None,
    )
    text, _ = reported(tmp_path, ship_tables.write_findings, "Learned", content)
    assert "No effect was found." in text
    assert "probably wrong: none." in text
    assert "does not hold the learned ship" in text
    assert "Less than nominal" not in text


def test_expectations_are_told_by_run_with_delays_that_need_no_model(tmp_path):
    made = [
        SimpleNamespace(
            name=name, content=found(("delay", 0.4, [])), evaluation=SimpleNamespace(smoothed=SimpleNamespace(delay=delay))
        )
        for name, delay in (("a", 0.25), ("b", float("nan")))
    ]  # fmt: skip
    text, results = reported(tmp_path, ship_tables.write_expected, made)
    assert "| expected | without a | without b |" in text
    assert "| delay of 0.3 to 0.5 s | 0.4 s | 0.4 s |" in text
    assert "the delay of the commands: a 0.25 s. The" in text
    assert results["late"] == {"a": 0.25, "b": None}
    assert len(results["expected"]) == 4
    text, _ = reported(tmp_path, ship_tables.write_expected, made[1:])
    assert "Pose and commands alone" not in text


def test_the_learned_curve_is_held_against_the_pulls(tmp_path, monkeypatch):
    drawn = {}
    monkeypatch.setattr(
        Report, "figure", lambda report, name, figure, caption: drawn.update({name: figure})
    )
    (tmp_path / "cse1_static").mkdir()
    curved, straight = Model().plus(CURVE), Model()
    pulled = bollard.surge_force(curved, COMMANDS)
    pd.DataFrame({"pitch": COMMANDS, "F_per_vsp": pulled}).to_csv(tmp_path / bollard.PULLS, index=False)
    pulls = bollard.read(tmp_path)
    assert pulls.command == pytest.approx(COMMANDS)
    assert pulls.force == pytest.approx(pulled)
    folds = [SimpleNamespace(name=n, model=straight) for n in "ab"]
    text, results = reported(tmp_path, ship_tables.write_curve, folds, curved, pulls)
    assert "0.000 N learned from all" in text
    assert "the target was 0.1 N: reached." in text
    assert list(results["bollard"]["differences"]) == ["nominal", "all runs", "without a", "without b"]
    assert results["bollard"]["forces"]["all runs"] == pytest.approx(pulled.tolist())
    (axes,) = drawn["bollard"].axes
    lines = {line.get_label(): line for line in axes.get_lines()}
    assert lines["learned"].get_ydata() == pytest.approx(bollard.surge_force(curved, bollard.GRID))
    for name in ("nominal", "learned, one run left out"):
        assert lines[name].get_ydata() == pytest.approx(1.165 * bollard.GRID)
    assert lines["bollard pulls, not learned from"].get_ydata() == pytest.approx(pulled)
    assert lines["learned, one run left out"].get_alpha() < 1.0, "behind the learned line"
    assert (len(axes.get_lines()), len(axes.get_legend().get_texts())) == (5, 4), "folds share a label"
    text, _ = reported(tmp_path, ship_tables.write_curve, folds, straight, pulls)
    assert "the target was 0.1 N: not reached." in text


def test_gaps_of_a_run_are_gaps_of_its_model_error():
    middle = np.array([1.0, 2.0, 5.0, 9.0])
    omega_before, omega_after = np.arange(12.0).reshape(4, 3), -np.arange(12.0).reshape(4, 3)
    e = SimpleNamespace(
        weak_windows=SimpleNamespace(middle=middle),
        before=SimpleNamespace(omega=omega_before),
        after=SimpleNamespace(omega=omega_after),
    )
    figure = ship_tables.model_error_picture(e)
    assert [panel.get_ylabel() for panel in figure.axes] == ["surge [N]", "sway [N]", "yaw [N m]"]
    for k, panel in enumerate(figure.axes):
        before, after = panel.get_lines()
        assert (before.get_label(), after.get_label()) == ("before", "after")
        assert before.get_xdata() == pytest.approx([1.0, 2.0, 5.0, np.nan, 9.0], nan_ok=True)
        gapped = [*omega_after[:3, k], np.nan, omega_after[3, k]]
        assert after.get_ydata() == pytest.approx(gapped, nan_ok=True)
        assert before.get_ydata()[0] == omega_before[0, k]


def test_shares_that_go_with_commands_are_of_blocks_that_were_not_fitted():
    """A force that follows the commands goes with them; one of its own in each block, with none."""
    rng = np.random.default_rng(0)
    w = SimpleNamespace(held=np.eye(400), block=np.repeat(np.arange(8), 50))
    commands = rng.normal(size=(400, 2))
    law = np.column_stack([commands[:, 0], np.abs(commands[:, 1]), rng.normal(size=400)])
    assert leave_one_out._explained(w, law, commands) == pytest.approx([1.0, 1.0, 0.0], abs=0.02)
    half = law + np.column_stack([rng.normal(size=400)] * 2 + [np.zeros(400)])
    assert leave_one_out._explained(w, half, commands)[0] == pytest.approx(0.5, abs=0.1)
    switched = law * np.where(w.block < 4, 1.0, -1.0)[:, None]
    assert leave_one_out._explained(w, switched, commands) == pytest.approx([0.0] * 3, abs=0.02)
    every_other = law * np.where(w.block % 2, 1.0, -1.0)[:, None]
    assert leave_one_out._explained(w, every_other, commands) == pytest.approx([0.0] * 3, abs=0.02)


def test_command_asks_for_its_study(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(measured_ship, "run_study", asked.append)
    measured_ship.main([str(tmp_path)])
    measured_ship.main([str(tmp_path), "--out", str(tmp_path / "out"), "--prior", "0.1", "--quick"])
    assert [[*work.args] for work in asked] == [
        [tmp_path, Path("results/study_measured_ship"), None, False],
        [tmp_path, tmp_path / "out", 0.1, True],
    ]
    assert asked[0].func is measured_ship.study


# The whole


def measure(folder, seeds=(1, 2), seconds=64.0):
    """Files as NTNU's of a ship with a thrust curve, and pulls of its propellers."""
    for part in ("cse1", "cse1_static"):
        (folder / part).mkdir()
    for seed in seeds:
        run, _ = sail(seconds, h=0.05, thrusters=CURVE, seed=seed)
        x, y, psi = run.pose.T
        none = np.zeros_like(x)
        settings = none + 0.4, none + 0.5
        rows = [run.time, x + seed, y, none, none, none, psi, *five(run).T, *settings]
        savemat(folder / "cse1" / f"run{seed}.mat", {"cse1_data": np.array(rows)})
    pulls = {"pitch": COMMANDS, "F_per_vsp": bollard.surge_force(Model().plus(CURVE), COMMANDS)}
    pd.DataFrame(pulls).to_csv(folder / bollard.PULLS, index=False)


@pytest.mark.slow
def test_report_has_all_that_was_learned(tmp_path, monkeypatch):
    measure(tmp_path)
    model = Model().plus(CURVE)
    sure = {name: (value - 0.1, value + 0.1) for name, value in CURVE.items()}
    finding = Finding("thrust_curve", CURVE, sure, 0.9, ["deadband"], 0.8, 0.8, model)
    learned = Findings([finding], [], model, [Suspect("Y_r", 74.0, 0.5)])
    sound = SimpleNamespace(
        driven_on=(),
        nominal_min_dissipation=0.1,
        learned_min_dissipation=0.2,
        bounded=True,
        region=None,
        mass_definite=True,
        closed_loop=True,
        notes=(),
    )
    monkeypatch.setattr(session, "method", lambda _: SimpleNamespace(fit=lambda *_: learned))
    monkeypatch.setattr(session, "check_stability", lambda *_: sound)
    report = measured_ship.study(tmp_path, tmp_path / "out", 1.0, quick=False)
    text = report.read_text(encoding="utf-8")
    results = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    assert set(results["diagnoses"]) == {"without run1", "without run2", "all runs"}
    assert "| `thrust_curve` |" in text
    assert "Y_r = 0.5 (z = 74.0)" in text
    nominal, learned = (results["bollard"]["differences"][n]["rms"] for n in ("nominal", "all runs"))
    assert learned == pytest.approx(0.0, abs=1e-12)
    assert nominal > 0.1
    assert "RMS difference to the pulls at |pitch| ≤ 0.7: 0.000 N" in text
    pictures = [line.split("(")[1].rstrip(")") for line in text.splitlines() if line.startswith("![")]
    assert sorted(pictures) == ["bollard.png", "omega_run1.png", "omega_run2.png"]
    assert {p.name for p in (tmp_path / "out").iterdir()} == {*pictures, "report.md", "results.json"}


def test_folders_without_runs_or_pulls(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(InputError, match="no bollard pulls"):
        measured_ship.study(tmp_path, out, 1.0, quick=False)
    measure(tmp_path, seeds=(1,))
    with pytest.raises(InputError, match="a single run"):
        measured_ship.study(tmp_path, out, 1.0, quick=False)
    assert not out.exists()


def test_bad_input_is_one_line_and_exit_code_2(tmp_path):
    command = [
        sys.executable,
        "-m",
        "studies.measured_ship",
        tmp_path / "nowhere",
        "--out",
        tmp_path / "out",
    ]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert ended.returncode == 2
    assert ended.stderr.startswith("error: no bollard pulls")
    assert ended.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


@needs_data
@pytest.mark.slow
def test_real_ship_is_explained_where_it_was_not_learned_from(tmp_path):
    """Minutes of two runs; of the pulls only the shape counts, as their propeller speed is not known."""
    for name, seconds in (("dptest1", 150.0), ("dptest3", 180.0)):
        rows = loadmat(DATA / "cse1" / f"{name}.mat")["cse1_data"]
        part = (rows[0] >= 100.0) & (rows[0] < 100.0 + seconds)
        savemat(tmp_path / f"{name}.mat", {"cse1_data": rows[:, part]})
    runs = leave_one_out.gather(measured_files(tmp_path), silent)
    (fold,) = measured_ship.learned(runs, 1.0, True, silent)
    assert fold.name == "dptest1"
    assert fold.fall[0] > 2.0
    assert min(fold.fall) > 1.0
    nominal, learned = (
        bollard.difference(m, bollard.read(DATA)).scaled for m in (fold.found.start, fold.model)
    )
    assert learned < nominal
