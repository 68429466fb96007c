"""FMUs without Python: as the Python FMUs to the bit, in our master, in other tools, in a program in C."""

import json
import math
import subprocess
import zipfile
from xml.etree import ElementTree

import pytest
from fmpy.validation import validate_fmu
from support import ccode
from support.ccode import same_bits
from support.command import command
from support.project import COMPONENTS, ROOT

from cosim.run import main as run_scenario
from fmus.check.checking import main as check
from fmus.declare import flatten, width

pytestmark = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")
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


@pytest.mark.parametrize("stop", [20.0, pytest.param(198.0, marks=pytest.mark.slow)])
def test_same_log_from_native_and_from_python_fmus(stop, native, tmp_path):
    scenario = content(stop)
    (tmp_path / "python.json").write_text(json.dumps(scenario))
    (tmp_path / "native.json").write_text(json.dumps(scenario | {"native": True}))
    logs = []
    for kind in ("python", "native"):
        out = tmp_path / kind
        done = command(run_scenario, tmp_path / f"{kind}.json", "--out", out, "--quiet", "--no-plots")
        assert done.returncode == 0, done.stderr
        logs.append((out / "log.csv").read_bytes())
        told = json.loads((out / "log.json").read_text())["fmus"].values()
        assert [entry["native"] for entry in told] == [kind == "native"] * 5
    assert logs[0] == logs[1]
    assert logs[0].count(b"\n") == round(stop * 100) + 2


def test_reset_and_states_repeat_bit_for_bit(native, opened_here):
    one, other = (
        opened_here(native["vessel"], "one").initialise(),
        opened_here(native["vessel"], "other").initialise(),
    )
    first = one.play(0)
    state = one.fmu.getFMUstate()
    rows = one.play(1)
    saved = one.fmu.serializeFMUstate(state)
    one.fmu.setFMUstate(state)
    assert one.play(1) == rows
    restored = other.fmu.deSerializeFMUstate(saved)
    other.fmu.setFMUstate(restored)
    assert other.play(1) == rows
    for fmu, given in ((one, state), (other, restored)):
        fmu.fmu.freeFMUstate(given)
    one.fmu.reset()
    one.initialise()
    assert one.play(0) == first


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
    assert "no state of this FMU" in vessel.messages[-1][1]


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


def test_program_in_c_runs_a_vessel_without_python(native, tmp_path):
    """A process that holds no Python opens the library and prints what it computes."""
    zipfile.ZipFile(native["vessel"]).extractall(tmp_path)
    (library,) = tmp_path.glob("binaries/*/vessel.*")
    guid = ElementTree.parse(tmp_path / "modelDescription.xml").getroot().get("guid")
    host = tmp_path / "host"
    source = ROOT / "tests" / "support" / "host.c"
    subprocess.run([ccode.COMPILER, "-o", host, source, "-ldl"], check=True)
    component = COMPONENTS["vessel"]
    first = width(component.params)  # value reference of the first input
    arguments = [host, library, guid, str(first)]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    i, p = component.inputs(0.5, 0.1, -0.02), component.params()
    state, outputs = component.init(i, p), ()
    for _ in range(1000):
        state, outputs = component.step(state, i, p, 0.01)
    *numbers, mapped = done.stdout.splitlines()
    assert same_bits(map(float, numbers), flatten(outputs)[:3])
    assert mapped in ("no Python in this process", "what is mapped cannot be read here")
