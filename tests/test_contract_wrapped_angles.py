"""Angles that were interpolated where they wrap, by lines that are known; and stretches without rows."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.runs.run_constants import FAR
from diagnosis.runs.sensors import wraps
from diagnosis.runs.sensors.evidence import LEAST_TURN, Evidence


@dataclass
class Run:
    """The part of a run that is asked for."""

    time: np.ndarray
    pose: np.ndarray
    measured: dict


def crossing(rows, first=3.1, rate=0.01, before=10, after=10):
    """A heading that turns through pi at a rate, and a log of it that has a line of some rows there."""
    n = before + rows + after + 1
    true = first + rate * (np.arange(n) - before)
    seen = np.angle(np.exp(1j * true))
    seen[before : before + rows + 1] = np.linspace(seen[before], seen[before + rows], rows + 1)
    return true, seen, np.arange(before + 1, before + rows)


@settings(max_examples=20)
@given(st.integers(2, 12), st.sampled_from([1.0, -1.0]))
def test_rows_of_a_line_through_a_wrap_are_on_the_short_way(rows, side):
    true, seen, inside = crossing(rows, rate=0.05)
    found, changed = wraps.unwrapped(side * seen)
    assert changed.tolist() == inside.tolist()
    assert np.exp(1j * found) == pytest.approx(np.exp(1j * side * true))
    kept = np.delete(np.arange(seen.size), inside)
    assert found[kept].tolist() == (side * seen)[kept].tolist()


@pytest.mark.parametrize(("turn", "wrapped"), [(1.5, True), (2.0, True), (2.2, False)])
def test_a_line_through_a_wrap_may_span_a_turn_of_less_than_half_of_itself(turn, wrapped):
    """Rows between two telegrams while the ship turns: 2 pi less the turn is twice the turn at 2.09 rad."""
    seen = np.concatenate([np.full(20, 2.5), np.linspace(2.5, 2.5 + turn - 2.0 * np.pi, 6)[1:-1]])
    seen = np.concatenate([seen, np.full(20, 2.5 + turn - 2.0 * np.pi)])
    assert (wraps.unwrapped(seen)[1].size == 4) == wrapped


def test_rows_without_an_angle_are_passed_over():
    true, seen, inside = crossing(5, rate=0.1)
    gaps = np.full(2 * seen.size, np.nan)
    gaps[::2] = seen
    found, changed = wraps.unwrapped(gaps)
    assert changed.tolist() == (2 * inside).tolist()
    assert np.isnan(found[1::2]).all()
    assert np.exp(1j * found[::2]) == pytest.approx(np.exp(1j * true))
    none, changed = wraps.unwrapped(np.full(4, np.nan))
    assert np.isnan(none).all()
    assert changed.size == 0


@pytest.mark.parametrize(
    "seen",
    [
        np.angle(np.exp(0.1j * np.arange(80))),  # a jump is no line
        np.concatenate(
            [np.zeros(20), np.linspace(0.0, 2.0, 5), np.full(20, 2.0)]
        ),  # a quick turn, no wrap
        np.concatenate([np.zeros(20), [2.5, -2.5, 2.5, -2.5, 2.5], np.zeros(20)]),  # a course at rest
        np.linspace(0.0, 6.0, 90),  # not quicker than usual
    ],
)
def test_other_angles_stay_as_they_are(seen):
    found, changed = wraps.unwrapped(seen)
    assert changed.size == 0
    assert found.tolist() == seen.tolist()


def test_a_line_that_is_too_slow_for_a_wrap_is_a_turn():
    """Over so many rows a ship may turn all round."""
    most = int(2.0 * np.pi / LEAST_TURN)
    for rows, wrapped in ((most - 2, True), (most, True), (most + 1, False), (most + 7, False)):
        end = 0.5 * 1.05 * LEAST_TURN * rows
        seen = np.concatenate([np.full(100, end), np.linspace(end, -end, rows + 1), np.full(100, -end)])
        assert (wraps.unwrapped(seen)[1].size > 0) == wrapped


def test_a_step_is_large_beside_what_is_usual():
    """A heading that always turns by 0.05 rad a row: eight times that is no step of a ship."""
    for step, large in ((0.9 * FAR * 0.05, False), (1.1 * FAR * 0.05, True)):
        rows = int(np.ceil(5.9 / step))
        seen = np.concatenate([2.0 + 0.05 * np.arange(21), 3.0 - step * np.arange(1, rows + 1)])
        seen = np.concatenate([seen, seen[-1] + 0.05 * np.arange(1, 21)])
        assert (wraps.unwrapped(seen)[1].size > 0) == large


@pytest.mark.parametrize("name", ["psi", "psi_2", "course"])
def test_each_angle_of_a_run_is_repaired_and_said(name):
    true, seen, inside = crossing(5, rate=0.1)
    pose, measured = (
        np.zeros((seen.size, 3)),
        {"u": seen.copy(), "psi_2": 0.0 * seen, "course": 0.0 * seen},
    )
    if name == "psi":
        pose[:, 2] = seen
    else:
        measured[name] = seen.copy()
    run = Run(0.5 * np.arange(seen.size), pose, measured)
    found = wraps.wraps(run, None)
    repaired = found.run.pose[:, 2] if name == "psi" else found.run.measured[name]
    assert np.exp(1j * repaired) == pytest.approx(np.exp(1j * true))
    assert found.run.measured["u"].tolist() == seen.tolist()
    assert not found.run.pose[:, :2].any()
    (finding,) = found.findings
    assert (finding.channel, finding.kind, finding.value) == (name, "wrap", float(inside.size))
    assert (finding.start, finding.end) == (0.5 * inside[0], 0.5 * inside[-1])
    assert finding.sentence == f"{name} was interpolated where it wraps, in {inside.size} rows"
    assert run.pose[:, 2].tolist() == (seen.tolist() if name == "psi" else (0.0 * seen).tolist()), (
        "as it was read"
    )


def test_a_run_without_a_wrap_is_itself():
    run = Run(np.arange(5.0), np.zeros((5, 3)), {})
    found = wraps.wraps(run, None)
    assert found.run is run
    assert found.findings == ()


def evidence(time, u):
    run = SimpleNamespace(
        time=np.asarray(time, float), measured={"u": np.asarray(u, float), "v": np.zeros(len(time))}
    )
    return Evidence(run, np.arange(len(time)), None, None, None, ("u", "v"), None)


def test_stretches_without_rows_or_velocity_are_known():
    time = np.concatenate([np.arange(0.0, 20.0, 0.5), np.arange(60.0, 80.0, 0.5)])
    u = np.ones(time.size)
    assert evidence(time, u).unlogged == [(19.5, 60.0)]
    u[:30] = np.nan
    u[-30:] = np.nan
    assert evidence(time, u).unlogged == [(0.0, 15.0), (19.5, 60.0), (64.5, 79.5)]
    assert evidence(np.arange(0.0, 20.0, 0.5), np.ones(40)).unlogged == []
