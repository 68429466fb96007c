"""The command: exit codes, files, interruption, and nothing half-written."""

import json
import os
import re
import signal
import stat
import subprocess
import sys
import time
import zipfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.command import command as in_this_process
from support.command import without_progress
from support.cosim_run import SSV, command, in_a_process, parameter, start
from support.events import once_there
from support.plain import GAIN
from support.project import ROOT

import cosim
from cosim import metrics, plots, run
from cosim.master import real_time
from cosim.results.log import to_parquet
from cosim.scenario import Roles
from fmucheck.checking import main as check_main
from fmus.build.__main__ import main as build_main

PICTURES = {"trajectory.png", "errors.png", "metrics.png", "forces.png", "model_error.png"}


def test_run_leaves_log_metrics_and_pictures(scenario, tmp_path):
    done = in_a_process(scenario(), "--out", tmp_path / "out")
    assert done.returncode == 0
    assert done.stderr == ""
    assert "e_pos_rms" in done.stdout
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "log.csv", "log.json", "metrics.json", *PICTURES,
    }  # fmt: skip
    assert (tmp_path / "out" / "log.csv").read_text().startswith("time,vessel.")
    keys = "e_pos_rms e_pos_max cross_track_rms heading_rms ISE IAE W I_tau_dot IAEW IAEWWT IWWT from to"
    assert list(json.loads((tmp_path / "out" / "metrics.json").read_text())) == keys.split()


def test_metrics_are_told_before_anything_is_drawn(scenario, tmp_path, monkeypatch):
    stated = []
    monkeypatch.setattr(
        cosim.results.drawing, "draw", lambda *_: stated.append(sys.stdout.getvalue()) or []
    )
    done = command(scenario(), "--out", tmp_path / "out")
    assert "e_pos_rms" in stated[0]
    assert done.stdout.count("e_pos_rms") == 1


def test_quiet_without_plots_says_and_draws_nothing(scenario, tmp_path):
    done = in_a_process(scenario(), "--out", tmp_path / "out", "--quiet", "--no-plots")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert not PICTURES & {p.name for p in (tmp_path / "out").iterdir()}


def test_metrics_do_not_depend_on_what_is_logged(scenario, tmp_path):
    results = []
    for k, log in enumerate(({}, {"every": 7}, {"signals": ["guidance.x_t"]})):
        command(scenario(log=log), "--out", tmp_path / str(k), "--no-plots")
        results.append(json.loads((tmp_path / str(k) / "metrics.json").read_text()))
    assert results[0] == results[1] == results[2]


def test_metrics_of_a_log_are_those_of_its_run(scenario, tmp_path):
    command(scenario(metrics={"from": 0.5, "to": 1.5}), "--out", tmp_path / "out", "--no-plots")
    done = in_this_process(metrics.main, tmp_path / "out", "--json")
    again, own = json.loads(done.stdout), json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert again == pytest.approx(own)
    assert (own["from"], own["to"]) == (0.5, 1.5)


def test_runs_are_laid_over_each_other(scenario, tmp_path):
    for name in "ab":
        command(scenario(), "--out", tmp_path / name, "--no-plots")
    done = in_this_process(plots.main, tmp_path / "a", tmp_path / "b", "--out", tmp_path / "c")
    assert (done.returncode, done.stderr) == (0, "")
    assert {p.name for p in (tmp_path / "c").iterdir()} == PICTURES
    done = in_this_process(plots.main, tmp_path / "nowhere")
    assert done.returncode == 2
    assert "no log in" in done.stderr
    (tmp_path / "file").write_text("")
    done = in_this_process(metrics.main, tmp_path / "file")
    assert f"'{tmp_path / 'file'}' is a file; a log is a folder" in done.stderr


@pytest.mark.slow
def test_instances_may_have_any_names(ellipse, tmp_path):
    """With their roles stated, metrics and pictures are those of the usual names, to the byte."""
    new = {
        "vessel": "ship",
        "guidance": "path",
        "controller": "law",
        "thrusters": "drives",
        "observer": "filter",
    }

    def renamed(signal):
        instance, dot, variable = signal.partition(".")
        return new[instance] + dot + variable

    other = {
        **ellipse,
        "fmus": {new[name]: entry for name, entry in ellipse["fmus"].items()},
        "connections": [[renamed(end) for end in pair] for pair in ellipse["connections"]],
        "faults": [
            {**f, "signals": [renamed(name) for name in f["signals"]]} for f in ellipse["faults"]
        ],
        "roles": {
            role: [renamed(name) for name in names] for role, names in Roles().model_dump().items()
        },
    }
    results = [
        cosim.simulate(cosim.load_scenario(content), tmp_path / name, pictures=True)
        for name, content in (("usual", ellipse), ("other", other))
    ]
    assert results[0].metrics == results[1].metrics != {}
    for name in ("metrics.json", *PICTURES):
        assert (tmp_path / "usual" / name).read_bytes() == (tmp_path / "other" / name).read_bytes(), name
    assert "roles" not in json.loads((tmp_path / "usual" / "log.json").read_text())["scenario"]
    again = json.loads((tmp_path / "other" / "log.json").read_text())["scenario"]["roles"]
    assert again == other["roles"]
    assert cosim.simulate(cosim.load_scenario({**other, "roles": {}}), tmp_path / "none").metrics == {}


def test_default_folder_is_results_and_the_name(scenario, tmp_path):
    done = command(scenario(name="mine"), "--no-plots", cwd=tmp_path)
    assert done.returncode == 0
    assert (tmp_path / "results" / "mine" / "log.csv").is_file()


def test_folder_holds_nothing_of_an_earlier_run(scenario, tmp_path):
    out = tmp_path / "out"
    command(scenario(), "--out", out)
    (out / "notes.txt").write_text("mine")
    command(scenario(log={"signals": ["vessel.x"]}), "--out", out)
    assert {p.name for p in out.iterdir()} == {"log.csv", "log.json", "metrics.json", "notes.txt", *PICTURES} - {
        "forces.png", "model_error.png",
    }  # fmt: skip


def test_a_folder_is_one_run_s_as_long_as_that_runs(scenario, tmp_path):
    out, second = tmp_path / "out", []

    def meanwhile(seconds):
        if not second:
            second.append(command(scenario(stop=0.5), "--out", out))

    first = cosim.simulate(cosim.load_scenario(scenario()), out, progress=meanwhile)
    (done,) = second
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert f"another run writes to '{out}'" in done.stderr
    assert first.status == "done"
    assert len((out / "log.csv").read_text().splitlines()) == first.rows + 1
    assert not [p.name for p in out.iterdir() if p.name.startswith(".")]
    again = command(scenario(stop=0.5), "--out", out)
    assert again.returncode == 0
    assert "replaces the earlier run" in again.stdout + again.stderr


@pytest.mark.parametrize(
    ("changes", "arguments", "message"),
    [
        ({"stopp": 1.0}, [], "did you mean 'stop'"),
        ({}, ["--parameters", "nowhere.ssv"], "no such parameter set"),
        ({}, ["--realtime", "-1"], "positive number"),
        ({}, ["--outt", "x"], "unrecognized arguments: --outt x; did you mean '--out'?"),
        ({}, ["--entirely-other"], "unrecognized arguments: --entirely-other; "),
        ({}, ["--out", ""], "needs the name of a folder"),
        ({"log": {"signals": ["vessel.x_n"]}}, [], "did you mean 'x_m'"),
    ],
)
def test_bad_input_is_one_message_exit_2_and_no_file(scenario, tmp_path, changes, arguments, message):
    out = tmp_path / "out"
    done = command(scenario(**changes), "--out", out, *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not out.exists()


def test_out_that_cannot_be_a_folder_is_refused(scenario, tmp_path):
    (tmp_path / "file").write_text("")
    done = command(scenario(), "--out", tmp_path / "file")
    assert done.returncode == 2
    assert "file': it is a file, not a folder" in done.stderr


def test_warning_goes_to_stderr(scenario, ellipse):
    connections = [c for c in ellipse["connections"] if c[1] != "thrusters.*"]
    done = command(scenario(connections=connections, stop=0.1), "--no-plots", "--out", "/dev/null/x")
    assert "warning: thrusters: input u, v, r, u_c, v_c not connected" in done.stderr


def test_failed_simulation_is_exit_3_with_the_log_kept(scenario, tmp_path):
    events = [
        {"time": 1.0, "model": "vessel", "variable": "tau_X", "action": "override", "value": 1e300}
    ]
    done = in_a_process(scenario(events=events), "--out", tmp_path / "out")
    assert done.returncode == 3
    assert "vessel: the step from t = 1.0 s returned " in done.stderr
    assert "not finite" in done.stderr
    assert "Traceback" not in done.stderr
    assert len(cosim.read_log(tmp_path / "out")["time"]) == 101
    assert (tmp_path / "out" / "metrics.json").is_file()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_run_keeps_its_log_and_says_so(scenario, tmp_path, number):
    out = tmp_path / "out"
    process = start(scenario(stop=10000.0), out)
    process.send_signal(number)
    _, stderr = process.communicate()
    assert process.returncode == 130
    assert "interrupted: " in stderr
    assert "Traceback" not in stderr
    log = cosim.read_log(out)
    sidecar = json.loads((out / "log.json").read_text())
    assert sidecar["status"] == "interrupted"
    assert sidecar["rows"] == len(log["time"]) > 10


def test_killed_run_leaves_a_log_readable_up_to_its_last_block(scenario, tmp_path):
    out = tmp_path / "out"
    process = start(scenario(stop=10000.0), out, "--realtime", "4")
    first, size = cosim.read_log(out)["time"][-1], (out / "log.csv").stat().st_size
    once_there(lambda: (out / "log.csv").stat().st_size > size)
    process.kill()
    process.communicate()
    log = cosim.read_log(out)
    assert np.allclose(np.diff(log["time"]), 0.01)
    assert log["time"][-1] > first
    assert json.loads((out / "log.json").read_text())["status"] == "running"


def test_log_cut_in_the_middle_of_a_line_is_read_up_to_it(scenario, tmp_path):
    command(scenario(), "--out", tmp_path / "out", "--no-plots")
    whole = cosim.read_log(tmp_path / "out")
    data = (tmp_path / "out" / "log.csv").read_bytes()
    (tmp_path / "out" / "log.csv").write_bytes(data[:-37])
    cut = cosim.read_log(tmp_path / "out")
    assert all((cut[n] == whole[n][:-1]).all() for n in whole)


def test_real_time_is_kept(scenario, tmp_path):
    begun = time.monotonic()
    done = command(scenario(stop=3.0), "--out", tmp_path / "out", "--no-plots", "--realtime", "2")
    assert time.monotonic() - begun >= 1.5
    assert "missed deadlines" in done.stdout
    pace = json.loads((tmp_path / "out" / "log.json").read_text())["realtime"]
    assert pace["factor"] == 2.0


def test_pace_waits_in_short_sleeps_and_measures_how_late_it_is(monkeypatch):
    """Two simulated seconds a second; a sleep takes 10 ms more than it was asked for."""
    now, slept = [100.0], []

    def sleep(seconds):
        slept.append(seconds)
        now[0] += seconds + 0.01

    monkeypatch.setattr(real_time.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(real_time.time, "sleep", sleep)
    pace = real_time.RealTimePace(2.0, 0.1, lambda: False, started=100.0)
    pace.wait(0.3)
    assert max(slept) == real_time.LONGEST_SLEEP
    assert now[0] == pytest.approx(100.15 + 0.01)
    now[0] = 101.0  # 0.8 s later than it should: 2 s of the simulation are due
    pace.wait(0.4)
    found = pace.summary()
    assert found["factor"] == 2.0
    assert found["deadline_misses"] == 1, "more than half of 0.1 s late"
    assert found["lateness_max"] == pytest.approx(0.8)
    assert found["jitter_rms"] == pytest.approx(0.5 * (0.8 - 0.01))
    stopped = real_time.RealTimePace(1.0, 0.1, lambda: True, started=100.0)
    stopped.wait(1000.0)
    assert now[0] == 101.0, "who has stopped a run does not wait"


def test_columns_of_any_type_become_parquet(tmp_path):
    """Only of floating-point numbers the bytes are split."""
    parquet = pytest.importorskip("pyarrow.parquet")
    (tmp_path / "log.csv").write_text("time,on,steps,name\n0.0,true,3,a\n0.5,false,4,b\n")
    file = parquet.ParquetFile(to_parquet(tmp_path))
    assert file.read().to_pydict() == {
        "time": [0.0, 0.5], "on": [True, False], "steps": [3, 4], "name": ["a", "b"]
    }  # fmt: skip
    columns = [file.metadata.row_group(0).column(k) for k in range(4)]
    split = ["BYTE_STREAM_SPLIT" in column.encodings for column in columns]
    assert split == [True, False, False, False]
    assert [path.name for path in tmp_path.iterdir()] == ["log.parquet"]


def test_parquet_holds_what_csv_holds(scenario, tmp_path):
    pytest.importorskip("pyarrow")
    command(scenario(), "--out", tmp_path / "csv", "--no-plots")
    done = command(scenario(), "--out", tmp_path / "parquet", "--no-plots", "--parquet")
    assert done.returncode == 0
    assert not (tmp_path / "parquet" / "log.csv").exists()
    a, b = cosim.read_log(tmp_path / "csv"), cosim.read_log(tmp_path / "parquet")
    assert list(a) == list(b)
    assert all(np.array_equal(a[n], b[n], equal_nan=True) for n in a)
    assert list(cosim.read_log(tmp_path / "parquet", ["vessel.x"])) == ["time", "vessel.x"]


def test_parameter_set_beats_the_scenario_with_a_notice(scenario, ellipse, tmp_path):
    ellipse["fmus"]["vessel"]["parameters"]["delta_X_u"] = -1.0
    learned = tmp_path / "model.ssv"
    learned.write_text(SSV.format(parameter("vessel.delta_X_u", -4.0) + parameter("other.x", 1.0)))
    done = command(scenario(), "--out", tmp_path / "out", "--no-plots", "--parameters", learned)
    assert done.returncode == 0
    assert "vessel.delta_X_u = -4.0" in done.stderr
    assert "overrides -1.0" in done.stderr
    assert "has values for a model 'other', which is not in the scenario" in done.stderr
    log = cosim.read_log(tmp_path / "out")
    assert log["vessel.omega_X"] == pytest.approx(-4.0 * log["vessel.u"])


def test_empty_parameter_set_is_valid(scenario, tmp_path):
    (tmp_path / "empty.ssv").write_text(SSV.format(""))
    done = command(
        scenario(), "--out", tmp_path / "o", "--no-plots", "--parameters", tmp_path / "empty.ssv"
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<a/>", "is not an SSP 1.0 parameter set"),
        ("<a", "cannot be read as a parameter set"),
        (SSV.format(parameter("delta_X_u", 1.0)), "is not of the form model.parameter"),
        (SSV.format(parameter("vessel.delta_X_u", "much")), "its value is not a number"),
        (SSV.format(parameter("vessel.delta_X_uu_", 1.0)), "does not exist; did you mean"),
        (SSV.format(parameter("vessel.m", -1.0)), "is below its minimum"),
        (SSV.format(parameter("vessel.delta_X_u", "nan")), "its value is not a number"),
        (SSV.format(parameter("vessel.delta_X_u", "1_000")), "its value is not a number"),
        (SSV.format(2 * parameter("vessel.delta_X_u", 1.0)), "occurs twice"),
        (SSV.format(parameter("vessel.X_u", '1.0" unit="kN.s/m')), "but the FMU's unit is 'N.s/m'"),
        (SSV.format("").replace("UTF-8", "foo"), "cannot be read as a parameter set"),
    ],
)
def test_wrong_parameter_set_is_refused(scenario, tmp_path, text, message):
    (tmp_path / "wrong.ssv").write_text(text)
    done = command(scenario(), "--out", tmp_path / "out", "--parameters", tmp_path / "wrong.ssv")
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "out").exists()


def test_unpacked_fmus_are_removed(scenario, tmp_path):
    env = {**os.environ, "TMPDIR": str(tmp_path / "tmp")}
    (tmp_path / "tmp").mkdir()
    assert in_a_process(scenario(), "--out", tmp_path / "out", "--no-plots", env=env).returncode == 0
    assert list((tmp_path / "tmp").iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "gone", "said"),
    [
        ("NoBinary", "binaries/", "cannot be loaded"),
        ("NoModule", "resources/slavemodule", "is a Python FMU without its resources/slavemodule.txt"),
    ],
)
def test_a_missing_part_is_one_message(tmp_path, plain_fmu, kind, gone, said):
    fmu = plain_fmu(kind, GAIN)
    with zipfile.ZipFile(fmu) as archive:
        content = {n: archive.read(n) for n in archive.namelist() if not n.startswith(gone)}
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    path = tmp_path / "s.json"
    path.write_text(
        json.dumps({"name": "s", "step": 0.1, "stop": 1.0, "fmus": {"a": {"path": f"{kind}.fmu"}}})
    )
    done = command(path, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_permission_is_refused(scenario, tmp_path):
    (tmp_path / "closed").mkdir(mode=stat.S_IRUSR | stat.S_IXUSR)
    done = command(scenario(), "--out", tmp_path / "closed" / "out")
    assert done.returncode == 2


@pytest.mark.parametrize("main", [run.main, metrics.main, plots.main, build_main, check_main])
def test_help_has_examples_and_says_what_each_option_does(main):
    done = in_this_process(main, "--help")
    assert done.returncode == 0
    assert "example" in done.stdout
    for line, after in pairwise(f"{done.stdout}\n".splitlines()):
        if re.match(r"  -{1,2}\w", line):
            assert re.search(r"\S {2,}\S", line) or after.startswith(" " * 20), line
    options = re.findall(r"--([a-z-]+) ([A-Z_]+)", done.stdout)
    assert not [option for option, value in options if option.upper() == value], "says what it takes"
    assert done.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="not on Windows")
def test_help_that_cannot_be_written_is_said():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "cosim.run", "--help"], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert (done.returncode, "No space left" in done.stderr) == (3, True)


def test_master_never_imports_the_physics():
    code = "import sys, cosim.run, cosim.plots; print(*[m for m in sys.modules if m.split('.')[0] == 'fmus'])"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.split() == []


def test_reader_that_goes_away_is_no_error(scenario, tmp_path):
    code = f"{sys.executable} -m cosim.run {scenario()} --out {tmp_path / 'out'} --no-plots | true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.stdout.strip() == "0"
    assert done.stderr == ""


def test_full_disk_is_one_message(scenario, tmp_path):
    """Not /dev/full: the log lies in a folder. A file size limit does the same."""
    code = f"ulimit -f 400; exec {sys.executable} -m cosim.run {scenario(stop=9.0)} --out {tmp_path / 'out'} --no-plots --quiet"
    done = subprocess.run(["bash", "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 3
    assert "Traceback" not in done.stderr
    assert len(cosim.read_log(tmp_path / "out")["time"]) > 10
    assert not list((tmp_path / "out").glob(".*"))


@pytest.mark.parametrize("name", ["log.csv", "log.json", "metrics.json"])
def test_metrics_never_overwrite_files_of_the_run(scenario, tmp_path, name):
    command(scenario(), "--out", tmp_path / "out", "--no-plots")
    before = (tmp_path / "out" / name).read_bytes()
    done = in_this_process(metrics.main, tmp_path / "out", "--out", tmp_path / "out" / name)
    assert done.returncode == 2
    assert "is a file of the run itself" in done.stderr
    assert (tmp_path / "out" / name).read_bytes() == before


def test_result_folder_whose_name_is_too_long_is_bad_input(scenario, tmp_path):
    done = command(scenario(), "--out", tmp_path / ("x" * 300))
    (line,) = without_progress(done.stderr).splitlines()
    assert (done.returncode, line.startswith("error: cannot write to ")) == (2, True)


@pytest.mark.parametrize(
    ("path", "place", "expected"),
    [
        ("vessel.m=15", ("fmus", "vessel", "parameters", "m"), 15),
        ("fmus.vessel.parameters.m=15.5", ("fmus", "vessel", "parameters", "m"), 15.5),
        ("controller=controller_bs.fmu", ("fmus", "controller", "path"), "controller_bs.fmu"),
        ("faults.0.std=[0.001, 0.002]", ("faults", 0, "std"), [0.001, 0.002]),
        ("metrics.from=0.5", ("metrics", "from"), 0.5),
        ("seed=4", ("seed",), 4),
    ],
)
def test_set_changes_one_value(ellipse, tmp_path, path, place, expected):
    (tmp_path / "some.json").write_text(json.dumps(ellipse | {"stop": 1.0}))
    out = tmp_path / "out"
    done = command(tmp_path / "some.json", "--no-plots", "--out", out, "--set", path)
    assert done.returncode == 0, done.stderr
    value = json.loads((out / "log.json").read_text())["scenario"]
    for key in place:
        value = value[key]
    assert value == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("vesel.m=15", "no instance 'vesel'; did you mean 'vessel'?"),
        ("vessel.mm=15", "vessel.mm does not exist; did you mean 'm'?"),
        ("faults.0.sdt=1", "faults[0].sdt: unknown key; did you mean 'std'?"),
        ("faults.7.std=1", "there is no entry '7' in the list"),
        ("fmus.vesel.path=x.fmu", "no instance 'vesel'"),
        ("metrics.form=1", "unknown key; did you mean 'from'?"),
        ("name.x=1", "'name' is a value"),
        ("fmus=1", "'fmus' is a group: name one of the values"),
        ("fmus.vessel.parameters=1", "'fmus.vessel.parameters' is a group"),
        ("controller=./none.fmu", "no such FMU"),
        ("vessel.m", "sets nothing"),
    ],
)
def test_set_refuses_what_the_scenario_lacks(ellipse, tmp_path, text, message):
    (tmp_path / "some.json").write_text(json.dumps(ellipse))
    done = command(tmp_path / "some.json", "--out", tmp_path / "out", "--set", text)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_file_in_set_is_relative_to_the_working_directory(ellipse, tmp_path, fmus):
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "some.json").write_text(json.dumps(ellipse | {"stop": 1.0}))
    (tmp_path / "mine.fmu").write_bytes(fmus["controller_bs"].read_bytes())
    arguments = (
        "deep/some.json",
        "--no-plots",
        "--out",
        "out",
        "--set",
        "controller=./mine.fmu",
        "--seed",
        3,
    )
    done = command(*arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    stated = json.loads((tmp_path / "out" / "log.json").read_text())
    assert stated["seed"] == 3
    assert stated["fmus"]["controller"]["path"] == str(tmp_path / "mine.fmu")
