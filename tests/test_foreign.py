"""An FMU that is no Python: a first-order lag in C, compiled here, run beside ours."""

import zipfile

import fmpy
import numpy as np
import pytest
from foreign import build_lag, needs_compiler

import cosim

pytestmark = needs_compiler


@pytest.fixture
def lag(tmp_path):
    """Path of the compiled FMU."""
    return build_lag(tmp_path)


def scenario(lag, **changes):
    return {
        "name": "lag", "step": 0.01, "stop": 2.0,
        "fmus": {
            "guidance": {"path": "guidance_ellipse.fmu", "parameters": {"u_t": 0.1}},
            "lag": {"path": str(lag), "parameters": {"T": 0.5}},
        },
        "connections": [["guidance.x_t_dot", "lag.in[1]"]],
    } | changes  # fmt: skip


def test_compiled_fmu_runs_beside_python_ones(lag, tmp_path):
    result = cosim.simulate(cosim.load_scenario(scenario(lag)), tmp_path / "out")
    assert result.status == "done"
    log = cosim.read_log(tmp_path / "out")
    u, y = log["lag.in[1]"], log["lag.out, filtered"]
    assert np.allclose(np.diff(y), 0.01 / 0.5 * (u[1:] - y[:-1]))
    assert list(log["lag.steps"]) == list(range(201))


def test_events_reach_its_parameter_and_its_flag(lag, tmp_path):
    events = [
        {"time": 0.5, "model": "lag", "variable": "T", "action": "override", "value": 0.1},
        {"time": 1.0, "model": "lag", "variable": "on", "action": "override", "value": False},
        {"time": 1.5, "model": "lag", "variable": "on", "action": "reset"},
    ]
    cosim.simulate(cosim.load_scenario(scenario(lag, events=events)), tmp_path / "out")
    log = cosim.read_log(tmp_path / "out")
    u, change = log["lag.in[1]"][1:], np.diff(log["lag.out, filtered"])
    y = log["lag.out, filtered"][:-1]
    assert np.allclose(change[:50], 0.01 / 0.5 * (u - y)[:50])
    assert np.allclose(change[50:100], 0.01 / 0.1 * (u - y)[50:100])
    assert (change[100:150] == 0.0).all()
    assert (change[150:] != 0.0).all()


def test_its_error_ends_the_run_with_what_it_said(lag, tmp_path):
    events = [{"time": 1.0, "model": "lag", "variable": "in[1]", "action": "override", "value": 1e7}]
    result = cosim.simulate(cosim.load_scenario(scenario(lag, events=events)), tmp_path / "out")
    assert result.status == "failed"
    assert "returned error: input 1e+07 is too large" in result.message
    assert len(cosim.read_log(tmp_path / "out")["time"]) == 101


def test_alone_it_does_what_fmpy_makes_it_do(lag, tmp_path):
    content = {
        "name": "alone", "step": 0.01, "stop": 2.0,
        "fmus": {"lag": {"path": str(lag), "parameters": {"in[1]": 1.0}}},
    }  # fmt: skip
    cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    y = cosim.read_log(tmp_path / "out")["lag.out, filtered"]
    other = fmpy.simulate_fmu(
        str(lag),
        stop_time=2.0,
        output_interval=0.01,
        start_values={"in[1]": 1.0},
        output=["out, filtered"],
    )
    assert np.allclose(y, other["out, filtered"], rtol=1e-12)


def test_refused_instantiation_is_one_message(lag, tmp_path):
    with zipfile.ZipFile(lag) as archive:
        content = {n: archive.read(n) for n in archive.namelist()}
    wrong = content["modelDescription.xml"].replace(b"{lag}", b"{other}")
    with zipfile.ZipFile(lag, "w") as archive:
        for name, data in (content | {"modelDescription.xml": wrong}).items():
            archive.writestr(name, data)
    with pytest.raises(cosim.InputError, match="cannot be instantiated as 'lag'"):
        cosim.simulate(cosim.load_scenario(scenario(lag)), tmp_path / "out")
    assert not (tmp_path / "out").exists()
