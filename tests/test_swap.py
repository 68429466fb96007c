"""docs/swap.md, run as it stands; docs/interface.md, read from the FMUs again; and the signs it tells."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from support.project import ROOT

import cosim
from cosim.interface import interface
from cosim.scenario import load_scenario
from cosim.system import prepare

SWAP = (ROOT / "docs" / "swap.md").read_text()
SCENARIO = ROOT / "scenarios" / "ellipse.json"


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", SWAP, re.S)


def follow(folder, script, build, old, new, seconds):
    """Do what the page says, in a folder; returns the result of the run."""
    (folder / script).write_text(next(b for b in blocks("python") if b.startswith(f"# {script}\n")))
    command = next(b for b in blocks("sh") if script in b).split()
    assert command[0] == build
    subprocess.run([sys.executable, "-m", *command], cwd=folder, check=True, capture_output=True)
    text = SCENARIO.read_text()
    assert text.count(old) == 1
    (folder / "swapped.json").write_text(text.replace(old, new))
    scenario = load_scenario(
        folder / "swapped.json", {"stop": seconds, "metrics": {"from": seconds / 2}}
    )
    return cosim.simulate(scenario, folder / "out")


@pytest.mark.parametrize(("script", "place"), [("pid.py", 0), ("ship.py", 1)])
def test_swapping_by_one_line_as_documented(tmp_path, script, place):
    lines = [block.rstrip("\n") for block in blocks("json")]
    result = follow(tmp_path, script, "pythonfmu", *lines[2 * place : 2 * place + 2], 20.0)
    assert result.status == "done"
    assert result.metrics["e_pos_rms"] < 0.3
    log = cosim.read_log(result.folder, ["vessel.x", "vessel.y"])
    # It goes along with the target, which makes some 1.6 m in that time.
    assert np.hypot(np.ptp(log["vessel.x"]), np.ptp(log["vessel.y"])) > 1.0


def test_the_run_commands_of_the_page_are_commands():
    runs = [block.split() for block in blocks("sh") if "cosim.run" in block]
    assert len(runs) == 2
    for run in runs:
        assert run[:3] == ["python", "-m", "cosim.run"]
        assert run[3].endswith(".json")


def test_interface_page_is_up_to_date():
    page = (ROOT / "docs" / "interface.md").read_text()
    system = prepare(load_scenario(SCENARIO))
    try:
        fresh = interface(system)
    finally:
        system.close()
    _, found, rest = page.partition("<!-- from the FMUs -->\n\n")
    assert found
    assert rest == fresh, (
        "python -m cosim.interface scenarios/ellipse.json tells what should stand there"
    )


@pytest.mark.parametrize(
    ("force", "moves"),
    [("tau_X", "vessel.x"), ("tau_Y", "vessel.y"), ("tau_N", "vessel.psi")],
)
def test_signs_are_as_the_page_says(tmp_path, force, moves):
    """Northbound, a push forward goes north, to starboard east, and a positive moment turns to the east."""
    content = {
        "name": "push", "step": 0.02, "stop": 1.0,
        "fmus": {"vessel": {"path": "vessel.fmu", "parameters": {force: 0.5}}},
    }  # fmt: skip
    result = cosim.simulate(load_scenario(content), tmp_path)
    log = cosim.read_log(result.folder, [moves])
    assert log[moves][-1] - log[moves][0] > 0.001


@pytest.mark.parametrize("kind", ["controller", "observer"])
def test_all_of_a_kind_have_the_inputs_of_the_page(fmus, kind):
    from cosim.fmu import FmuModel

    def inputs(path):
        return {v.name for v in FmuModel(path).variables.values() if v.causality == "input"}

    expected = inputs(fmus["controller_abs" if kind == "controller" else "observer_mdf"])
    for name in fmus:  # of which only these are built
        if name.startswith(f"{kind}_"):
            assert inputs(fmus[name]) <= expected, name


def test_interface_command_tells_what_is_wrong(tmp_path, capsys):
    from cosim.interface import main

    assert main([str(tmp_path / "nothing.json")]) == 2
    assert "no such scenario" in capsys.readouterr().err
    assert main([str(SCENARIO)]) == 0
    assert capsys.readouterr().out.strip() in (ROOT / "docs" / "interface.md").read_text()


def test_log_tells_the_order(tmp_path):
    content = json.loads(SCENARIO.read_text()) | {"stop": 0.1, "metrics": {}}
    cosim.simulate(load_scenario(content), tmp_path)
    assert "order" in json.loads((tmp_path / "log.json").read_text())
