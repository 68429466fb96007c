"""Runs that are the same, or nearly, are known again; runs that are others are not."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from support.measured import DATA, NOISE, jumps, needs_data, sail

import diagnosis
from cosim import InputError
from diagnosis.predictors import Model, read_model, ship_with, write_model
from diagnosis.runs import Fingerprint, prepare
from studies.ship_folds import read
from studies.tanker import COLUMNS


@pytest.fixture(scope="module")
def run():
    return sail(64.0, h=0.1)[0]


def print_of(run, of=None):
    return Fingerprint.of(prepare(run, of, anyway=True).smoothed)


def turned(pose, by=0.0):
    """Poses with their headings, which are continuous, in (-pi, pi]."""
    return np.column_stack([pose[:, :2], np.angle(np.exp(1j * (pose[:, 2] + by)))])


def resampled(run, period):
    time = np.arange(run.time[0], run.time[-1], period)
    columns = np.column_stack([run.pose[:, :2], np.unwrap(run.pose[:, 2]), run.tau_cmd])
    between = np.column_stack([np.interp(time, run.time, x) for x in columns.T])
    return replace(run, time=time, pose=turned(between[:, :3]), tau_cmd=between[:, 3:])


def elsewhere(run):
    x, y, psi = *run.pose.T[:2], np.unwrap(run.pose[:, 2])
    moved = np.column_stack([5.0 - y, x, psi])
    return replace(run, time=run.time + 100.0, pose=turned(moved, np.pi / 2.0))


def mirrored(run):
    pose = np.column_stack([run.pose[:, 0], -run.pose[:, 1], -np.unwrap(run.pose[:, 2])])
    return replace(run, pose=turned(pose), tau_cmd=run.tau_cmd * [1.0, -1.0, -1.0])


COPIES = {
    "the same": lambda run: run,
    "rounded": lambda run: replace(run, pose=run.pose.round(4)),
    "sampled at other times": lambda run: resampled(run, 0.137),
    "larger": lambda run: replace(run, pose=run.pose * [1.05, 1.05, 1.0]),
    "elsewhere and later": elsewhere,
    "mirrored": mirrored,
    "cut": lambda run: run.rows(run.time > run.time[0] + 21.3),
    "slower": lambda run: replace(run, time=1.01 * run.time),
    "with more noise": lambda run: replace(
        run, pose=run.pose + 3.0 * NOISE * np.random.default_rng(0).standard_normal(run.pose.shape)
    ),
}


@pytest.mark.parametrize("change", COPIES)
def test_a_copy_is_known_again(run, change):
    """Also by what a file remembers of the run."""
    remembered = Fingerprint.read(print_of(run).content())
    assert remembered.alike(print_of(COPIES[change](run)))


def test_another_run_is_another(run):
    remembered = Fingerprint.read(print_of(run).content())
    assert not remembered.alike(print_of(sail(64.0, h=0.1, given=jumps)[0]))
    assert not remembered.alike(print_of(sail(64.0, h=0.1, ship={"X_u": -1.5})[0]))


@needs_data
@pytest.mark.slow
def test_zigzags_of_a_tanker_are_all_others():
    """Seven trials, of which the basin repeated some to either side."""
    model = Model(ship=ship_with((), "kvlcc2"))
    files = sorted((DATA / "kvlcc2_hsva").glob("z_[12]0_*.csv"))
    prints = [print_of(read(f, COLUMNS, model), model.ship) for f in files]
    assert len(prints) == 7
    assert [(a.name, b.name) for a, b in combinations(prints, 2) if a.alike(b)] == []


def test_a_model_remembers_its_runs(run, tmp_path):
    """In model.ssv, and what is made from that; without them the file is as before."""
    known = print_of(run)
    path = tmp_path / "model.ssv"
    write_model(path, Model({"X_u": -1.0}, learned_from=(known,)))
    found = read_model(path)
    assert [f.sha256 for f in found.learned_from] == [known.sha256]
    assert found.learned_from[0].alike(known)
    assert found.plus({"X_u": 0.1}).learned_from == found.learned_from
    assert "learned_from" not in _written(tmp_path / "none.ssv", Model({"X_u": -1.0}))
    path.write_text(path.read_text().replace('"period"', '"perod"'))
    with pytest.raises(InputError, match="its list of training runs is damaged"):
        read_model(path)


def _written(path, model):
    write_model(path, model)
    return path.read_text()


@pytest.mark.slow
def test_what_is_learned_remembers_what_it_was_learned_from(tmp_path):
    """Training and validation runs, not those of the test."""
    runs = [sail(s, h=0.1, seed=k)[0] for k, s in enumerate((64.0, 48.0, 40.0))]
    named = [replace(r, name=n) for r, n in zip(runs, "abc", strict=True)]
    train, validate, test = ([r] for r in diagnosis.gather(named))
    found = diagnosis.calibrate(train, test, validate=validate)
    assert [f.name for f in found.model.learned_from] == ["a", "b"]
