"""One file gives one set of samples, whichever command reads it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.cases import slow
from support.command import command
from support.measured import sail

from cosim import InputError
from diagnosis import (
    analysis,
    compare,
    learn,
    measure_trial,
    pca,
    pls,
    propose_columns,
    repair,
    replay,
    sysid,
    watch,
)
from diagnosis.runs import (
    Examined,
    Run,
    SensorFinding,
    cut,
    prepare,
    prepared_run,
    read_each,
    thinning,
)
from thesis.open_loop import loop_of
from thesis.open_loop.playback import fed

SPIKES = (500, 2500, 4000, 5200)  # rows at which one begins
FEW = 2500  # rows, to which the runs are thinned
LOST = 10.0  # s, that the log's clock leaves out


def turning(t):
    """tau [N, N, N m] that keeps the ship under way, and turns it to and fro."""
    X = 0.8 + 0.2 * np.sin(0.31 * t)
    Y = 0.2 * np.sin(0.47 * t + 1.0)
    return np.column_stack([X, Y, 0.12 * np.sin(0.39 * t) + 0.06 * np.sin(0.97 * t)])


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory):
    """A file with rows that are held, spikes, and a jump of the clock that its velocity repairs."""
    run, nu = sail(140.0, given=turning)
    nu = nu + 1e-3 * np.random.default_rng(3).standard_normal(nu.shape)
    pose = run.pose.copy()
    pose[1000:1040] = pose[999]
    for row in SPIKES:
        pose[row : row + 4, :2] += [0.5, -0.5]
    run = replace(run, pose=pose, measured=dict(zip(("u", "v", "r"), nu.T, strict=True)))
    run = run.rows((run.time < 80.0) | (run.time > 80.0 + LOST))
    file = tmp_path_factory.mktemp("spoilt") / "run.csv"
    table = {"time": np.where(run.time < 85.0, run.time, run.time - LOST)}
    table |= dict(zip(("x", "y", "psi"), run.pose.T, strict=True))
    table |= dict(zip(("tau_X", "tau_Y", "tau_N"), run.tau_cmd.T, strict=True)) | dict(run.measured)
    pd.DataFrame(table).to_csv(file, index=False)
    return file


@pytest.fixture(scope="module")
def thinned(spoilt):
    """The prepared run, which has more rows than are not too many."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(thinning, "MOST_ROWS", FEW)
        return prepare(spoilt)


@pytest.fixture
def prepared(monkeypatch, thinned):
    monkeypatch.setattr(thinning, "MOST_ROWS", FEW)
    return thinned


def samples(prepared):
    """Times and poses (n, 4) of the samples of a run."""
    rows = prepared.samples
    return np.column_stack([prepared.track.run.time, prepared.track.pose])[rows]


def of_windows(runs):
    (w,) = runs
    used = w.smoothed.used
    return np.column_stack([w.smoothed.time, w.smoothed.track.pose])[used]


def seen(monkeypatch, place, main, *arguments):
    """What a command hands to some function."""
    found = []

    def spy(runs, *_, **__):
        found.append(runs)
        raise InputError("seen")

    monkeypatch.setattr(place, spy)
    done = command(main, *arguments)
    assert (done.returncode, "seen" in done.stderr) == (2, True), done.stderr
    return found[0]


def test_the_file_is_spoilt_and_repaired(prepared):
    (gap,) = prepared.sensors.findings
    assert (gap.kind, gap.repaired) == ("clock_gap", True)
    counts = prepared.smoothed.counts
    assert counts.frozen > 10
    assert counts.spikes >= len(SPIKES)
    assert counts.used == len(samples(prepared)) == prepared.samples.sum()


@pytest.mark.parametrize(
    ("main", "place"),
    [
        slow((learn.main, "diagnosis.session.begin")),
        (compare.main, "diagnosis.session.evaluate"),
    ],
)
def test_of_learning_and_comparing(prepared, monkeypatch, spoilt, tmp_path, main, place):
    runs = seen(monkeypatch, place, main, spoilt, "--out", tmp_path / "out")
    assert np.array_equal(of_windows(runs), samples(prepared))


def test_of_a_trial_that_is_the_whole_run_or_a_part(prepared, monkeypatch, spoilt, tmp_path):
    """A part is that of the file's times, though the clock is repaired: it jumps at 80 s."""
    common = (spoilt, "--trial", "zigzag", "--out", tmp_path / "out")
    place = "diagnosis.assessment.gathering.usable"
    (whole,) = seen(monkeypatch, place, measure_trial.main, *common)
    assert np.array_equal(np.column_stack([whole.time, whole.track.pose])[whole.used], samples(prepared))
    (part,) = seen(monkeypatch, place, measure_trial.main, *common, "--from", 85, "--to", 110)
    missing = prepared.sensors.findings[0].value
    inside = prepared.track.run.time >= 85.0 + missing - 1e-6
    inside &= prepared.track.run.time <= 110.0 + missing + 1e-6
    assert part.time == pytest.approx(prepared.track.run.time[inside], abs=1e-9)
    assert np.array_equal(part.track.valid, prepared.track.valid[inside])
    assert (part.used == prepared.samples[inside]).mean() > 0.999  # a spike may be told at an end


@pytest.mark.parametrize("main", [pca.main, slow(sysid.main)])
def test_of_the_analyses_of_the_thesis(prepared, monkeypatch, spoilt, tmp_path, main):
    found = []
    gather = analysis.gather_samples

    def spy(*arguments, **options):
        found.extend(gather(*arguments, **options))
        raise InputError("seen")

    monkeypatch.setattr("thesis.analysis.gather_samples", spy)
    for by in ("smoothed", "mdf"):
        command(main, spoilt, "--estimates", by, "--out", tmp_path / "out")
    smoothed, filtered = found
    assert np.array_equal(smoothed.time, samples(prepared)[:, 0])
    assert smoothed.nu == pytest.approx(prepared.smoothed.nu[prepared.samples])
    assert set(filtered.time) <= set(prepared.track.run.time), "the filter gives one for a lost row, too"


@pytest.mark.parametrize("main", [slow(replay.main), watch.main])
def test_of_playing_it_to_an_observer(prepared, monkeypatch, spoilt, tmp_path, main):
    controller = ("--controller", "abs") if main is replay.main else ()
    source = seen(monkeypatch, "thesis.open_loop.play", main, spoilt, *controller, "--out", tmp_path)
    inputs = fed(source, loop_of(spoilt, "abs", None, None))
    pose = np.column_stack([inputs[f"observer.{name}"] for name in ("x_m", "y_m", "psi_m")])
    rows, whole = source.prepared.samples, samples(prepared)
    assert source.time[rows] + source.track.run.time[0] == pytest.approx(whole[:, 0], abs=1e-9)
    assert pose[rows][:, :2] == pytest.approx(whole[:, 1:3], abs=1e-12)
    turns = (pose[rows][:, 2] - whole[:, 3]) / (2.0 * np.pi)
    assert turns == pytest.approx(np.round(turns), abs=1e-9)


def test_of_a_repaired_file(prepared, spoilt, tmp_path):
    """It is written with all its rows, and read again it has the same samples."""
    done = command(repair.main, spoilt, "--out", tmp_path / "repaired.csv")
    assert done.returncode == 0, done.stderr
    again = prepare(tmp_path / "repaired.csv")
    assert not again.sensors.findings
    assert np.array_equal(samples(again), samples(prepared))
    assert len(again.raw.time) == len(prepared.raw.time)


def test_a_repair_refuses_what_no_other_command_reads(spoilt, tmp_path):
    """A heading in degrees; told to go on, it states what was found in the file."""
    table, out = pd.read_csv(spoilt), tmp_path / "out.csv"
    table["psi"] = np.degrees(table["psi"])
    again = table.iloc[1000:1500].assign(x=lambda t: t["x"] + 900.0)
    pd.concat([table, again]).to_csv(tmp_path / "run.csv", index=False)
    done = command(repair.main, tmp_path / "run.csv", "--out", out)
    assert done.returncode == 2
    assert "is its heading in deg?" in done.stderr
    assert not out.exists()
    done = command(repair.main, tmp_path / "run.csv", "--out", out, "--anyway")
    said = " ".join(done.stdout.split())
    assert done.returncode == 0, done.stderr
    assert "a second run begins in row" in said
    assert "rad/s in place of deg/s" in said


def test_a_repair_says_which_channels_agree_with_nothing(monkeypatch, spoilt, tmp_path):
    plain = prepare(spoilt).sensors
    aside = Examined(plain.run, notes=("r is not used",)).without({*plain.run.measured})
    monkeypatch.setattr(prepared_run, "examine", lambda run, _: replace(aside))
    monkeypatch.setattr(Examined, "without", lambda self, _: self)
    done = command(repair.main, spoilt, "--out", tmp_path / "out.csv")
    assert "nothing that agrees with it\nr is not used\n" in done.stdout
    assert "only the pose is measured" not in done.stdout
    assert "channels agree" not in done.stdout


def test_other_columns_keep_to_their_rows(spoilt, tmp_path):
    """Whatever becomes of rows and times."""
    table = pd.read_csv(spoilt)
    table["x_t"] = table["x"] + 1.0
    pd.concat([table, table.iloc[:3]]).to_csv(tmp_path / "run.csv", index=False)
    track = prepare(tmp_path / "run.csv", also=["x_t", "y_t"]).track
    assert track.run.time.size == len(table)
    assert np.array_equal(track.run.measured["x_t"], track.run.pose[:, 0] + 1.0)
    assert "y_t" not in track.run.measured


def test_only_the_later_run_of_a_name_gets_another_one():
    time, zero = np.arange(4.0), np.zeros((4, 3))
    runs = [Run(name, time, zero + k, zero) for k, name in enumerate("aba")]
    assert [run.name for run in read_each(runs)] == ["a", "b", Path("a").absolute().as_posix()]
    with pytest.raises(InputError, match="'b' holds the same measurement as 'a'"):
        read_each([runs[0], replace(runs[0], name="b")])


def test_runs_of_one_name_get_more_of_their_path(spoilt, tmp_path):
    table = pd.read_csv(spoilt)
    table.iloc[1:].to_csv(tmp_path / "run.csv", index=False)
    names = [run.name for run in read_each([spoilt, tmp_path / "run.csv"])]
    assert names == ["run", (tmp_path / "run.csv").as_posix()]
    with pytest.raises(InputError, match="is given twice"):
        read_each([spoilt, spoilt])


@pytest.mark.parametrize(
    "module", [learn, compare, measure_trial, pca, pls, sysid, replay, watch, propose_columns]
)
def test_every_command_refuses_what_cannot_be_repaired_unless_told(
    monkeypatch, spoilt, tmp_path, module
):
    fault = SensorFinding("r", "scale", 2.0, "1", (1.9, 2.1), 0.0, 1.0, "r reads twice", repaired=False)
    monkeypatch.setattr(prepared_run, "examine", lambda run, _: Examined(run, (fault,)))
    others = {replay: ("--controller", "abs"), measure_trial: ("--trial", "zigzag")}.get(module, ())
    out = () if module is propose_columns else ("--out", tmp_path / "out")
    done = command(module.main, spoilt, *others, *out)
    # The proposal states how to read the file all the same.
    stated, code = (done.stdout, 0) if module is propose_columns else (done.stderr, 2)
    assert done.returncode == code, done.stderr
    stated = " ".join(stated.split())
    assert "r reads twice" in stated
    assert "--anyway" in stated

    def cleaned(run, anyway, scale):
        raise InputError(f"cleaned {anyway}")

    monkeypatch.setattr(prepared_run, "clean", cleaned)
    done = command(module.main, spoilt, "--anyway", *others, *out)
    assert "cleaned True" in done.stderr + done.stdout


def test_parts_of_a_run_are_all_of_it_one_after_the_other():
    time = np.arange(0.0, 30.0, 0.5)
    rows = np.arange(time.size)
    pose = np.column_stack([rows, 2.0 * rows, 0.0 * rows])
    lap, other = (Run(name, time, pose, 3.0 * pose, measured={"u": 4.0 * rows}) for name in ("lap", "b"))
    *parts, last = cut([lap, other], [("lap", 20.0), ("lap", 7.5)])
    assert last is not lap
    assert [part.name for part in (*parts, last)] == [
        "lap until 7.5 s", "lap from 7.5 s until 20 s", "lap from 20 s", "b"
    ]  # fmt: skip
    for name in ("time", "pose", "tau_cmd"):
        assert np.array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(lap, name))
    assert np.array_equal(np.concatenate([p.measured["u"] for p in parts]), lap.measured["u"])
    assert [p.time[0] for p in parts] == [0.0, 7.5, 20.0]
    assert np.array_equal(last.pose, other.pose)
