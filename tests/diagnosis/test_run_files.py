"""The files of a planned run (diagnosis/design/run_files.py): a scenario, a table of commands, a picture."""

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest

import cosim
from cosim.scenario import find_scenario
from diagnosis.design import run_files
from diagnosis.design.run_files import MEASURED, TARGET, draw, write_run
from diagnosis.predictors.thrust import LONGEST_STEP

N = 5


class Fine:
    """A motion in fine steps whose numbers tell where they are from."""

    def __init__(self, h, orders=None):
        self.time = h * np.arange(N)
        self.eta = 1.0 + np.arange(3.0 * N).reshape(N, 3)
        self.eta_dot, self.eta_ddot = 100.0 + self.eta, 200.0 + self.eta
        self.orders = orders

    def thrust(self, model):
        assert model == "likeliest"
        return 300.0 + self.eta


def designer(orders=None, scale=1.0, seconds=20.0):
    asked = []

    def motions(plans, size, h):
        asked.extend((steps, size, h) for steps in plans)
        numbers = None if orders is None else 400.0 + np.arange(2.0 * N).reshape(N, 2)
        return [Fine(h, numbers) for _ in plans]

    return SimpleNamespace(
        scale=scale,
        orders=orders,
        model="likeliest",
        motions=motions,
        asked=asked,
        data=[SimpleNamespace(smoothed=SimpleNamespace(noise=np.array([0.1, 0.2, 0.3])))],
        limits=SimpleNamespace(seconds=seconds),
    )


def written(d, folder, number=2, ship=None):
    found = SimpleNamespace(steps="steps", size="size")
    write_run(d, found, number, folder, ship)
    with (folder / f"commands_{number}.csv").open() as file:
        header, *rows = csv.reader(file)
    return json.loads((folder / f"scenario_{number}.json").read_text()), header, np.array(rows, float)


@pytest.mark.parametrize("scale", [1.0, 4.0])
def test_a_controller_follows_set_points_with_the_force_that_is_needed(tmp_path, scale):
    d = designer(scale=scale)
    content, header, rows = written(d, tmp_path)
    h = LONGEST_STEP * scale
    assert d.asked == [("steps", "size", h)]
    assert header == ["time", *TARGET, "tau_X", "tau_Y", "tau_N"]
    fine = Fine(h)
    expected = np.column_stack([fine.time, fine.eta, fine.eta_dot, fine.eta_ddot, 300.0 + fine.eta])
    assert rows == pytest.approx(expected, rel=1e-6)
    (recording,) = content["recordings"]
    assert recording["path"] == "commands_2.csv"
    assert recording["inputs"] == {f"controller.{n}": n for n in TARGET}, "tau is for a real ship"
    assert content["roles"] == {"target": ["controller.x_t", "controller.y_t", "controller.psi_t"]}
    ellipse = json.loads(find_scenario("ellipse").read_text())
    assert {*content["fmus"]} == {*ellipse["fmus"]} - {"guidance"}
    assert content["connections"] == [
        c for c in ellipse["connections"] if c[0].partition(".")[0] != "guidance"
    ]
    assert "ship" not in content


def test_thrusters_follow_orders_and_the_track_stands_beside(tmp_path):
    orders = SimpleNamespace(names=["rudder.delta", "propeller.n"])
    content, header, rows = written(designer(orders), tmp_path, ship="kvlcc2")
    assert header == ["time", "x", "y", "psi", *orders.names]
    fine = Fine(LONGEST_STEP)
    assert rows[:, 1:4] == pytest.approx(fine.eta)
    assert rows[:, 4:] == pytest.approx(400.0 + np.arange(2.0 * N).reshape(N, 2))
    assert content["recordings"][0]["inputs"] == {f"thrusters.{n}": n for n in orders.names}
    assert content["ship"] == "kvlcc2"
    assert "guidance" not in content["fmus"]
    assert content["fmus"]["thrusters"]["parameters"] == {}
    assert not any("guidance." in name for c in content["connections"] for name in c)


@pytest.mark.parametrize("seconds", [20.0, 20.03])
def test_a_run_begins_where_its_track_does_and_lasts_whole_steps(tmp_path, seconds):
    content, *_ = written(designer(seconds=seconds), tmp_path, 7)
    assert content["fmus"]["vessel"]["parameters"] == {"x_0": 1.0, "y_0": 2.0, "psi_0": 3.0}
    assert content["name"] == "next_7"
    assert content["step"] == LONGEST_STEP
    assert content["stop"] == pytest.approx(seconds, abs=0.5 * LONGEST_STEP)
    assert content["stop"] / LONGEST_STEP == pytest.approx(
        round(content["stop"] / LONGEST_STEP), abs=1e-6
    )
    (noise,) = content["faults"]
    assert noise == {"kind": "noise", "signals": MEASURED, "std": [0.1, 0.2, 0.3]}
    assert content["metrics"] == {}
    assert cosim.load_scenario({**content, "recordings": []}).name == "next_7"


@pytest.mark.quick
def test_a_picture_has_the_basin_the_target_and_the_tracks_by_each_hypothesis(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(run_files, "hulls", lambda poses, outline: drawn.append(poses) or [np.eye(4, 2)])
    from matplotlib.figure import Figure

    figures, save = [], Figure.savefig
    monkeypatch.setattr(
        Figure, "savefig", lambda self, *a, **k: figures.append(self) or save(self, *a, **k)
    )
    eta = np.column_stack([np.arange(100.0), -np.arange(100.0), np.zeros(100)])
    tracks = np.stack([eta, eta + 1.0])
    d = SimpleNamespace(basin=SimpleNamespace(north=(-1.0, 9.0), east=(-4.0, 5.0)), outline="outline")
    k = SimpleNamespace(hypotheses=[SimpleNamespace(name=n) for n in ("none", "X_u", "lag")])
    spread = SimpleNamespace(ids=[1, 2], eta=[tracks, 2.0 * tracks])
    draw(d, k, SimpleNamespace(eta=eta), spread, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 1000
    (axes,) = figures[0].axes
    lines = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
    assert lines["basin"].tolist() == [[-4.0, -1.0], [5.0, -1.0], [5.0, 9.0], [-4.0, 9.0], [-4.0, -1.0]]
    assert lines["target"] == pytest.approx(eta[:, [1, 0]])
    assert lines["start"].tolist() == [[eta[0, 1], eta[0, 0]]]
    assert lines["under X_u"] == pytest.approx(tracks[0][:, [1, 0]])
    assert lines["under lag"] == pytest.approx(2.0 * tracks[0][:, [1, 0]])
    shown = [text.get_text() for text in axes.get_legend().get_texts()]
    assert shown == ["basin", "under X_u", "under lag", "target", "start"]
    (poses,) = drawn
    assert poses[0].tolist() == eta[0].tolist()
    assert poses[-1].tolist() == eta[-1].tolist()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east [m]", "north [m]")
