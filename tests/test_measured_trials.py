"""Manoeuvring trials that were measured: the same measures, and beside them what models predict."""

import json
from typing import Any

import numpy as np
import pandas as pd
import pytest
from support.cases import slow
from support.command import command
from support.measured import DATA, needs_data
from support.project import ROOT

import cosim
import diagnosis
from cosim.trials import executes, measure, passage
from diagnosis.assessment.trial_errors import trial_errors
from diagnosis.compare import main as compare_main
from diagnosis.measure_trial import main as trial_main
from diagnosis.repair import main as repair_main

ORDERS = ["thrusters.tau_cmd_X", "thrusters.tau_cmd_Y", "thrusters.tau_cmd_N"]
COLUMNS = ["time", "vessel.x", "vessel.y", "vessel.psi", *ORDERS]
NAMES = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]


@pytest.fixture(scope="module")
def sailed(tmp_path_factory):
    """Folders of a zig-zag and a circle of the Otter."""
    folder = tmp_path_factory.mktemp("sailed")
    for kind in ("zigzag", "circle"):
        cosim.simulate(f"otter_{kind}", folder / kind, stop=60.0)
    return folder


def as_file(sailed, kind, folder, trial: str | None = "same", noise=0.002, **others):
    """The measurement of a run as a file, 10 samples a second, with a file beside."""
    log = cosim.read_log(sailed / kind, COLUMNS)
    table = pd.DataFrame({new: log[old][::5] for new, old in zip(NAMES, COLUMNS, strict=True)})
    table[["x", "y", "psi"]] += noise * np.random.default_rng(1).standard_normal((len(table), 3))
    table["psi"] = (table["psi"] + np.pi) % (2.0 * np.pi) - np.pi
    table = table.assign(**others)
    table.to_csv(folder / f"{kind}.csv", index=False)
    stated = kind if trial == "same" else trial
    (folder / f"{kind}.csv.json").write_text(json.dumps({"trial": stated}))
    return folder / f"{kind}.csv"


@pytest.mark.parametrize("kind", ["zigzag", slow("circle")])
def test_a_measured_trial_has_the_measures_of_the_simulated_one(sailed, tmp_path, kind):
    file = as_file(sailed, kind, tmp_path)
    done = command(trial_main, file, "--ship", "otter", "--out", tmp_path / "measured")
    assert done.returncode == 0, done.stderr
    assert f"Trial: {kind}" in done.stdout
    assert command(trial_main, sailed / kind, "--out", tmp_path / "simulated").returncode == 0
    measured, simulated = (
        json.loads((tmp_path / name / "trial.json").read_text()) for name in ("measured", "simulated")
    )
    assert measured["trial"] == simulated["trial"] == kind
    assert measured["limits"].keys() == simulated["limits"].keys()
    assert measured["executes"] == pytest.approx(simulated["executes"], abs=0.11)
    assert measured["measures"].keys() == simulated["measures"].keys()
    for name, value in simulated["measures"].items():
        assert measured["measures"][name] == pytest.approx(value, rel=0.03, abs=0.12), name
    assert (tmp_path / "measured" / "trial.png").exists()


def test_the_option_says_which_trial_and_which_part(sailed, tmp_path):
    file = as_file(sailed, "circle", tmp_path, trial=None)
    out = tmp_path / "out"
    done = command(
        trial_main, file, "--ship", "otter", "--trial", "circle", "--from", 10, "--to", 45, "--out", out
    )
    assert done.returncode == 0, done.stderr
    stated = json.loads((out / "trial.json").read_text())
    assert stated["executes"] == pytest.approx([20.0], abs=0.11)
    assert "tactical_diameter" in stated["measures"]
    assert "circle_speed" not in stated["measures"]


def test_a_part_without_an_approach_says_so(sailed, tmp_path):
    file = as_file(sailed, "circle", tmp_path)
    stated = []
    for start in (0, 19.5):
        done = command(trial_main, file, "--ship", "otter", "--from", start, "--out", tmp_path / "out")
        assert done.returncode == 0, done.stderr
        stated.append("before the first execute: initial heading and speed need one" in done.stdout)
        log = command(trial_main, sailed / "circle", "--from", start, "--out", tmp_path / "out")
        stated.append("before the first execute: initial heading and speed need one" in log.stdout)
    assert stated == [False, False, True, True]


@pytest.mark.parametrize(("stop", "said"), [(45.0, False), (21.0, True)])
def test_a_trial_that_measures_nothing_says_so(sailed, tmp_path, stop, said):
    done = command(trial_main, sailed / "zigzag", "--to", stop, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert ("no further measures" in done.stdout) == said


@pytest.mark.parametrize(
    ("trial", "others", "arguments", "message"),
    [
        (None, {}, (), "does not state its trial"),
        ("zig-zag", {}, (), "is not a manoeuvring trial; did you mean 'zigzag'?"),
        ("same", {"tau_N": 1.0}, (), "is constant"),
        ("same", {}, ("--from", 1e6), "too short"),
    ],
)
def test_mistakes_are_one_line(sailed, tmp_path, trial, others, arguments, message):
    file = as_file(sailed, "zigzag", tmp_path, trial, **others)
    done = command(trial_main, file, "--ship", "otter", *arguments, "--out", tmp_path / "out")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert message in done.stderr
    assert trial is not None or "zigzag.csv.json'" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_log_that_is_no_trial_needs_the_option(tmp_path):
    """A file beside its folder is not read."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text()) | {
        "stop": 1.0,
        "metrics": {},
    }
    cosim.simulate(cosim.load_scenario(content), tmp_path / "log", pictures=False)
    done = command(trial_main, tmp_path / "log", "--out", tmp_path / "out")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "give --trial" in done.stderr
    assert ".json" not in done.stderr


def errors(files, ship, learned=None) -> list[Any]:
    """errors[].trial of runs, before and after."""
    craft = diagnosis.predictors.ship_with((), ship)
    model = diagnosis.Model(ship=craft)
    after = model if learned is None else model.plus(learned)
    runs = diagnosis.gather(files, model=model)
    return [trial_errors(e) for e in diagnosis.evaluate(runs, model, after).evaluations]


def test_the_model_of_the_ship_predicts_its_trial_and_another_one_does_not(sailed, tmp_path):
    files = [as_file(sailed, kind, tmp_path) for kind in ("zigzag", "circle")]
    zigzag, circle = errors(files, "otter", {"delta_N_r": 25.0})
    for name in ("advance", "transfer", "tactical_diameter"):
        measured, before, after = circle[name]
        assert before == pytest.approx(measured, rel=0.02)
        assert after < 0.98 * before
    measured, before, after = zigzag["overshoot"][0]
    assert before == pytest.approx(measured, abs=0.01)
    assert after > 1.05 * before
    assert len(zigzag["overshoot"]) > 2
    assert errors([as_file(sailed, "zigzag", tmp_path, trial=None)], "otter") == [None]


def test_compare_writes_them(sailed, tmp_path):
    file = as_file(sailed, "zigzag", tmp_path)
    done = command(compare_main, file, "--ship", "otter", "--out", tmp_path / "found")
    assert done.returncode == 0, done.stderr
    stated = json.loads((tmp_path / "found" / "comparison.json").read_text())["errors"][0]["trial"]
    assert [len(triple) for triple in stated["overshoot"]] == [3] * len(stated["overshoot"])
    assert len(stated["check_angle"]) == 3
    for page in (done.stdout, (tmp_path / "found" / "report.html").read_text(encoding="utf-8")):
        assert "Manoeuvring trials" in page
        assert "overshoot_1" in page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--ship", "kvlcc2"), "states the ship 'otter'; --ship kvlcc2 contradicts that"),
        (("--trial", "zigzag"), "states the trial 'circle'; --trial zigzag contradicts that"),
    ],
)
def test_what_contradicts_the_log_is_refused(sailed, tmp_path, arguments, said):
    done = command(trial_main, sailed / "circle", *arguments, "--out", tmp_path / "out")
    line = done.stderr.splitlines()[-1]
    assert (done.returncode, said in line) == (2, True)
    same = ("--ship", "otter", "--trial", "circle")
    assert command(trial_main, sailed / "circle", *same, "--out", tmp_path / "out").returncode == 0


def test_a_log_of_a_trial_is_one_to_the_diagnosis(sailed):
    found = errors([sailed / "zigzag"], "otter")[0]
    assert found["overshoot"][0][1] == pytest.approx(found["overshoot"][0][0], abs=0.005)


# Real ones

TANKER = {"time": "t", "psi": {"name": "psi_deg", "unit": "deg"}, "propeller.n": "rps",
          "rudder.delta": {"name": "rudder_deg", "unit": "deg", "flip": True}}  # fmt: skip


@needs_data
@pytest.mark.parametrize(
    ("name", "check"), [("z_10_10_p", 10.0), slow(("z_10_10_s", 10.0)), slow(("z_20_10_s", 10.0))]
)
def test_zigzags_of_the_tanker(name, check, tmp_path):
    """The order turns at the heading that the file's name tells, and 10/10 is as the basin's."""
    file = tmp_path / f"{name}.csv"
    file.write_bytes((DATA / "kvlcc2_hsva" / file.name).read_bytes())
    (tmp_path / f"{file.name}.json").write_text(json.dumps({"trial": "zigzag", "columns": TANKER}))
    found = errors([file], "kvlcc2")[0]
    assert np.degrees(found["check_angle"][0]) == pytest.approx(check, abs=1.5)
    measured, before, after = np.array(found["overshoot"]).T
    assert 3.0 < np.degrees(measured[0]) < 15.0
    assert (before == after).all()
    assert before == pytest.approx(measured, rel=0.6)


VESSEL = {"time": "tvec", "x": "N", "y": "E", "psi": {"name": "psi", "unit": "deg"},
          "r": {"name": "r", "unit": "deg/s"}, "azimuth.alpha": {"name": "Azi", "unit": "deg"},
          "azimuth.n": {"name": "RPM", "unit": "rpm"}}  # fmt: skip


@pytest.mark.slow
@needs_data
def test_a_log_with_a_wrong_clock_is_repaired_and_measured(tmp_path):
    """The log by its own times, and the repaired one by the true times, give the same measures."""
    raw, repaired = tmp_path / "trial_1.csv", tmp_path / "repaired.csv"
    log = pd.read_csv(DATA / "gunnerus" / raw.name)
    log[(log.tvec > 200.0) & (log.tvec < 800.0)].to_csv(raw, index=False)
    (tmp_path / f"{raw.name}.json").write_text(json.dumps({"columns": VESSEL}))

    done = command(repair_main, raw, "--ship", "gunnerus", "--out", repaired)
    assert done.returncode == 0, done.stderr
    before, after = pd.read_csv(raw), pd.read_csv(repaired)
    times = [470.0, 684.0]
    rows = np.searchsorted(before.tvec, times)
    true = after.time.to_numpy()[rows]  # the repair leaves out four rows
    for file, (start, stop) in ((raw, times), (repaired, true)):
        part = "--from", start, "--to", stop, "--out", tmp_path / "out"
        done = command(trial_main, file, "--ship", "gunnerus", "--trial", "circle", *part)
        assert done.returncode == 0, done.stderr
        stated = json.loads((tmp_path / "out" / "trial.json").read_text())["measures"]
        assert stated["tactical_diameter"] == pytest.approx(92.3, abs=1.5)
        assert stated["transfer"] == pytest.approx(40.6, abs=1.5)
        assert stated["advance"] == pytest.approx(104.2, rel=0.06)
        assert np.degrees(stated["circle_rate"]) == pytest.approx(2.83, abs=0.1)


@needs_data
@pytest.mark.parametrize(
    ("part", "begin", "end", "advance", "transfer", "diameter"),
    [
        (1, 489.0, 684.0, 104.2, 40.6, 92.3),
        (1, 1215.0, 1399.0, 87.3, 48.5, 95.8),
        (1, 2317.0, 2557.0, 151.5, 122.3, 254.1),
        (2, 7109.0, 7369.0, 86.7, 39.7, 92.1),
        (2, 7577.0, 7736.0, 117.1, 58.0, 125.4),
    ],
)
def test_circles_of_the_research_vessel(part, begin, end, advance, transfer, diameter):
    """Against circles that were measured by others in the same log: a metre is a fifth of a second."""
    log = pd.read_csv(DATA / "gunnerus" / f"trial_{part}.csv")
    log = log[(log.tvec >= begin - 12.0) & (log.tvec <= end)]
    psi = np.radians(log.psi.to_numpy())
    jumps = np.abs((np.diff(psi) + np.pi) % (2.0 * np.pi) - np.pi) > 0.2  # interpolated through 360
    whole = ~(np.append(jumps, False) | np.append(False, jumps))
    p = passage(*(c[whole] for c in (log.tvec, log.N, log.E, psi, log.Azi)))
    found = measure("circle", p, 33.9)
    assert executes(p)[0] == pytest.approx(begin, abs=1.0)
    assert found["advance"] == pytest.approx(advance, abs=1.5)
    assert found["transfer"] == pytest.approx(transfer, abs=0.7)
    assert found["tactical_diameter"] == pytest.approx(diameter, abs=0.7)
