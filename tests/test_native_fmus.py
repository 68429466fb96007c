"""FMUs without Python: as the Python FMUs to the bit, in our master, in other tools, in a program in C."""

import json
import math
import zipfile
from importlib.util import find_spec
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from support import ccode
from support.ccode import same_bits
from support.command import command
from support.project import COMPONENTS, ROOT

from benchmarks.windows_numbers import WINE, deviation, host, inputs, stepped
from cosim.run import main as run_scenario
from fmucheck.checking import main as check
from fmus.build import build, native_targets
from fmus.declare import flatten, packer

pytestmark = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")
ZIG = find_spec("ziglang") is not None
NAMES = ["vessel", "thrusters", "observer_mdf", "guidance_ellipse", "controller_abs"]


def described(path):
    """The model description without what tells builds and tools apart."""
    root = ElementTree.fromstring(zipfile.ZipFile(path).read("modelDescription.xml"))
    for attribute in ("guid", "generationTool"):
        del root.attrib[attribute]
    for element in root.iter():
        element.attrib.pop("needsExecutionTool", None)
        element.text = element.tail = None
    return ElementTree.tostring(root)


@pytest.mark.parametrize("name", NAMES)
def test_description_is_that_of_the_python_fmu(name, native, fmus):
    assert described(native[name]) == described(fmus[name])
    assert validate_fmu(str(native[name])) == []
    inside = zipfile.ZipFile(native[name]).namelist()
    assert len(inside) == 2
    assert not [entry for entry in inside if "python" in entry or entry.endswith(".py")]


@pytest.mark.parametrize("name", ["vessel", "thrusters"])
@pytest.mark.slow
def test_no_rule_finds_anything(name, native):
    done = command(check, native[name])
    assert done.returncode == 0, done.stdout
    assert "no findings" in done.stdout


@pytest.mark.parametrize("name", NAMES)
def test_same_bits_as_the_python_fmu(name, native, fmus, opened_here):
    rows = [opened_here(path, name).initialise().play(name, 60) for path in (native[name], fmus[name])]
    assert all(map(same_bits, *rows))


def content(stop):
    """The ellipse with faults of several kinds, and events that switch effects on."""
    scenario = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    pose = ["observer.x_m", "observer.y_m", "observer.psi_m"]
    scenario["faults"] += [
        {"kind": "dropout", "signals": pose, "at": [0.3 * stop], "duration": 0.5, "value": "nan"},
        {
            "kind": "dropout",
            "signals": ["vessel.tau_X"],
            "at": [0.6 * stop],
            "duration": 0.1,
            "value": "nan",
        },
    ]
    changes = [("vessel", "delta_X_u", -4.0), ("thrusters", "delay", 0.07), ("vessel", "V_n", 0.02),
               ("thrusters", "curve_bow_u_3", -0.4), ("thrusters", "lag", 0.2), ("vessel", "mass", 1.5)]  # fmt: skip
    scenario["events"] = [
        {
            "time": stop * (k + 1) / 8,
            "model": model,
            "variable": name,
            "action": "override",
            "value": value,
        }
        for k, (model, name, value) in enumerate(changes)
    ]
    return scenario | {"stop": stop, "metrics": {}}


def test_same_log_from_native_and_from_python_fmus(native, tmp_path):
    stop = 20.0
    scenario = content(stop)
    (tmp_path / "python.json").write_text(json.dumps(scenario | {"native": False}))
    (tmp_path / "native.json").write_text(json.dumps(scenario | {"native": True}))
    logs = []
    for kind in ("python", "native"):
        out = tmp_path / kind
        done = command(run_scenario, tmp_path / f"{kind}.json", "--out", out, "--quiet", "--no-plots")
        assert done.returncode == 0, done.stderr
        logs.append((out / "log.csv").read_bytes())
        stated = json.loads((out / "log.json").read_text())["fmus"].values()
        assert [entry["native"] for entry in stated] == [kind == "native"] * 5
    assert logs[0] == logs[1]
    assert logs[0].count(b"\n") == round(stop * 100) + 2


def test_state_of_another_fmu_is_refused(native, opened_here):
    vessel, observer = (
        opened_here(native["vessel"]).initialise(),
        opened_here(native["observer_mdf"]).initialise(),
    )
    state = observer.fmu.getFMUstate()
    saved = observer.fmu.serializeFMUstate(state)
    observer.fmu.freeFMUstate(state)
    with pytest.raises(Exception, match="error"):
        vessel.fmu.deSerializeFMUstate(saved)
    assert "not a state of this FMU" in vessel.messages[-1][1]


LAST_SUCCESSFUL_TIME = 2  # of fmi2StatusKind


def test_state_that_is_set_restores_the_last_successful_time(native, opened_here):
    vessel = opened_here(native["vessel"]).initialise()
    vessel.play(0)
    state = vessel.fmu.getFMUstate()
    reached = vessel.fmu.getRealStatus(LAST_SUCCESSFUL_TIME)
    vessel.fmu.doStep(reached, 0.5)
    assert vessel.fmu.getRealStatus(LAST_SUCCESSFUL_TIME) == reached + 0.5
    vessel.fmu.setFMUstate(state)
    assert vessel.fmu.getRealStatus(LAST_SUCCESSFUL_TIME) == reached
    vessel.fmu.freeFMUstate(state)


def test_serialised_state_that_was_changed_anywhere_is_refused(native, opened_here):
    vessel = opened_here(native["vessel"]).initialise()
    vessel.play(0)
    state = vessel.fmu.getFMUstate()
    saved = bytes(vessel.fmu.serializeFMUstate(state))
    vessel.fmu.freeFMUstate(state)
    for place in (*range(0, 80, 3), *range(80, len(saved), len(saved) // 40), len(saved) - 1):
        changed = saved[:place] + bytes([saved[place] ^ 1]) + saved[place + 1 :]
        if not any(saved[place:64]) and place < 64:  # behind the end of the guid
            continue
        with pytest.raises(FMICallException):
            vessel.fmu.deSerializeFMUstate(changed)
    assert {text for _, text in vessel.messages} == {
        "these bytes are not a state of this FMU",
        "this state belongs to another version",
        "this state was changed: its checksum differs",
    }


@pytest.mark.parametrize("kind", ["native", "Python"])
@pytest.mark.parametrize(
    "before", [(), ("get",), ("setup", "enter"), ("setup", "enter", "get"), ("state",)]
)
def test_step_before_initialisation_is_refused_whatever_was_called_before(
    before, kind, native, fmus, opened_here
):
    vessel = opened_here(native["vessel"] if kind == "native" else fmus["vessel"])
    for call in before:
        {
            "get": vessel.get,
            "setup": lambda: vessel.fmu.setupExperiment(startTime=0.0),
            "enter": vessel.fmu.enterInitializationMode,
            "state": lambda: vessel.fmu.setFMUstate(vessel.fmu.getFMUstate()),
        }[call]()
    with pytest.raises(FMICallException):
        vessel.fmu.doStep(0.0, 0.01)
    assert "needs a finished initialisation" in " ".join(text for _, text in vessel.messages)


def test_what_is_out_of_place_is_told_and_changes_nothing(native, opened_here):
    vessel = opened_here(native["vessel"]).initialise()
    before = vessel.get()
    for values in ({"x": 3.0}, {"X_u": math.nan}, {"x_0": 9.0}):
        vessel.set(**values)
    assert [status for status, _ in vessel.messages] == [1, 1, 1]
    assert "x_0 is fixed" in vessel.messages[-1][1]
    assert (vessel.get(), vessel.get("X_u", "x_0")) == (before, [-0.6555, 5.0])
    observer = opened_here(native["controller_abs"]).initialise(x_hat=0.3)
    observer.set(x_hat=math.inf)
    assert "x_hat is inf" in observer.messages[-1][1]
    assert observer.get("x_hat") == [0.3]


def test_failing_step_is_an_error_with_its_cause_and_keeps_the_state(native, opened_here):
    vessel = opened_here(native["vessel"]).initialise()
    vessel.step(0.0)
    before = vessel.get()
    wrong = [({"tau_X": 1e300}, "not finite"), ({"tau_X": 0.0, "m": -2.0}, "division by zero")]
    for values, reason in wrong:
        vessel.set(**values)
        with pytest.raises(Exception, match="error"):
            vessel.step(0.01)
        assert vessel.messages[-1][0] == 3
        assert reason in vessel.messages[-1][1]
        assert vessel.get() == before
    vessel.set(m=14.11)
    vessel.step(0.01)
    for h in (-0.01, math.nan, math.inf, 1e9):
        with pytest.raises(Exception, match="error"):
            vessel.step(0.0, h)


@pytest.mark.parametrize("name", NAMES)
def test_program_in_c_runs_it_without_python(name, native, tmp_path):
    """A process that holds no Python opens the library and prints what it computes."""
    zipfile.ZipFile(native[name]).extractall(tmp_path / name)
    component = COMPONENTS[name]
    rows = inputs(component, 200)
    program = host("linux64", tmp_path)
    found, mapped = stepped(program, tmp_path / name, component, rows)
    pack, p = packer(component.inputs), component.params()
    state = component.init(pack(rows[0]), p)
    for row, outputs in zip(rows, found, strict=True):
        state, expected = component.step(state, pack(row), p, 0.01)
        assert same_bits(outputs, flatten(expected))
    assert mapped in ("no Python in this process", "what is mapped cannot be read here")


@pytest.mark.slow
@pytest.mark.skipif(WINE is None or not ZIG, reason="not on Windows, and Wine or zig is not installed")
@pytest.mark.parametrize("name", ["vessel", "observer_kalman"])
def test_library_for_windows_gives_the_same_numbers(name, tmp_path):
    """Its mathematical library is another one."""
    component, rows = COMPONENTS[name], inputs(COMPONENTS[name])
    (archive,) = build([name], native=native_targets("linux64,win64"))
    zipfile.ZipFile(archive).extractall(tmp_path / name)
    linux, windows = (
        stepped(host(target, tmp_path), tmp_path / name, component, rows)[0]
        for target in ("linux64", "win64")
    )
    assert np.ptp(linux, axis=0).max() > 0.0
    assert deviation(windows, linux) <= 1e-12
