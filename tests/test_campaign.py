"""Campaigns: designs, refusals, one row a run, nothing run twice, and the same numbers wherever they are made."""

import json
import os
import re
import signal
import subprocess
import sys

import pandas
import pytest
from rich.console import Console
from support.command import command
from support.events import once_there
from support.project import ROOT

import cosim
from cosim.campaign import __main__ as conducting
from cosim.campaign import shown_progress
from cosim.campaign.__main__ import main
from cosim.campaign.campaign_file import LoadedCampaign
from cosim.campaign.case_scenarios import CaseScenarios
from cosim.campaign.design import cases
from cosim.campaign.run_table import JOURNAL


@pytest.fixture
def base(ellipse, tmp_path):
    """A scenario file of 1 s, for campaigns beside it."""
    ellipse["stop"] = 1.0
    (tmp_path / "base.json").write_text(json.dumps(ellipse))
    return tmp_path


def campaign(base, axes, **keys):
    path = base / "some.campaign.json"
    path.write_text(json.dumps({"scenario": "base.json", "axes": axes, **keys}))
    return path


def shown(base, axes, **keys):
    return [case.shown for case in cases(LoadedCampaign(campaign(base, axes, **keys)).campaign)]


def without_time(table):
    return table.drop(columns="wall_s")


def test_grid_and_list(base):
    axes = {
        "m": {"set": "vessel.m", "values": [14.0, 15.0]},
        "seed": {"set": "seed", "values": [0, 1]},
    }
    assert [(c["m"], c["seed"]) for c in shown(base, axes)] == [
        (14.0, 0),
        (14.0, 1),
        (15.0, 0),
        (15.0, 1),
    ]
    assert [(c["m"], c["seed"]) for c in shown(base, axes, design="list")] == [(14.0, 0), (15.0, 1)]


def test_latin_and_sobol_fill_every_stratum(base):
    axes = {
        "x": {"set": "vessel.x_0", "uniform": [2.0, 10.0]},
        "y": {"set": "vessel.y_0", "normal": [1.0, 0.5]},
        "std": {"set": ["faults.0.std", "faults.1.std"], "log_uniform": [1e-4, 1e-2]},
        "c": {"set": "controller", "values": ["controller_bs.fmu", "controller_abs.fmu"], "cross": True},
    }
    for design in ({"latin": 16}, {"sobol": 16}):
        found = shown(base, axes, design=design, seed=3)
        assert found == shown(base, axes, design=design, seed=3)
        assert found != shown(base, axes, design=design, seed=4)
        assert len(found) == 32
        first = found[::2]
        assert sorted(int((c["x"] - 2.0) / 0.5) for c in first) == list(range(16))
        assert all(1e-4 <= c["std"] <= 1e-2 for c in first)
        assert sum(c["std"] < 1e-3 for c in first) == 8  # half of it below the geometric middle
        assert sum(c["y"] < 1.0 for c in first) == 8
        assert [c["c"] for c in found[:2]] == ["controller_bs.fmu", "controller_abs.fmu"]


@pytest.mark.parametrize(
    ("axes", "keys", "message"),
    [
        ({"m": {"set": "vesel.m", "values": [1]}}, {}, "no instance 'vesel'; did you mean 'vessel'?"),
        ({"m": {"set": "vessel.mm", "values": [1]}}, {}, "vessel.mm does not exist; did you mean 'm'?"),
        ({"m": {"set": "faults.9.std", "values": [1]}}, {}, "there is no entry '9' in the list"),
        ({"m": {"set": "faults.0.sdt", "values": [1]}}, {}, "unknown key; did you mean 'std'?"),
        ({"m": {"set": "vessel.m", "value": [1]}}, {}, "unknown key; did you mean 'values'?"),
        ({"m": {"set": "vessel.m", "uniform": [1, 2]}}, {}, "uniform is not possible in a grid"),
        (
            {"m": {"set": "vessel.m", "uniform": [2, 1]}},
            {"design": {"latin": 4}},
            "the lower value comes first",
        ),
        (
            {"m": {"set": "vessel.m", "normal": [2, -1]}},
            {"design": {"latin": 4}},
            "must be above zero",
        ),
        ({"m": {"set": "vessel.m", "log_uniform": [0, 1]}}, {"design": {"latin": 4}}, "above zero"),
        ({"m": {"set": "vessel.m", "values": [14, "x"]}}, {}, "needs a value of type Real"),
        ({"m": {"set": "controller", "values": ["./no.fmu"]}}, {}, "no such FMU"),
        ({"W": {"set": "vessel.m", "values": [14]}}, {}, "'W' cannot be an axis"),
        ({"m": {"set": "vessel.m", "values": [14]}}, {"design": "gird"}, '"grid", "list"'),
        (
            {"m": {"set": "vessel.m", "values": [14]}},
            {"scenario": "bas.json"},
            "did you mean 'base.json'?",
        ),
        (
            {"m": {"set": "seed", "values": [14]}, "n": {"set": "seed", "values": [1]}},
            {},
            "set the same",
        ),
        (
            {"m": {"set": "vessel.m", "values": [14]}, "s": {"set": "seed", "values": [1, 2]}},
            {"design": "list"},
            "the same number of values in each axis",
        ),
    ],
)
def test_mistakes_are_told_before_anything_runs(base, axes, keys, message):
    done = command(main, campaign(base, axes, **keys), "--workers", 0, "--out", base / "out")
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (base / "out").exists()


def test_a_row_for_each_run_with_the_metrics_of_a_fresh_one(base):
    path = campaign(
        base,
        {
            "controller": {
                "set": "controller",
                "values": ["controller_abs.fmu", "controller_bs.fmu"],
            },
            "k": {"set": "vessel.m", "values": [14.0, 18.0]},
        },
    )
    done = command(main, path, "--workers", 0, "--out", base / "out", "--keep-logs")
    assert done.returncode == 0, done.stderr
    table = pandas.read_parquet(base / "out" / "runs.parquet")
    assert list(table.columns[:2]) == ["controller", "k"]
    assert list(table["status"]) == ["done"] * 4
    for row in table.to_dict("records"):
        content = json.loads((base / "base.json").read_text())
        content["fmus"]["controller"]["path"] = row["controller"]
        content["fmus"]["vessel"]["parameters"]["m"] = row["k"]
        fresh = cosim.simulate(cosim.load_scenario(content), base / "fresh")
        assert {name: row[name] for name in fresh.metrics} == fresh.metrics
        log = base / "out" / "logs" / row["hash"][:16] / "log.csv"
        assert log.read_bytes() == (base / "fresh" / "log.csv").read_bytes()
    stated = json.loads((base / "out" / "campaign.json").read_text())
    assert (stated["status"], stated["runs"], stated["done"]) == ("done", 4, 4)
    assert stated["versions"]["cybership"]


def test_a_value_in_a_group_is_set_after_the_group(base):
    """Whichever axis is first; and the value of the group stays as it is written."""
    inner = {"set": "vessel.m", "values": [14.0, 30.0]}
    group = [{"path": "vessel.fmu", "parameters": {"x_0": 5.0}}]
    outer = {"set": "fmus.vessel", "values": group}
    for axes in ({"m": inner, "o": outer}, {"o": outer, "m": inner}):
        loaded = LoadedCampaign(campaign(base, axes))
        scenarios = CaseScenarios(loaded, None, None)
        made = [scenarios.scenario(case).fmus["vessel"].parameters for case in cases(loaded.campaign)]
        assert made == [{"x_0": 5.0, "m": 14.0}, {"x_0": 5.0, "m": 30.0}]
        assert loaded.campaign.axes["o"].values == group


def test_compiled_fmus_that_are_reset_give_the_same_runs(base, native, monkeypatch):
    """By the same hashes, so that a campaign goes on with FMUs of the other kind."""
    path = campaign(base, {"seed": {"set": "seed", "values": [0, 1]}})
    monkeypatch.setattr("cosim.campaign.conduct.prepare_library", lambda native: f"made for {native}")
    tables, logs = {}, {}
    for kind in (True, False):
        out, notes = base / f"native_{kind}", []
        made = cosim.run_campaign(path, out, workers=0, keep_logs=True, show=notes.append, native=kind)
        assert list(made["status"]) == ["done"] * 2
        assert any("--no-native" in note for note in notes) == kind
        assert f"note: made for {kind}" in notes
        folders = [out / "logs" / h[:16] for h in made["hash"]]
        stated = [json.loads((folder / "log.json").read_text()) for folder in folders]
        assert [t["fmus"]["vessel"]["native"] for t in stated] == [kind] * 2
        logs[kind] = [(folder / "log.csv").read_bytes() for folder in folders]
        tables[kind] = made.drop(columns="wall_s")
    assert tables[True].equals(tables[False])
    assert logs[True] == logs[False]
    made, logs = tables[True], logs[True]
    content = json.loads((base / "base.json").read_text()) | {"native": True, "seed": 1}
    fresh = cosim.simulate(cosim.load_scenario(content), base / "fresh")
    assert fresh.metrics == {name: made[name][1] for name in fresh.metrics}
    assert (base / "fresh" / "log.csv").read_bytes() == logs[1]


def test_finished_runs_are_not_made_again(base, monkeypatch):
    axes = {"m": {"set": "vessel.m", "values": [14.0, 15.0]}}
    first = cosim.run_campaign(campaign(base, axes), base / "out", workers=0)
    journal = base / "out" / JOURNAL
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(lines[0] + lines[1][:40])  # killed while it wrote the second row
    axes["m"]["values"].append(16.0)
    made = []
    original = cosim.dispatch.workplace.Workplace.run
    monkeypatch.setattr(
        "cosim.dispatch.workplace.Workplace.run",
        lambda self, content, keep: made.append(content) or original(self, content, keep),
    )
    second = cosim.run_campaign(campaign(base, axes), base / "out", workers=0)
    assert [c["fmus"]["vessel"]["parameters"]["m"] for c in made] == [15.0, 16.0]
    assert without_time(second)[:2].equals(without_time(first))
    third = cosim.run_campaign(campaign(base, axes), base / "out", workers=0)
    assert len(made) == 2
    assert third.equals(second)


def test_an_interrupt_of_the_first_table_is_told_in_the_summary(base, monkeypatch):
    """To import what writes it takes a second, in which nothing has run."""
    original, called = cosim.campaign.conduct.write_table, []

    def write(folder, made):
        called.append(folder)
        if len(called) == 1:
            raise KeyboardInterrupt
        original(folder, made)

    monkeypatch.setattr("cosim.campaign.conduct.write_table", write)
    path = campaign(base, {"m": {"set": "vessel.m", "values": [14.0]}})
    with pytest.raises(KeyboardInterrupt):
        main([str(path), "--workers", "0", "--out", str(base / "out")])
    assert pandas.read_parquet(base / "out" / "runs.parquet").empty
    stated = json.loads((base / "out" / "campaign.json").read_text())
    assert (stated["status"], stated["done"]) == ("interrupted", 0)


def test_an_interrupt_keeps_what_has_finished(base, monkeypatch):
    original, made = cosim.dispatch.workplace.Workplace.run, []

    def run(self, content, keep):
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(content)
        return original(self, content, keep)

    monkeypatch.setattr("cosim.dispatch.workplace.Workplace.run", run)
    path = campaign(base, {"m": {"set": "vessel.m", "values": [14.0, 15.0, 16.0]}})
    with pytest.raises(KeyboardInterrupt):
        main([str(path), "--workers", "0", "--out", str(base / "out")])
    assert len(pandas.read_parquet(base / "out" / "runs.parquet")) == 2
    assert json.loads((base / "out" / "campaign.json").read_text())["status"] == "interrupted"


@pytest.mark.slow
def test_the_table_is_whole_before_workers_are_asked_to_end(base, monkeypatch):
    """A busy scheduler takes longer to answer than an interrupted command has."""
    from distributed import Client

    from cosim.dispatch.dask_workers import DaskWorkers

    out, given, stated, ask, cancel = base / "out", [], [], DaskWorkers._next, Client.cancel

    def interrupted(self, ended):
        if len(given) == 2:
            raise KeyboardInterrupt
        given.append(ask(self, ended))
        return given[-1]

    def recorded(self, futures, **options):
        stated.append(json.loads((out / "campaign.json").read_text()))
        return cancel(self, futures, **options)

    monkeypatch.setattr(DaskWorkers, "_next", interrupted)
    monkeypatch.setattr(Client, "cancel", recorded)
    path = campaign(base, {"m": {"set": "vessel.m", "values": [14.0, 15.0, 16.0, 17.0, 18.0]}})
    with pytest.raises(KeyboardInterrupt):
        cosim.run_campaign(path, out, workers=2)
    journal = (out / JOURNAL).read_text().splitlines()
    assert [content["status"] for content in stated] == ["interrupted"]
    assert stated[0]["done"] == len(journal) == len(pandas.read_parquet(out / "runs.parquet")) >= 2


def test_a_failed_run_is_a_row_with_its_message(base, chain, plain_fmu):
    step = "self.y += h\nif self.k > 2.5 and t > 0.4: raise ValueError('too much')\nreturn True"
    init = (
        "self.y = 0.0\nself.k = 1.0\nself.register_variable(Real('y', causality=Fmi2Causality.output))\n"
        "self.register_variable(Real('k', start=1.0, causality=Fmi2Causality.parameter,"
        " variability=Fmi2Variability.tunable))"
    )
    chain["fmus"]["ramp"]["path"] = str(plain_fmu("Breaks", init, step))
    (base / "base.json").write_text(json.dumps(chain))
    path = campaign(base, {"k": {"set": "ramp.k", "values": [1.0, 3.0, 2.0]}})
    done = command(main, path, "--workers", 0, "--out", base / "out")
    assert done.returncode == 0
    assert "1 of 3 runs failed: ramp" in done.stderr
    table = pandas.read_parquet(base / "out" / "runs.parquet")
    assert list(table["status"]) == ["done", "failed", "done"]
    assert table["message"][1].startswith("ramp: the step from t = 0.5 s returned")
    assert table["message"][0].startswith("no metrics")


def test_an_unknown_fmu_is_instantiated_anew(base, chain, plain_fmu):
    """One that counts its runs in its class would count them in the next run, if it were only reset."""
    init = (
        "self.y = 0.0\ntype(self).runs = getattr(type(self), 'runs', 0) + 1\n"
        "self.n = float(type(self).runs)\n"
        "self.register_variable(Real('y', causality=Fmi2Causality.output))"
    )
    chain["fmus"]["ramp"]["path"] = str(
        plain_fmu("Counts", init, "self.y = self.n * (t + h)\nreturn True")
    )
    (base / "base.json").write_text(json.dumps(chain))
    path = campaign(base, {"k": {"set": "gain.k", "values": [1.0, 1.5]}})
    made = cosim.run_campaign(path, base / "out", workers=0, keep_logs=True)
    logs = [cosim.read_log(base / "out" / "logs" / h[:16])["ramp.y"][-1] for h in made["hash"]]
    assert logs[0] == logs[1]


def test_equal_runs_are_made_once_and_labels_are_shown(base):
    axes = {"m": {"set": "vessel.m", "values": [14.0, 14.0], "labels": ["a", "b"]}}
    made = cosim.run_campaign(campaign(base, axes), base / "out", workers=0)
    assert list(made["m"]) == ["a", "b"]
    assert len((base / "out" / JOURNAL).read_bytes().splitlines()) == 1


@pytest.mark.parametrize(
    "axis", [{"set": "seed", "values": [0, 0]}, {"set": "vessel.m", "values": [14.0, 14.0]}]
)
@pytest.mark.parametrize("faulty", [True, False])
def test_seeds_without_effect_are_noted(base, ellipse, axis, faulty):
    if not faulty:
        (base / "base.json").write_text(json.dumps(ellipse | {"faults": []}))
    notes = []
    cosim.run_campaign(campaign(base, {"a": axis}), base / "out", workers=0, show=notes.append)
    assert any("no faults, so the seed" in note for note in notes) == (
        axis["set"] == "seed" and not faulty
    )


def test_differences_and_the_best_are_tables(base, monkeypatch):
    axes = {
        "m": {"set": "vessel.m", "values": [14.0, 15.0]},
        "seed": {"set": "seed", "values": [0, 1, 2]},
    }
    rows = [
        {
            "m": m,
            "seed": s,
            "W": (m == 15.0) + 1.0 + 0.1 * s,
            "IAE": 2.0,
            "status": "done",
            "hash": f"{m} {s}",
            "message": "",
        }
        for m in (14.0, 15.0)
        for s in range(3)
    ]
    monkeypatch.setattr(conducting, "run_campaign", lambda *_, **__: pandas.DataFrame(rows))
    (base / "out").mkdir()
    arguments = ("--metrics", "W", "--compare", "m", "--pareto", "W,IAE", "--out", base / "out")
    done = command(main, campaign(base, axes), *arguments)
    assert done.returncode == 0, done.stderr
    text = " ".join(done.stdout.split())
    assert "6 runs in" in text
    assert "not dominated in both W and IAE" in text
    assert "m against metric unit pairs difference percent better" in re.sub(r"\W+", " ", text)
    found = pandas.read_csv(base / "out" / "differences.csv")
    assert found["pairs"].tolist() == [3]
    assert found["difference"].abs().tolist() == pytest.approx([1.0])
    assert pandas.read_csv(base / "out" / "pareto.csv")["m"].tolist() == [14.0]


def test_the_campaign_file_is_not_overwritten(base):
    path = campaign(base, {"m": {"set": "vessel.m", "values": [14.0]}}).rename(base / "campaign.json")
    done = command(main, path, "--workers", 0, "--out", base)
    assert done.returncode == 2
    assert "would overwrite" in done.stderr


def test_the_missing_extra_is_named(base, monkeypatch):
    monkeypatch.setattr("cosim.campaign.conduct.find_spec", lambda name: None)
    path = campaign(base, {"m": {"set": "vessel.m", "values": [14.0]}})
    done = command(main, path)
    assert done.returncode == 2
    assert "pip install 'cybership[campaign]'" in done.stderr


@pytest.mark.parametrize(("name", "runs"), [("gains", 8), ("otter", 6)])
def test_the_shipped_campaigns_are_valid(name, runs):
    loaded = LoadedCampaign(ROOT / "scenarios" / "campaigns" / f"{name}.campaign.json")
    assert len(cases(loaded.campaign)) == runs


def dask(folder, *arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *map(str, arguments)],
        env={**os.environ, "DASK_TEMPORARY_DIRECTORY": str(folder)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def address_in(file):
    """The address in the file of a scheduler, or nothing while the file is missing or not yet whole."""
    try:
        return json.loads(file.read_text())["address"]
    except (FileNotFoundError, json.JSONDecodeError):
        return None


@pytest.fixture
def scheduler(tmp_path):
    """A scheduler with two workers, each a process: address and the processes of the workers."""
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    common = ("--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", file)
    started = [dask(tmp_path, "scheduler", "--port", 0, *common)]
    try:
        for _ in range(2):
            started.append(dask(tmp_path, "worker", "--nthreads", 1, "--no-nanny", *common))
        yield once_there(lambda: address_in(file)), started[1:]
    finally:
        for process in started:
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_killed_worker_changes_nothing(base, scheduler, monkeypatch):
    address, workers = scheduler
    path = campaign(
        base,
        {
            "c": {"set": "controller", "values": ["controller_bs.fmu", "controller_abs.fmu"]},
            "seed": {"set": "seed", "values": list(range(10))},
        },
    )
    killed = []

    def progress(ended, failed, of):
        if ended >= 4 and not killed:
            killed.append(ended)
            os.kill(workers[0].pid, signal.SIGKILL)

    spread = cosim.run_campaign(path, base / "spread", scheduler=address, progress=progress)
    assert killed[0] < 20
    assert workers[0].wait() == -signal.SIGKILL
    here = cosim.run_campaign(path, base / "here", workers=0)
    assert set(here["status"]) == {"done"}
    assert without_time(spread).equals(without_time(here))
    workers[1].kill()
    monkeypatch.setattr("cosim.dispatch.dask_workers.WITHOUT_WORKERS", 2.0)
    path = campaign(base, {"m": {"set": "vessel.m", "values": [14.0, 15.0]}})
    with pytest.raises(cosim.SimulationError, match="no worker for 2 s"):
        cosim.run_campaign(path, base / "nobody", scheduler=address)
    assert json.loads((base / "nobody" / "campaign.json").read_text())["status"] == "failed"


@pytest.mark.slow
def test_a_run_that_ends_its_process_is_a_failed_row_and_no_other(base, chain, plain_fmu):
    init = (
        "self.y = 0.0\nself.k = 1.0\nself.register_variable(Real('y', causality=Fmi2Causality.output))\n"
        "self.register_variable(Real('k', start=1.0, causality=Fmi2Causality.parameter,"
        " variability=Fmi2Variability.tunable))"
    )
    step = "self.y += h\nif self.k > 2.5: os._exit(0)\nreturn True"
    chain["fmus"]["ramp"]["path"] = str(plain_fmu("Dies", init, step))
    (base / "base.json").write_text(json.dumps(chain))
    path = campaign(base, {"k": {"set": "ramp.k", "values": [3.0, 1.0, 2.0, 1.5, 1.6, 1.7]}})
    made = cosim.run_campaign(path, base / "out", workers=1)
    assert list(made["status"]) == ["failed", *["done"] * 5]
    assert made["message"][0].startswith("it ended every process")
    lines = (base / "out" / JOURNAL).read_text().splitlines()
    assert sorted(json.loads(line)["status"] for line in lines) == [*["done"] * 5, "lost"]


def test_progress_in_a_file_is_a_line_now_and_then(monkeypatch, capsys):
    """Four runs in a minute: the other four take another one."""
    clock = iter([0.0, 1.0, 60.0, 61.0, 121.0])
    monkeypatch.setattr(shown_progress.time, "monotonic", lambda: next(clock))
    with shown_progress.shown_progress(Console(), quiet=False) as progress:
        progress(1, 0, 9)
        progress(5, 0, 9)
        progress(6, 1, 9)
        progress(7, 1, 9)
    assert capsys.readouterr().out.splitlines() == [
        "5 of 9 runs, about 60 s left",
        "7 of 9 runs (1 failed), about 40 s left",
    ]
    clock = iter([0.0, 40.0, 80.0])
    with shown_progress.shown_progress(Console(), quiet=True) as progress:
        progress(1, 0, 9)
        progress(2, 0, 9)
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_the_page_has_the_shipped_campaign_and_what_it_prints(tmp_path):
    page = (ROOT / "docs" / "campaign.md").read_text(encoding="utf-8")
    shipped = ROOT / "scenarios" / "campaigns" / "gains.campaign.json"
    content = re.search(r"```json\n(.*?)```", page, re.DOTALL)[1]
    printed = re.search(r"```\n(controller.*?)```", page, re.DOTALL)[1]
    assert json.loads(content) == json.loads(shipped.read_text())
    options = (
        "--compare",
        "controller",
        "--metrics",
        "e_pos_rms",
        "--workers",
        0,
        "--out",
        tmp_path / "o",
    )
    done = command(main, shipped, *options)
    assert done.returncode == 0, done.stderr
    assert " ".join(printed.split()) in " ".join(done.stdout.split())
