"""What is done to a file, and tells nothing of the ship, does not decide what is found in it."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from support.cases import in_part
from support.measured import commands, jumps, sail, slow_swings, smoothed
from support.shared import kept

from diagnosis import Model, Windows, clean, weak_windows
from diagnosis.predictors import omega
from diagnosis.predictors.windows import usable_windows

SECONDS, H, LATE = 64.0, 0.01, 0.3
# Commands, delay of the thrusters [s], noise.
KINDS = {
    "swings": (commands, 0.0, 1.0),
    "slow": (slow_swings, 0.0, 1.0),
    "jumps": (jumps, 0.0, 1.0),
    "quiet": (jumps, 0.0, 0.1),
    "late": (jumps, LATE, 1.0),
}
HIDDEN = (
    {"vessel": {"delta_X_u": -1.0}},
    {"vessel": {"delta_N_r": -0.5}},
    {"thrusters": {"loss_surge": 0.2}},
)


def thinned(run, k):
    return run.rows(np.arange(0, run.time.size, k))


def frozen(run):
    """Four short freezes."""
    pose = run.pose.copy()
    for at in (0.17, 0.36, 0.58, 0.83):
        row = round(at * run.time.size)
        pose[row : row + round(0.4 / (run.time[1] - run.time[0]))] = pose[row - 1]
    return replace(run, pose=pose)


def turned(run):
    """The heading continuous, and a turn more."""
    psi = np.unwrap(run.pose[:, 2]) + 2.0 * np.pi
    return replace(run, pose=np.column_stack([run.pose[:, :2], psi]))


def gappy(run):
    """2 % of the rows dropped, none with which a window begins."""
    rng = np.random.default_rng(0)
    first = np.isclose(np.remainder(run.time + 1e-6, 8.0), 0.0, atol=1e-4)
    return run.rows(np.flatnonzero((rng.random(run.time.size) > 0.02) | first))


def stamped(run):
    """Unix time."""
    return replace(run, time=run.time + 1.7e9 + 0.123)


CHANGES = {
    "freezes": frozen,
    "wrap": turned,
    "drops": gappy,
    "unix": stamped,
    "100 Hz": None,
    "10 Hz": lambda run: thinned(run, 5),
}
LOSING = ("drops", "10 Hz", "100 Hz")  # of which commands are lost or won


def measured(kind, change=None):
    """The smoothed run of a kind at 50 Hz, changed."""
    given, delay, noise = KINDS[kind]
    thrusters = {"delay": delay} if delay else {}
    run, _ = sail(SECONDS, H, thrusters=thrusters, noise=noise, given=given)
    if change == "100 Hz":
        return smoothed(run)
    run = thinned(run, 2)
    return smoothed(CHANGES[change](run) if change else run)


def errors(run, kind):
    """Window errors of position [m] and heading [rad], of the true model and of others."""
    truth = {"delay": KINDS[kind][1]}
    models = [Model(x.get("vessel", {}), truth | x.get("thrusters", {})) for x in ({}, *HIDDEN)]
    windows = Windows([run])
    return np.array([windows.summary(r).over_all() for r in windows.residuals_of_each(models)], float)


def errors_of_whole(kind):
    """Those of the run that is not changed."""
    return errors(measured(kind), kind)


# Each change with one kind, each kind with one change or two.
CASES = [
    (kind, change)
    for k, kind in enumerate(KINDS)
    for j, change in enumerate(CHANGES)
    if (k + j) % 5 == 0
]
QUICK = [("jumps", "unix"), ("swings", "freezes"), ("quiet", "drops")]


@pytest.mark.parametrize(("kind", "change"), in_part(CASES, keep=QUICK))
def test_preprocessing_does_not_decide_the_result(kind, change):
    other = measured(kind, change)
    before, after = kept(errors_of_whole, kind), errors(other, kind)
    lost = np.abs(after[0] - before[0])
    assert (np.abs(after - before) <= 0.2 * before + lost).all()
    if change not in LOSING:
        assert (after[0] <= 1.2 * before[0]).all(), "the true model"
    stated = [note for note in other.notes if note.startswith("commands act")]
    assert bool(stated) <= bool(KINDS[kind][1]), "no delay is told where there is none"
    if stated:
        assert other.delay == pytest.approx(LATE, abs=0.05)


def silent(run):
    """(n,), rows in two holes of 1.5 s."""
    return np.logical_or(*[np.abs(run.time - at * run.time[-1]) < 0.75 for at in (0.31, 0.64)])


def holed(run):
    """Rows are missing."""
    return run.rows(np.flatnonzero(~silent(run)))


def unheard(run):
    """Commands are missing, and held."""
    tau = pd.DataFrame(np.where(silent(run)[:, None], np.nan, run.tau_cmd)).ffill().to_numpy()
    return replace(run, tau_cmd=tau, held=silent(run)[:, None])


@pytest.mark.parametrize("change", [holed, unheard])
def test_hole_in_the_commands_spoils_no_window(change):
    run, _ = sail(SECONDS, H, given=jumps)
    run = thinned(run, 2)
    whole, other = (weak_windows(smoothed(r)) for r in (run, change(run)))
    assert whole.middle.size - 28 <= other.middle.size < whole.middle.size - 12
    rms = [np.sqrt(np.mean(omega(w, Model()) ** 2, axis=0)) for w in (whole, other)]
    assert (rms[1] <= 1.5 * rms[0]).all()


@pytest.mark.parametrize(
    ("first", "last"),
    [(0.0, 0.6), (0.3, 1.0), (0.2, 0.8), (0.0, 0.35)],  # shares of the time; the last one: most are lost
)
def test_where_a_command_is_lost_no_model_is_judged(first, last):
    run, _ = sail(SECONDS, H, given=jumps)
    run = thinned(run, 2)
    begin, end = run.time[0] + SECONDS * first, run.time[0] + SECONDS * last
    lost = (run.time < begin) | (run.time > end)
    commands = run.tau_cmd.copy()
    commands[lost, 1] = commands[np.flatnonzero(~lost)[-1], 1]
    track = clean(replace(run, tau_cmd=commands, held=lost[:, None]))
    assert ((track.silences % 2 == 1) == lost).mean() > 0.99
    assert sum(note.startswith("commands are missing for") for note in track.notes) == 1
    other, whole = smoothed(replace(run, tau_cmd=commands, held=lost[:, None])), smoothed(run)
    windows = weak_windows(other)
    assert ((windows.middle > begin) & (windows.middle < end)).all()
    rms = [np.sqrt(np.mean(omega(w, Model()) ** 2, axis=0)) for w in (weak_windows(whole), windows)]
    assert (rms[1] <= 1.5 * rms[0]).all()
    length = 10.0
    starts = other.time[usable_windows(other, length).first_rows]
    assert starts.size
    assert ((starts >= begin) & (starts + length <= end + H)).all()


def test_commands_that_are_written_when_they_change_are_known_all_the_time():
    run, _ = sail(SECONDS, H, given=jumps)
    held = np.ones((run.time.size, 1), bool)
    held[::100] = False
    assert (clean(replace(run, held=held)).silences == 0).all()
    assert clean(holed(replace(run, held=None))).silences.tolist().count(1) == 0
