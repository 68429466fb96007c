"""The commands of the diagnosis: files, terminal, exit codes; and bad input, one line each."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import redirect_stdout
from dataclasses import fields
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from support.cse1 import EFFECTS
from support.measured import sail, table_of
from support.processes import two_processes
from support.shared import once

import diagnosis
from cosim import InputError
from cybership import scratch_folder
from diagnosis import compare, design_run, learn, session
from diagnosis.assessment.stability import OPERATING, least_dissipation
from diagnosis.execution.result_folder import together
from diagnosis.predictors import DescribedShip
from diagnosis.report import ReportData, calibration_content
from diagnosis.report.formatting import as_json, finite
from diagnosis.report.headline import SEARCH_GAINED, SEARCH_GAINED_NOTHING
from fmus.effects import STANDARD
from fmus.ship import ship

EMPTY = (
    '<ParameterSet xmlns="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" '
    'name="model"><Parameters>%s</Parameters></ParameterSet>'
)
HERE = Path(__file__).parent
COLUMNS = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]
DRAG = {"ship": {"delta_X_u": -3.0}}
SIGNALS = {"time": "time"} | {n: f"observer.{n}_m" for n in ("x", "y", "psi")}
SIGNALS |= {f"tau_{a}": f"thrusters.tau_cmd_{a}" for a in "XYN"}


def frame(seconds=96.0, **hidden):
    return table_of(sail(seconds, h=0.05, **hidden)[0])


def write_runs(folder):
    for name, seconds, hidden in (("a", 64.0, DRAG), ("b", 48.0, DRAG), ("c", 64.0, {})):
        frame(seconds, seed=ord(name), **hidden).to_csv(folder / f"{name}.csv", index=False)


@pytest.fixture(scope="session")
def runs(shared):
    """A folder with measured runs: a and b of a ship with more drag than the model's, c of the model's."""
    return once(shared / "measured", write_runs)


def run(main, *arguments):
    """Exit code and standard output of a command."""
    shown = StringIO()
    with redirect_stdout(shown):
        try:
            code = main([str(a) for a in arguments])
        except SystemExit as end:
            code = end.code
    return code, shown.getvalue()


def strict(path):
    def refuse(constant):
        raise AssertionError(f"{constant} in {path}")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


def model(folder):
    return import_module("diagnosis.predictors").read_model(folder / "model.ssv")


@pytest.fixture(scope="session")
def learned(runs, shared):
    """Folder, exit code and terminal of one run of learn, on logs that say wrong things of the plant."""

    def work(folder):
        write_logs(runs, folder)
        with two_processes():
            done = run(learn.main, folder / "a", "--test", folder / "b", "--out", folder / "deep" / "er")
        (folder / "done").write_text(json.dumps(done))

    folder = once(shared / "learned", work)
    return folder / "deep" / "er", *json.loads((folder / "done").read_text())


def test_the_files_are_there_and_nothing_else(learned):
    out, code, _ = learned
    assert code == 0
    early = {"calibrated.json", "calibrated.ssv", "comparison.json"}
    found = {"diagnosis.json", "model.ssv", "posterior.json", "report.html"}
    assert {p.name for p in out.iterdir()} == {*early, *found, "coefficients.csv", "coefficients.tex"}


def test_the_hidden_drag_is_found_and_the_error_falls(learned):
    out, _, _ = learned
    content = strict(out / "diagnosis.json")
    (first,) = content["effects"]
    assert first["id"] == "X_u", "far outside of the prior of its coefficient"
    assert first["confidence"] > 0.95
    assert not content["remainder"]["significant"]
    assert content["verdict"] == ("ambiguous" if first["indistinguishable"] else "found")
    low, high = first["coefficients"]["delta_X_u"]["ci95"]
    assert low < -3.0 < high
    assert first["share_of_error"] > 0.9
    for errors, held_out in zip(content["errors"], (False, True), strict=True):
        assert errors["held_out"] is held_out
        for key in ("window_position_rmse", "window_heading_rmse"):
            assert errors[key]["after"] < 0.3 * errors[key]["before"]
        assert errors["omega_rms"]["after"][0] < 0.1 * errors["omega_rms"]["before"][0]
    assert model(out).vessel["delta_X_u"] == first["coefficients"]["delta_X_u"]["value"]


def test_json_has_every_key_of_the_format(learned):
    content = strict(learned[0] / "diagnosis.json")
    keys = "verdict effects possibilities withdrawn remainder suspect_coefficients ranking data errors where"
    assert {*keys.split(), "where_after", "stability"} <= set(content)
    assert [e["use"] for e in content["errors"]] == ["train", "test"]
    region = {
        *["axis", "by", "unit", "run", "low", "high", "rms", "elsewhere", "share_of_time", "sentence"]
    }
    assert all(region == set(r) for r in content["where"]["regions"])
    profile = {*["axis", "by", "unit", "run", "ends", "rms", "uncertainty", "share_of_time"]}
    assert all(profile == set(p) for p in content["where_after"]["profiles"])
    axis = {"rms", "uncertainty", "share"}
    assert all(axis == set(a) for a in content["remainder"]["axes"].values())
    effect = {
        *["id", "axis", "coefficients", "confidence", "share_of_error", "indistinguishable", "advice"]
    }
    assert effect <= set(content["effects"][0])
    assert {"value", "unit", "ci95", "run"} == set(content["effects"][0]["coefficients"]["delta_X_u"])
    assert {"id", "score", "q2", "beyond", "behind", "behind_std"} == set(content["ranking"][0])
    assert {r["id"] for r in content["ranking"]} <= set(EFFECTS)
    counts = {"samples", "frozen", "dropped", "spikes", "used"}
    assert counts <= set(content["data"])
    for name in counts:
        assert content["data"][name] == sum(r[name] for r in content["data"]["runs"])
    stable = {"nominal_min_dissipation", "learned_min_dissipation", "bounded", "region"}
    assert stable <= set(content["stability"])


def test_the_files_agree_with_each_other_and_with_the_model(learned):
    out, _, _ = learned
    content, posterior = strict(out / "diagnosis.json"), strict(out / "posterior.json")
    start, last, deviation = diagnosis.Model(), model(out), np.sqrt(np.diag(posterior["covariance"]))
    std = dict(zip(posterior["names"], deviation, strict=True))
    assert [c["name"] for c in content["coefficients"][:2]] == ["vessel.m", "vessel.I_z"]
    known = {c["name"] for c in content["coefficients"]}
    assert known >= {f"{start.owner(n)}.{n}" for n in start.ship.coefficients if start.value(n)}
    for c in content["coefficients"]:
        name = c["name"].partition(".")[2]
        assert (c["before"], c["unit"]) == (start.value(name), start.declared(name).unit)
        assert c["after"] == pytest.approx(last.value(name))
        half = 1.959964 * std[c["name"]]
        assert c["ci95"] == pytest.approx((c["after"] - half, c["after"] + half))
        assert (c["origin"] == "learned") == (name == "delta_X_u")
    (effect,) = content["effects"]
    assert effect["coefficients"]["delta_X_u"]["ci95"] == pytest.approx(c["ci95"], rel=1e-4)
    table = pd.read_csv(out / "coefficients.csv")
    assert [*table.columns] == ["name", "unit", "before", "after", "ci95_low", "ci95_high", "origin"]
    rows = [[c["before"], c["after"], *c["ci95"]] for c in content["coefficients"]]
    np.testing.assert_allclose(table[["before", "after", "ci95_low", "ci95_high"]], rows)
    assert (out / "coefficients.tex").read_text(encoding="utf-8").count(r"\\") == len(table) + 1
    correlation = np.array(content["correlation"]["matrix"])
    assert correlation * np.outer(deviation, deviation) == pytest.approx(
        np.array(posterior["covariance"])
    )
    assert [(r["run"], r["seconds"], r["samples"]) for r in content["data"]["runs"]] == [("a", 64.0, 1280), ("b", 48.0, 960)]  # fmt: skip
    assert content["windows"] == {"prediction": 8.0, "model_error": 3.0}
    assert (content["runs"], content["model"], content["seed"], content["prior"]) == (["a", "b"], None, 0, None)  # fmt: skip
    assert content["files"] == [*learn.EARLY, "diagnosis.json", "model.ssv", "posterior.json", "report.html", "coefficients.csv", "coefficients.tex"]  # fmt: skip
    assert content["versions"]["numpy"] == np.__version__
    scores = [r["score"] for r in content["ranking"]]
    assert scores == sorted(scores)
    assert [r["behind"] for r in content["ranking"]] == pytest.approx([s - scores[0] for s in scores])
    # What remains is judged on the runs that decide, the profiles are of all runs.
    for k, (axis, left) in enumerate(content["remainder"]["axes"].items()):
        for key, when, total in (
            ("where_after", "after", left["rms"]),
            ("where", "before", left["rms"] / left["share"] ** 0.5),
        ):
            of_run = {e["use"]: e["omega_rms"][when][k] for e in content["errors"]}
            decide = [e["omega_rms"][when][k] for e in content["errors"] if e["use"] != "test"]
            assert min(decide) * (1.0 - 1e-9) <= total <= max(decide) * (1.0 + 1e-9)
            assert set(of_run) == {"train", "test"}
            profiles = [p for p in content[key]["profiles"] if (p["axis"], p["run"]) == (axis, None)]
            assert profiles
            for p in profiles:
                squares = [
                    n * (x or 0.0) ** 2 for n, x in zip(p["share_of_time"], p["rms"], strict=True)
                ]
                every = [*decide, of_run["test"]]
                assert min(every) <= math.sqrt(sum(squares)) <= max(every)
    for key, of in (("nominal", start), ("learned", last)):  # over the region of the data
        assert least_dissipation(of, OPERATING) < content["stability"][f"{key}_min_dissipation"] < 0.0


def test_terminal_tells_what_the_file_tells_within_80_columns(learned):
    out, _, text = learned
    content = strict(out / "diagnosis.json")
    flat = " ".join(text.split())
    assert max(map(len, text.splitlines()[:-1])) <= 80
    for part in (
        content["effects"][0]["sentence"],
        content["effects"][0]["equation"],
        *content["where"]["sentences"],
    ):
        assert " ".join(part.split()) in flat
    assert "b (test)" in flat
    assert flat.endswith(f"report.html, coefficients.csv, coefficients.tex in {out}")


def test_a_log_is_the_run_of_its_measurement(runs, tmp_path):
    write_logs(runs, tmp_path)
    for name in "ab":
        log, table = (diagnosis.read(path) for path in (tmp_path / name, runs / f"{name}.csv"))
        for field in fields(diagnosis.Run):
            if field.name in ("called", "file", "hashes", "layout"):  # of the file
                continue
            if field.name == "ship":
                assert log.ship == table.ship is not None
                continue
            np.testing.assert_array_equal(getattr(log, field.name), getattr(table, field.name))


def write_logs(runs, tmp_path):
    """Folders a and b of logs that hold the measured runs, and more that is not to be looked at."""
    for name in "ab":
        (tmp_path / name).mkdir()
        table = pd.read_csv(runs / f"{name}.csv", dtype=str).rename(columns=SIGNALS)  # as it is written
        table.assign(**{"vessel.x": 7.0}).to_csv(tmp_path / name / "log.csv", index=False)
        plant = {"scenario": {"fmus": {"vessel": {"parameters": {"delta_X_u": 9.0, "m": 99.0}}}}}
        (tmp_path / name / "log.json").write_text(json.dumps(plant))


@pytest.mark.slow
def test_compare_with_the_learned_model_gives_the_errors_after(learned, runs, tmp_path):
    ssv, files = learned[0] / "model.ssv", [runs / "a.csv", runs / "b.csv"]
    code, _ = run(compare.main, *files, "--model", ssv, "--out", tmp_path)
    assert code == 0
    content, last = strict(learned[0] / "diagnosis.json")["errors"], strict(tmp_path / "comparison.json")
    assert not [e for e in last["errors"] if "use" in e], "nothing is learned from any run"
    assert last["model"] == "model.ssv"
    for e, a in zip(content, last["errors"], strict=True):
        for key in ("window_position_rmse", "window_heading_rmse", "omega_rms"):
            # Newtons are those by the mass of the model in use, which the learned one changes a little.
            near = 1e-2 if key == "omega_rms" else 1e-9
            assert a[key]["before"] == pytest.approx(e[key]["after"], rel=near)


UGLY = {
    "a missing file": (["aa.csv"], "did you mean 'a.csv'?"),
    "a folder without a log": (["."], "log.csv is missing"),
    "too short to learn": (["little.csv"], "too little data to learn from"),
    "no thrust": (["idle.csv"], "commands are zero throughout"),
    "the same run twice": (["a.csv", "a.csv"], "is given twice"),
    "held out what was learned": (["a.csv", "--test", "copy.csv"], "the same measurement as"),
    "a model that is none": (["a.csv", "--model", "a.csv"], "cannot be read as a parameter set"),
    "an unknown parameter": (["a.csv", "--model", "wrong.ssv"], "delta_X_v"),
    "a folder that is a file": (["a.csv", "--out", "a.csv"], "it is a file, not a folder"),
    "a horizon beyond the run": (
        ["a.csv", "--horizon", "1000"],
        "longer than every run; the longest has",
    ),
    "a horizon within a row": (["a.csv", "--horizon", "0.001"], "shorter than the"),
    "effects that are none": (["a.csv", "--effects", "none.py"], "registers no effect"),
}


@pytest.fixture(scope="session")
def ugly(runs, tmp_path_factory):
    """The folder of the runs with those that cannot be used."""
    good, folder = pd.read_csv(runs / "a.csv"), tmp_path_factory.mktemp("ugly")
    good.to_csv(folder / "a.csv", index=False)
    good[:600].to_csv(folder / "little.csv", index=False)
    good.assign(tau_X=0.0, tau_Y=0.0, tau_N=0.0).to_csv(folder / "idle.csv", index=False)
    good.to_csv(folder / "copy.csv", index=False)
    row = '<Parameter name="vessel.delta_X_v"><Real value="1"/></Parameter>'
    (folder / "wrong.ssv").write_text(EMPTY % row)
    (folder / "none.py").write_text("x = 1\n")
    return folder


@pytest.mark.parametrize("case", UGLY)
def test_bad_input_is_one_line_and_leaves_nothing(case, ugly, tmp_path, monkeypatch, capfd):
    arguments, message = UGLY[case]
    monkeypatch.chdir(ugly)
    before = sorted(ugly.iterdir())
    out = [] if "--out" in arguments else ["--out", tmp_path / "out" / "in"]
    code, text = run(learn.main, *arguments, *out)
    assert code == 2
    assert text == ""
    said = capfd.readouterr().err
    assert message in said
    assert len(said.splitlines()) == 1
    assert sorted(ugly.iterdir()) == before
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "name", ["compare", "learn", "pca", "pls", "propose_columns", "replay", "sysid", "watch"]
)
def test_help_has_examples_and_exit_codes_on_lines_of_their_own(name):
    room = "diagnosis" if name in ("compare", "learn", "propose_columns") else "thesis"
    code, text = run(import_module(f"{room}.{name}").main, "--help")
    lines = text.splitlines()
    assert code == 0
    assert any(line.startswith("exit codes: 0 done") for line in lines)
    first = next(k for k, line in enumerate(lines) if line.startswith("examples:"))
    assert f"python -m {room}.{name} " in lines[first]


@pytest.fixture
def written(monkeypatch, tmp_path):
    """The commands without their work: what is learned is given, and each file says what made it."""
    (tmp_path / "a.csv").write_text("time\n")
    given = SimpleNamespace(
        sound=True,
        learned=SimpleNamespace(model=diagnosis.Model().plus({"delta_X_u": -1.0})),
        posterior=SimpleNamespace(write=lambda path, *_: path.write_text("{}")),
        comparison=SimpleNamespace(
            evaluations=[], omega_std=[], predictor=DescribedShip(diagnosis.Model())
        ),
        files=None,
        measured=False,
    )

    def report_of(found, model, files):
        given.files = files
        return given

    def write_coefficients(made, csv, tex):
        assert made is given
        csv.write_text("csv")
        tex.write_text("tex")

    def write_report(path, made, advance, origin):
        assert made is given
        path.write_text("html")

    for name, stub in (
        ("ReportData", SimpleNamespace(of=report_of)),
        ("file_content", lambda made: {"verdict": "found"}),
        ("show_diagnosis", lambda made, out: [f"shown, in {out}"]),
        ("show_comparison", lambda made, out: [f"shown, in {out}"]),
        ("write_coefficients", write_coefficients),
        ("write_report", write_report),
    ):
        monkeypatch.setattr(f"diagnosis.report.{name}", stub)
    monkeypatch.setattr("diagnosis.assessment.gathering.gather", lambda paths, *_: list(paths))
    task = SimpleNamespace(
        compare=lambda: given.comparison,
        with_likelier_commands=lambda: task,
        calibrate=lambda: None,
        diagnose=lambda: given,
        runs=[],
        train=[],
        validate=[],
    )
    monkeypatch.setattr(session, "begin", lambda *_, **__: task)
    monkeypatch.setattr(session, "evaluate", lambda *_, **__: given.comparison)
    return given


@pytest.mark.parametrize(
    ("sound", "options", "kept"),
    [(True, [], True), (False, [], False), (False, ["--allow-unstable"], True)],
)
def test_model_that_is_not_sound_is_not_written_unless_it_is_asked_for(
    sound, options, kept, written, tmp_path
):
    written.sound = sound
    code, text = run(learn.main, tmp_path / "a.csv", "--out", tmp_path / "out", *options)
    files = {learn.COMPARISON, *learn.FILES} - (set() if kept else {learn.MODEL, learn.POSTERIOR})
    assert code == (0 if kept else 3)
    assert {path.name for path in (tmp_path / "out").iterdir()} == files == set(written.files)
    assert ("model.ssv is NOT written" in text) is not kept
    assert "shown, in" in text
    assert strict(tmp_path / "out" / "diagnosis.json") == {"verdict": "found"}
    assert (tmp_path / "out" / learn.CSV).read_text() == "csv"


def test_compare_writes_its_numbers_and_its_page(written, tmp_path):
    code, text = run(compare.main, tmp_path / "a.csv", "--out", tmp_path / "out")
    assert (code, "shown, in" in text) == (0, True)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"comparison.json", "report.html"}
    assert strict(tmp_path / "out" / "comparison.json") == {"verdict": "found"}


def test_compare_shows_its_errors_before_it_draws_the_report(written, monkeypatch, tmp_path, capsys):
    def draw(*_):
        assert "shown, in" in capsys.readouterr().out
        assert (tmp_path / "out" / "comparison.json").exists()
        raise InputError("no picture")

    monkeypatch.setattr("diagnosis.report.write_report", draw)
    assert compare.main([str(tmp_path / "a.csv"), "--out", str(tmp_path / "out")]) == 2
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"comparison.json"}


@pytest.mark.parametrize("prior", ["-0.1", "nan", "much"])
def test_a_prior_that_is_none_is_refused(prior, runs, capfd):
    code, _ = run(learn.main, runs / "a.csv", f"--prior={prior}")
    assert code == 2
    assert "zero or more" in capfd.readouterr().err
    with pytest.raises(InputError, match="zero or more"):
        diagnosis.diagnose([], prior=-0.1)


@pytest.mark.parametrize(
    ("moment", "said"),
    [
        ("b@30", "there is no training run 'b' to split; there is a"),
        ("a@1e9", "run 'a' has no row in a part of it: it is from 0 to "),
        ("a", "needs the name of a run and seconds, as run1@131, not 'a'"),
        ("a@noon", "needs the name of a run and seconds, as run1@131, not 'a@noon'"),
        ("@30", "needs the name of a run and seconds, as run1@131, not '@30'"),
    ],
)
def test_a_moment_at_which_no_run_is_cut_is_refused(moment, said, runs, capfd):
    code, _ = run(learn.main, runs / "a.csv", "--test", runs / "b.csv", "--split", moment)
    assert code == 2
    assert said in " ".join(capfd.readouterr().err.split())


def test_a_run_that_is_split_is_two_runs(runs, tmp_path):
    given = [runs / "a.csv", "--split", "a@40", "--prior", "0", "--quick", "--out", tmp_path / "out"]
    code, _ = run(learn.main, *given)
    assert code == 0
    errors = strict(tmp_path / "out" / learn.COMPARISON)["errors"]
    assert [each["run"] for each in errors] == ["a until 40 s", "a from 40 s"]


def test_a_split_run_is_split_again_by_what_reads_its_result(runs, tmp_path):
    options = learn._parser().parse_args([str(runs / "a.csv"), "--split", "a@40"])
    task = tmp_path / "posterior.json"
    task.write_text(json.dumps({"task": learn._task(options)}))
    assert design_run._task(task).split == [("a", 40.0)]


def test_a_split_is_refused_where_the_parameters_of_an_fmu_are_calibrated(capfd):
    given = ["run.csv", "--model", "a.fmu", "--parameters", "p.json", "--split", "run@40"]
    assert learn.main(given) == 2
    assert "a parameter of an FMU has one value for all runs" in " ".join(capfd.readouterr().err.split())


def test_runs_of_the_same_name_are_told_apart(runs, tmp_path):
    (tmp_path / "a.csv").write_bytes((runs / "b.csv").read_bytes())
    names = [w.run.name for w in diagnosis.gather([runs / "a.csv", tmp_path / "a.csv"])]
    assert len(set(names)) == 2
    assert names[0] == "a", "whatever runs follow"


def write(out, text, error=None, names=("a", "b")):
    with together(out, ["a", "b"]) as new:
        for name in names:
            (new / name).write_text(text)
        assert not error or new.parent.parent == out
        if error:
            raise error


def test_folder_that_another_command_takes_away_is_made_again(tmp_path, monkeypatch):
    out, made = tmp_path / "a" / "b", scratch_folder.tempfile.mkdtemp

    def taken_away(**options):
        monkeypatch.setattr(scratch_folder.tempfile, "mkdtemp", made)
        out.rmdir()
        return made(**options)

    monkeypatch.setattr(scratch_folder.tempfile, "mkdtemp", taken_away)
    with together(out, ["x"]) as new:
        (new / "x").write_text("x")
    assert [f.name for f in out.iterdir()] == ["x"]


def test_files_appear_together_or_not_at_all(tmp_path):
    out = tmp_path / "new" / "folder"
    with pytest.raises(KeyboardInterrupt):
        write(out, "half", KeyboardInterrupt())
    assert not list(tmp_path.iterdir())
    write(out, "1")
    with pytest.raises(InputError):
        write(out, "2", InputError())
    assert {p.name: p.read_text() for p in out.iterdir()} == {"a": "1", "b": "1"}
    write(out, "3", names=["a"])
    assert {p.name: p.read_text() for p in out.iterdir()} == {"a": "3"}


def in_a_process(command, *arguments):
    """A command in a process of its own, where no vessel was imported yet."""
    text = (
        "import sys; from importlib import import_module; from cosim.command import run_command; "
        f"m = import_module('diagnosis.{command}'); run_command(lambda: m.main(sys.argv[1:]))"
    )
    paths = os.pathsep.join([str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, "-c", text, *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )


def test_commands_are_listed():
    listed = subprocess.run(
        [sys.executable, "-m", "diagnosis"], capture_output=True, text=True, check=True
    )
    for command in ("compare", "learn"):
        assert f"python -m diagnosis.{command}" in listed.stdout
    wrong = subprocess.run([*listed.args, "learn"], capture_output=True, text=True, check=False)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "'learn'; the commands are diagnosis.compare and diagnosis.learn" in wrong.stderr


USERS = '''
from typing import Annotated
from fmus.effects import effect

@effect("N_uuv", kind="force", axis="N", formula="N = k u u v", symbol="k")
def N_uuv(ship, N_uuv: Annotated[float, "N.s3/m3", "moment by u u v"] = 0.0):
    """A moment that I suspect."""
    return 0.0, 0.0, N_uuv * ship.u * ship.u * ship.v
'''


@pytest.mark.slow
def test_an_effect_of_the_user_is_found(tmp_path):
    (tmp_path / "mine.py").write_text(USERS)
    craft = ship(STANDARD.plus_file(tmp_path / "mine.py"))
    frame(64.0, ship={"N_uuv": 400.0}, craft=craft).to_csv(tmp_path / "run.csv", index=False)
    arguments = [tmp_path / "run.csv", "--effects", tmp_path / "mine.py", "--out", tmp_path / "out"]
    code, text = run(learn.main, *arguments, "--prior", "0")
    assert code == 0
    first = strict(tmp_path / "out" / "diagnosis.json")["effects"][0]
    assert first["id"] == "N_uuv"
    assert first["coefficients"]["N_uuv"]["value"] == pytest.approx(400.0, rel=0.1)
    assert first["sentence"] == "The ship has an effect that the model lacks: A moment that I suspect."
    assert "N = k u u v; k = " in text


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="no SIGINT to send")
def test_ctrl_c_leaves_the_answers_that_are_there(runs, tmp_path):
    out = tmp_path / "out"
    ended = in_a_process("learn", runs / "a.csv", "--out", out)
    while not (out / learn.CALIBRATION).exists():
        time.sleep(0.02)
        assert ended.poll() is None
    ended.send_signal(signal.SIGINT)
    shown, said = ended.communicate()
    assert "interrupted" in said
    assert ended.returncode == 130
    assert {path.name for path in out.iterdir()} == {*learn.EARLY}
    assert learn.SECOND in shown
    assert learn.THIRD not in shown


def test_numbers_that_are_none_are_null():
    found = finite({"a": math.nan, "b": [np.inf, np.float64(1.0)], "c": np.array([np.nan, 2.0])})
    assert found == {"a": None, "b": [None, 1.0], "c": [None, 2.0]}


@pytest.fixture(scope="session")
def quick(runs, shared):
    """Folder, exit code and terminal of one run of learn --quick."""

    def work(folder):
        with two_processes():
            done = run(
                learn.main, runs / "a.csv", "--test", runs / "b.csv", "--quick", "--out", folder / "out"
            )
        (folder / "done").write_text(json.dumps(done))

    folder = once(shared / "quick", work)
    return folder / "out", *json.loads((folder / "done").read_text())


def test_quick_stops_after_the_second_answer_and_says_what_is_left_out(quick):
    out, code, text = quick
    files = {path.name for path in out.iterdir()}
    content = strict(out / learn.CALIBRATION)
    assert code == 0
    assert files == {*learn.EARLY, learn.REPORT} == set(content["files"])
    assert strict(out / learn.COMPARISON)["files"] == [learn.COMPARISON]
    assert text.index(learn.FIRST) < text.index(learn.SECOND)
    assert " ".join(learn.LEFT_OUT.split()) in " ".join(text.split())
    assert content["left_out"] == [learn.LEFT_OUT]
    assert [e["use"] if "use" in e else e["held_out"] for e in content["errors"]] == [False, True]


def test_python_gives_what_the_command_gives(quick, runs):
    """The command in two processes, and this in one."""
    a, b = diagnosis.gather([runs / "a.csv", runs / "b.csv"])
    content = strict(quick[0] / learn.CALIBRATION)
    calibrated = diagnosis.calibrate([a], [b])
    report = ReportData.of(calibrated.comparison, None, content["files"])
    found = calibration_content(calibrated, report, content["left_out"])
    assert json.loads(as_json(found)) == content


def test_the_calibrated_parameter_set_has_the_error_that_is_told(quick, runs):
    out, _, _ = quick
    compared = diagnosis.compare([runs / "a.csv", runs / "b.csv"], model=out / learn.CALIBRATED)
    first = strict(out / learn.COMPARISON)["errors"]
    for e, before, stated in zip(
        compared.evaluations, first, strict(out / learn.CALIBRATION)["errors"], strict=True
    ):
        assert e.before.position == pytest.approx(stated["window_position_rmse"]["after"], rel=1e-6)
        assert before["window_position_rmse"]["before"] == stated["window_position_rmse"]["before"]


def test_all_effects_of_the_calibrated_model_are_those_of_the_initial_one(quick):
    model = import_module("diagnosis.predictors").read_model(quick[0] / learn.CALIBRATED)
    assert not [name for name in model.vessel if name.startswith("delta_")]


def test_three_answers_come_in_their_order_and_the_search_gains_where_an_effect_is_hidden(learned):
    out, _, text = learned
    places = [text.index(answer) for answer in (learn.FIRST, learn.SECOND, learn.THIRD)]
    assert places == sorted(places)
    content, after = strict(out / "diagnosis.json"), text[places[-1] :]
    gain = content["gain"]["position"]
    assert content["gain"]["gained"]
    assert gain["difference"] > 2.0 * gain["standard_error"]
    assert gain["difference"] == pytest.approx(gain["before"] ** 2 - gain["after"] ** 2)
    assert SEARCH_GAINED in " ".join(after.split())
    assert SEARCH_GAINED_NOTHING not in content["sentence"] + after


@pytest.mark.slow
def test_nothing_is_found_or_gained_where_nothing_is_missing(runs, tmp_path):
    code, text = run(learn.main, runs / "c.csv", "--prior", "0", "--out", tmp_path)
    content, page = strict(tmp_path / "diagnosis.json"), (tmp_path / "report.html").read_text("utf-8")
    assert (code, content["verdict"], content["effects"]) == (0, "none", [])
    for sentence in content["sentence"].split(". "):
        assert sentence in " ".join(text.split())
    for key in ("window_position_rmse", "window_heading_rmse", "omega_rms"):
        assert content["errors"][0][key]["after"] == content["errors"][0][key]["before"]
    assert all("no model error detected" in s for s in content["where"]["sentences"])
    empty = model(tmp_path)
    assert (dict(empty.vessel), dict(empty.thrusters), empty.clock) == ({}, {}, 0.0)
    assert not content["gain"]["gained"]
    assert content["sentence"].startswith(SEARCH_GAINED_NOTHING)
    third = " ".join(text[text.index(learn.THIRD) :].split())
    assert third.startswith(f"{learn.THIRD.strip()} Gain of the search {SEARCH_GAINED_NOTHING}")
    assert f'<p class="lead">{SEARCH_GAINED_NOTHING}' in re.sub(r"</?a\b[^>]*>", "", page)


@pytest.mark.parametrize("answers", [0, 1])
def test_an_interrupt_keeps_the_answers_that_are_there(answers, runs, tmp_path, monkeypatch):
    def interrupt(task):
        raise KeyboardInterrupt

    name = ("compare", "calibrate")[answers]
    monkeypatch.setattr(session.Session, name, interrupt)
    with pytest.raises(KeyboardInterrupt):
        run(learn.main, runs / "b.csv", "--out", tmp_path / "out")
    there = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    assert there == {*learn.EARLY[:answers]}


def test_files_of_an_older_result_go_away_with_the_first_answer(runs, tmp_path, monkeypatch):
    def refuse(task):
        raise InputError("refused")

    monkeypatch.setattr(session.Session, "calibrate", refuse)
    (tmp_path / learn.DIAGNOSIS).write_text("{}")
    code, _ = run(learn.main, runs / "b.csv", "--out", tmp_path)
    assert code == 2
    assert {path.name for path in tmp_path.iterdir()} == {learn.COMPARISON}


def test_exact_coefficients_are_not_calibrated(runs, tmp_path):
    code, text = run(learn.main, runs / "b.csv", "--prior", "0", "--quick", "--out", tmp_path / "out")
    assert code == 0
    assert " ".join(learn.NOTHING_TO_FIT.split()) in " ".join(text.split())
    assert {path.name for path in (tmp_path / "out").iterdir()} == {learn.COMPARISON}
    with pytest.raises(InputError, match="no coefficient to calibrate"):
        diagnosis.calibrate(runs / "b.csv", prior=0.0)
