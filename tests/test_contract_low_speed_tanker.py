"""The study of the tanker on numbers that are given: folds, tables, and what is learned."""

from types import SimpleNamespace

import numpy as np
import pytest

from cosim import InputError
from studies import low_speed_tanker as study
from studies.low_speed_tanker import LearnedFit

NAN = np.nan


class Page:
    """A report that keeps what it is given."""

    def __init__(self, *_):
        self.texts, self.headings, self.tables, self.results = [], [], [], {}
        self.text, self.heading = self.texts.append, self.headings.append

    def table(self, header, rows):
        self.tables.append((header, [*rows]))

    def result(self, name, value):
        self.results[name] = value

    def write(self):
        return self


def run(name):
    return SimpleNamespace(run=SimpleNamespace(name=name), smoothed=name)


class Windows:
    """Two windows of each run, with two samples each, but none of a run called ``turn_none``."""

    def __init__(self, runs, seconds):
        self.runs, self.seconds = runs, seconds
        self.run = np.repeat(np.arange(len(runs)), [0 if r == "turn_none" else 2 for r in runs])
        self.sample_window = np.repeat(np.arange(self.run.size), 2)

    def residuals(self, model):
        return self.seconds * np.arange(self.sample_window.size)

    def summary(self, left):
        return SimpleNamespace(over_all=lambda k: (self.seconds * (k + 1), np.radians(0.1 * (k + 1))))


def test_errors_are_those_of_each_run_by_horizon(monkeypatch):
    monkeypatch.setattr(study.diagnosis, "Windows", Windows)
    runs = [run("turn_a"), run("turn_none"), run("zigzag_b")]
    plain = study.errors(runs, None)
    assert plain["zigzag_b"] == [
        (60.0, pytest.approx(0.3), pytest.approx(NAN, nan_ok=True)),
        (180.0, pytest.approx(0.3), pytest.approx(NAN, nan_ok=True)),
    ]
    seen = []

    def bands(smoothed, windows):
        assert windows.runs == [smoothed]
        if smoothed == "turn_a":
            return None
        return SimpleNamespace(coverage=lambda left: seen.append(left.tolist()) or 0.75)

    found = study.errors(runs, None, LearnedFit(None, bands))
    inside = {name: [e[2] for e in each] for name, each in found.items()}
    assert inside["zigzag_b"] == [0.75, 0.75]
    assert np.isnan(inside["turn_a"] + inside["turn_none"]).all()
    assert seen == [[80.0, 100.0, 120.0, 140.0], [240.0, 300.0, 360.0, 420.0]]


FOUND = {
    "turn_1": [(1.0, 2.0, 0.8), (4.0, 8.0, 0.9)], "turn_2": [(4.0, 8.0, 0.6), (16.0, NAN, NAN)],
    "zigzag_1": [(3.0, 3.0, 0.7), (3.0, 3.0, 0.5)],
}  # fmt: skip


def test_a_table_has_geometric_means_by_kind_and_of_all():
    page = Page()
    means = study.table(page, "it", FOUND)
    ((header, rows),) = page.tables
    assert header == [
        "kind", "tests", "position, 20 s [m]", "heading, 20 s [°]", "position, 60 s [m]", "heading, 60 s [°]",
        "in the bands, 20 s [%]", "in the bands, 60 s [%]",
    ]  # fmt: skip
    assert rows[0] == ["turn", 2, "2", "4", "8", "8", "70", "90"]
    assert rows[1][:6] == ["zigzag", 1, "3", "3", "3", "3"]
    assert rows[2][:2] == ["all", 3]
    assert means == pytest.approx(
        np.array([[12 ** (1 / 3), 48 ** (1 / 3)], [192 ** (1 / 3), 24 ** (1 / 2)]])
    )
    assert page.results == {"it": FOUND}
    none = {n: [(p, h, NAN) for p, h, _ in each] for n, each in FOUND.items()}
    study.table(page, "it", none)
    assert len(page.tables[1][0]) == len(page.tables[1][1][0]) == 6


def test_tests_are_compared_one_by_one(monkeypatch):
    monkeypatch.setattr(study.diagnosis, "Windows", Windows)
    page, runs = Page(), [run("turn_1"), run("turn_2")]
    before = {"turn_1": [(1.0, 1.0, 0.5), (2.0, 2.0, 0.5)], "turn_2": [(1.0, 1.0, 0.5), (2.0, 2.0, 0.5)]}
    after = {"turn_1": [(0.5, 1.1, 0.0), (2.0, 3.0, 0.0)], "turn_2": [(2.0, 1.1, 0.0), (1.0, 1.0, 0.0)]}
    study.compare_tests(page, runs, before, after)
    ((header, rows),) = page.tables
    assert header[:3] == ["test", "windows of 20 s", "windows of 60 s"]
    assert rows == [
        ["turn_1", "2", "2", "0.50", "1.10", "1.00", "1.50"], ["turn_2", "2", "2", "2.00", "1.10", "0.50", "0.50"],
    ]  # fmt: skip
    assert page.texts == [
        "Of 2 tests, the errors are larger than the published model's: 1 in position, 20 s; 2 in heading, 20 s; "
        "0 in position, 60 s; 1 in heading, 60 s."
    ]


def test_what_is_learned_is_named(monkeypatch):
    effects = [SimpleNamespace(id="N_r"), SimpleNamespace(id="X_u")]
    learned = SimpleNamespace(model="learned", effects=effects)
    found = SimpleNamespace(changed=True, learned=learned, bands="bands", verdict="found")
    monkeypatch.setattr(study.diagnosis, "diagnose", lambda rest, model, advance: found)
    assert study.learn([], "model", True) == (("learned", "bands"), "found, N_r, X_u")
    found.changed, learned.effects = False, []
    assert study.learn([], "model", True) == (("model", "bands"), "found, no effect")
    moved = {"a": 1.4, "b": -2.0, "c": 3.04, "d": 1.5, "e": -1.6}
    findings = SimpleNamespace(moved=moved, model="fitted")
    begun = SimpleNamespace(calibration=SimpleNamespace(findings=findings, bands="bands"))
    monkeypatch.setattr(study.diagnosis, "begin", lambda rest, model: begun)
    assert study.learn([], "model", False) == (("fitted", "bands"), "c +3.0, b -2.0, e -1.6")
    begun.calibration = None
    with pytest.raises(InputError, match="do not determine"):
        study.learn([], "model", False)


@pytest.mark.parametrize(("folds", "search"), [(0, False), (2, False), (2, True)])
def test_the_study_has_the_published_model_and_what_each_fold_learns(
    monkeypatch, tmp_path, folds, search
):
    pages, asked = [], []
    for name in ("turn_1", "turn_2", "zigzag_1", "other_1"):
        (tmp_path / f"{name}.csv").write_text("")
    monkeypatch.setattr(study, "Report", lambda *of: pages.append(Page()) or pages[-1])
    monkeypatch.setattr(study, "read", lambda file, columns, model: run(file.stem))
    monkeypatch.setattr(study.diagnosis, "gather", lambda runs, **how: asked.append(how) or runs)
    monkeypatch.setattr(study, "Model", lambda ship: SimpleNamespace(ship=ship))
    described = SimpleNamespace(_replace=lambda **more: more)
    monkeypatch.setattr(study, "ship_with", lambda effects, name: SimpleNamespace(description=described))
    monkeypatch.setattr(study, "ship", lambda description: description)

    def errors(runs, model, fit=None):
        size = 2.0 if fit is None else 1.0
        return {w.run.name: [(size, size, NAN), (size, 4.0 * size, NAN)] for w in runs}

    learned = []

    def learn(rest, model, searched):
        learned.append(([w.run.name for w in rest], searched))
        return LearnedFit("model", None), "what it says"

    monkeypatch.setattr(study, "errors", errors)
    monkeypatch.setattr(study, "learn", learn)
    monkeypatch.setattr(study, "compare_tests", lambda page, *of: page.text("compared"))
    page = study.study(tmp_path, tmp_path, folds, search, False)
    assert asked[0]["horizon"] == 60.0
    assert page.texts[0].startswith("3 tests.")
    assert [*page.results] == ["description", "no wind"] + (["learned"] if folds else [])
    if not folds:
        assert learned == []
        return
    # Of each kind about as many in each fold.
    assert learned == [(["turn_2"], search), (["turn_1", "zigzag_1"], search)]
    assert "Without turn_1, zigzag_1: what it says." in page.texts
    assert page.texts[-3].endswith("0.50 in position and 0.50 in heading over 20 s; 0.50 in position and 0.50 in "
                                   "heading over 60 s.")  # fmt: skip
    assert any(t.startswith("With the search") for t in page.texts) == search
    assert any("by more than 1.5 standard deviations" in t for t in page.texts) != search


def test_a_folder_without_tests_is_refused(tmp_path):
    (tmp_path / "other_1.csv").write_text("")
    with pytest.raises(InputError, match="no tests KIND_DATE_TIME"):
        study.study(tmp_path, tmp_path, 0, False, False)


@pytest.mark.parametrize("calibrate", [True, False])
def test_the_command_searches_unless_it_is_told_to_calibrate(monkeypatch, calibrate):
    seen = []
    monkeypatch.setattr(study, "run_study", seen.append)
    words = ["study", "data", "--folds", "4", "--quick", *(["--calibrate"] if calibrate else [])]
    monkeypatch.setattr("sys.argv", words)
    study.main()
    data, _, folds, search, quick = seen[0].args
    assert (str(data), folds, search, quick) == ("data", 4, not calibrate, True)
