"""The study of the thrust allocation: pushes of a ship whose turn is known in closed form."""

import json

import numpy as np
import pytest

import cosim
from thesis import allocation
from thesis.allocation import Push

BIAS = 0.02  # m; where a push does not turn the ship if the thrust acts where it is assumed


def heading(content):
    """The ship turns by what the force is off its resistance, with the square of time, from any heading."""
    given = content["fmus"]["thrusters"]["parameters"]
    t = np.arange(0.0, content["stop"] + 1e-9, 0.01)
    force = content["events"][0]["value"]
    return t, 0.7 + 0.1 * force * (given["attack_point_dx"] + BIAS - given["p_x"]) * t**2


@pytest.fixture
def pushed(monkeypatch):
    """Pushes that were made."""
    made = []
    monkeypatch.setattr(allocation, "headings", lambda content: made.append(content) or heading(content))
    return made


def test_a_push_is_a_force_to_the_side_and_noise_and_nothing_else():
    content = allocation.scenario(0.1, 0.05, Push(0.4, 2.0, 0.001), 7)
    (event,), (fault,) = content["events"], content["faults"]
    assert (event["model"], event["variable"], event["value"], event["time"]) == (
        "thrusters",
        "tau_Y",
        0.4,
        0.0,
    )
    assert event["action"] == "override"
    assert (fault["kind"], fault["signals"], fault["std"]) == ("noise", ["observer.psi_m"], 0.001)
    assert (content["seed"], content["stop"]) == (7, 2.0)
    assert content["fmus"]["thrusters"]["parameters"] == {"p_x": 0.1, "attack_point_dx": 0.05}
    cosim.load_scenario(content)


def test_turn_is_half_of_what_both_sides_differ_by(pushed):
    push = Push(force=0.5, seconds=2.0)
    assert allocation.turn(0.1, 0.3, push, 0) == pytest.approx(0.1 * 0.5 * (0.3 + BIAS - 0.1) * 4.0)
    assert [content["events"][0]["value"] for content in pushed] == [0.5, -0.5]
    allocation.turn(0.1, 0.3, push, 1)
    assert [content["seed"] for content in pushed] == [0, 1, 2, 3], "the noise of two does not cancel"
    assert allocation.turn(0.3 + BIAS, 0.3, push, 0) == pytest.approx(0.0)


@pytest.mark.parametrize("hidden", [-0.05, 0.0, 0.18])
def test_the_point_is_found_at_which_a_push_does_not_turn(hidden, pushed):
    found, tried = allocation.tune(hidden, Push(), 0)
    assert found == pytest.approx(hidden + BIAS, abs=1e-4)
    assert [p for p, _ in tried[:2]] == [-allocation.REACH, allocation.REACH]
    assert len(pushed) == 2 * len(tried), "no push is made twice"
    assert len({p for p, _ in tried}) == len(tried)


def test_a_point_out_of_reach_is_told(pushed):
    with pytest.raises(cosim.SimulationError, match="no point of attack within"):
        allocation.tune(0.5, Push(), 0)


def test_headings_are_those_of_a_run_that_went_through(monkeypatch):
    class Ended:
        status, message = "done", "why"

    log = {"time": np.arange(3.0), "observer.psi_m": np.array([3.0, -3.0, -2.9])}
    monkeypatch.setattr(cosim, "load_scenario", lambda content: content)
    monkeypatch.setattr(cosim, "simulate", lambda scenario, folder: Ended)
    monkeypatch.setattr(cosim, "read_log", lambda folder: log)
    t, psi = allocation.headings({})
    assert t.tolist() == [0.0, 1.0, 2.0]
    assert psi == pytest.approx([3.0, 2.0 * np.pi - 3.0, 2.0 * np.pi - 2.9]), "without a jump by a turn"
    Ended.status = "failed"
    with pytest.raises(cosim.SimulationError, match="a push failed: why"):
        allocation.headings({})


def test_report_has_the_error_against_the_shift(tmp_path, pushed, monkeypatch):
    drawn = {}
    monkeypatch.setattr(
        allocation.Report,
        "figure",
        lambda self, name, figure, caption: (
            drawn.update({name: (figure, caption)}) if self.draws else None
        ),
    )
    text = allocation.study(tmp_path, range(2), Push(), (-0.05, 0.0, 0.18)).read_text("utf-8")
    found = json.loads((tmp_path / "results.json").read_text("utf-8"))["found"]
    assert {dx: len(t["points"]) for dx, t in found.items()} == dict.fromkeys(
        ("-0.050", "+0.000", "+0.180"), 2
    )
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith(("| -0.", "| +0."))]
    assert [row[0] for row in rows] == ["| -0.050", "| +0.000", "| +0.180"]
    assert all(abs(float(row[2].split()[0])) < 0.2 for row in rows), "millimetres, the bias taken off"
    assert "p_o = 0.0200 m" in text
    pairs = sum(content["events"][0]["value"] > 0.0 for content in pushed)
    assert f"It took {pairs / 6:.1f} pairs" in text
    figure, caption = drawn["heading"]
    before, after = figure().axes[0].get_lines()
    assert (before.get_label(), after.get_label()) == ("p_o = 0", "p_o = 0.200 m")
    assert before.get_ydata()[-1] == pytest.approx(np.degrees(0.7 + 0.1 * 0.3 * 0.2 * 9.0))
    assert after.get_ydata()[-1] == pytest.approx(np.degrees(0.7), abs=0.01)
    assert "+0.18 m away (Fig. 6.7)" in caption
    again = allocation.study(tmp_path, (), Push(force=9.0), (), again=True)
    assert "commanded 0.3 N" in again.read_text("utf-8").replace("\n", " "), "the push of the results"


def test_command_asks_for_its_pushes(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(allocation, "run_study", asked.append)
    for arguments in ([], ["--quick", "--force", "0.5", "--hidden", "0.1", "0.2"], ["--seeds", "5"]):
        allocation.main(["--out", str(tmp_path), *arguments])
    assert [[*work.args] for work in asked] == [
        [tmp_path, range(3), Push(), list(allocation.HIDDEN), False],
        [tmp_path, range(1), Push(force=0.5), [0.1, 0.2], False],
        [tmp_path, range(5), Push(), list(allocation.HIDDEN), False],
    ]
    assert asked[0].func is allocation.study
