"""Scenarios of a described ship: its FMUs by bare names, its outline, its name in the log."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
from support.command import command
from support.project import COMPONENTS, ROOT

import cosim
from cosim.campaign.__main__ import main as campaign_main
from cosim.fmu import FmuModel
from cosim.formats.outline import AnnotatedOutline, read_outline
from cosim.results import read_options
from cosim.run import main as run_main
from diagnosis.compare import main as compare_main
from fmus.build import build
from fmus.fmi.model_description import guid_of, model_description
from fmus.ship import ship
from fmus.ships.ship_file import read_ship

OTTER = read_ship("otter")


def short(stop=4.0, **changes):
    """The shipped scenario of the Otter, not so long: to compile its FMUs would take longer than to run."""
    content = json.loads((ROOT / "scenarios" / "otter_waypoints.json").read_text())
    content["fmus"]["guidance"]["table"] = str(ROOT / "scenarios" / "otter_route.csv")
    return content | {"stop": stop, "metrics": {}, "native": False} | changes


@pytest.fixture(scope="module")
def otter(tmp_path_factory):
    """The folder of a short run, with its pictures."""
    folder = tmp_path_factory.mktemp("otter")
    assert cosim.simulate(short(), folder, pictures=True).status == "done"
    return folder


def test_the_log_names_the_ship_and_holds_its_commands(otter):
    stated = json.loads((otter / "log.json").read_text())
    assert stated["scenario"]["ship"] == "otter"
    assert {"thrusters.port_n", "thrusters.starboard_n"} <= stated["columns"].keys()
    assert read_options(otter).outline == AnnotatedOutline("otter", OTTER.length, OTTER.outline)


@pytest.mark.parametrize("path", ["vessel.fmu", "thrusters.fmu", "controller_pid.fmu"])
def test_bare_names_are_the_fmus_of_the_ship(otter, path):
    stated = json.loads((otter / "log.json").read_text())["fmus"].values()
    (used,) = [fmu["guid"] for fmu in stated if fmu["path"].endswith(path)]
    (theirs,) = build(path, ship=OTTER)
    (usual,) = build(path)
    assert used == FmuModel(theirs).description.guid != FmuModel(usual).description.guid


def test_python_and_native_fmus_have_the_same_numbers(tmp_path):
    logs = []
    for native in (False, True):
        result = cosim.simulate(short(), tmp_path / str(native), native=native)
        assert (result.status, result.native) == ("done", native)
        logs.append((tmp_path / str(native) / "log.csv").read_bytes())
    assert logs[0] == logs[1]


def test_the_option_beats_the_scenario(tmp_path):
    for given in ("cse1", None):
        result = cosim.simulate(short(0.2), tmp_path, ship=given)
        assert ("thrusters.port_n" in result.log) == (given is None)


def test_a_file_beside_the_scenario_describes_the_ship(tmp_path):
    text = (ROOT / "ships" / "otter.toml").read_text().replace('name = "otter"', 'name = "lutra"')
    (tmp_path / "lutra.toml").write_text(text)
    (tmp_path / "run.json").write_text(json.dumps(short(0.2, ship="lutra.toml")))
    cosim.simulate(tmp_path / "run.json", tmp_path / "out")
    options = read_options(tmp_path / "out")
    assert options.outline is not None
    assert (options.outline.name, options.ship) == ("lutra", str(tmp_path / "lutra.toml"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--ship", "oter"), "no ship 'oter'; did you mean 'otter'?"),
        (("--set", "ship=oter"), "did you mean 'otter'?"),
        (("--ship", ROOT / "ships" / "oter.toml"), "did you mean 'otter.toml'?"),
        (("--ship", ""), "neither the name of a ship nor that of a .toml file"),
        (("--set", "controller=controller_pit.fmu"), "did you mean 'controller_pid'?"),
    ],
)
def test_mistakes_are_one_line(tmp_path, arguments, message):
    done = command(run_main, "otter_waypoints", *arguments, "--out", tmp_path / "out")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert message in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("described", [None, OTTER], ids=["cse1", "otter"])
def test_the_annotation_of_a_vessel_is_its_outline(described):
    made = ship(description=described).vessel
    root = model_description(made, guid_of("0"), "1")
    assert read_outline(root.find("VendorAnnotations")) == AnnotatedOutline(*made.outline)
    corners = np.array(made.outline.corners)
    assert np.ptp(corners[:, 0]) == pytest.approx(made.outline.length, rel=0.1)
    assert sorted(corners[:, 1]) == pytest.approx(sorted(-corners[:, 1]))


def test_only_a_vessel_is_drawn():
    assert [name for name, c in COMPONENTS.items() if c.outline is not None] == ["vessel"]


@pytest.mark.parametrize("ship_element", ["", '<Ship name="a" length="x" outline="0,0 1,0 1,1"/>',
                                          '<Ship name="a" length="1" outline="0,0 1,0"/>',
                                          '<Ship name="a" length="1" outline="0,0 1,nan 1,1"/>'])  # fmt: skip
def test_an_annotation_that_holds_no_outline_draws_none(ship_element):
    tool = f'<Tool name="cybership">{ship_element}</Tool>'
    annotations = ElementTree.fromstring(f"<VendorAnnotations>{tool}</VendorAnnotations>")
    assert read_outline(annotations) is None


def test_an_axis_of_ships_runs_each(tmp_path):
    (tmp_path / "run.json").write_text(json.dumps(short(0.2)))
    content = {"scenario": "run.json", "axes": {"ship": {"set": "ship", "values": ["otter", "cse1"]}}}
    (tmp_path / "c.campaign.json").write_text(json.dumps(content))
    done = command(
        campaign_main,
        tmp_path / "c.campaign.json",
        "--workers",
        0,
        "--keep-logs",
        "--out",
        tmp_path / "o",
    )
    assert done.returncode == 0, done.stderr
    names = {read_options(log.parent).outline.name for log in (tmp_path / "o").rglob("log.json")}
    assert names == {"otter", "cse1"}


@pytest.mark.slow
def test_the_diagnosis_takes_the_ship_from_the_log(tmp_path):
    cosim.simulate(short(60.0, native="auto"), tmp_path / "run")
    done = command(compare_main, tmp_path / "run", "--out", tmp_path / "found")
    assert done.returncode == 0, done.stderr
    assert "the ship is otter" in done.stderr
    assert json.loads((tmp_path / "found" / "comparison.json").read_text())


def test_logs_of_several_ships_are_refused(otter, tmp_path):
    cosim.simulate(short(0.2), tmp_path / "other", ship="cse1")
    done = command(compare_main, otter, tmp_path / "other", "--out", tmp_path / "found")
    assert done.returncode == 2
    assert "of several ships" in done.stderr


@pytest.mark.parametrize(("name", "warns"), [("cse1", True), ("otter", False)])
def test_a_log_of_another_ship_than_stated_is_a_warning(otter, tmp_path, name, warns):
    done = command(compare_main, otter, "--ship", name, "--out", tmp_path / "found")
    assert ("is a log of otter; it is read as one of cse1, as --ship states" in done.stderr) == warns


@pytest.mark.slow
def test_the_otter_follows_its_route_by_heading_alone(tmp_path):
    """A third of a metre across, and a length behind: nothing feeds its drag forward."""
    metrics = cosim.simulate("otter_waypoints", tmp_path).metrics
    assert metrics["cross_track_rms"] < 0.4
    assert metrics["e_pos_max"] < 1.2 * OTTER.length
