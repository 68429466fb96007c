"""FMUs that are held against measured runs: ours as a foreign one, others by a map, and what is refused."""

import json
import os
import re
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from zipfile import ZipFile

import numpy as np
import pytest
from scipy.linalg import expm
from support.foreign import needs_compiler
from support.measured import csv_of, lacking_at_all_rows, sail

import diagnosis
from cosim import InputError, Unit
from cosim.fmu import FmuModel, FmuVariable
from diagnosis import Fmu, Run, compare, learn
from diagnosis.predictors import UnmatchedError
from diagnosis.predictors.fmu.variable_map import completed, propose, signal_lines
from fmus.build import build, native_targets
from fmus.build.start_values_file import read_starts

pytestmark = needs_compiler

# The same ship with names and units of its own: heading in degrees to port, speeds in knots.
OTHER = '''
"""A ship with names of its own."""

from typing import Annotated, NamedTuple

from fmus.declare import FIXED, Component
from fmus.ship import ship
from fmus.signals import Force

SHIP = ship().vessel
DEG, KNOT = 57.29577951308232, 3600.0 / 1852.0


class Params(NamedTuple):
    along: Annotated[float, "1", "surge at first [kn]", FIXED] = 0.0
    across: Annotated[float, "1", "sway at first [kn]", FIXED] = 0.0
    turning: Annotated[float, "1", "yaw rate at first [deg/s], to port", FIXED] = 0.0


class Inputs(NamedTuple):
    pull: Annotated[float, "1", "surge force [kN]"] = 0.0
    push: Annotated[float, "1", "sway force [kN]"] = 0.0
    twist: Annotated[float, "1", "yaw moment [kN m], to port"] = 0.0


class Outputs(NamedTuple):
    a: Annotated[float, "1", "first"] = 0.0
    b: Annotated[float, "1", "second"] = 0.0
    c: Annotated[float, "1", "third"] = 0.0

'''
BODY = """
def init(i, p):
    return SHIP.state(0.0, 0.0, 0.0, p.along / KNOT, p.across / KNOT, -p.turning / DEG, 0.0)


def step(s, i, p, h):
    after, o = SHIP.step(s, Force(1e3 * i.pull, 1e3 * i.push, -1e3 * i.twist), SHIP.params(), h)
    return after, Outputs(RETURNED)


COMPONENT = Component(
    name="NAME", description="A ship", params=Params, state=SHIP.state, inputs=Inputs, outputs=Outputs,
    init=init, step=step, sampled=False, max_step=0.02,
)
"""
POSE = "o.pose.x, o.pose.y, -DEG * o.pose.psi"
VELOCITY = "KNOT * o.velocity.u, KNOT * o.velocity.v, -DEG * o.velocity.r"
INPUTS = {
    "tau_X": {"name": "pull", "unit": "kN"},
    "tau_Y": {"name": "push", "unit": "kN"},
    "tau_N": {"name": "twist", "unit": "kN.m", "flip": True},
}
START = {
    "u": {"name": "along", "unit": "kn"},
    "v": {"name": "across", "unit": "kn"},
    "r": {"name": "turning", "unit": "deg/s", "flip": True},
}
POSE_MAP = {
    "x": {"name": "a", "unit": "m"},
    "y": {"name": "b", "unit": "m"},
    "psi": {"name": "c", "unit": "deg", "flip": True},
}
VELOCITY_MAP = {
    "u": {"name": "a", "unit": "kn"},
    "v": {"name": "b", "unit": "kn"},
    "r": {"name": "c", "unit": "deg/s", "flip": True},
}
SAME = {name: name for name in ("x", "y", "psi", "u", "v", "r")}
BEGUN = {name: f"{name}_0" for name in SAME}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Our vessel, and two ships with names of their own: one gives its pose, one its velocity."""
    made = tmp_path_factory.mktemp("foreign")
    for name, returned in (("posed", POSE), ("moving", VELOCITY)):
        (made / f"{name}.py").write_text(
            OTHER + BODY.replace("RETURNED", returned).replace("NAME", name)
        )
    build(["vessel", str(made / "posed.py"), str(made / "moving.py")], made, native=native_targets())
    return made


@pytest.fixture(scope="module")
def runs():
    return diagnosis.gather([sail(40.0)[0]])


@pytest.fixture(scope="module")
def plain(runs):
    return diagnosis.evaluate(runs)


@pytest.fixture(scope="module")
def nominal(plain):
    return errors(plain)


def errors(comparison):
    (e,) = comparison.evaluations
    return e.before.position, e.before.heading


def lacking(comparison):
    """The model error (K, 3)."""
    return comparison.evaluations[0].before.omega


def mapped(folder, fmu, tmp_path, **content):
    path = tmp_path / "map.json"
    path.write_text(json.dumps(content))
    return Fmu(folder / fmu, path)


def test_our_vessel_as_a_foreign_one_misses_by_the_same(folder, runs, plain, nominal):
    """In windows, and by the force that it lacks, which the noise of the run leaves at some mN."""
    found = diagnosis.compare(runs, model=folder / "vessel.fmu")
    assert errors(found) == pytest.approx(nominal, rel=1e-6)
    assert np.abs(lacking(found) - lacking_at_all_rows(*runs, diagnosis.Model())).max() < 1e-6
    slow = diagnosis.gather(
        [sail(40.0, h=0.1)[0]]
    )  # of which the known ship's force takes all rows, too
    found_slow = diagnosis.compare(slow, model=folder / "vessel.fmu")
    assert found_slow.before.sentences == diagnosis.evaluate(slow).before.sentences
    assert not found.predictor.whole
    assert not found.predictor.placed


@pytest.mark.parametrize(("fmu", "outputs"), [("posed.fmu", POSE_MAP), ("moving.fmu", VELOCITY_MAP)])
def test_names_and_units_of_its_own_by_a_map(folder, runs, plain, nominal, tmp_path, fmu, outputs):
    """Where only the velocity is told, it is integrated by the trapezoidal rule; else the pose is bent."""
    model = mapped(folder, fmu, tmp_path, inputs=INPUTS, outputs=outputs, start=START)
    found = diagnosis.evaluate(runs, model)
    assert errors(found) == pytest.approx(nominal, rel=1e-3)
    assert np.abs(lacking(found) - lacking(plain)).max() < 3e-4
    assert found.predictor.placed


def test_a_wrong_sign_in_the_map_shows(folder, runs, nominal, tmp_path):
    wrong = {**INPUTS, "tau_N": {"name": "twist", "unit": "kN.m"}}
    model = mapped(folder, "posed.fmu", tmp_path, inputs=wrong, outputs=POSE_MAP, start=START)
    assert errors(diagnosis.evaluate(runs, model))[1] > 10.0 * nominal[1]


def test_without_a_start_whole_runs_from_rest_or_after_a_run_in(folder, runs, nominal, tmp_path):
    """From rest the true model follows a whole run; a run-in leaves out what it says of the start."""
    model = mapped(folder, "posed.fmu", tmp_path, inputs=INPUTS, outputs=POSE_MAP)
    whole = diagnosis.evaluate(runs, model)
    (e,) = whole.evaluations
    assert whole.predictor.whole
    assert whole.predictor.run_in(e.smoothed) == 0.0
    assert e.windows.run.size == 1
    assert e.windows.since[-1] == pytest.approx(40.0, abs=0.1)
    assert e.before.position < 0.5
    late = mapped(folder, "posed.fmu", tmp_path, inputs=INPUTS, outputs=POSE_MAP, run_in=10.0)
    (e,) = diagnosis.evaluate(runs, late).evaluations
    assert e.windows.since[0] == pytest.approx(10.0, abs=0.1)
    assert np.hypot(*e.before.residuals[0, :2]) < 0.02
    too_long = mapped(folder, "posed.fmu", tmp_path, inputs=INPUTS, outputs=POSE_MAP, run_in=100.0)
    with pytest.raises(InputError, match="leaves nothing"):
        diagnosis.evaluate(runs, too_long)


@pytest.fixture
def csv(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    csv_of(sail(40.0)[0], "run.csv")
    return "run.csv"


def test_the_command_writes_comparison_report_and_map(folder, csv, tmp_path, nominal):
    out = tmp_path / "out"
    command = [csv, "--model", str(folder / "vessel.fmu"), "--out", str(out)]
    assert compare.main(command) == 0
    content = json.loads((out / "comparison.json").read_text())
    (stated,) = content["errors"]
    assert stated["window_position_rmse"]["before"] == pytest.approx(nominal[0], rel=1e-3)
    assert max(stated["omega_rms"]["before"]) < 0.01
    assert len(content["where"]["sentences"]) == 3
    assert content["fmu"]["map"]["outputs"]["x"] == "x"
    assert "starts from the measured state" in (out / "report.html").read_text()
    again = [*command[:3], "--map", str(out / "map.json"), "--out", str(tmp_path / "again")]
    assert compare.main(again) == 0
    same = json.loads((tmp_path / "again" / "comparison.json").read_text())
    assert same["errors"] == content["errors"]


def test_a_first_call_proposes_a_map(folder, csv, tmp_path, capsys):
    assert compare.main([csv, "--model", str(folder / "posed.fmu")]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()[-1:]
    assert "no output is" in line
    assert "'map.json'" in line
    proposal = json.loads((tmp_path / "map.json").read_text())
    assert proposal["outputs"]["x"] is None
    for group, signals in (("inputs", INPUTS), ("outputs", POSE_MAP), ("start", START)):
        proposal[group] |= signals
    (tmp_path / "map.json").write_text(json.dumps(proposal))
    assert compare.main([csv, "--model", str(folder / "posed.fmu"), "--map", "map.json"]) == 0


WRONG = {
    "no JSON": ("{", "cannot be read"),
    "no such key": ('{"input": {}}', "did you mean 'inputs'"),
    "no such signal": ('{"inputs": {"tau_Z": "tau_X"}}', "is not a signal"),
    "no such variable": ('{"inputs": {"tau_X": "tau_XX"}}', "did you mean 'tau_X'"),
    "no such unit": ('{"inputs": {"tau_X": {"name": "tau_X", "unit": "kg"}}}', "is not a unit"),
    "other quantity": ('{"outputs": {"x": "u"}}', "which is not a unit of length"),
    "factor zero": ('{"inputs": {"tau_X": {"name": "tau_X", "factor": 0}}}', "factor is 0"),
    "list": ("[]", "'"),
    "group is a list": ('{"inputs": ["tau_X"]}', "inputs"),
    "incomplete": (
        '{"inputs": {"tau_X": "tau_X"}, "outputs": {"x": "x", "y": "y"}}',
        "no output is psi",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_bad_map_is_refused_in_one_line(folder, runs, tmp_path, name):
    content, message = WRONG[name]
    (tmp_path / "bad.json").write_text(content)
    with pytest.raises(InputError, match=re.escape(message)) as refused:
        diagnosis.evaluate(runs, Fmu(folder / "vessel.fmu", tmp_path / "bad.json"))
    assert "\n" not in str(refused.value)


def test_wrong_files_are_refused_in_one_line(folder, csv, tmp_path, capsys):
    (tmp_path / "broken.fmu").write_text("no archive")
    (tmp_path / "bad.json").write_text(WRONG["no such variable"][0])
    bad = ["--model", str(folder / "vessel.fmu"), "--map", "bad.json"]
    for command in (["--model", "broken.fmu"], ["--model", "none.fmu"], ["--map", "none.json"], bad):
        assert compare.main([csv, *command]) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert line.startswith("error: ")


def test_an_fmu_without_forces_has_nothing_to_compare(runs, tmp_path):
    build(["guidance_ellipse"], tmp_path)
    with pytest.raises(UnmatchedError, match="no input is"):
        diagnosis.evaluate(runs, tmp_path / "guidance_ellipse.fmu")


def variable(name, causality, unit):
    return FmuVariable(name, "Real", 0, causality, "continuous", unit, "", None, None, None)


def test_names_and_units_that_an_fmu_declares_are_matched():
    """By whole names, last parts and marks of a start; by units' names and by what they are of SI."""
    degree = Unit("degree", (0,) * 7, np.pi / 180.0)
    shift = Unit("kilonewton", (1, 1, -2, 0, 0, 0, 0), 1e3, 2.0)
    second = Unit("s", (0, 0, 1, 0, 0, 0, 0))
    declared = [
        variable("ship.heading", "output", degree),
        variable("west", "output", None),
        variable("x", "output", Unit("mm")),
        variable("r", "output", second),
        variable("n_0", "parameter", None),
        variable("start_u", "parameter", Unit("kn")),
        variable("Fx", "input", shift),
        variable("Rudder_Delta", "input", degree),
    ]
    model = SimpleNamespace(
        variables={v.name: v for v in declared}, can_be_set=lambda v: v.causality == "parameter"
    )
    model.reals = partial(FmuModel.reals, model)
    commands = {"tau_X": "force", "rudder.delta": "angle"}
    proposed = propose(model, commands)
    assert proposed.content()["outputs"] == {
        "x": "x", "y": {"name": "west", "flip": True}, "psi": "ship.heading", "u": None, "v": None, "r": None,
    }  # fmt: skip
    found = completed(proposed, model, commands, "map")
    assert {s: c.name for s, c in found.stated("start").items()} == {"u": "start_u"}
    lines = signal_lines(found, commands)
    for group, signal, own, si in (
        ("outputs", "psi", 90.0, np.pi / 2.0),
        ("outputs", "x", 1500.0, 1.5),
        ("start", "u", 3600.0, 1852.0),
        ("inputs", "tau_X", 0.5, 502.0),
        ("inputs", "rudder.delta", -10.0, np.radians(-10.0)),
    ):
        assert lines[group][signal].gain * own + lines[group][signal].offset == pytest.approx(si)


# Of another ship than the one that is known: heavier, with another drag, and a moment of its own.
VENDOR = {"m": 18.0, "X_u": -1.2, "Y_v": -3.0, "N_r": -0.3, "X_udot": -1.0, "delta_N_uv": 0.5}


@pytest.fixture(scope="module")
def vendor(tmp_path_factory):
    """An FMU whose parameters nobody knows."""
    made = tmp_path_factory.mktemp("vendor")
    diagnosis.write_model(made / "vendor.ssv", diagnosis.Model(vessel=VENDOR))
    native = native_targets()
    build(["vessel"], made, read_starts(made / "vendor.ssv"), native=native)
    return (made / "vessel.fmu").rename(made / "vendor.fmu")


def vendors(hidden, seconds):
    """A run of the vendor's ship with a hidden effect, and one to test on."""
    lasting = enumerate((seconds, 0.7 * seconds))
    sailed = [sail(s, 0.1, ship=VENDOR | hidden, seed=k)[0] for k, s in lasting]
    return diagnosis.gather(sailed)


def test_the_force_that_an_unknown_ship_lacks_is_that_by_its_own_parameters(vendor):
    """Its inertia is seen in how it answers forces; the known ship would be wrong by 0.16 N."""
    runs = vendors({"delta_X_u": -2.0}, 50.0)[:1]
    found, true = (diagnosis.evaluate(runs, m) for m in (vendor, diagnosis.Model(vessel=VENDOR)))
    by_all = lacking_at_all_rows(*runs, diagnosis.Model(vessel=VENDOR))
    assert np.abs(lacking(found) - by_all).max() < 1e-5
    assert errors(found) == pytest.approx(errors(true), rel=1e-6)
    (e,) = found.evaluations
    assert e.model.mass == pytest.approx(diagnosis.Model(vessel=VENDOR).mass, rel=1e-6)
    beside = diagnosis.evaluate(runs, e.model.plus({"delta_X_u": -2.0}))
    assert errors(beside)[0] < 0.1 * errors(found)[0]


@pytest.mark.slow
def test_nothing_is_found_beside_an_unknown_ship_that_lacks_nothing(vendor):
    train, test = vendors({}, 50.0)
    d = diagnosis.diagnose([train], [test], model=vendor)
    assert d.verdict == "none"
    assert d.learned.effects == []


@pytest.mark.slow
def test_learn_writes_an_fmu_with_what_was_found(vendor, tmp_path, capsys):
    """It predicts a run of which nothing was learned; an FMU without an input for it is told which."""
    hidden = VENDOR | {"delta_X_u": -2.0}
    runs = [
        str(csv_of(sail(s, 0.1, ship=hidden, seed=k)[0], tmp_path / f"{k}.csv"))
        for k, s in enumerate((50.0, 16.0))
    ]
    out = tmp_path / "out"
    assert learn.main([runs[0], "--test", runs[1], "--model", str(vendor), "--out", str(out)]) == 0
    content = json.loads((out / "diagnosis.json").read_text())
    assert content["verdict"] == "found"
    (effect,) = content["effects"]
    assert effect["id"] == "X_u"
    (coefficient,) = effect["coefficients"].values()
    assert coefficient["value"] == pytest.approx(-2.0, rel=0.1)
    assert {"found.fmu", "map.json"} <= {*content["files"]} == {p.name for p in out.iterdir()}
    (test,) = (e["window_position_rmse"] for e in content["errors"] if e["held_out"])
    after, _ = errors(diagnosis.compare(runs[1], model=Fmu(out / "found.fmu", out / "map.json")))
    assert after < 0.1 * test["before"]


def test_an_fmu_without_a_force_is_told_what_input_it_would_need(folder, runs, tmp_path):
    model = mapped(folder, "vessel.fmu", tmp_path, inputs={"tau_Y": "tau_Y"}, outputs=SAME, start=BEGUN)
    predictor = model.on(runs)
    (stated,) = predictor.write(tmp_path, predictor.model.plus({"delta_X_u": -2.0}), runs)
    assert "it needs tau_X or u_dot, which the map names under 'disturbance_inputs'" in stated
    assert not (tmp_path / "found.fmu").exists()


def test_a_system_is_held_against_a_run_as_one_fmu(runs, plain, nominal, tmp_path):
    """Its thrusters act a step later than those of one model: it misses by up to three tenths more."""
    pytest.importorskip("fmu_manipulation_toolbox")
    axes = [(f"thrusters.tau_act_{a}", f"vessel.tau_{a}") for a in "XYN"]
    content = {
        "name": "ship", "step": 0.02, "stop": 40.0,
        "fmus": {"thrusters": {"path": "thrusters.fmu"}, "vessel": {"path": "vessel.fmu"}},
        "connections": [*axes, *((f"vessel.{v}", f"thrusters.{v}") for v in "uvr")],
    }  # fmt: skip
    (tmp_path / "ship.json").write_text(json.dumps(content))
    found = diagnosis.compare(runs, model=tmp_path / "ship.json")
    assert np.abs(lacking(found) - lacking(plain)).max() < 1e-4
    assert errors(found) == pytest.approx(nominal, rel=0.3)
    assert found.predictor.given.content()["start"]["u"] == "vessel.u_0"


DESCRIPTION = "modelDescription.xml"
UGLY = {
    "model exchange only": ((r"<CoSimulation.*?/>", "<ModelExchange modelIdentifier='x'/>"), "", "model exchange"),
    "FMI 3": (('fmiVersion="2.0"', 'fmiVersion="3.0"'), "", "for FMI 3.0"),
    "other platform": (("^", ""), "binaries/", "cannot be loaded"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "command"), [*((name, compare) for name in UGLY), ("FMI 3", learn)])
def test_an_fmu_that_cannot_run_here_is_refused_in_one_line(
    folder, csv, tmp_path, capsys, name, command
):
    (old, new), without, message = UGLY[name]
    with ZipFile(folder / "vessel.fmu") as given, ZipFile(tmp_path / "ugly.fmu", "w") as made:
        for entry in given.namelist():
            content = given.read(entry)
            if entry == DESCRIPTION:
                content = re.sub(old, new, content.decode(), count=1, flags=re.S).encode()
            if not (without and entry.startswith(without)):
                made.writestr(entry, content)
    assert command.main([csv, "--model", "ugly.fmu", "--out", "out"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line
    assert not (tmp_path / "out").exists()


OSCILLATOR = Path(os.environ.get("CYBERSHIP_FMUS", "")) / "damped_oscillator.fmu"
# Of Dymola: a mass of 2 kg on a spring of 10 N/m and a damper of 1 N s/m, by its force and its states.
MASS_MAP = {
    "inputs": {"tau_X": "f"},
    "outputs": {"x": "s", "u": "v", "y": 0.0, "psi": 0.0, "v": 0.0, "r": 0.0},
    "start": {"x": "springDamper.s_rel", "u": "springDamper.v_rel"},
}


def swung(damper, seconds, seed):
    """The mass as it was measured with another damper [N s/m], exact between commands."""
    h, rng = 0.02, np.random.default_rng(seed)
    t = h * np.arange(round(seconds / h))
    force = 2.0 * np.sin(0.7 * t + seed) + 1.5 * rng.uniform(-1.0, 1.0, t.size)[(t / 3.0).astype(int)]
    motion = np.zeros((3, 3))
    motion[0, 1], motion[1] = 1.0, (-5.0, -0.5 * damper, 0.5)
    step = expm(h * motion)[:2]
    x = np.zeros((t.size, 2))
    for k in range(t.size - 1):
        x[k + 1] = step @ [*x[k], force[k]]
    pose = np.column_stack([x[:, 0], 0.0 * t, 0.0 * t])
    pose += [5e-4, 5e-4, 9e-4] * rng.standard_normal(pose.shape)
    return Run(f"swung {seed}", t, pose, np.column_stack([force, 0.0 * t, 0.0 * t]))


@pytest.mark.slow
@pytest.mark.skipif(
    not OSCILLATOR.is_file(), reason="no damped_oscillator.fmu: CYBERSHIP_FMUS names no folder"
)
def test_what_an_fmu_of_another_tool_lacks_is_found(tmp_path):
    """Its mass is seen in how it answers a force, its damper is too weak by 2 N s/m."""
    (tmp_path / "map.json").write_text(json.dumps(MASS_MAP))
    damper = 3.0
    runs = diagnosis.gather([swung(damper, 100.0, 1), swung(damper, 60.0, 2)], anyway=True)
    d = diagnosis.diagnose(runs[:1], runs[1:], model=Fmu(OSCILLATOR, tmp_path / "map.json"))
    assert d.verdict == "found"
    assert d.start.mass[0, 0] == pytest.approx(2.0, rel=1e-3)
    (found,) = d.learned.effects
    assert found.values == {"delta_X_u": pytest.approx(1.0 - damper, rel=0.05)}
    held_out = d.comparison.evaluations[1]
    assert held_out.after.position < 0.2 * held_out.before.position


@pytest.mark.slow
def test_a_force_in_the_earth_frame_is_found_in_addition_to_parameters(vendor, tmp_path):
    """On every heading it acts on other inputs; the FMU with it predicts what the fit does."""
    hidden = VENDOR | {"F_n": 0.25}
    runs = [
        str(csv_of(sail(s, 0.1, ship=hidden, seed=k)[0], tmp_path / f"{k}.csv"))
        for k, s in enumerate((26.0, 16.0))
    ]
    parameters = [{"name": "X_u", "value": VENDOR["X_u"], "prior": {"rel_std": 0.2}}]
    given, out = tmp_path / "parameters.json", tmp_path / "out"
    given.write_text(json.dumps({"parameters": parameters}))
    named = ["--model", str(vendor), "--parameters", str(given), "--out", str(out)]
    assert learn.main([runs[0], "--test", runs[1], *named]) == 0
    content = json.loads((out / "diagnosis.json").read_text())
    assert content["verdict"] == "found"
    (effect,) = content["effects"]
    assert effect["id"] == "earth_force:F_n"
    (coefficient,) = effect["coefficients"].values()
    assert coefficient["value"] == pytest.approx(0.25, rel=0.1)
    assert not any(p["moved"] for p in content["parameters"])
    (test,) = (e for e in content["errors"] if e["held_out"])
    assert test["outputs"]["x"]["after"] < 0.3 * test["outputs"]["x"]["before"]
    found = Fmu(out / "found.fmu", out / "map.json")
    before, after = (errors(diagnosis.compare(runs[1], model=m)) for m in (vendor, found))
    assert after[0] < 0.3 * before[0]
