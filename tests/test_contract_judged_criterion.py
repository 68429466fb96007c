"""Criteria on windows that are given: which count, what follows, and what a reader is told of a record."""

import hashlib
import json
from types import SimpleNamespace

import numpy as np
import pytest

from cosim import InputError
from diagnosis.acceptance.criterion import Criterion
from diagnosis.acceptance.judged_criterion import FEW, LEARNED, Predicted, decide, judge
from diagnosis.acceptance.record import validation, verification
from diagnosis.acceptance.record.validation import _JudgedRuns, _not_covered, _rows
from diagnosis.acceptance.record.verification import FORM, verify_record

W = 40
WITHIN = {"quantity": "position", "horizon": 8.0, "tolerance": 1.0, "unit": "m", "coverage": 0.5}


def criterion(**changes):
    return Criterion(**{**WITHIN, **changes})


def run(name="a", off=(0.1, 0.0), count=W, lacking=0, after=8.0, psi=0.0, std=0.0, more=(), **changes):
    """A run whose predictions are off by some metres to north and east, in each of its windows."""
    wave = np.cos(np.arange(count))  # of the size of an error, so that windows differ
    measured = np.zeros((count, 6))
    measured[:, 2] = psi
    motion = measured.copy()
    motion[:, :2] += np.outer(1.0 + 0.1 * wave, off)
    predictions = SimpleNamespace(
        motion=motion, measured=measured, rows=np.arange(count), possible=count + lacking,
        after=np.full(count, after),
    )  # fmt: skip
    variance = {"position": np.full(count, std**2), "heading": np.full(count, std**2)}
    names = (
        "measurement",
        "initial_state",
        "parameters",
        "process_noise",
        "current",
        "wind",
        "numerical",
    )
    sources = {
        n: variance if n == "measurement" else {q: 0.0 * v for q, v in variance.items()} for n in names
    }
    sources |= dict(more)
    signals = {"u": np.linspace(0.0, 1.0, count), "r": np.zeros(count)}
    return Predicted(name, predictions, sources, signals)._replace(**changes)


def test_errors_are_distances_and_their_mean_is_in_the_axes_of_the_ship():
    psi = 0.5
    found = judge(criterion(), ["a"], [run(off=(0.3, 0.4), psi=psi)])
    size = 0.5 * (1.0 + 0.1 * np.cos(np.arange(W)))
    assert found.found.errors == pytest.approx(size)
    body = (0.3 + 0.4j) * np.exp(-1j * psi) * np.mean(size) / 0.5
    assert found.found.offset == pytest.approx([body.real, body.imag])
    assert found.found.run.tolist() == [0] * W
    assert found.outcome == "met"
    assert found.found.interval.estimate == 1.0
    assert found.counts == (W, W, {}, ["a"], {})
    assert found.flags == []


def test_windows_of_several_runs_count_together():
    found = judge(criterion(), ["a", "b"], [run(), run("b", count=10, off=(2.0, 0.0))])
    assert found.found.run.tolist() == [0] * W + [1] * 10
    assert found.found.interval.estimate == pytest.approx(W / (W + 10))
    assert found.counts.runs == ["a", "b"]
    assert [(p.name, rows.sum()) for p, rows in found.windows] == [("a", W), ("b", 10)]


def test_a_run_that_was_not_compared_leaves_it_open():
    found = judge(criterion(runs=["a", "c"]), ["a", "b"], [run(), run("b")])
    assert (found.outcome, found.reason) == ("cannot be judged", "run c was not compared")
    assert found.found is None


def test_windows_count_by_what_the_criterion_asks():
    """Each that does not count has one reason."""
    every = [run(lacking=3), run("b", learned=True), run("c"), run("d", same=frozenset("ad"))]
    found = judge(criterion(runs=["a", "b", "d"]), list("abcd"), every, {"e": 2, "f": 5})
    again = "the same motion as a, which counts"
    assert found.counts.offered == 4 * W + 3 + 7
    assert found.counts.judged == W
    assert found.counts.excluded == {
        FEW: 3 + 7, LEARNED: W, "not among the runs of the criterion": W, again: W,
    }  # fmt: skip
    short = "no window of 8 s has enough samples"
    assert found.counts.left_out == {
        "e": short, "f": short, "b": LEARNED, "c": "not among the runs of the criterion", "d": again,
    }  # fmt: skip
    assert found.counts.runs == ["a"]


def test_training_runs_count_where_the_criterion_says_so():
    learned = run(learned=True)
    assert judge(criterion(), ["a"], [learned]).outcome == "cannot be judged"
    found = judge(criterion(training_runs=True), ["a"], [learned])
    assert found.outcome == "met"
    assert found.flags == ["Training runs of the model count, as the criterion states."]
    assert judge(criterion(training_runs=True), ["a"], [run()]).flags == []


def test_only_windows_within_the_operating_range_count():
    limits = {"u": (0.25, 0.75), "r": (-0.1, 0.1)}
    found = judge(criterion(operating_range=limits), ["a"], [run()])
    u = np.linspace(0.0, 1.0, W)
    inside = (u >= 0.25) & (u <= 0.75)
    assert found.counts.judged == inside.sum()
    assert found.counts.excluded == {"mean u not from 0.25 to 0.75": W - inside.sum()}
    assert found.windows[0][1].tolist() == inside.tolist()
    edge = judge(criterion(operating_range={"u": (1.0, 2.0)}), ["a"], [run()])
    assert edge.counts.judged == 1, "its ends are within"
    both = judge(criterion(operating_range={"u": (0.25, 2.0), "r": (0.1, 0.2)}), ["a"], [run()])
    assert both.counts.judged == 0
    below = (u < 0.25).sum()
    assert both.counts.excluded == {
        "mean u not from 0.25 to 2": below, "mean r not from 0.1 to 0.2": W - below,
    }  # fmt: skip
    with pytest.raises(InputError, match="run a has no 'w'"):
        judge(criterion(operating_range={"w": (0.0, 1.0)}), ["a"], [run()])


@pytest.mark.parametrize(
    ("changes", "given", "reason"),
    [
        ({}, [run(learned=True)], "every run was used to learn the model"),
        ({}, [], "no run has a window of 8 s with enough samples"),
        (
            {"operating_range": {"u": (5.0, 6.0), "r": (0.0, 1.0)}},
            [run()],
            "outside the data: no window has u from 5 to 6, r from 0 to 1",
        ),
    ],
)
def test_where_nothing_counts_it_says_why(changes, given, reason):
    found = judge(criterion(**changes), ["a"], given)
    assert found.outcome == "cannot be judged"
    assert found.reason.startswith(reason)


def test_met_names_what_is_not_known():
    unknown = run(std=0.001, more={"current": "nobody knows it"})
    found = judge(criterion(), ["a"], [unknown])
    assert found.outcome == "met"
    assert found.reason.endswith("; u_val leaves out what is not known: current")
    off = judge(criterion(), ["a"], [run(off=(5.0, 0.0), more={"current": "nobody knows it"})])
    assert off.outcome == "not met"
    assert "u_val leaves out" not in off.reason


def test_samples_well_before_the_horizon_are_said():
    (flag,) = judge(criterion(), ["a"], [run(after=7.5)]).flags
    assert flag.startswith("Samples are rare: what is judged is 7.5 s after the start")
    assert judge(criterion(), ["a"], [run(after=7.61)]).flags == []


def test_errors_far_below_those_of_the_measurement_are_said():
    """Below half of it, by more than chance."""
    for size, said in ((0.45, True), (0.55, False)):
        flags = judge(criterion(), ["a"], [run(off=(size * 0.1, 0.0), std=0.1, psi=0.0)]).flags
        assert any("error of position" in flag for flag in flags) == said
    # Of two windows it may be chance.
    few = judge(criterion(), ["a"], [run(off=(0.045, 0.0), std=0.1, count=2)]).flags
    assert not any("error of position" in flag for flag in few)
    heading = judge(criterion(), ["a"], [run(off=(0.1, 0.0), std=0.01)]).flags
    assert any("error of heading" in flag for flag in heading), "it is zero"


@pytest.mark.parametrize(
    ("size", "outcome"), [(0.9, "met"), (1.1, "cannot be judged"), (1.7, "not met")]
)
@pytest.mark.parametrize("statistic", ["fraction", "rms"])
def test_an_error_beyond_the_tolerance_by_less_than_its_uncertainty_decides_nothing(
    statistic, size, outcome
):
    """Twice u_val is 0.4 m, of a tolerance of 1 m."""
    c = Criterion(**{**{k: v for k, v in WITHIN.items() if k != "coverage"}, "statistic": statistic})
    errors = size * (1.0 + 0.01 * np.cos(np.arange(60)))
    found, reason, _ = decide(c, errors, 60, 0.2)
    assert found == outcome
    assert ("2 u_val = 0.4 m" in reason) == (outcome == "cannot be judged")
    assert decide(c, errors, 60, 0.51)[1].startswith("the tolerance is smaller than")


# The record


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture
def record(tmp_path, monkeypatch):
    """Writes a record of some files in a folder of data; returns a function that checks it."""
    data = tmp_path / "data"
    data.mkdir()
    for name in ("criteria.json", "a.csv", "report.html"):
        (data / name).write_text(name)
    monkeypatch.setattr(verification, "code", lambda: {"version": "1", "sha256": "c"})
    files = {name: {"role": role, "path": str(data / name), "sha256": sha256(data / name)} for role, name in (
        ("criteria", "criteria.json"), ("measurement", "a.csv"), ("report", "report.html"))}  # fmt: skip
    content = {
        "form": FORM, "code": {"version": "1", "sha256": "c"}, "criteria": files["criteria.json"],
        "files": [files["a.csv"]], "samples": [{"run": "a", "file": "a.csv"}, {"run": "b", "file": ""}],
        "reports": [files["report.html"]], "public_key": None,
    }  # fmt: skip
    (tmp_path / "out").mkdir()
    path = tmp_path / "out" / "validation.json"

    def check(allow=(), key=None, **changes):
        path.write_text(json.dumps(content | changes))
        return verify_record(path, key, allow)

    return check


def test_a_record_holds_where_all_files_are_the_same(record):
    found = record()
    assert [c.holds for c in found] == [None, True, True, True, True, None]
    assert [c.line.partition(":")[0] for c in found] == [
        "signature", "code", "criteria", "measurement", "report", "data",
    ]  # fmt: skip
    assert found[0].line == "signature: none; a change of the record is not detectable"
    assert found[-1].line == "data: run b was a table in memory"
    assert all(not c.allowed for c in found)


def test_what_may_be_missing_is_allowed_where_it_could_not_be_checked(record):
    found = record(["signature", "b", "a.csv"])
    assert [c.allowed for c in found] == [True, False, False, False, False, True]
    with pytest.raises(InputError, match=r"'z' cannot be allowed; there are .*a\.csv.*signature"):
        record(["z"])


def test_a_file_that_differs_does_not_hold_and_one_that_is_gone_is_not_checked(record, tmp_path):
    (tmp_path / "data" / "a.csv").write_text("other")
    changed = record()[3]
    assert changed.holds is False
    assert "differs" in changed.line
    (tmp_path / "data" / "a.csv").unlink()
    gone = record(["measurement"])[3]
    assert (gone.holds, gone.allowed) == (None, True)
    assert gone.line.endswith("not found here")
    # A copy next to the record is the file, or is wrong.
    (tmp_path / "out" / "a.csv").write_text("a.csv")
    assert record()[3].holds is True
    (tmp_path / "out" / "a.csv").write_text("other")
    assert record()[3].holds is False


def test_a_copy_may_be_of_another_file_of_that_name(record, tmp_path):
    """And what a command writes next to its record is no copy of what it read."""
    other = tmp_path / "data" / "more"
    other.mkdir()
    (other / "a.csv").write_text("of another run")
    first = {
        "role": "m",
        "path": str(tmp_path / "data" / "a.csv"),
        "sha256": sha256(tmp_path / "data" / "a.csv"),
    }
    second = {"role": "m", "path": str(other / "a.csv"), "sha256": sha256(other / "a.csv")}
    (tmp_path / "out" / "a.csv").write_text("of another run")
    assert [c.holds for c in record(files=[first, second])[3:5]] == [True, True]
    assert record(files=[first])[3].holds is False
    (tmp_path / "out" / "report.html").write_text("written by compare")
    assert record()[4].holds is True


def test_another_code_could_not_be_checked(record):
    found = record(code={"version": "2", "sha256": "d"})[1]
    assert (found.holds, found.name) == (None, "code")
    assert "different from here" in found.line
    with pytest.raises(InputError, match="has the form 'other'"):
        record(form="other")


def test_a_signature_needs_a_key_and_a_key_a_signature(record, tmp_path, monkeypatch):
    named = record(public_key="KEY")
    assert named[0].holds is False
    assert "is missing next to the record" in named[0].line
    assert named[1].name == "key"
    (tmp_path / "out" / "validation.sig").write_bytes(b"signed")
    assert record()[0] == (
        False,
        "signature: present, but the record names no key; --key gives one",
        "",
        False,
    )
    monkeypatch.setattr(
        verification, "is_signed", lambda raw, signature, public, where: public == b"KEY"
    )
    good = record(public_key="KEY")
    assert (good[0].holds, good[1].holds) == (True, None)
    assert good[0].line == "signature: by the key that the record names"
    assert (
        record(public_key="other")[0].line
        == "signature: not of this record by the key that the record names"
    )
    file = tmp_path / "key.pem"
    file.write_bytes(b"KEY")
    given = record(public_key="other", key=file)
    assert (given[0].holds, given[1].name) == (True, "code"), "whose key it is, is known"
    file.unlink()
    with pytest.raises(InputError, match="cannot be read"):
        record(public_key="KEY", key=file)


# What a record says of its runs and its model


def test_poses_in_a_row_tell_cuts_of_one_log():
    """Of so many rows, in which the ship moves all the time."""
    pose = np.cumsum(np.random.default_rng(0).normal(size=(60, 3)), axis=0)
    n = validation.IN_A_ROW
    assert len(_rows(pose)) == 60 - n
    assert _rows(pose) & _rows(pose[20:])
    assert not _rows(pose) & _rows(pose + 1e-9)
    still = pose.copy()
    still[30:] = still[30]
    assert len(_rows(still)) == 31 - n
    gap = pose.copy()
    gap[30, 0] = np.nan
    assert len(_rows(gap)) == (30 - n) + (60 - 30 - n), "the row behind it has moved"


class Print:
    """A fingerprint of a run."""

    def __init__(self, name, motion):
        self.name, self.motion, self.sha256 = name, motion, name

    def alike(self, other):
        return self.motion == other.motion


def compared(monkeypatch, runs, learned_from=()):
    """A comparison of runs: name -> motion, poses, whether it is held out."""
    monkeypatch.setattr(validation.Fingerprint, "of", lambda smoothed: smoothed)
    evaluations = [
        SimpleNamespace(
            name=name, smoothed=Print(name, motion), learned=object(), held_out=held_out,
            weak_windows=SimpleNamespace(run=SimpleNamespace(pose=pose, trial=None)),
        )
        for name, (motion, pose, held_out) in runs.items()
    ]  # fmt: skip
    model = SimpleNamespace(learned_from=list(learned_from))
    return SimpleNamespace(evaluations=evaluations, predictor=SimpleNamespace(model=model))


def test_runs_that_the_model_has_seen_are_told_by_their_motion(monkeypatch):
    rng = np.random.default_rng(1)
    poses = [np.cumsum(rng.normal(size=(60, 3)), axis=0) for _ in range(4)]
    runs = {
        "a": (1, poses[0], False), "b": (2, poses[1], True), "c": (3, poses[1][10:], True),
        "d": (1, poses[2], True), "e": (5, poses[3], True),
    }  # fmt: skip
    seen = Print("x", 5)
    found = _JudgedRuns(compared(monkeypatch, runs, [seen]), None, None, [])
    assert [f.name for f in found.learned_from] == ["x", "a"]
    assert [sorted(pair) for pair in found.same] == [["a", "d"], ["b", "c"]]
    assert found._seen == {"a", "d", "e"}
    more = SimpleNamespace(learned_from=[Print("y", 2)])
    assert _JudgedRuns(compared(monkeypatch, runs), more, None, [])._seen == {"a", "b", "d"}


def test_runs_are_predicted_for_each_horizon_with_what_is_not_known(monkeypatch):
    runs = {"a": (1, np.zeros((0, 3)), True), "b": (1, np.zeros((0, 3)), True)}
    monkeypatch.setattr(validation, "_rows", lambda pose: set())

    def predictions(e, horizon):
        if e.name == "b":
            raise InputError("b is too short")
        return SimpleNamespace(name=e.name, horizon=horizon)

    monkeypatch.setattr(validation, "Predictions", predictions)
    monkeypatch.setattr(validation, "possible", lambda smoothed, horizon: int(horizon))
    stated = {"initial_state": "no noise is known", "current": {"position": np.zeros(1)}}
    monkeypatch.setattr(validation, "sources_of", lambda *_: stated)
    monkeypatch.setattr(validation, "window_means", lambda p: {"u": p.horizon})
    notes = []
    judged = _JudgedRuns(compared(monkeypatch, runs), None, None, notes)
    (found,) = judged.predicted(4.0)
    assert (found.name, found.sources, found.signals, found.same) == (
        "a",
        stated,
        {"u": 4.0},
        {"a", "b"},
    )
    assert found.learned is False
    assert judged.short == {4.0: {"b": 4}}
    assert notes == ["initial state: no noise is known", "b is too short"]


def test_what_nobody_may_conclude_is_listed(monkeypatch):
    comparison = compared(monkeypatch, {"a": (1, np.zeros((0, 3)), True)})
    comparison.predictor.whole, comparison.predictor.name = False, "model.fmu"
    met = judge(criterion(), ["a"], [run(std=0.01, more={"wind": "not known"})])
    later = judge(criterion(quantity="heading", unit="deg", horizon=4.0, runs=["z"]), ["a"], [run()])
    said = [*_not_covered(comparison, [met, later])]
    assert said[1] == "Predictions over other times than 4, 8 s."
    assert said[2].startswith("Errors of heading, ")
    assert "position" not in said[2]
    assert said[3] == "position after 8 s: u_val does not include wind, which are not known."
    assert said[-1] == "Measures of manoeuvring trials: there is no trial among the runs."
    assert not any("measured state" in s for s in said)
    comparison.predictor.whole = True
    comparison.evaluations[0].weak_windows.run.trial = "zigzag"
    said = [*_not_covered(comparison, [met, later])]
    assert "Predictions from a measured state: the velocity of model.fmu cannot be set." in said
    assert said[-1].endswith("which comparison.json has, but no criterion.")


@pytest.mark.parametrize(
    ("parametric", "own", "by_user", "confinement", "stated"),
    [
        (True, False, False, "", "none needed: the model is parameters of this program"),
        (True, True, False, "", "unconfined: effects of the user (unconfined)"),
        (False, False, False, "landlock", "landlock"),
        (False, False, False, "", "unconfined"),
        (True, False, True, "", "unconfined"),
        (False, True, False, "landlock", "unconfined: effects of the user (landlock)"),
    ],
)
def test_what_keeps_the_code_of_a_model_from_the_data(
    monkeypatch, parametric, own, by_user, confinement, stated
):
    monkeypatch.setattr(validation, "foreign", lambda predictor: by_user)
    description = SimpleNamespace(outside=list("abcd"))
    predictor = SimpleNamespace(
        parametric=parametric, confinement=confinement, description=lambda: description
    )
    effects = SimpleNamespace(files=["e.py"] if own else [])
    model = SimpleNamespace(ship=SimpleNamespace(effects=effects))
    comparison = SimpleNamespace(predictor=predictor, evaluations=[SimpleNamespace(model=model)])
    assert validation._confinement(comparison) == stated
    said = [*validation._of_code(comparison)]
    assert (len(said) == 2) == stated.startswith("unconfined")
    assert said[-1].endswith("files outside of its own: a, b, c, ....")
    description.outside = list("abc")
    assert [*validation._of_code(comparison)][-1].endswith("own: a, b, c.")
    description.outside = []
    assert len([*validation._of_code(comparison)]) == len(said) - 1


def test_a_model_is_named_by_its_file_or_by_what_it_is(monkeypatch):
    monkeypatch.setattr(validation, "foreign", lambda predictor: hasattr(predictor, "own"))
    monkeypatch.setattr(validation, "parameters_of", lambda model: model)

    def name(**more):
        return validation._model_name(SimpleNamespace(predictor=SimpleNamespace(name="it", **more)))

    assert name(own=1) == "SimpleNamespace, a class of the user"
    assert name(files=[("model", "m.fmu"), ("map", "m.json")], parametric=False) == "m.fmu"
    assert name(parametric=False) == "it, which is not a file"
    assert name(parametric=True, model=({}, {})) == "nominal model"
    assert name(parametric=True, model=({}, {"lag": 1.0})) == "parameters that are not a file"
