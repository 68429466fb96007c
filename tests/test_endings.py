"""Every ending is told: commands that an FMU ends, campaigns, bad input beside scenarios."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import closing

import numpy as np
import pandas
import pytest
from filelock import FileLock
from support import ccode
from support.command import command, without_progress
from support.project import ROOT

import cosim
from cosim.campaign import run_table
from cosim.campaign.__main__ import main as campaign_main
from cosim.campaign.conduct import SUMMARY
from cosim.campaign.run_table import JOURNAL, TABLE
from cosim.compiled.library import entry_of
from cosim.export.__main__ import main as export_main
from cosim.master.recorder import demand_memory
from cosim.results.performance import read_columns
from cosim.system import prepare
from fmus.build.__main__ import main as build_main

linux_only = pytest.mark.skipif(sys.platform != "linux", reason="no supervisor here")

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


def ended(process):
    """Exit code and lines on standard error of a process that ends."""
    _, stderr = process.communicate()
    return process.returncode, without_progress(stderr).splitlines()


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
    stated = json.loads((folder / SUMMARY).read_text())
    assert {json.loads(line)["hash"] for line in lines} == set(made["hash"])
    assert len(made) == stated["done"] + stated["failed"]
    return stated


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
    stated = agreed(tmp_path / "out")
    assert (stated["status"], stated["done"], stated["runs"]) == ("failed", 2, 4)
    assert "exit code 0" in stated["message"]


@linux_only
def test_fmu_that_exits_with_0_is_no_success_of_a_replay(plain_fmu, tmp_path):
    t = np.arange(0.0, 20.0, 0.05)
    columns = dict.fromkeys(("tau_X", "tau_Y", "tau_N"), 0.1) | {
        "x": np.sin(t),
        "y": t,
        "psi": 0.1 * np.sin(t),
    }
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
        started("thesis.replay", tmp_path / "run.csv", "--controller", fmu, "--out", out)
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
    process.send_signal(signal.SIGINT)
    code, lines = ended(process)  # how quickly is a matter of benchmarks.reliability
    assert (code, len(lines)) == (130, 1), lines
    assert lines[0].startswith("interrupted: ")
    stated = json.loads((out / SUMMARY).read_text())
    assert (stated["status"], stated["done"]) == ("interrupted", 1)
    assert list(pandas.read_parquet(out / TABLE)["k"]) == [1.0]


def test_rows_do_not_vanish_from_the_table(runs, tmp_path):
    out = tmp_path / "out"
    made = cosim.run_campaign(runs([1.0, 2.0, 3.0]), out, workers=0)
    with pytest.raises(
        cosim.InputError, match="has 3 runs, and 2 of them are not in this campaign: they would"
    ):
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
    stated = agreed(tmp_path / "out")
    assert stated["status"] == "failed"
    assert "No space left" in stated["message"]
    assert stated["done"] == (3 if what == "journal" else 2)


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
    assert any("1 lines of 'runs.jsonl' do not describe a run" in note for note in notes)
    assert again.drop(columns="wall_s").equals(made.drop(columns="wall_s"))


def test_what_is_no_scheduler_and_no_number_of_workers_is_told_at_once(runs, tmp_path):
    path = runs([1.0, 2.0])
    for address in ("nonsense", "tcp://", "10.0.0.1", "tcp://host"):
        done = command(campaign_main, path, "--scheduler", address, "--out", tmp_path / "out")
        assert done.returncode == 2
        assert (
            done.stderr
            == f"error: '{address}' is not an address of a scheduler: it takes the form tcp://HOST:PORT\n"
        )
    with pytest.raises(cosim.InputError, match="workers = -1"):
        cosim.run_campaign(path, tmp_path / "out", workers=-1)
    with pytest.raises(cosim.InputError, match="workers = -1"):
        cosim.dispatch.analyse_runs([], len, workers=-1)
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
    assert "--compare k: 1 of 2 runs failed, and no pair is complete" in done.stderr


@linux_only
def test_one_interrupt_ends_a_command_that_waits_for_another_process(ellipse, tmp_path):
    (tmp_path / "cache").mkdir()
    (tmp_path / "s.json").write_text(json.dumps(ellipse))
    fmus = {"CYBERSHIP_CACHE": str(tmp_path / "cache")}
    with FileLock(f"{entry_of(tmp_path / 'cache')}.lock"):
        process = started(
            "cosim.run", tmp_path / "s.json", "--out", tmp_path / "out", "--no-plots", **fmus
        )
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        code, lines = ended(process)  # long before the other process gives the lock back
    assert (code, [line for line in lines if not line.startswith("note")]) == (130, ["interrupted"])


@linux_only
@pytest.mark.slow
def test_an_interrupt_of_an_fmu_that_hangs_before_the_first_row_leaves_the_earlier_run(
    plain_fmu, tmp_path
):
    hang = (
        "if __import__('os').environ.get('HANGS'):\n    print('here', flush=True)\n"
        "    __import__('signal').pthread_sigmask(0, {2})\n    __import__('ctypes').PyDLL(None).sleep(1000)"
    )
    fmu, out = plain_fmu("Deaf", f"{OUTPUT}{hang}\n"), tmp_path / "new" / "out"
    scenario = {"name": "s", "step": 0.1, "stop": 1.0, "fmus": {"deaf": {"path": str(fmu)}}}
    (tmp_path / "s.json").write_text(json.dumps(scenario))
    arguments = "cosim.run", tmp_path / "s.json", "--out", out, "--no-plots", "--quiet"

    def interrupted():
        process = started(*arguments, HANGS="yes")
        assert process.stdout.readline() == "here\n"
        process.send_signal(signal.SIGINT)
        assert ended(process) == (130, ["interrupted"])

    interrupted()
    assert not out.parent.exists()
    assert ended(started(*arguments))[0] == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    interrupted()
    assert before == {path.name: path.read_bytes() for path in out.iterdir()}


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


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """A cache of the test's own, with the step loop in it."""
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path / "cache"))
    assert loop_library() == ""
    return tmp_path / "cache"


def loop_library():
    """Load the library in a process of its own; what it notes."""
    code = (
        "from cosim.compiled.library import library, prepare_library\n"
        "print(prepare_library(None))\nlibrary()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 0 or "NoLibraryError" in done.stderr, done.stderr
    return done.stdout.strip()


needs_compiler = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")


@linux_only
@needs_compiler
@pytest.mark.parametrize("size", [0, pytest.param(5000, marks=pytest.mark.slow)])
def test_a_damaged_library_is_made_again_and_that_is_said(size, own_cache):
    (entry,) = own_cache.glob("loop_*.so")
    whole = entry.read_bytes()
    entry.write_bytes(whole[:size])
    assert "was damaged, and is compiled again" in loop_library()
    assert len(entry.read_bytes()) == len(whole)
    assert loop_library() == ""


@linux_only
@needs_compiler
def test_a_compiler_that_makes_nothing_leaves_nothing(tmp_path, monkeypatch):
    fake = tmp_path / "bin" / "gcc"
    fake.parent.mkdir()
    fake.write_text('#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\n: > "$2"\n')
    fake.chmod(0o755)
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path / "cache"))
    path = os.environ["PATH"]
    monkeypatch.setenv("PATH", f"{fake.parent}:{path}")
    loop_library()
    assert not list((tmp_path / "cache").glob("loop_*.so"))
    monkeypatch.setenv("PATH", path)
    loop_library()
    assert len(list((tmp_path / "cache").glob("loop_*.so"))) == 1


@pytest.mark.slow
@linux_only
@needs_compiler
def test_a_library_that_others_may_write_is_not_loaded(own_cache):
    (entry,) = own_cache.glob("loop_*.so")
    for place in (entry, own_cache):
        mode = place.stat().st_mode
        place.chmod(mode | 0o020)
        assert "other users may write to" in loop_library()
        place.chmod(mode)
        if os.getuid() == 0:
            os.chown(place, 12345, -1)
            assert "belongs to another user" in loop_library()
            os.chown(place, 0, -1)
    assert loop_library() == ""


@pytest.mark.slow
@linux_only
def test_a_damaged_fmu_is_built_again_and_foreign_ones_are_not_used(tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    monkeypatch.setenv("CYBERSHIP_CACHE", str(cache))
    fmu = cache / command(build_main, "guidance_setpoint").stdout.strip()
    whole = fmu.read_bytes()
    fmu.write_bytes(whole[:1000])
    done = command(build_main, "guidance_setpoint")
    assert done.returncode == 0
    assert "was damaged, and is built again" in done.stderr
    assert fmu.read_bytes() == whole
    for place in (fmu, fmu.parent, cache):
        mode = place.stat().st_mode
        place.chmod(mode | 0o002)
        done = command(build_main, "guidance_setpoint")
        assert (done.returncode, "other users may write to" in done.stderr) == (2, True)
        place.chmod(mode)
    assert command(build_main, "guidance_setpoint").stderr == ""


def test_built_fmus_replace_no_other_file(fmus, tmp_path):
    (tmp_path / "vessel.fmu").write_text("mine")
    done = command(build_main, "vessel", "--out", tmp_path)
    assert (done.returncode, (tmp_path / "vessel.fmu").read_text()) == (2, "mine")
    assert "exists and is another file; --overwrite replaces it" in done.stderr
    for more in (["--overwrite"], []):
        assert command(build_main, "vessel", "--out", tmp_path, *more).returncode == 0
    assert (tmp_path / "vessel.fmu").read_bytes() == fmus["vessel"].read_bytes()


def test_source_replaces_no_other_file(tmp_path):
    (tmp_path / "README.md").write_text("mine")
    arguments = "--native", "guidance_setpoint", "--source", tmp_path
    done = command(build_main, *arguments)
    assert (done.returncode, (tmp_path / "README.md").read_text()) == (2, "mine")
    assert "exists and is another file; --overwrite replaces it" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["README.md"]
    for more in (["--overwrite"], []):
        assert command(build_main, *arguments, *more).returncode == 0


@pytest.mark.parametrize("empty", ["", " "])
def test_nothing_is_no_name_of_a_folder(runs, tmp_path, monkeypatch, empty):
    path = runs([1.0])
    before = sorted(tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    for main, *arguments in (
        (campaign_main, path, "--workers", 0, "--out", empty),
        (build_main, "guidance_setpoint", "--out", empty),
        (build_main, "--native", "guidance_setpoint", "--source", empty),
    ):
        done = command(main, *arguments)
        assert (done.returncode, "needs the name of a folder" in done.stderr) == (2, True)
    with pytest.raises(cosim.InputError, match="name of a folder"):
        cosim.run_campaign(path, empty, workers=0)
    assert sorted(tmp_path.iterdir()) == before


def test_exports_replace_no_file(chain, tmp_path):
    (tmp_path / "s.json").write_text(json.dumps(chain))
    (tmp_path / "s.ssp").write_text("mine")
    done = command(export_main, tmp_path / "s.json", "--ssp", tmp_path / "s.ssp")
    assert (done.returncode, (tmp_path / "s.ssp").read_text()) == (2, "mine")
    assert "exists; --overwrite replaces it" in done.stderr
    assert (
        command(export_main, tmp_path / "s.json", "--ssp", tmp_path / "s.ssp", "--overwrite").returncode
        == 0
    )
    for _ in range(2):
        done = command(export_main, tmp_path / "s.json", "--osp", tmp_path / "osp")
    assert (done.returncode, "--overwrite replaces it" in done.stderr) == (2, True)


def test_a_run_replaces_no_log_of_the_user(ellipse, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "log.csv").write_text("mine")
    scenario = cosim.load_scenario(ellipse | {"stop": 0.1})
    with pytest.raises(
        cosim.InputError, match=r"log.csv' does not belong to a run \(there is no log.json\)"
    ):
        cosim.simulate(scenario, tmp_path / "out")
    assert (tmp_path / "out" / "log.csv").read_text() == "mine"
    for options in ({"overwrite": True}, {}):
        assert cosim.simulate(scenario, tmp_path / "out", **options).status == "done"
    for empty in ("", " "):
        with pytest.raises(cosim.InputError, match="name of a folder"):
            cosim.simulate(scenario, empty)


def test_more_steps_than_memory_are_told_before_anything_is_written(ellipse, tmp_path):
    content = ellipse | {"step": 1e-6, "stop": 1e9, "faults": [], "events": []}
    for entry in content["fmus"].values():
        entry.pop("step", None)
    with pytest.raises(cosim.InputError, match=r"1000000000000000 steps are too many: .* GiB of memory"):
        cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_memory_is_demanded_for_what_is_kept(ellipse, monkeypatch):
    """Eight bytes for time and each column that metrics, or pictures, too, read, at every step."""
    with closing(prepare(cosim.load_scenario(ellipse | {"stop": 5.0}))) as system:
        roles = system.scenario.roles
        for pictures, reads in ((False, read_columns(system.signals, roles)), (True, roles.columns)):
            columns = {*reads} & {*system.signals}
            memory = {"SC_PHYS_PAGES": (1 + len(columns)) * 501, "SC_PAGE_SIZE": 8}
            monkeypatch.setattr(os, "sysconf", memory.__getitem__)
            demand_memory(system, pictures)
            memory["SC_PHYS_PAGES"] -= 1
            with pytest.raises(cosim.InputError, match="steps are too many"):
                demand_memory(system, pictures)


@linux_only
def test_no_home_folder_is_one_line(ellipse, chain, tmp_path):
    """As of a user without HOME and without an entry among the users of the system."""
    nobody = "import pwd\ndef unknown(_): raise KeyError\npwd.getpwuid = unknown\n"
    (tmp_path / "sitecustomize.py").write_text(nobody)
    kept = {
        k: v for k, v in os.environ.items() if k not in ("HOME", "CYBERSHIP_CACHE", "XDG_CACHE_HOME")
    }
    kept["PYTHONPATH"] = f"{tmp_path}:{ROOT}"
    for content, code in ((ellipse, 2), (chain, 0)):
        (tmp_path / "s.json").write_text(json.dumps(content | {"stop": 0.5}))
        done = subprocess.run(
            [sys.executable, "-m", "cosim.run", "s.json", "--no-plots"],
            cwd=tmp_path, capture_output=True, text=True, env=kept, check=False,
        )  # fmt: skip
        assert done.returncode == code, done.stderr
        if code:
            assert done.stderr.startswith("error: this user has no home folder: set CYBERSHIP_CACHE")
            assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "~").exists()
