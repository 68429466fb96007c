"""The benchmark of logs: ways to record one do what they say, and each aim is counted."""

import json
from typing import Any

import numpy as np
import pandas as pd
import pytest

from benchmarks.logs.aims import aims
from benchmarks.logs.recorded import Good, Recorded
from benchmarks.logs.ways_to_log import WAYS

H = 0.1


def good():
    t = np.arange(0.0, 60.0, H)
    motion = np.column_stack([0.3 * t, np.sin(0.1 * t), 0.2 * np.sin(0.2 * t)])
    noise = 1e-3 * np.random.default_rng(0).standard_normal(motion.shape)
    table = pd.DataFrame(motion + noise, columns=["x", "y", "psi"])
    table.insert(0, "time", t)
    return Good(table.assign(tau_X=np.sin(t)), motion, np.full(3, 1e-3), None)


def recorded(way):
    return WAYS[way].record(good().table.copy(), np.random.default_rng(0))


@pytest.mark.parametrize("file", [10, 20, 50])
def test_a_slow_receiver_is_held_in_a_quick_file(file):
    table = recorded(f"2 Hz held in {file}")
    assert np.median(np.diff(table["time"])) == pytest.approx(1.0 / file)
    new = np.diff(table["x"]) != 0.0
    assert new.mean() == pytest.approx(2.0 / file, rel=0.05)
    assert np.isin(table["x"], good().table["x"]).all()


def test_lines_meet_at_the_samples():
    table = recorded("1 Hz lines in 10")
    assert np.mean(np.abs(np.diff(table["x"], 2)) < 1e-12) == pytest.approx(0.9, abs=0.02)


def test_motions_above_half_of_a_rate_are_noise_to_its_samples():
    g = good()
    assert g.noise((np.inf, 10.0, 20.0)) == pytest.approx(g.sigma)
    quick = 0.01 * np.sin(2.0 * np.pi * 2.0 * g.table["time"].to_numpy())
    moved = Good(g.table, g.motion + quick[:, None], g.sigma, None)
    assert moved.noise((2.0, 1.0, 8.0)) == pytest.approx([0.0071, 0.0071, 1e-3], rel=0.05)


def test_results_are_read_back():
    o = Recorded("a", noise=(1.0, np.nan, 2.0), found={"X_u": 0.9, "mass": None}, doubted=("x",))
    again = Recorded.of(json.loads(json.dumps(o.content(), allow_nan=False)))
    assert again.content() == o.content()
    assert np.isnan(again.noise[1])


def test_each_aim_is_counted():
    """A filter is a right finding where the way of recording has it."""
    known: dict[str, Any] = {"noise": (1.0, 1.5, np.nan), "rel_std": (0.1, 0.1, 0.0)}
    found = [
        Recorded(
            "clean",
            verdict="found",
            found={"X_u": 0.95},
            listed={"X_u": 0.9, "Y_v": 0.05, "mass": None},
            error=1.0,
            **known,
        ),
        Recorded(
            "heading filtered 1 s",
            noise=(1.0, 2.0, 0.5),
            rel_std=(0.1, 0.5, 0.1),
            at_most=(False, False, True),
            verdict="found",
            found={"X_u": 0.9, "heading_lag": 0.95},
            listed={"heading_lag": 0.9, "X_u": None},
            error=1.2,
        ),
        Recorded(
            "2 Hz held in 10", verdict="found", found={"mass": 0.85}, listed={"mass": 0.9}, error=3.0
        ),
        Recorded("clock jumps +1 s", misstated=("x",), doubted=("x",), verdict="none", error=9.0),
        Recorded("d", refused="no"),
    ]
    numbers = dict(aims(found, None))
    assert [*numbers.values()] == [
        "1 of 5 refused",
        "2 of 3 channels; 1 are said to be unknown",
        "0 of 1 channels",
        "1 of 1",
        "0 channels of 9",
        "1 of 2",
        "1 of 2",
        "1 of 3: 2 Hz held in 10",
        "2.10, worst 3.00 (2 Hz held in 10)",
    ]
    assert (
        dict(aims(found, ["mass"]))["none sure (0.8) of an absent cause"]
        == "1 of 3: heading filtered 1 s"
    )
