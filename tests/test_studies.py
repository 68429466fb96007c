"""What the studies share: variants of scenarios, runs over seeds, intervals, reports."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.dispatch import FinishedRun
from studies import study_command
from studies.study_command import study_parser
from studies.study_report import Report, Verdict, seeds_line
from thesis import monte_carlo
from thesis.monte_carlo import (
    SampleMean,
    interval,
    paired,
    ratio,
    run_all,
    run_each,
    shipped,
    vary,
    without,
)


def test_variant_leaves_the_shipped_content_alone():
    content = shipped("ellipse")
    before = json.dumps(content)
    varied = vary(
        content,
        fmus={"observer": "observer_df.fmu"},
        parameters={"vessel.delta_X_u": -4.0},
        faults=without(content["faults"], "freeze"),
        stop=5.0,
    )
    assert json.dumps(content) == before
    assert varied["fmus"]["observer"] == {"path": "observer_df.fmu"}
    assert varied["fmus"]["vessel"]["parameters"]["delta_X_u"] == -4.0
    assert varied["fmus"]["vessel"]["parameters"]["x_0"] == 5.0
    assert {fault["kind"] for fault in varied["faults"]} == {"noise"}
    assert varied["stop"] == 5.0


def test_wrong_names_are_told_with_what_was_near():
    with pytest.raises(cosim.InputError, match="did you mean 'ellipse'"):
        shipped("elipse")
    with pytest.raises(cosim.InputError, match="did you mean 'vessel'"):
        vary(shipped("ellipse"), parameters={"vesel.m": 1.0})


def last_x(result):
    return float(cosim.read_log(result.folder, ["observer.x_m"])["observer.x_m"][-1])


@pytest.mark.slow
def test_runs_come_back_by_variant_and_seed(tmp_path):
    short = vary(shipped("ellipse"), stop=0.5, metrics={})
    moved = vary(short, parameters={"vessel.x_0": 7.0})
    finished = []
    found = run_all({"a": short, "b": moved}, [3, 4], last_x, tmp_path, 2, lambda: finished.append(1))
    assert len(finished) == 4
    assert found["a"] == pytest.approx([5.0, 5.0], abs=0.05)
    assert found["b"] == pytest.approx([7.0, 7.0], abs=0.05)
    assert found["a"][0] != found["a"][1], "another seed gives other noise"
    assert json.loads((tmp_path / "b" / "4" / "log.json").read_text())["scenario"]["seed"] == 4


def test_every_variant_runs_with_its_seeds(monkeypatch, tmp_path):
    asked = {}

    def analyse_runs(contents, analyse, folders, processes, advance):
        asked.update(contents=contents, analyse=analyse, folders=folders, processes=processes)
        for _ in contents:
            advance()
        return [(content["name"], content["seed"]) for content in contents]

    monkeypatch.setattr(monte_carlo, "analyse_runs", analyse_runs)
    variants, finished = {"a": {"name": "A", "stop": 1.0}, "b": {"name": "B", "seed": 99}}, []
    found = run_all(variants, [3, 4], print, tmp_path, 2, lambda: finished.append(1))
    assert found == {"a": [("A", 3), ("A", 4)], "b": [("B", 3), ("B", 4)]}
    assert asked["folders"] == [tmp_path / name / str(seed) for name in "ab" for seed in (3, 4)]
    assert (asked["analyse"], asked["processes"], len(finished)) == (print, 2, 4)
    assert asked["contents"][0] == {"name": "A", "stop": 1.0, "seed": 3}
    assert variants["b"] == {"name": "B", "seed": 99}
    assert run_each(variants, {"a": [7], "b": []}, print) == {"a": [("A", 7)], "b": []}
    assert asked["folders"] == [None]
    assert asked["processes"] is None


def test_metrics_are_those_of_a_run_that_went_through(monkeypatch):
    assert monte_carlo.metrics(FinishedRun({}, metrics={"W": 1.0})) == {"W": 1.0}
    with pytest.raises(cosim.SimulationError, match="why"):
        monte_carlo.metrics(FinishedRun({}, status="failed", message="why"))


@pytest.mark.parametrize(
    ("error", "code", "out", "err"),
    [
        (None, 0, "there\n", ""),
        (cosim.InputError("wrong"), 2, "", "error: wrong\n"),
        (cosim.SimulationError("lost"), 3, "", "error: lost\n"),
    ],
)
def test_a_study_ends_with_its_report_or_one_line(error, code, out, err, monkeypatch, capsys):
    def study():
        if error is not None:
            raise error
        return "there"

    monkeypatch.setattr(study_command, "run_command", lambda work: sys.exit(work()))
    with pytest.raises(SystemExit) as ended:
        study_command.run_study(study)
    assert (ended.value.code, *capsys.readouterr()) == (code, out, err)


def test_options_of_studies_are_those_that_make_sense():
    plain = study_parser("studies.nothing", "What it does.", "an example").parse_args([])
    assert vars(plain) == {
        "out": Path("results/study_nothing"),
        "seeds": 10,
        "jobs": None,
        "quick": False,
    }
    still = study_parser("studies.nothing", "", "", seeds=None, jobs=False).parse_args(["--quick"])
    assert vars(still) == {"out": Path("results/study_nothing"), "quick": True}
    text = study_parser("studies.nothing", "What it does.", "an example").format_help()
    for part in (
        "python -m studies.nothing",
        "What it does.",
        "examples:\nan example",
        "(default: 10)",
        "0 done, 2 bad input",
    ):
        assert part in text


def test_progress_moves_on_without_a_terminal(capsys):
    with study_command.progress(2, "runs") as advance:
        advance()
        advance()
    assert capsys.readouterr().out == ""


def test_interval_holds_the_true_mean_as_often_as_it_says():
    rng = np.random.default_rng(0)
    inside = 0
    for _ in range(2000):
        found = interval(rng.normal(1.0, 2.0, 5).tolist())
        inside += found.low <= 1.0 <= found.high
    assert 0.935 < inside / 2000 < 0.965


def test_pairing_takes_off_what_both_share():
    rng = np.random.default_rng(1)
    shared = rng.normal(0.0, 100.0, 10)
    a, b = shared + 1.0 + rng.normal(0.0, 0.01, 10), shared
    assert paired(a, b).low > 0.9
    assert interval(a - 50.0).low < 0.0
    assert ratio(np.abs(b) * 2.0, np.abs(b)).mean == pytest.approx(2.0)


def test_single_value_has_an_open_interval():
    assert interval([3.0]) == (3.0, -np.inf, np.inf)
    assert str(interval([3.0])) == "3"


def test_report_holds_what_was_put_in(tmp_path):
    from matplotlib.figure import Figure

    report = Report(tmp_path / "new", "A study", [0, 1, 2])
    report.heading("Part")
    report.table(["name", "|e| [m]"], [["x|y", 0.123456], ["none", float("nan")]])
    report.figure("picture", Figure(), "What is seen")
    report.verdicts("claims", [Verdict("said", {"a": True, "b": False}, "1 to 2")], "numbers and cause")
    report.result("error", {"x": SampleMean(1.0, 0.5, 1.5), "y": np.array([1.0, np.nan])})
    text = report.write().read_text()
    assert "Seeds 0-2." in text
    assert "| x\\|y | 0.1235 |" in text
    assert "| none | – |" in text
    assert "![What is seen](picture.png)" in text
    results = json.loads((tmp_path / "new" / "results.json").read_text())
    assert "| thesis | here | numbers and cause |" in text
    assert "| said | holds: a; does not hold: b | 1 to 2 |" in text
    assert results["claims"] == [
        {"thesis": "said", "here": {"a": True, "b": False}, "numbers": "1 to 2", "printed": {}}
    ]
    assert results["error"] == {"x": {"mean": 1.0, "low": 0.5, "high": 1.5}, "y": [1.0, None]}
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == [
        "picture.png",
        "report.md",
        "results.json",
    ]


def test_what_fails_half_way_leaves_the_file_of_before(tmp_path):
    path = tmp_path / "report.md"
    path.write_text("before")

    def fail():
        with cosim.atomic_write(path) as scratch:
            scratch.write_text("half")
            raise RuntimeError("stopped half way")

    with pytest.raises(RuntimeError, match="half way"):
        fail()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_seeds_are_told_shortly():
    assert seeds_line(range(10)) == "seeds 0-9"
    assert seeds_line([3]) == "seed 3"
    assert seeds_line([1, 5]) == "seeds 1, 5"


@pytest.mark.parametrize("wrong", [["--seeds", "0"], ["--seeds", "many"], ["--jobs", "-1"], ["--what"]])
def test_wrong_option_ends_in_exit_code_2(wrong):
    with pytest.raises(SystemExit) as ended:
        study_parser("studies.nothing", "", "").parse_args(wrong)
    assert ended.value.code == 2
