"""A run that is played to FMUs: what they are fed, what they are connected to, and what is said of it."""

import json
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import InputError
from thesis.open_loop import playback, replay_report
from thesis.open_loop.playback import OpenLoop, Played, fed
from thesis.open_loop.replayed import Replay, replayed, stretches
from thesis.open_loop.run_source import COMMAND, ERRORS, TARGET

H, N = 0.1, 50
NAN = np.nan


def source(tau=None, target=None, time=None, **more):
    time = H * np.arange(N) if time is None else time
    pose = np.column_stack([time, 2.0 * time, 0.1 * time])
    track = SimpleNamespace(run=SimpleNamespace(pose=pose, time=time + 7.0), period=H)
    tau = np.column_stack([np.arange(N), -np.arange(N), 0.5 * np.arange(N)]) if tau is None else tau
    made = {"name": "a", "time": time, "step": H, "track": track, "tau": tau, "target": target, "lost": {},
            "compared": {}}  # fmt: skip
    return SimpleNamespace(**(made | more))


def loop(**more):
    return OpenLoop(
        **({"controller": {"path": "controller_x.fmu"}, "observer": {"path": "observer_mdf.fmu"}} | more)
    )


def targets():
    return np.arange(N)[:, None] + 0.1 * np.arange(len(TARGET))


# What is fed


def test_the_force_is_that_of_the_step_before_and_the_pose_of_now():
    found = fed(source(), loop())
    s = source()
    for k, name in enumerate(("x_m", "y_m", "psi_m")):
        assert found[f"observer.{name}"].tolist() == s.track.run.pose[:, k].tolist()
    for k, name in enumerate(COMMAND):
        assert found[name].tolist() == [s.tau[0, k], *s.tau[:-1, k]]
    assert found.keys() == {"observer.x_m", "observer.y_m", "observer.psi_m", *COMMAND}


def test_what_was_lost_keeps_its_last_value_unless_an_fmu_gives_it():
    tau, target = source().tau.copy(), targets()
    tau[:3], tau[10:13], target[20:22] = NAN, NAN, NAN
    held = fed(source(tau, target), loop())
    assert held[COMMAND[0]][:5].tolist() == [0.0, 0.0, 0.0, 0.0, 3.0]
    assert held[COMMAND[0]][10:15].tolist() == [9.0, 9.0, 9.0, 9.0, 13.0]
    assert held[f"controller.{TARGET[0]}"][19:23].tolist() == [19.0, 19.0, 19.0, 22.0]
    given = fed(source(tau, target), loop(thrusters={"path": "t"}, guidance={"path": "g"}))
    assert np.flatnonzero(np.isnan(given[COMMAND[0]])).tolist() == [0, 1, 2, 3, 11, 12, 13]
    assert np.flatnonzero(np.isnan(given[f"controller.{TARGET[1]}"])).tolist() == [20, 21]


def test_a_recording_has_nan_for_a_pose_and_nothing_for_all_else(tmp_path):
    columns = {"observer.x_m": np.array([1.0, NAN]), "tau_cmd_X": np.array([NAN, 2.0])}
    playback._write(tmp_path / "r.csv", np.array([0.0, 0.5]), columns)
    assert (tmp_path / "r.csv").read_text().split() == [
        "time,observer.x_m,tau_cmd_X", "0.0,1.0,", "0.5,nan,2.0",
    ]  # fmt: skip


def scenario(s, of):
    notes = []
    found = playback._scenario(s, of, "r.csv", fed(s, of), notes)
    return found, notes


def test_an_open_loop_has_the_observer_the_controller_and_what_gives_what_was_lost():
    content, notes = scenario(source(target=targets()), loop(guidance={"path": "g"}))
    assert content["fmus"].keys() == {"observer", "controller"}, "the run has its whole target"
    assert content["connections"] == [["observer.*", "controller.*"]]
    (recording,) = content["recordings"]
    assert recording["inputs"]["observer.tau_X"] == "tau_cmd_X"
    assert recording["inputs"]["controller.tau_cmd_X"] == "tau_cmd_X"
    assert recording["inputs"]["observer.x_m"] == "observer.x_m"
    assert (content["step"], content["stop"], notes) == (H, 4.9, [])
    assert content["log"] == {"signals": ["observer.*", "controller.*"]}
    gaps = targets()
    gaps[3] = NAN
    for target in (gaps, None):
        content, notes = scenario(source(target=target), loop(guidance={"path": "g"}))
        assert content["fmus"]["guidance"] == {"path": "g"}
        assert ["guidance.*", "controller.*"] in content["connections"]
        assert notes == []


@pytest.mark.parametrize("stated", [True, False])
def test_thrusters_limit_what_the_controller_asks(stated):
    content, notes = scenario(source(), loop(thrusters={"path": "t"}, stated=stated))
    links = content["connections"]
    assert ["controller.tau_*", "thrusters.tau_*"] in links
    assert ["thrusters.tau_cmd_*", "observer.tau_*"] in links
    assert (["thrusters.tau_cmd_*", "controller.tau_cmd_*"] in links) == stated
    inputs = content["recordings"][0]["inputs"]
    assert any(n.startswith("controller.tau_cmd") for n in inputs) == stated
    # Without a target the estimate is its own.
    assert ["observer.psi_hat", "controller.psi_t"] in links
    assert "the run has no target" in notes[0]
    alone, notes = scenario(source(), loop())
    assert (len(alone["connections"]), notes) == (1, []), "a detector needs none"


def test_an_observer_is_told_how_often_it_gets_a_measurement():
    s = source()
    s.track.period = 0.3000000000001
    found = playback._paced(loop(), s)
    assert found == {"path": "observer_mdf.fmu", "parameters": {"measurement_period": 0.3}}
    s.track.period = 0.01
    assert playback._paced(loop(), s)["parameters"] == {"measurement_period": H}
    for other in ("observer_mdf.fmu", {}), ("other_mdf.fmu", None), ("observer_none.fmu", None):
        entry = {"path": other[0]} | ({} if other[1] is None else {"parameters": other[1]})
        assert playback._paced(loop(observer=entry), s) is entry


@pytest.mark.parametrize("status", ["done", "failed", "interrupted"])
def test_a_run_is_played_until_its_end(monkeypatch, status):
    seen = {}

    def simulate(content, folder):
        seen["recording"] = Path(content["recordings"][0]["path"]).read_text().splitlines()
        return SimpleNamespace(status=status, message="it broke", folder=folder)

    monkeypatch.setattr(playback.cosim, "load_scenario", lambda content: content)
    monkeypatch.setattr(playback.cosim, "simulate", simulate)
    monkeypatch.setattr(playback.cosim, "read_log", lambda folder: {"time": folder.name})
    uneven = H * np.arange(N)
    uneven[5] += 1e-3
    if status == "done":
        found = playback.play(source(time=uneven), loop())
        assert (found.log, len(seen["recording"])) == ({"time": "out"}, N + 1)
        assert found.notes == [f"samples are not regular: steps of {H} s"]
        assert found.loop.observer["parameters"] == {"measurement_period": H}
        assert playback.play(source(), loop()).notes == []
    else:
        with pytest.raises(KeyboardInterrupt if status == "interrupted" else InputError):
            playback.play(source(), loop())


def test_samples_are_regular_within_rounding():
    assert playback._regular(source())
    assert playback._regular(source(time=H * np.arange(N) + 1e-10))
    uneven = H * np.arange(N)
    uneven[5] += 1e-6
    assert not playback._regular(source(time=uneven))


def test_a_signal_at_a_sample_is_that_of_the_last_row_before():
    log = {"time": np.array([0.0, 0.1, 0.2, 0.35]), "s": np.array([1.0, 2.0, 3.0, 4.0])}
    s = SimpleNamespace(time=np.array([-0.1, 0.0, 0.1 - 1e-12, 0.15, 0.34, 0.35, 9.0]))
    assert Played(s, loop(), log, []).at_samples("s").tolist() == [1.0, 1.0, 2.0, 2.0, 3.0, 4.0, 4.0]


# What a replay shows


def replay(
    log=None, spikes=(1.0, 3.0), stored=(1.5, 2.5), blocked=None, own=True, lost=None, compared=None
):
    time = H * np.arange(N)
    log = {"time": time, "controller.z": time**2, **(log or {})}
    s = source(lost=lost or {}, compared=compared or {})
    played = Played(s, loop(own=own), log, ["a note"])
    blocked = np.zeros(N, bool) if blocked is None else blocked
    return Replay(played, np.array(spikes), np.array(stored), blocked)


@settings(max_examples=20)
@given(
    st.lists(st.floats(0.0, 10.0), max_size=4), st.lists(st.floats(0.0, 12.0), min_size=1, max_size=9)
)
def test_near_is_within_a_second_after_a_spike(spikes, times):
    found = replay(spikes=sorted(spikes)).near(np.array(times))
    for t, near in zip(times, found, strict=True):
        since = [t - s for s in spikes if t - s > -1e-9]
        if not any(abs(x - 1.0) < 1e-8 or abs(x) < 1e-8 for x in since):
            assert near == any(0.0 <= x < 1.0 for x in since)


def test_shares_are_of_the_time_the_samples_and_the_updates_near_a_spike():
    time = H * np.arange(N)
    rate = {"controller.by_store": time, "controller.by_now": 0.0 * time}
    r = replay(rate)
    near = np.array([(1.0 <= round(t, 9) < 2.0) or (3.0 <= round(t, 9) < 4.0) for t in time])
    found = r.spike_share
    assert found["time"] == pytest.approx(near.mean())
    assert found["stored"] == 0.5
    assert found["by_store"] == pytest.approx(time[near].sum() / time.sum())
    assert np.isnan(found["by_now"])
    none = replay(stored=()).spike_share
    assert np.isnan(none["stored"])
    assert np.isnan(none["by_store"])


def test_agreement_is_the_largest_difference_where_the_run_has_the_signal():
    z = (H * np.arange(N)) ** 2
    lost = z + 0.1
    lost[3:], lost[0] = NAN, z[0] - 0.3
    compared = {"z": lost, "y": np.full(N, NAN), "tau_cmd_X": np.zeros(N)}
    r = replay({"thrusters.tau_cmd_X": np.full(N, -2.0)}, compared=compared)
    assert r.agreement == pytest.approx({"z": 0.3, "tau_cmd_X": 2.0})


def test_spikes_and_jumps_after_a_gap_are_found_with_what_was_stored_and_blocked():
    s = source()
    no = np.zeros(N, bool)
    spikes, valid, frozen, dropped = (no.copy() for _ in range(4))
    spikes[[4, 9]], valid[4], frozen[20:23], dropped[30:], dropped[22] = True, True, True, True, True
    s.track.valid, s.track.frozen, s.track.dropped = valid, frozen, dropped
    s.prepared = SimpleNamespace(smoothed=SimpleNamespace(spikes=spikes))
    at = np.where(np.arange(N) < 10, 0.0, np.where(np.arange(N) < 25, 0.9, 2.4))
    log = {"time": s.time, "controller.stored_at": at, "controller.beta": np.linspace(0.0, 1.0, N)}
    found = replayed(Played(s, loop(), log, []))
    assert found.spikes == pytest.approx([0.4, 2.3])
    assert found.stored.tolist() == [0.9, 2.4]
    assert found.blocked.tolist() == (np.linspace(0.0, 1.0, N) < 0.5).tolist()
    plain = replayed(Played(s, loop(), {"time": s.time}, []))
    assert plain.stored.size == plain.blocked.sum() == 0


@given(st.lists(st.booleans(), max_size=12))
def test_stretches_are_where_a_mask_holds(mask):
    rows = [k for a, b in stretches(np.array(mask, bool)) for k in range(a, b + 1)]
    assert rows == [k for k, m in enumerate(mask) if m]
    found = stretches(np.array(mask, bool))
    assert all(b + 1 < c for (_, b), (c, _) in pairwise(found))


# The report


def reported(own=True, lost=None):
    time = H * np.arange(N)
    log = {
        "controller.phi_hat_X": time, "controller.phi_hat_Y": 2.0 * time, "controller.sigma_min": 0.1 * time,
        "controller.stored": time, "controller.by_store": time, "controller.by_now": time,
    }  # fmt: skip
    blocked = np.zeros(N, bool)
    blocked[5:10] = True
    z = time**2
    return replay(
        log, blocked=blocked, own=own, lost=lost, compared={"z": z + 0.25, "w": np.full(N, NAN)}
    )


def test_the_content_has_what_was_recovered_stored_and_blocked():
    lost = np.zeros(N, bool)
    lost[:7] = True
    stated = replay_report.content(reported(lost={"z": lost}))
    assert stated["recovered"] == {"z": 7}
    assert stated["phi_hat"] == pytest.approx({"phi_hat_X": 4.9, "phi_hat_Y": 9.8})
    assert stated["sigma_min"] == pytest.approx(0.49)
    assert stated["stored"]["count"] == 2
    assert stated["spikes"]["count"] == 2
    assert stated["blocked"] == {"share": 0.1, "times": [[0.5, pytest.approx(0.9)]]}
    assert stated["agreement"] == pytest.approx({"z": 0.25})
    assert (stated["samples"], stated["step"], stated["own_controller"]) == (N, H, True)
    assert replay_report.content(replay())["sigma_min"] is None


def test_the_sentences_say_what_was_lost_and_learned():
    lost = np.zeros(N, bool)
    lost[:7] = True
    first, second, third, fourth, last = replay_report.sentences(reported(lost={"z": lost}))
    assert first == "Run a: samples recovered: z 7."
    assert second == "The replayed signals differ from those in the run by at most 0.25 (z)."
    assert third == "2 samples stored, learning blocked 10 % of the time; 2 spikes and jumps."
    assert fourth.startswith("Within a second after one: 40 % of the time, 50 % of the stored samples, ")
    assert last == "a note"
    other = [*replay_report.sentences(reported(own=False))]
    assert other[0] == "Run a: nothing was lost."
    assert other[1].startswith("The run was made with another controller")
    plain = [*replay_report.sentences(replay(compared={"z": np.full(N, NAN)}))]
    assert plain == ["Run a: nothing was lost.", "a note"]


def test_the_series_has_every_signal_at_the_samples_of_the_run(tmp_path):
    lost = np.zeros(N, bool)
    lost[0] = True
    replay_report.write_series(tmp_path / "replay.csv", reported(lost={"z": lost}))
    head, first, *_, end = (tmp_path / "replay.csv").read_text().split()
    names = ["phi_hat_X", "phi_hat_Y", "sigma_min", "stored", "by_store", "by_now"]
    assert head == ",".join(["time", *(f"controller.{n}" for n in names), "recovered.z"])
    assert first.split(",")[0] == "7.0", "by the clock of the run"
    assert [first[-1], end[-1]] == ["1", "0"]
    assert len((tmp_path / "replay.csv").read_text().split()) == N + 1


def test_rows_are_of_what_can_be_compared():
    lost = np.zeros(N, bool)
    lost[:3] = True
    rows = replay_report._rows(reported(lost={"z": lost}))
    assert [row[:2] for row in rows] == [["z", 3], ["w", 0]]
    assert rows[0][2] == "0.25"


def test_pictures_have_a_panel_for_each_signal_with_what_was_blocked_and_stored():
    r = reported()
    figure = replay_report._over_time(r, ("sigma_min", "by_store"))
    for panel, name in zip(figure.axes, ("sigma_min", "by_store"), strict=True):
        line, marks = panel.get_lines()
        assert line.get_ydata() == pytest.approx(r.played.log[f"controller.{name}"])
        assert marks.get_xdata() == pytest.approx([1.5, 2.5])
        assert panel.get_ylabel() == name
        (shade,) = panel.patches
        assert shade.get_window_extent().width > 0.0
    assert [p.get_xlabel() for p in figure.axes] == ["", "time [s]"]
    lost = np.arange(N) % 2 == 0
    compared = np.where(lost, NAN, 1.0)
    r = replay({"thrusters.tau_cmd_X": np.zeros(N)}, lost={"z": lost}, compared={"z": compared})
    figure = replay_report._signals(r, ("z", "tau_cmd_X"))
    dots, line = figure.axes[0].get_lines()
    assert dots.get_xdata() == pytest.approx((H * np.arange(N))[1::2])
    assert line.get_ydata() == pytest.approx((H * np.arange(N)) ** 2)
    assert len(figure.axes[1].get_lines()) == 1


# The FMUs to play a run to


SCENARIO = {
    "fmus": {
        "observer": {"path": "observer_kalman.fmu", "parameters": {"a": 1.0}, "step": 0.1},
        "guidance": {"path": "guidance_ellipse.fmu"},
        "controller": {"path": "controller_abs.fmu", "parameters": {"K": 2.0}},
        "thrusters": {"path": "thrusters.fmu", "parameters": {"l_vsp": 0.5, "loss_bow": 0.3}},
        "vessel": {"path": "vessel.fmu", "parameters": {"m": 9.0}},
    },
    "connections": [["thrusters.tau_cmd_X", "controller.tau_cmd_X"], ["vessel.x", "observer.x_m"]],
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A log of this project, with the scenario that made it."""
    (tmp_path / "log.json").write_text(json.dumps({"scenario": SCENARIO}))
    allocated = SimpleNamespace(allocation_parameters={"l_vsp"})
    monkeypatch.setattr(playback, "ship", lambda: allocated)
    return tmp_path


def test_the_fmus_of_a_log_are_its_own_and_never_its_plant(folder):
    found = playback.loop_of(folder, "abs", None, None)
    assert found.controller == SCENARIO["fmus"]["controller"]
    assert found.observer == {"path": "observer_kalman.fmu", "parameters": {"a": 1.0}}
    assert found.guidance == {"path": "guidance_ellipse.fmu"}
    assert found.thrusters == {"path": "thrusters.fmu", "parameters": {"l_vsp": 0.5}}
    assert (found.stated, found.own) == (True, True)
    assert playback.loop_of(folder / "log.csv", "abs", None, None) == found
    assert playback.loop_of(folder / "log.csv", "abs", "kalman", None) == found


def test_another_controller_or_observer_is_not_that_of_the_run(folder):
    other = playback.loop_of(folder, "cl_win", None, None)
    assert (other.controller, other.own, other.stated) == (
        {"path": "controller_cl_win.fmu"},
        False,
        True,
    )
    seen = playback.loop_of(folder, "abs", "mdf", None)
    assert (seen.observer, seen.own) == ({"path": "observer_mdf.fmu"}, False)
    silent = {**SCENARIO, "connections": SCENARIO["connections"][1:]}
    (folder / "log.json").write_text(json.dumps({"scenario": silent}))
    assert not playback.loop_of(folder, "abs", None, None).stated, "it was not told in the run"
    assert playback.loop_of(folder, "cl_win", None, None).stated


@pytest.mark.parametrize("text", ["{", "[]", "{}", None])
def test_without_a_scenario_the_usual_fmus_are_taken(folder, text):
    (folder / "log.json").unlink() if text is None else (folder / "log.json").write_text(text)
    found = playback.loop_of(folder, "abs", None, None)
    assert found.observer == {"path": "observer_mdf.fmu"}
    assert (found.guidance, found.own, found.stated) == (None, False, True)
    assert found.thrusters == {"path": "thrusters.fmu", "parameters": {}}
    (folder / "log.json").write_text(json.dumps({"scenario": SCENARIO}))
    assert playback.loop_of(folder / "a.csv", "abs", None, None).guidance is None, (
        "no log of this project"
    )


def test_a_scenario_that_is_given_counts_in_place_of_the_run_s(folder, monkeypatch):
    given = json.loads(json.dumps(SCENARIO))
    given["fmus"]["observer"]["path"] = "../own.fmu"
    model = SimpleNamespace(model_dump=lambda mode, by_alias: given)
    monkeypatch.setattr(playback.cosim, "load_scenario", lambda path: model)
    found = playback.loop_of(folder, "abs", None, folder / "s" / "scenario.json")
    assert found.observer["path"] == str((folder / "own.fmu").resolve())
    assert not found.own


def test_a_detector_takes_the_place_of_the_controller(folder):
    found = playback.watch_loop(folder, "watch_thrusters", None, None)
    assert found.controller == {"path": "watch_thrusters.fmu"}
    assert (found.guidance, found.thrusters, found.stated) == (None, None, True)
    assert found.observer["path"] == "observer_kalman.fmu"


@pytest.mark.parametrize(
    ("name", "path"),
    [("abs", "controller_abs.fmu"), ("controller_abs", "controller_abs.fmu"), ("abs.fmu", "abs.fmu"),
     ("watch_x", "watch_x.fmu")],
)  # fmt: skip
def test_a_bare_name_is_an_fmu_of_the_project(name, path):
    assert playback._path(name, "controller") == path
    assert playback._path("some/own.fmu", "controller") == str(Path("some/own.fmu").resolve())


def test_the_page_has_pictures_of_what_was_learned(monkeypatch):
    monkeypatch.setattr(replay_report, "_signals", lambda r, names: names)
    monkeypatch.setattr(replay_report, "_over_time", lambda r, names: tuple(names))
    r = reported(lost={"z": np.ones(N, bool)})
    r.played.log.update({f"controller.phi_hat_{k}": np.zeros(N) for k in range(19)})
    page = replay_report.document(r)
    assert page.lead == "Run a: samples recovered: z 50."
    first, errors, learning = page.sections
    assert first.text == [*replay_report.sentences(r)][1:]
    assert [p.figure for p in errors.plots] == [ERRORS[:3], ERRORS[3:], COMMAND]
    names = replay_report.estimates(r)
    assert len(names) == 21
    shown = [p.figure for p in learning.plots]
    assert shown == [
        replay_report.OMEGA,
        tuple(names[:8]),
        tuple(names[8:16]),
        ("sigma_min", "by_store", "by_now"),
    ]
    assert page.provenance["lost"] == "z"
    plain = replay_report.document(replay())
    assert plain.provenance["lost"] == "nothing"
    assert [p.figure for p in plain.sections[2].plots] == [replay_report.OMEGA]
