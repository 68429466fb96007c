"""A described ship through the diagnosis: its commands, its predictions, and what is hidden in its runs."""

import importlib
import json
from dataclasses import replace

import numpy as np
import pytest

import cosim
import diagnosis
from benchmarks import ship_effects
from benchmarks.ship_effects import Cause, causes, sail
from cosim import InputError
from diagnosis import propose_columns
from diagnosis.predictors import Model, Windows, ship_with
from diagnosis.predictors.thrust import Response
from diagnosis.runs import read, read_frame
from thesis import analysis


@pytest.fixture(scope="module")
def ship():
    return ship_with((), "otter")


@pytest.fixture(scope="module")
def run(ship):
    return sail(ship, Cause("", {}, {}), np.random.default_rng(5), None, seconds=120.0)


def test_commands_are_read_by_actuator_and_unit(ship, run, tmp_path):
    revolutions = run.rename(columns={"port.n": "port.n [rpm]", "starboard.n": "starboard.n [rad/s]"})
    revolutions["port.n [rpm]"] *= 60.0
    revolutions["starboard.n [rad/s]"] *= 2.0 * np.pi
    run.to_csv(tmp_path / "run.csv", index=False)
    from_file, from_table = read(tmp_path / "run.csv", of=ship), read_frame(revolutions, "run", ship)
    assert from_file.signals == ("port.n", "starboard.n")
    np.testing.assert_allclose(from_table.commands, from_file.commands, rtol=1e-12)
    np.testing.assert_allclose(from_file.commands, run[["port.n", "starboard.n"]], rtol=1e-12)


def test_columns_of_a_described_ship_are_proposed(run, tmp_path, capsys):
    """Commands by nearly their names and in other units are found, and then read as they were meant."""
    other = run.rename(columns={"port.n": "Port n [rpm]", "starboard.n": "STARBOARD_N"})
    other["Port n [rpm]"] *= 60.0
    other.to_csv(tmp_path / "run.csv", index=False)
    command = [str(tmp_path / "run.csv"), "--ship", "otter", "--write"]
    assert propose_columns.main(command) == 0
    stated = json.loads((tmp_path / "run.csv.json").read_text())["columns"]
    assert stated == {"port.n": {"name": "Port n [rpm]", "unit": "rpm"}, "starboard.n": "STARBOARD_N"}
    found = read(tmp_path / "run.csv", of=ship_with((), "otter"))
    np.testing.assert_allclose(found.commands, run[["port.n", "starboard.n"]], rtol=1e-9)


def test_force_of_the_commands_is_that_of_the_two_propellers(ship, run):
    found = read_frame(run, "run", ship)
    thrust = np.where(found.commands > 0.0, 0.43742, 0.25444) * found.commands * abs(found.commands)
    port, starboard = thrust.T
    np.testing.assert_allclose(found.tau_cmd[:, 0], port + starboard, atol=1e-9)
    np.testing.assert_allclose(found.tau_cmd[:, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.tau_cmd[:, 2], 0.395 * (port - starboard), atol=1e-9)


def test_no_window_begins_while_actuators_may_follow_commands_from_before_the_run(ship, run):
    """The Otter's propellers lag by 1 s. What they were commanded before the log is not known."""
    model, (w,) = (
        Model(ship=ship),
        diagnosis.gather([read_frame(run, "run", ship)], model=Model(ship=ship)),
    )
    after = w.run.time[0] + 3.0 * 1.0
    assert (w.middle - 0.5 * w.width).min() >= after - 1e-9
    assert Windows([w.smoothed], w.horizon).start.min() >= after
    began, lasts = w.middle - 0.5 * w.width, w.middle + 0.5 * w.width
    held, rest = (
        Response(w.run, model, moving).means(np.stack([began, lasts]))[1] for moving in (True, False)
    )
    unknown = np.abs(w.run.commands[0])
    assert (unknown > 1.0).all(), "the first command is not zero, or this test shows nothing"
    assert (np.abs(held - rest).max(axis=(0, 1)) <= 0.05 * unknown).all()
    assert (np.abs(held - rest).max(axis=(0, 1)) > 0.0).all()


def test_the_described_lag_is_not_reported_as_a_delay(ship, run):
    (w,) = diagnosis.gather([read_frame(run, "run", ship)], model=Model(ship=ship))
    for delay, reported in ((0.4, False), (1.5, True)):
        notes = replace(w.smoothed, delay=delay, late=True).notes
        assert any("after they are given" in note for note in notes) == reported


@pytest.mark.parametrize(
    ("columns", "stated"),
    [
        ({"port.n": "prot.n"}, "no column 'port.n'; did you mean 'prot.n'"),
        ({"port.n": "a", "starboard.n": "b"}, "no commands: port.n, starboard.n"),
        ({"port.n": "port.n [kg]"}, "'kg' is not a unit of port.n"),
    ],
)
def test_a_wrong_column_is_told_in_one_line(ship, run, columns, stated):
    with pytest.raises(InputError, match=stated.replace(".", r"\.")):
        read_frame(run.rename(columns=columns), "run", ship)


def test_commands_far_beyond_their_limit_are_refused_and_say_since_when(ship, run):
    """Beyond its limit a command counts as the limit: a change of its unit midway would be learned."""
    other = run.copy()
    half = len(other) // 2
    other.loc[half:, "port.n"] *= 60.0
    first = run["time"][int(np.argmax(np.abs(other["port.n"]) > 3.0 * 16.541))]
    assert first >= run["time"][half]
    since = (
        rf"port\.n reaches .* times its limit, .*from {first:.4g} s on; probably its unit changes there"
    )
    with pytest.raises(InputError, match=since):
        diagnosis.load(other, ship="otter")
    other.loc[:half, "port.n"] = 0.0  # nothing has another unit before
    with pytest.raises(InputError, match="s on; probably it is in another unit"):
        diagnosis.load(other, ship="otter")
    requested = run.copy()
    requested["port.n"] *= 1.5  # a request that was logged before it was clipped
    assert diagnosis.load(requested, ship="otter")


@pytest.mark.parametrize(
    ("read_as", "stated", "fix"),
    [
        (lambda n: n / 16.541, "are in shares of the limits", {"factor": 16.54}),
        (lambda n: -n, "commands have the wrong sign", {"flip": True}),
    ],
)
def test_commands_in_another_unit_or_sign_are_told_with_what_mends_them(
    run, tmp_path, read_as, stated, fix
):
    table = run[run["time"] < 40.0].copy()
    names = ["port.n", "starboard.n"]
    table[names] = read_as(table[names])
    table.to_csv(tmp_path / "run.csv", index=False)
    with pytest.raises(InputError) as error:
        diagnosis.load(tmp_path / "run.csv", ship="otter")
    assert stated in str(error.value)
    line = {"columns": {n: {"name": n} | fix for n in names}}
    assert f"put {json.dumps(line)} into" in str(error.value)


def test_force_columns_are_commands_too(ship, run):
    """A run that tells forces is one of the commands that the ship's allocation gives for them."""
    found = read_frame(run, "run", ship)
    forces = run[["time", "x", "y", "psi"]].copy()
    for k, name in enumerate(("tau_X", "tau_Y", "tau_N")):
        forces[name] = found.tau_cmd[:, k]
    (by_force,), (by_command,) = (diagnosis.load(t, ship="otter") for t in (forces, run))
    a, b = (
        diagnosis.evaluate([w], Model(ship=ship)).evaluations[0].before for w in (by_force, by_command)
    )
    np.testing.assert_allclose(a.omega, b.omega, atol=1e-6 * np.abs(found.tau_cmd).max())


def test_the_exact_model_predicts_what_was_simulated(ship, monkeypatch):
    """Simulation step by step and prediction of windows are two ways to the same motion."""
    monkeypatch.setattr(ship_effects, "NOISE", (2e-4, 2e-4, 2e-4))
    run = sail(ship, Cause("", {}, {}), np.random.default_rng(6), None, seconds=120.0)
    (w,) = diagnosis.load(run, ship="otter")
    (e,) = diagnosis.evaluate([w], Model(ship=ship)).evaluations
    assert e.before.position < 5e-3  # of some 5 m


@pytest.mark.slow
def test_a_weak_port_propeller_is_named(ship):
    rng = np.random.default_rng(3)
    runs = [sail(ship, causes(ship)["loss"], rng, None, seconds=120.0) for _ in range(2)]
    found = diagnosis.diagnose(runs[:1], runs[1:], prior=0.0, ship="otter").content
    assert found.verdict == "found"
    (effect,) = found.effects
    assert effect.id == "loss_port"
    assert "port propeller" in found.sentence
    low, high = effect.coefficients["loss_port"].ci95
    assert low < 0.15 < high


def test_python_takes_the_ship_from_the_log(tmp_path):
    """Without a word about it, and refuses runs of several ships."""
    otter = cosim.simulate("otter_waypoints", tmp_path / "otter", stop=40.0, pictures=False)
    runs = diagnosis.load(otter)
    assert runs[0].run.ship == ship_with((), "otter").description
    assert diagnosis.evaluate(runs).evaluations[0].model.ship.scale == ship_with((), "otter").scale
    other = cosim.simulate("ellipse", tmp_path / "ellipse", stop=30.0, pictures=False)
    with pytest.raises(InputError, match="of several ships"):
        diagnosis.load([otter, other])
    with pytest.raises(InputError, match="of several ships: otter, cse1"):
        diagnosis.evaluate([*runs, *diagnosis.load(other)])


@pytest.fixture(scope="module")
def otter_log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("analysed") / "otter"
    options = {"vessel.X_u": -60.0}
    cosim.simulate("otter_waypoints", folder, stop=60.0, pictures=False, set=options)
    return folder


def test_model_error_of_the_analyses_is_that_of_the_ship(otter_log):
    """Relative to its own nominal model, of which the drag alone is another."""
    (s,) = analysis.gather_samples([otter_log], "smoothed", of=ship_with((), "otter"))
    nominal = ship_with((), "otter").parameters["vessel"]["X_u"].start
    missing = (-60.0 - nominal) * s.nu[:, 0]
    np.testing.assert_allclose(np.median(s.omega[:, 0] / missing), 1.0, atol=0.1)
    assert analysis.as_model(np.zeros(3), np.zeros((3, 0)), [], ship_with((), "otter")).vessel == {
        f"map_{axis}_1": 0.0 for axis in "XYN"
    }


@pytest.mark.slow
@pytest.mark.parametrize("start", [40.0, 40.07])
def test_a_propeller_that_dies_late_in_one_short_run_is_no_curve_over_the_speed(tmp_path, start):
    """The ship is slow from then on alone; without noise an edge that is off by a row would count."""
    options = {"thrusters.port_outage_start_1": start, "thrusters.port_outage_end_1": 70.0}
    log = tmp_path / "run"
    cosim.simulate("otter_zigzag", log, stop=70.0, pictures=False, set=options)
    (found,) = diagnosis.diagnose(diagnosis.load(log)).content["effects"]
    assert found["id"] == "port_failure"
    assert found["confidence"] > 0.95
    (time,) = found["coefficients"].values()
    assert time["value"] == pytest.approx(start, abs=0.015), "commands act at steps of 0.02 s"


@pytest.fixture(scope="module")
def cybership2_log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cybership2") / "run"
    cosim.simulate("ellipse_bs", folder, stop=60.0, pictures=False, ship="cybership2")
    return folder


@pytest.mark.parametrize(("name", "more"), [("pca", []), ("pls", ["--recipe", "PLS1"])])
def test_analyses_without_a_model_of_their_own_take_any_ship(
    cybership2_log, tmp_path, capsys, name, more
):
    command = importlib.import_module(f"diagnosis.{name}").main
    assert command([str(cybership2_log), "--out", str(tmp_path / "out"), *more]) == 0
    assert "the ship is cybership2" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "more"), [("sysid", []), ("watch", []), ("replay", ["--controller", "abs"])]
)
def test_analyses_of_the_thesis_model_refuse_another_ship(otter_log, tmp_path, capsys, name, more):
    command = importlib.import_module(f"diagnosis.{name}").main
    assert command([str(otter_log), "--out", str(tmp_path / "out"), *more]) == 2
    assert "is of otter; this analysis supports cse1 only" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
