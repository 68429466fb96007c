"""An FMU that is no Python: a first-order lag in C, compiled here, run beside ours."""

import json
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from support.foreign import ANY_STEP, STATE, build_lag, needs_compiler

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
    edit(lag, lambda name, data: data.replace(b'guid="{lag}"', b'guid="{other}"'))
    with pytest.raises(cosim.InputError, match="cannot be instantiated as 'lag'"):
        cosim.simulate(cosim.load_scenario(scenario(lag)), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def alone(lag, **changes):
    return {
        "name": "alone", "step": 0.1, "stop": 1.0,
        "fmus": {"lag": {"path": str(lag), "parameters": {"in[1]": 1.0}}},
    } | changes  # fmt: skip


# Cannot step across t = 0.437 s at once; tells that it gets there.
CORNER = "if (t < 0.437 && t + h > 0.437 + 1e-12) { m->last = 0.437; return 2; }"


def test_discarded_step_is_done_again_in_shorter_ones(tmp_path):
    """Forward Euler in three pieces shows in the numbers: up to the corner, and from there on."""
    fmu = build_lag(tmp_path, "lag", CORNER, f"{ANY_STEP} {STATE}")
    result = cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out")
    assert result.status == "done"
    log, y = cosim.read_log(tmp_path / "out"), 0.0
    expected = [0.0]
    for h in (0.1, 0.1, 0.1, 0.1, (0.437 - 0.4, 0.5 - 0.437), 0.1, 0.1, 0.1, 0.1, 0.1):
        for part in np.atleast_1d(h):
            y += part * (1.0 - y)
        expected.append(y)
    assert log["lag.out, filtered"] == pytest.approx(expected, abs=1e-15)
    assert list(log["lag.steps"]) == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11]


def test_step_is_halved_where_the_fmu_does_not_tell_how_far_it_got(tmp_path):
    fmu = build_lag(
        tmp_path, "lag", "m->last = t; if (t > 0.35 && h > 0.03) return 2;", f"{ANY_STEP} {STATE}"
    )
    result = cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out")
    assert result.status == "done"
    assert cosim.read_log(tmp_path / "out")["lag.steps"][-1] > 4 + 6 * 3


@pytest.mark.parametrize("capabilities", [ANY_STEP, f"{ANY_STEP} {STATE}"])
def test_step_that_goes_on_after_the_call_is_awaited(tmp_path, capabilities):
    habit = "m->pending = 3; m->pending_step = h; return 5;"
    asynchronous = f'canRunAsynchronuously="true" {capabilities}'  # as the standard spells it
    logs = []
    for name, how in (("plain", ""), ("late", habit)):
        fmu = build_lag(tmp_path, name, how, asynchronous)
        content = alone(fmu) | {"name": name}
        assert cosim.simulate(cosim.load_scenario(content), tmp_path / name).status == "done"
        logs.append((tmp_path / name / "log.csv").read_text())
    assert logs[0] == logs[1]


def test_fmu_that_goes_to_another_folder_is_not_followed(tmp_path, monkeypatch):
    """Results stay in the folder that was meant when the run began."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    fmu = build_lag(tmp_path, "lag", 'if (chdir("/")) return 3;')
    result = cosim.simulate(cosim.load_scenario(alone(fmu)))
    assert result.status == "done"
    assert result.folder == Path("results") / "alone"
    assert Path.cwd() == tmp_path / "here"
    assert {p.name for p in result.folder.iterdir()} == {"log.csv", "log.json"}


@pytest.mark.parametrize("capabilities", [ANY_STEP, STATE])
def test_discarded_step_that_cannot_be_done_again_tells_how_far_it_got(tmp_path, capabilities):
    fmu = build_lag(tmp_path, "lag", CORNER, capabilities)
    result = cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out")
    assert result.status == "failed"
    assert result.message == "lag: the step from t = 0.4 s returned discard; it stopped at t = 0.437 s"
    assert len(cosim.read_log(tmp_path / "out")["time"]) == 5


@pytest.mark.parametrize("capabilities", [ANY_STEP, f"{ANY_STEP} {STATE}"])
def test_fmu_that_asks_for_the_end_is_told(tmp_path, capabilities):
    habit = "if (t > 0.45) { m->last = t + 0.01; m->done = 1; return 2; }"
    fmu = build_lag(tmp_path, "lag", habit, capabilities)
    result = cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out")
    assert result.status == "failed"
    assert "requests the end of the simulation at t = 0.51 s" in result.message


def test_fmu_that_always_discards_is_given_up(tmp_path):
    fmu = build_lag(tmp_path, "lag", "m->last = t; return 2;", f"{ANY_STEP} {STATE}")
    result = cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out")
    assert result.status == "failed"
    assert "returned discard" in result.message


def test_steps_never_vary_for_an_fmu_that_wants_them_constant(tmp_path):
    """Not even in the last digits, and with an event in between."""
    habit = "if (m->last != 0.0 && h != m->last) return 3; m->last = h;"
    fmu = build_lag(tmp_path, "lag", habit, 'canHandleVariableCommunicationStepSize="false"')
    events = [{"time": 0.123, "model": "lag", "variable": "T", "action": "override", "value": 0.1}]
    content = alone(fmu, step=0.01, events=events)
    content["fmus"]["lag"]["step"] = 0.05
    assert cosim.simulate(cosim.load_scenario(content), tmp_path / "out").status == "done"


def test_last_words_of_a_crashing_fmu_are_heard(tmp_path, capfd):
    fmu = build_lag(tmp_path, "lag", 'if (t > 0.45) { printf("so it ends\\n"); abort(); }')
    content = alone(fmu)
    content["fmus"]["lag"]["isolate"] = True
    cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    assert capfd.readouterr().err.count("so it ends") == 1


# Into whatever is open, the pipe to the master too.
RUBBISH = 'for (int f = 3; f < 50; f++) if (write(f, "rubbish", 7)) {}'


@pytest.mark.parametrize("habit", ["_exit(0);", RUBBISH])
def test_compiled_fmu_that_crashes_or_hangs_is_one_message(tmp_path, habit):
    fmu = build_lag(tmp_path, "lag", f"if (t > 0.45) {{ {habit} }}")
    content = alone(fmu)
    content["fmus"]["lag"] |= {"isolate": True, "timeout": 1.0}
    result = cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    assert result.status == "failed"
    assert "the step from t = 0.5 s" in result.message
    assert json.loads((tmp_path / "out" / "log.json").read_text())["status"] == "failed"
    assert len(cosim.read_log(tmp_path / "out")["time"]) == 6


ONCE = f'{ANY_STEP} canBeInstantiatedOnlyOncePerProcess="true"'


def test_two_instances_of_an_fmu_for_one_per_process_need_isolation(tmp_path):
    fmu = build_lag(tmp_path, "lag", "", ONCE)
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(fmu.read_bytes())
    for other in (fmu, copy):
        content = alone(fmu)
        content["fmus"]["second"] = {"path": str(other)}
        with pytest.raises(
            cosim.InputError, match='once per process, and lag does; give one of them "isolate"'
        ):
            cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
        content["fmus"]["second"]["isolate"] = True
        assert cosim.simulate(cosim.load_scenario(content), tmp_path / "out").status == "done"


def test_fmu_that_lacks_its_tool_says_so(tmp_path):
    fmu = build_lag(tmp_path, "lag", "", f'{ANY_STEP} needsExecutionTool="true"')
    assert cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out").status == "done"
    edit(fmu, lambda name, data: data.replace(b'guid="{lag}"', b'guid="{licence}"'))
    with pytest.raises(cosim.InputError, match="needs an installation of the tool"):
        cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out")


def test_binary_for_another_platform_is_one_message(tmp_path):
    fmu = build_lag(tmp_path)
    edit(fmu, lambda name, data: data, lambda name: name.replace(fmpy.platform, "amiga32"))
    with pytest.raises(cosim.InputError, match=f"cannot be loaded on {fmpy.platform}: it has amiga32"):
        cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out")


@pytest.mark.parametrize("isolate", [False, True])
def test_flood_of_messages_from_c_is_cut(tmp_path, isolate):
    """Formats, percent signs and lines of any length; more than a pipe holds."""
    habit = """for (int k = 0; k < 500; k++)
        m->callbacks->logger(m->callbacks->environment, m->name, 1, "w", "%d of %s: 100%% %0400d", k, "many", k);"""
    fmu = build_lag(tmp_path, "lag", habit)
    content = alone(fmu)
    content["fmus"]["lag"]["isolate"] = isolate
    shown = []
    result = cosim.simulate(cosim.load_scenario(content), tmp_path / "out", show=shown.append)
    assert result.status == "done"
    assert any(line.startswith("warning: lag: 3 of many: 100% 0000") for line in shown)
    assert len(shown) < 210


def test_nan_from_c_ends_the_run(tmp_path):
    fmu = build_lag(tmp_path, "lag", "if (t > 0.45) { m->y = NAN; return 0; }")
    result = cosim.simulate(cosim.load_scenario(alone(fmu)), tmp_path / "out")
    assert result.status == "failed"
    assert result.message == "lag.out, filtered is not finite at t = 0.6 s"


def edit(fmu, change, rename=lambda name: name):
    """Rewrite the files inside an FMU, and their names."""
    with zipfile.ZipFile(fmu) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, data in content.items():
            archive.writestr(rename(name), change(name, data))
