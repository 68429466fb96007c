"""Every ending is told: commands that an FMU ends, campaigns, bad input beside scenarios."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pandas
import pytest
from filelock import FileLock
from support.command import command
from support.project import ROOT

import cosim
from cosim.campaign import run_table
from cosim.campaign.__main__ import main as campaign_main
from cosim.campaign.conduct import SUMMARY
from cosim.campaign.run_table import JOURNAL, TABLE

linux_only = pytest.mark.skipif(sys.platform != "linux", reason="no watching process here")

OUTPUT = "self.y = 0.0\nself.register_variable(Real('y', causality=Fmi2Causality.output))\n"
FACTOR = (
    "self.k = 1.0\nself.register_variable(Real('k', start=1.0, causality=Fmi2Causality.parameter,"
    " variability=Fmi2Variability.tunable))"
)
EXIT = "__import__('ctypes').CDLL(None).exit(0)"


def started(*arguments, **environment):
    return subprocess.Popen(
        [sys.executable, "-m", *map(str, arguments)], cwd=ROOT, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, **environment},
    )  # fmt: skip


def ended(process, within=60.0):
    """Exit code and lines on standard error of a process that ends within some time [s]."""
    _, stderr = process.communicate(timeout=within)
    return process.returncode, stderr.splitlines()


@pytest.fixture
def runs(plain_fmu, tmp_path):
    """A function that writes a campaign over the parameter k of one foreign FMU."""
    made = {}

    def make(values, step="self.y += h\nreturn True", name="Grows", **keys):
        if name not in made:  # another one has another GUID
            made[name] = plain_fmu(name, OUTPUT + FACTOR, step)
        fmu = made[name]
        scenario = {"name": "s", "step": 0.1, "stop": 1.0, "fmus": {"ramp": {"path": str(fmu)}}}
        (tmp_path / "s.json").write_text(json.dumps(scenario))
        axes = {"k": {"set": "ramp.k", "values": values}}
        path = tmp_path / f"{name}.campaign.json"
        path.write_text(json.dumps({"scenario": "s.json", "axes": axes, **keys}))
        return path

    return make


def agreed(folder):
    """Summary of a campaign whose journal and table hold the same runs."""
    lines = (folder / JOURNAL).read_text().splitlines()
    made = pandas.read_parquet(folder / TABLE)
    told = json.loads((folder / SUMMARY).read_text())
    assert {json.loads(line)["hash"] for line in lines} == set(made["hash"])
    assert len(made) == told["done"] + told["failed"]
    return told


@linux_only
def test_fmu_that_exits_with_0_is_no_success_of_a_campaign(runs, tmp_path):
    path = runs([1.0, 1.5, 2.0, 3.0], f"self.y += h\nif self.k > 1.7: {EXIT}\nreturn True", "Exits")
    done = started("cosim.campaign", path, "--workers", 0, "--out", tmp_path / "out")
    code, lines = ended(done)
    assert code == 3
    assert len(lines) == 1
    assert lines[0].startswith(
        "error: ramp: the simulating process died in a step (exit code 0); 2 of 4"
    )
    told = agreed(tmp_path / "out")
    assert (told["status"], told["done"], told["runs"]) == ("failed", 2, 4)
    assert "exit code 0" in told["message"]


@linux_only
def test_fmu_that_exits_with_0_is_no_success_of_a_replay(plain_fmu, tmp_path):
    t = np.arange(0.0, 20.0, 0.05)
    columns = dict.fromkeys(("tau_X", "tau_Y", "tau_N"), 0.1) | {"x": np.sin(t), "y": t, "psi": 0.0}
    pandas.DataFrame({"time": t} | columns).to_csv(tmp_path / "run.csv", index=False)
    names = [f"{stem}_{axis}" for stem in ("x", "y", "psi") for axis in ("hat", "t")]
    inputs = "".join(
        f"self.{name} = 0.0\nself.register_variable(Real('{name}', causality=Fmi2Causality.input))\n"
        for name in [*names, *(f"tau_cmd_{axis}" for axis in "XYN")]
    )
    outputs = "".join(
        f"self.tau_{axis} = 0.0\nself.register_variable(Real('tau_{axis}', causality=Fmi2Causality.output))\n"
        for axis in "XYN"
    )
    fmu = plain_fmu("Law", inputs + outputs, f"if t > 1.0: {EXIT}\nreturn True")
    out = tmp_path / "new" / "out"
    code, lines = ended(
        started("diagnosis.replay", tmp_path / "run.csv", "--controller", fmu, "--out", out)
    )
    assert code == 3, lines
    assert lines[-1] == "error: controller: the simulating process died in a step (exit code 0)"
    assert not out.parent.exists()


@linux_only
def test_a_campaign_says_that_it_runs_and_that_it_was_interrupted(runs, tmp_path):
    out = tmp_path / "out"
    first = runs([1.0])
    assert command(campaign_main, first, "--workers", 0, "--out", out).returncode == 0
    assert agreed(out)["status"] == "done"
    hang = (
        "self.y += h\nif self.k > 1.5:\n    print('here', flush=True)\n    while True: pass\nreturn True"
    )
    second = runs([1.0, 2.0], hang, "Hangs")
    process = started("cosim.campaign", second, "--workers", 0, "--out", out, "--overwrite")
    assert process.stdout.readline() == "here\n"
    assert json.loads((out / SUMMARY).read_text())["status"] == "running"
    begun = time.monotonic()
    process.send_signal(signal.SIGINT)
    code, lines = ended(process)
    assert time.monotonic() - begun < 4.0  # 2 s on an idle machine
    assert (code, len(lines)) == (130, 1), lines
    assert lines[0].startswith("interrupted: ")
    told = json.loads((out / SUMMARY).read_text())
    assert (told["status"], told["done"]) == ("interrupted", 1)
    assert list(pandas.read_parquet(out / TABLE)["k"]) == [1.0]


def test_rows_do_not_vanish_from_the_table(runs, tmp_path):
    out = tmp_path / "out"
    made = cosim.run_campaign(runs([1.0, 2.0, 3.0]), out, workers=0)
    with pytest.raises(cosim.InputError, match="has 3 runs, of which this campaign lacks 2: they would"):
        cosim.run_campaign(runs([0.5, 1.0]), out, workers=0)
    assert pandas.read_parquet(out / TABLE).equals(made)
    longer = cosim.run_campaign(runs([0.5, 1.0, 2.0, 3.0]), out, workers=0)
    assert longer[1:].drop(columns="k").reset_index(drop=True).equals(made.drop(columns="k"))
    shorter = cosim.run_campaign(runs([0.5, 1.0]), out, workers=0, overwrite=True)
    assert list(shorter["k"]) == [0.5, 1.0]


def test_an_extended_campaign_that_is_interrupted_at_once_keeps_its_rows(runs, tmp_path, monkeypatch):
    cosim.run_campaign(runs([2.0, 3.0]), tmp_path / "out", workers=0)

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("cosim.dispatch.workplace.Workplace.run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        cosim.run_campaign(runs([1.0, 2.0, 3.0]), tmp_path / "out", workers=0)
    assert list(pandas.read_parquet(tmp_path / "out" / TABLE)["k"]) == [2.0, 3.0]
    assert agreed(tmp_path / "out")["status"] == "interrupted"


@pytest.mark.parametrize("what", ["journal", "table"])
def test_journal_and_table_agree_on_a_full_disk(what, runs, tmp_path, monkeypatch):
    real = {"journal": run_table.write_all, "table": run_table.write_table}[what]
    calls = []

    def full(target, content):
        calls.append(1)
        if len(calls) > 3:
            if what == "journal":
                real(target, content[: len(content) // 2])
            raise OSError(28, "No space left on device")
        real(target, content)

    place = (
        "cosim.campaign.run_table.write_all"
        if what == "journal"
        else "cosim.campaign.conduct.write_table"
    )
    monkeypatch.setattr(place, full)
    with pytest.raises(cosim.SimulationError, match="No space left on device"):
        cosim.run_campaign(runs([1.0, 2.0, 3.0, 4.0, 5.0]), tmp_path / "out", workers=0)
    told = agreed(tmp_path / "out")
    assert told["status"] == "failed"
    assert "No space left" in told["message"]
    assert told["done"] == (3 if what == "journal" else 2)


@pytest.mark.parametrize(
    "change",
    [{"wall_s": None}, {"metrics": {"W": "much"}}, {"metrics": None}, {"status": 7}, {"hash": 1}],
)
def test_a_journal_whose_numbers_are_none_is_told(change, runs, tmp_path):
    path = runs([1.0, 2.0])
    made = cosim.run_campaign(path, tmp_path / "out", workers=0)
    journal = tmp_path / "out" / JOURNAL
    first, second = journal.read_text().splitlines()
    journal.write_text(f"{json.dumps(json.loads(first) | change)}\n{second}\n")
    notes = []
    again = cosim.run_campaign(path, tmp_path / "out", workers=0, show=notes.append)
    assert any("1 lines of 'runs.jsonl' tell of no run" in note for note in notes)
    assert again.drop(columns="wall_s").equals(made.drop(columns="wall_s"))


def test_what_is_no_scheduler_and_no_number_of_workers_is_told_at_once(runs, tmp_path):
    path, begun = runs([1.0, 2.0]), time.monotonic()
    for address in ("nonsense", "tcp://", "10.0.0.1", "tcp://host"):
        done = command(campaign_main, path, "--scheduler", address, "--out", tmp_path / "out")
        assert done.returncode == 2
        assert (
            done.stderr
            == f"error: '{address}' is no address of a scheduler: it takes the form tcp://HOST:PORT\n"
        )
    with pytest.raises(cosim.InputError, match="workers = -1"):
        cosim.run_campaign(path, tmp_path / "out", workers=-1)
    with pytest.raises(cosim.InputError, match="workers = -1"):
        cosim.dispatch.analyse_runs([], len, workers=-1)
    assert time.monotonic() - begun < 5.0
    assert not (tmp_path / "out").exists()


def test_workers_that_do_not_start_are_told(runs, tmp_path, monkeypatch):
    import distributed

    def fail(*_, **__):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("cosim.dispatch.dask_workers.LocalCluster", fail)
    assert distributed
    done = command(campaign_main, runs([1.0, 2.0]), "--workers", 2, "--out", tmp_path / "out")
    assert done.returncode == 3
    assert done.stderr.startswith(
        "error: the workers were lost while they started: Nanny failed to start."
    )
    assert agreed(tmp_path / "out")["status"] == "failed"


def test_a_comparison_of_failed_runs_says_that_they_failed(runs, tmp_path):
    step = "if self.k > 1.5: raise ValueError('too much')\nself.y += h\nreturn True"
    path = runs([1.0, 2.0], step, "Fails")
    done = command(campaign_main, path, "--workers", 0, "--out", tmp_path / "out", "--compare", "k")
    assert done.returncode == 2
    assert "--compare k: 1 of 2 runs failed, and of no pair both went well" in done.stderr


@linux_only
def test_one_interrupt_ends_a_command_that_waits_for_another_process(ellipse, tmp_path):
    (tmp_path / "cache").mkdir()
    (tmp_path / "s.json").write_text(json.dumps(ellipse))
    fmus = {"CYBERSHIP_CACHE": str(tmp_path / "cache")}
    with FileLock(tmp_path / "cache" / "loop.lock"):
        process = started(
            "cosim.run", tmp_path / "s.json", "--out", tmp_path / "out", "--no-plots", **fmus
        )
        time.sleep(1.0)
        begun = time.monotonic()
        process.send_signal(signal.SIGINT)
        code, lines = ended(process)
    assert time.monotonic() - begun < 4.0  # 2 s on an idle machine
    assert (code, [line for line in lines if not line.startswith("note")]) == (130, ["interrupted"])


@linux_only
def test_an_interrupt_of_the_installed_program_is_one_line_from_its_first_line_on():
    text = (ROOT / "pyproject.toml").read_text()
    module, function = re.search(r'^cybership = "(.*):(.*)"$', text, re.MULTILINE).groups()
    code = (
        "import signal, sys\nsys.argv = ['cybership', 'run', 'ellipse']\n"
        "sys.addaudithook(lambda name, a: name == 'import' and a[0] == 'runpy' and signal.raise_signal(2))\n"
        f"from {module} import {function}\nsys.exit({function}())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert (done.returncode, done.stderr) == (130, "interrupted\n")
