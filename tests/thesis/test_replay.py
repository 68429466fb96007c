"""``thesis.replay``: a run through observer and controller FMUs open loop gives what was lost."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from support.project import ROOT

import cosim
from fmus.controller import cl_win_eps
from fmus.controller.backstepping import Applied, acting
from fmus.declare import packer, variables
from fmus.ship import ship
from fmus.signals import Force
from thesis.open_loop import gather_source, loop_of, play
from thesis.open_loop.playback import COMMAND, OpenLoop, fed, watch_loop
from thesis.replay import main

LOST = [f"{stem}_{axis}" for stem in ("thrusters.tau_cmd", "controller.tau") for axis in "XYN"]
LOST += [f"controller.z1_{axis}" for axis in ("x", "y", "psi")]


@pytest.fixture(scope="module")
def voyage(tmp_path_factory):
    """The eight with concurrent learning that is told the force that acts; 30 % of it lost."""
    folder = tmp_path_factory.mktemp("replay") / "eight"
    content = json.loads((ROOT / "scenarios" / "eight.json").read_text())
    content["fmus"]["controller"] = {"path": "controller_cl_win_eps.fmu", "parameters": {"tau_max": 1.0}}
    content["connections"].append(["thrusters.tau_cmd_*", "controller.tau_cmd_*"])
    spikes = {"kind": "spikes", "signals": ["observer.x_m", "observer.y_m"], "size": 0.1, "at": [9.0]}
    content |= {"stop": 14.0, "metrics": {}, "faults": [*content["faults"], spikes]}
    cosim.simulate(cosim.load_scenario(content), folder)
    whole = pd.read_csv(folder / "log.csv")
    gone = np.random.default_rng(0).random(len(whole)) < 0.3
    blanked = whole.copy()
    blanked.loc[gone, LOST] = np.nan
    blanked.to_csv(folder / "log.csv", index=False)
    return folder, whole, gone


@pytest.mark.slow
def test_what_was_lost_comes_back_exactly(voyage, tmp_path):
    folder, whole, gone = voyage
    assert main([str(folder), "--controller", "cl_win_eps", "--out", str(tmp_path)]) == 0
    found = pd.read_csv(tmp_path / "replay.csv")
    for name in [*LOST, "controller.phi_hat_2", "controller.sigma_min", "controller.omega_hat_N"]:
        assert (found[name] == whole[name]).all(), name
    for name in LOST:
        assert (found[f"recovered.{name.partition('.')[2]}"] == gone).all()
    stated = json.loads((tmp_path / "replay.json").read_text())
    assert stated["recovered"] == {n.partition(".")[2]: int(gone.sum()) for n in LOST}
    assert max(stated["agreement"].values()) == 0.0
    assert stated["own_controller"]
    assert stated["applied_force"]
    assert stated["blocked"]["share"] == pytest.approx((whole["controller.beta"] < 0.5).mean())
    assert stated["stored"]["count"] == whole["controller.stored_at"].diff().gt(0.0).sum() > 3
    assert any(abs(t - 9.0) < 0.011 for t in stated["spikes"]["times"])
    assert 0.0 < stated["spike_share"]["time"] < 0.5
    assert "<svg" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_another_controller_on_the_same_run(voyage):
    """Its errors are those of the run, as it sees the same ship and target; what it learns is not."""
    folder, whole, _ = voyage
    played = play(gather_source(folder), loop_of(folder, "abs", None, None))
    assert (played.at_samples("controller.z1_x") == whole["controller.z1_x"]).all()
    assert not (played.at_samples("controller.phi_hat_2") == whole["controller.phi_hat_2"]).all()


@pytest.mark.slow
def test_run_without_target_and_with_irregular_samples(voyage, tmp_path, capsys):
    """A plain file: rows missing, 20 Hz, no target; learning by eps goes on all the same."""
    _, whole, _ = voyage
    rows = whole.iloc[::5].drop(index=whole.index[100:200:15], errors="ignore")
    names = {"time": "time", "observer.x_m": "x", "observer.y_m": "y", "observer.psi_m": "psi"}
    names |= {f"thrusters.tau_cmd_{a}": f"tau_{a}" for a in "XYN"}
    rows[list(names)].rename(columns=names).to_csv(tmp_path / "run.csv", index=False)
    out = tmp_path / "out"
    assert main([str(tmp_path / "run.csv"), "--controller", "cl_win_eps", "--out", str(out)]) == 0
    stated = json.loads((out / "replay.json").read_text())
    assert stated["recovered"] == {}
    assert stated["stored"]["count"] > 0
    assert any("no target" in note for note in stated["notes"])
    assert "other controller" in capsys.readouterr().out.replace("\n", " ")


@pytest.mark.parametrize(
    ("arguments", "stated"),
    [
        (["--controller", "clx"], "no FMU 'controller_clx'"),
        (["--controller", "vessel.fmu"], "connections"),
        (["--controller", "abs", "--scenario", "none.json"], "no such scenario"),
    ],
)
def test_bad_input_is_one_message(tmp_path, capsys, arguments, stated):
    t = 0.05 * np.arange(400)
    columns = {"time": t, "x": np.sin(t), "y": np.cos(t), "psi": 0.1 * t}
    columns |= {f"tau_{axis}": np.sin(0.3 * t) for axis in "XYN"}
    pd.DataFrame(columns).to_csv(tmp_path / "run.csv", index=False)
    out = tmp_path / "out"
    assert main([str(tmp_path / "run.csv"), *arguments, "--out", str(out)]) == 2
    assert stated in capsys.readouterr().err
    assert not out.exists()


def test_applied_force_counts_only_where_it_is_told():
    asked = Force(1.0, 2.0, 3.0)
    assert acting(Applied(), asked) == asked
    assert acting(Applied(0.0, 0.0, 0.0), asked) == Force()


def test_controller_learns_by_the_force_that_is_told():
    """A request beyond the gate's 2 N blocks; the force that acts, which is smaller, does not."""
    c = cl_win_eps.COMPONENT
    p = packer(c.params)([v.start for v in variables(c.params)])
    far = c.inputs()
    far = far._replace(target=far.target._replace(x_t=5.0))
    for inputs, beta in ((far, 0.0), (far._replace(applied=Applied(1.0, 0.0, 0.0)), 1.0)):
        state = c.init(inputs, p)
        for _ in range(3):
            state, out = c.step(state, inputs, p, 0.01)
        assert out.learning.beta == beta


def test_a_loop_is_that_of_the_log_but_for_what_is_named(tmp_path):
    """Observer, guidance, law and what the allocation believes are of the run; the plant never is."""
    believed, plant = sorted(ship().allocation_parameters)[0], "loss_bow"
    assert plant not in ship().allocation_parameters
    fmus = {
        "observer": {"path": "observer_df.fmu", "parameters": {"b": 2.0}, "step": 0.1},
        "guidance": {"path": "guidance_ellipse.fmu"},
        "controller": {"path": "controller_cl_win_eps.fmu", "parameters": {"K_p_x": 0.7}},
        "thrusters": {"path": "thrusters.fmu", "parameters": {believed: 1.5, plant: 9.0}},
        "vessel": {"path": "vessel.fmu", "parameters": {"m": 20.0}},
    }
    content = {"fmus": fmus, "connections": [["thrusters.tau_cmd_X", "controller.tau_cmd_X"]]}
    (tmp_path / "log.json").write_text(json.dumps({"scenario": content}))
    eyes = {"path": "observer_df.fmu", "parameters": {"b": 2.0}}
    drive = {"path": "thrusters.fmu", "parameters": {believed: 1.5}}
    for run in (tmp_path, tmp_path / "log.csv"):
        own = loop_of(run, "cl_win_eps", None, None)
        assert own == OpenLoop(fmus["controller"], eyes, drive, fmus["guidance"], True, True)
    assert loop_of(tmp_path, "cl_win_eps", "df", None).own, "the observer of the run by its name"
    other = loop_of(tmp_path, "controller_bs", "observer_mdf.fmu", None)
    mdf = {"path": "observer_mdf.fmu"}
    assert other == OpenLoop({"path": "controller_bs.fmu"}, mdf, drive, fmus["guidance"], True, False)
    content["connections"] = []
    (tmp_path / "log.json").write_text(json.dumps({"scenario": content}))
    assert not loop_of(tmp_path, "cl_win_eps", None, None).stated, "its own controller was told nothing"
    assert loop_of(tmp_path, "cl_win_eps", "mdf", None).stated, "one that saw something else is told"
    watch = watch_loop(tmp_path, "watch_thrusters", None, None)
    assert watch == OpenLoop({"path": "watch_thrusters.fmu"}, eyes, None, None, True, False)
    for text in ("{", "[]", "{}"):  # cut off
        (tmp_path / "log.json").write_text(text)
        plain = {"path": "thrusters.fmu", "parameters": {}}
        found = loop_of(tmp_path, str(tmp_path / "mine.fmu"), None, None)
        assert found == OpenLoop({"path": str(tmp_path / "mine.fmu")}, mdf, plain, None, True, False)
    beside = loop_of(tmp_path / "other.csv", "bs", None, None)
    assert beside.observer == mdf, "a log of another tool beside one of ours"


def test_what_is_fed_is_held_where_it_is_lost_and_forces_are_those_of_the_step_before():
    nan = np.nan
    tau = np.array([[1.0, 0.0, 0.0], [nan, 2.0, 0.0], [3.0, nan, 0.5]])
    pose = np.arange(9.0).reshape(3, 3)
    run = SimpleNamespace(run=SimpleNamespace(pose=pose))
    source = SimpleNamespace(tau=tau, track=run, target=None)
    loop = OpenLoop({}, {})
    found = fed(source, loop)
    held = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
    assert np.column_stack([found[name] for name in COMMAND]).tolist() == held.tolist()
    assert [found[f"observer.{n}"].tolist() for n in ("x_m", "y_m", "psi_m")] == pose.T.tolist()
    assert len(found) == 6
    target = np.where(np.arange(27).reshape(3, 9) == 10, nan, 1.0 * np.arange(27).reshape(3, 9))
    source.target = target
    assert fed(source, loop)["controller.y_t"].tolist() == [1.0, 1.0, 19.0]
    guided = fed(source, replace(loop, guidance={}, thrusters={}))
    np.testing.assert_array_equal(guided["controller.y_t"], [1.0, nan, 19.0])
    np.testing.assert_array_equal(guided[COMMAND[0]], [1.0, 1.0, nan])
