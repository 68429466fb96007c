"""A package of somebody else, installed from its wheel, adds ship, law, hull function, effect, command."""

import os
import subprocess
import sys

import fmpy
import pytest
from support.project import ROOT

from cosim import InputError
from diagnosis.predictors import Model, ship_with
from fmus import hull_functions
from fmus.actuators.law import Law
from fmus.declare import DeclarationError
from fmus.effects import STANDARD

PACKAGE = ROOT / "examples" / "jet_boat"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with the package, installed from its wheel."""
    folder = tmp_path_factory.mktemp("package")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    built = subprocess.run(
        [*pip, "wheel", "--no-deps", "--wheel-dir", folder, PACKAGE],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if "No matching distribution found for setuptools" in built.stderr:
        pytest.skip("no package index, from which setuptools comes")
    assert built.returncode == 0, built.stderr
    (wheel,) = folder.glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", folder / "site", wheel], check=True)
    return folder / "site"


@pytest.fixture
def installed(site, monkeypatch):
    """The package can be imported in this process."""
    monkeypatch.syspath_prepend(site)
    yield
    Law.known.pop("jet_pump", None)
    hull_functions.FUNCTIONS.pop("bow_wave", None)


def run(site, *arguments):
    return subprocess.run(
        [sys.executable, "-m", *map(str, arguments)],
        capture_output=True, text=True, cwd=ROOT, check=False,
        env={**os.environ, "PYTHONPATH": str(site)},
    )  # fmt: skip


def test_its_command_is_one_of_cybership(site):
    usage = run(site, "cybership", "--help").stdout
    assert "  bollard-pull compute the force of a ship's thrusters at rest and full command\n" in usage
    assert run(site, "cybership", "bollard-pull").stdout == "12.00 N, 0.00 N, 0.00 N m\n"
    assert run(site, "cybership", "bollard-pull", "--help").stdout.startswith(
        "usage: cybership bollard-pull "
    )
    wrong = run(site, "cybership", "bollard-pull", "jet_bot")
    assert (wrong.returncode, wrong.stderr) == (
        2,
        "error: no ship 'jet_bot'; did you mean 'jet_boat'?\n",
    )


def test_fmus_carry_its_law_hull_function_and_effect(site, tmp_path):
    done = run(
        site, "fmus.build", "vessel", "thrusters", "--ship", "jet_boat", "--effects", "weed", "--out", tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    out = fmpy.simulate_fmu(tmp_path / "thrusters.fmu", stop_time=0.1, start_values={"tau_X": 3.0})
    assert out["tau_act_X"][-1] == pytest.approx(2.0 * 2.0 * 3.0 * 0.25**2)  # as in test_own_law.py
    speeds = {}
    for name, start in {
        "plain": {},
        "wave": {"bow_wave_drag": 20.0},
        "weed": {"weed_drag": -5.0},
    }.items():
        start = {"u_0": 1.0, "bow_wave_drag": 0.0, **start}
        out = fmpy.simulate_fmu(tmp_path / "vessel.fmu", stop_time=1.0, start_values=start, output=["u"])
        speeds[name] = out["u"][-1]
    assert speeds["wave"] < speeds["plain"] - 0.05
    assert speeds["weed"] < speeds["plain"] - 0.05


def test_the_diagnosis_knows_what_it_adds_where_it_is_named(installed):
    plain, weedy = ship_with([], "jet_boat"), ship_with(["weed"], "jet_boat")
    assert "loss_port" in plain.candidates
    assert {*weedy.candidates} - {*plain.candidates} == {"weed"}
    assert Model(ship=weedy).plus({"weed_drag": -1.0}).value("weed_drag") == -1.0
    assert "weed" not in ship_with([]).candidates  # installed is not yet used
    with pytest.raises(InputError, match="no such Python file of effects: 'wed'; did you mean 'weed'"):
        ship_with(["wed"])


def test_it_replaces_no_hull_function_of_the_project(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from fmus.hull_functions import hull_function\n\n\n"
        "@hull_function()\ndef cross_flow(u, v, r):\n    return 0.0, 0.0, 0.0\n"
    )
    with pytest.raises(DeclarationError, match="there is a function of the hull 'cross_flow' already"):
        STANDARD.plus_file(tmp_path / "mine.py")
