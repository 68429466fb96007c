"""The page in which a scenario runs: its numbers are those of cosim.run, and nothing foreign runs in it."""

import json
import re
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from support.chromium import BROWSER, NO_BROWSER, Tab
from support.command import command
from support.project import ROOT
from support.shared import kept

import cosim
from cosim.live.__main__ import main
from cosim.live.page_file import check_replaceable
from fmus.ships.ship_file import find_ship

SECONDS = 12.0  # of the run, with frozen measurements in it
CHANGE = 400  # base step at which the tests change something
EVIL = "</script><img src=x onerror='window.evil=1'> & \" $title"
TOLERANCE = 1e-12  # of a value, relative and absolute


def scenario(**changed):
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    return {**content, "description": EVIL, "stop": SECONDS, "metrics": {"from": 2.0}, **changed}


def made(content):
    """The text of the page of a scenario."""
    with TemporaryDirectory() as folder:
        (Path(folder) / "s.json").write_text(json.dumps(content))
        assert main([f"{folder}/s.json", "--out", f"{folder}/page.html"]) == 0
        return (Path(folder) / "page.html").read_text("utf-8")


@pytest.fixture
def tab(tmp_path):
    """Opens the page of a scenario."""
    if BROWSER is None:  # before a page is made, which takes seconds
        pytest.skip(NO_BROWSER)
    opened = []

    def of(content):
        page = tmp_path / "page.html"
        page.write_text(kept(made, content), encoding="utf-8")
        opened.append(Tab(page, tmp_path).__enter__())
        opened[-1].wait("typeof page !== 'undefined'")
        opened[-1].evaluate("page.then(() => true)")
        return opened[-1]

    yield of
    for each in opened:
        assert each.console == []
        each.__exit__()


def advanced(tab, steps):
    tab.evaluate(f"page.then((p) => {{ while (p.run.done < {steps} && p.advance()); p.show(); }})")


def agree(tab, folder, content):
    """The page's log and metrics are those of a run of the scenario."""
    result = cosim.simulate(content, folder / "run", log="all")
    expected = cosim.read_log(folder / "run")
    head, *lines = tab.evaluate("page.then((p) => p.run.csv())").splitlines()
    assert head.split(",") == list(expected)
    got = np.array([line.split(",") for line in lines], float)
    rows = np.stack([*expected.values()], axis=1)
    assert np.allclose(got, rows, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True)
    shown = tab.evaluate(
        "Object.fromEntries([...document.querySelectorAll('#metrics tr')].map((row) => "
        "[row.querySelector('th').textContent, Number(row.querySelector('td').dataset.value)]))"
    )
    assert shown == pytest.approx(dict(result.metrics), rel=1e-6)


@pytest.mark.slow
def test_log_and_metrics_are_those_of_a_run(tab, tmp_path):
    opened = tab(scenario())
    opened.press("e")
    opened.wait("page.then((p) => p.run.finished)")
    agree(opened, tmp_path, scenario())


@pytest.mark.slow
def test_changes_by_the_user_are_events(tab, tmp_path):
    """Keys and fields: a frozen measurement, and an effect that is added."""
    opened = tab(scenario())
    advanced(opened, CHANGE)
    opened.press("f")
    opened.evaluate(
        "document.getElementById('parameter').value = 'vessel.delta_X_u',"
        "document.getElementById('value').value = '-2', document.getElementById('apply').click()"
    )
    advanced(opened, CHANGE + 50)
    opened.press("f")
    advanced(opened, 1200)
    signals = ("x_m", "y_m", "psi_m")
    events = [
        {"time": 0.01 * step, "model": "observer", "variable": v, "action": action}
        for step, action in ((CHANGE, "hold"), (CHANGE + 50, "reset"))
        for v in signals
    ]
    drag = {"model": "vessel", "variable": "delta_X_u", "action": "override", "value": -2.0}
    agree(opened, tmp_path, scenario(events=[{"time": 0.01 * CHANGE, **drag}, *events]))
    assert [
        a["action"] for a in json.loads(opened.evaluate("page.then((p) => p.record())"))["actions"]
    ] == [
        "measurement frozen",
        "vessel.delta_X_u = -2",
        "measurement released",
    ]


@pytest.mark.slow
def test_events_rates_and_delays_are_those_of_a_run(tab, tmp_path):
    """With Jacobi's method, a slower controller, all kinds of faults, and events from the start on."""
    pose = [f"observer.{axis}_m" for axis in ("x", "y", "psi")]
    content = scenario(algorithm="jacobi", faults=[
        {"kind": "bias", "signals": pose[:2], "value": 0.01},
        {"kind": "spikes", "signals": pose[:1], "rate": 0.5, "size": 0.1},
        {"kind": "wrap", "signals": pose[2:]},
        {"kind": "delay", "signals": pose, "time": 0.05},
        {"kind": "dropout", "signals": pose, "at": [3.0], "duration": 0.5},
        {"kind": "noise", "signals": ["guidance.x_t"], "std": 0.001},
    ], events=[
        {"time": 0.0, "model": "controller", "variable": "x_hat", "action": "bias", "value": 0.02},
        {"time": 4.0, "model": "vessel", "variable": "delta_X_u", "action": "bias", "value": -1.0},
        {"time": 5.0, "model": "controller", "variable": "x_hat", "action": "reset"},
        {"time": 6.0, "model": "vessel", "variable": "delta_X_u", "action": "reset"},
    ])  # fmt: skip
    content["fmus"]["controller"]["step"] = 0.02
    opened = tab(content)
    advanced(opened, 1200)
    agree(opened, tmp_path, content)


@pytest.mark.slow
def test_every_controller_and_observer_can_be_chosen(tab):
    opened = tab(scenario())
    advanced(opened, CHANGE)
    names = opened.evaluate(
        "[...document.querySelectorAll('select.fmu')].map((s) => [...s.options].map((o) => o.textContent))"
    )
    assert {"controller_bs", "observer_luenberger"} <= {name for one in names for name in one}
    for k, choices in enumerate(names):
        for choice in range(len(choices)):
            opened.evaluate(
                f"{{ const s = document.querySelectorAll('select.fmu')[{k}]; s.selectedIndex = {choice};"
                "s.dispatchEvent(new Event('change')); }"
            )
            advanced(opened, opened.evaluate("page.then((p) => p.run.done)") + 5)
            status = opened.evaluate("document.getElementById('status').textContent")
            assert f" = {choices[choice]}, from" in status, choices[choice]


@pytest.mark.slow
def test_page_is_inert_and_fits(tab):
    """Texts of the scenario are texts; no other script runs; a phone needs no sideways scroll."""
    opened = tab(scenario())
    advanced(opened, CHANGE)
    opened.evaluate(
        "{ const s = document.createElement('script'); s.textContent = 'window.evil = 2';"
        "document.body.append(s); }"
    )
    assert opened.evaluate("window.evil") is None
    assert opened.console.pop()["entry"]["text"].startswith("Executing inline script violates")
    assert EVIL in opened.evaluate("document.body.textContent")
    opened.size(390, 844)
    assert opened.evaluate("document.documentElement.scrollWidth") <= 390
    policy = opened.evaluate("document.querySelector('meta[http-equiv]').content")
    assert "unsafe-inline" not in policy
    assert re.search(r"script-src 'sha256-[^']+' 'wasm-unsafe-eval';", policy)
    text = kept(made, scenario())
    assert len(text.encode()) < 3e6
    assert not re.search(r"https?://", text)
    unnamed = "[...document.querySelectorAll('button, input, select')].filter((e) => !(e.textContent || e.labels?.length"
    assert opened.evaluate(f"{unnamed} || e.ariaLabel)).length") == 0


def refused(content, folder):
    (folder / "s.json").write_text(json.dumps(content))
    done = command(main, folder / "s.json", "--out", folder / "page.html")
    assert done.returncode == 2
    assert not (folder / "page.html").exists()
    (line,) = done.stderr.splitlines()
    return line


def test_files_that_are_no_such_page_are_not_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr("cosim.live.page_file.alternatives", lambda *_: [])  # which take seconds
    file, other = tmp_path / "s.json", tmp_path / "other.html"
    file.write_text(json.dumps(scenario(stop=3.0)))
    other.write_text("<!DOCTYPE html>")
    (tmp_path / "folder").mkdir()
    ship = tmp_path / "ship.toml"
    ship.write_bytes(find_ship("cse1").read_bytes())
    for out, more, said in (
        (ship, ("--ship", ship, "--overwrite"), "is an input of the page"),
        (file, ("--overwrite",), "is an input of the page"),
        (other, (), "exists and is not such a page; --overwrite replaces it"),
        (tmp_path / "folder", ("--overwrite",), "is a folder"),
    ):
        before = out.is_file() and out.read_bytes()
        done = command(main, file, "--out", out, *more)
        assert (done.returncode, said in done.stderr) == (2, True)
        assert (out.is_file() and out.read_bytes()) == before
    assert command(main, file, "--out", other, "--overwrite").returncode == 0
    check_replaceable(other, (file,))  # its own page


def test_fmus_of_others_are_refused(fmus, tmp_path):
    content = scenario()
    content["fmus"]["vessel"]["path"] = str(fmus["vessel"])
    assert refused(content, tmp_path).startswith("error: fmus.vessel: ")


def test_inputs_from_files_are_refused(tmp_path):
    (tmp_path / "wind.csv").write_text("time,wind\n0,0\n")
    content = scenario(recordings=[{"path": "wind.csv", "inputs": {"thrusters.u": "wind"}}])
    assert "recordings" in refused(content, tmp_path)


@pytest.mark.slow
def test_a_large_page_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("cosim.live.page_file.alternatives", lambda *_: [])
    line = refused(scenario(stop=2000.0), tmp_path)
    assert re.search(r"the page would have \d+\.\d MB, .*--stop", line)
